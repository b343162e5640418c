"""Float64 twins of the techniques: plain, one pixel after the other, on the fragments of a dump. Slow on purpose.

The hybrid techniques' twin is `labeller.reference`; `exact` is that of all that store every fragment.
`flip` is the metric, for where its library is not installed.
"""
