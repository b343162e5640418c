"""Bytes that a labelling reads and writes, counted by its arrays: every pass over an array once, and whole.

What fits a cache is left out (scratch of a pixel, histograms, the pixels that compete for the remainder); so is the
line that a processor reads before it writes to it, in the copy that sets the scale as well. A pass that ends early in
every pixel counts whole.
"""

from __future__ import annotations

from labeller.curves import Curves
from labeller.hull import Hulls
from schemas.fragments import FragmentDump


def traffic(dump: FragmentDump, curves: Curves, hulls: Hulls, budgets: int) -> dict[str, dict[str, int]]:
    """Bytes of the steps of rule `optimal`, by the names that `timing.steps` has for them.

    Args:
        dump: Fragments of a view.
        curves: Its error curves.
        hulls: Their hulls.
        budgets: How many are allocated.

    Returns:
        Step -> `read` and `written`.
    """
    index = dump.offsets.nbytes
    lists = index + dump.rgba.nbytes + dump.depth.nbytes + dump.background.nbytes
    vertex = hulls.k.nbytes  # 4 bytes a vertex, as errors, keys and lengths have
    return {
        # The dump is checked first (depths, order of the offsets); then one pass makes all curves.
        "curves": {
            "read": lists + dump.depth.nbytes + index,
            "written": curves.error.nbytes + curves.offsets.nbytes,
        },
        # Vertices on a stack as long as the curves; sizes, their sums; then the vertices to their place.
        "hulls": {
            "read": 2 * (curves.error.nbytes + index) + vertex + 2 * index,
            "written": vertex + 2 * index + 2 * vertex,
        },
        # Keys and lengths of all steps, threads' shares; two histograms; then one walk along the hulls for each budget.
        "five budgets": {
            "read": (2 * vertex + 3 * index)
            + vertex
            + (2 * vertex + index)
            + 2 * vertex
            + budgets * (3 * vertex + 2 * index),
            "written": 3 * vertex + index + budgets * (index // 2 + 2 * dump.pixels),
        },
    }
