"""What a scene should be rendered with, and why.

`measure` finds the numbers, `rules` what follows from them (pure functions), `words` and `page` how it is said, and
`run` is the order of it. `gathered` takes the numbers from a benchmark or a build instead.
"""
