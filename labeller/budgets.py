"""Budgets that say something about captured views: below all of their fragments, above nearly none.

A budget that holds every fragment of a view makes every technique exact there, and one that holds hardly any makes all
of them alike. What lies between depends on the views: glass in a room has one transparent fragment a pixel, a hedge
fifty.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

RUNGS: Final = (0.05, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Default budgets are some of these multiples of W H: 4 is 32 bytes per pixel of slots, and a view with fewer fragments
than 0.05 W H has less to save than a technique's other buffers take. Few and fixed, so that views of like depth get
the same ones, and their labels and pictures are found again."""
MOST_HELD: Final = 0.75
"""Largest share of a view's fragments that a default budget holds, where a rung allows: above, nearly every allocation
is nearly exact."""
RUNGS_OF_A_VIEW: Final = 3


def default_budgets(loads: Iterable[float]) -> tuple[float, ...]:
    """Budgets that views are to be measured at, for all of them together.

    Of each view, the `RUNGS_OF_A_VIEW` largest rungs that hold at most `MOST_HELD` of its fragments; of one with so few
    that none does, the smallest rung.

    Args:
        loads: N / (W H) of each view, transparent fragments over pixels, in any order; 0 or more.

    Returns:
        Multiples of W H out of `RUNGS`, ascending, each once, at least one. Of every view with more than `RUNGS[0]` W H
        fragments at least one is below N.
    """
    chosen = {rung for load in loads for rung in _rungs_of(load)}
    return tuple(sorted(chosen)) or RUNGS[:1]


def _rungs_of(load: float) -> tuple[float, ...]:
    held = tuple(rung for rung in RUNGS if rung <= MOST_HELD * load)
    return held[-RUNGS_OF_A_VIEW:] or RUNGS[:1]
