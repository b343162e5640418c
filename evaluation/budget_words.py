"""What budgets can tell of views: where none was given, why these; where all hold everything, what to do."""

from __future__ import annotations

from collections.abc import Sequence

from labeller.budgets import MOST_HELD, default_budgets


def holds_all(factors: Sequence[float], loads: Sequence[float]) -> bool:
    """Whether every budget holds all fragments of every view.

    Args:
        factors: Budgets as multiples of W H.
        loads: N / (W H) of each view.
    """
    return min(factors) >= max(loads, default=0.0)


def said_defaults(factors: Sequence[float], loads: Sequence[float]) -> str:
    """Budgets that were not given, and why these.

    Args:
        factors: See `holds_all`.
        loads: See `holds_all`.
    """
    views = "the view to measure holds" if len(loads) == 1 else f"the {len(loads)} views to measure hold"
    return (
        f"Budgets {_listed(factors)} (x width x height), because {views} {_range(loads)} transparent fragments per "
        f"pixel: a budget decides something where it holds up to {MOST_HELD:.0%} of a view's fragments. --budgets "
        "gives others."
    )


def said_complete(factors: Sequence[float], loads: Sequence[float]) -> str:
    """That no budget decides anything.

    Args:
        factors: See `holds_all`.
        loads: See `holds_all`.
    """
    views = "the captured view has" if len(loads) == 1 else f"the {len(loads)} captured views have"
    smallest = f"The budget {factors[0]:g}" if len(factors) == 1 else f"Even the smallest budget, {factors[0]:g},"
    return (
        f"{smallest} holds all fragments, as {views} {_range(loads)} per pixel: every technique is exact within it, so "
        "there is nothing to measure."
    )


def remedy(loads: Sequence[float]) -> str:
    """What to do where no budget decides anything.

    Args:
        loads: See `holds_all`.
    """
    smaller = [factor for factor in default_budgets(loads) if factor < max(loads, default=0.0)]
    exact = "render these views with an exact technique, such as sbuffer, which takes little memory here."
    return f"Give smaller budgets, --budgets {_listed(smaller, ',')}, or {exact}" if smaller else exact.capitalize()


def _listed(factors: Sequence[float], comma: str = ", ") -> str:
    return comma.join(f"{factor:g}" for factor in factors)


def _range(loads: Sequence[float]) -> str:
    low, high = (f"{load:.2g}" for load in (min(loads), max(loads)))
    return low if low == high else f"{low} to {high}"
