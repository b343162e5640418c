"""OpenUSD's Storm as it is installed elsewhere: run in a process of its own, compared with, and patched.

Nothing of it is imported or shipped here. Its resources are read where they are installed, and changed there only by
`diaphane storm patch --apply`.
"""
