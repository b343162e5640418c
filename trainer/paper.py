"""DHOIT's network: its inputs, its labels, and the counts that its importances stand for (docs/TRAINING.md).

Inputs are those of the paper (section 4 of METHOD.md), in its order. Labels are `K / F` of the optimal allocation at
a budget F that the view is scored at, which training rows hold; the paper's come of its Algorithm 1, whose error is
1.3 to 2.4 times as large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal

import numba
import numpy as np
from numpy.typing import NDArray

from renderer.allocation.fill import budget_fill, paper_fill
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from trainer.dataset import GROUP, Drawing, PaperInputs, ViewData, draw_views
from trainer.weights import Weights

Fill = Literal["paper", "budget"]
"""`paper`: Eq. 3, floor alone; `budget`: floor, clamp, and the remainder by largest fraction."""

PAPER_FEATURES: Final = (
    *("n_share", "budget_share", "depth_near", "depth_far", "scene_depth_near", "scene_depth_far"),
    *(f"{name}_{c}" for name in ("rgb_mean", "rgb_nearest") for c in "rgb"),
)
"""n / N, F / N, window depth of the pixel's nearest and farthest fragment and of the view's, mean and nearest RGB."""

LABEL_PEAK: Final = 16.0
"""A repaired label is 1 where a pixel gets this many times the mean share of a pixel, and beyond."""

_MARGIN: Final = 2.0
"""Near plane: the nearest depth of the view over this; far plane: the farthest times this."""


def with_paper_inputs(
    view: ViewData, dump: FragmentDump, pixel: NDArray[np.integer], budgets: Sequence[int]
) -> ViewData:
    """A view with what DHOIT's network reads of it.

    Args:
        view: The view.
        dump: Its fragments; depths in metres along the view axis.
        pixel: [R], pixel index of each row.
        budgets: F of each of the view's anchors.
    """
    near, far = float(dump.depth.min()) / _MARGIN, float(dump.depth.max()) * _MARGIN
    first, last = dump.offsets[:-1][pixel], dump.offsets[1:][pixel] - 1
    depth = np.stack([dump.depth[first], dump.depth[last]], axis=1)
    bounds = _window(np.array([near * _MARGIN, far / _MARGIN]), near, far)
    return replace(
        view,
        paper=PaperInputs(
            depth=_window(depth, near, far).astype(np.float32),
            colours=_colours(dump, first, last + 1),
            scene_depth=(float(bounds[0]), float(bounds[1])),
            fragments=dump.total,
            pixels=dump.pixels,
            budgets=tuple(budgets),
        ),
    )


def paper_inputs(view: ViewData, rows: NDArray[np.int64] | slice, budget: int) -> NDArray[np.float32]:
    """What the network reads of some rows at a budget, float32 [R, 12], columns `PAPER_FEATURES`.

    Args:
        view: Rows with the inputs of the paper.
        rows: int64 [R], indices of rows, or a slice of them.
        budget: F, fragments.

    Raises:
        Problem: The view has no `PaperInputs`.
    """
    about = _about(view)
    n = view.n[rows]
    x = np.empty((len(n), len(PAPER_FEATURES)), dtype=np.float32)
    x[:, 0], x[:, 1] = n / about.fragments, budget / about.fragments
    x[:, 2:4], x[:, 4:6] = about.depth[rows], about.scene_depth
    x[:, 6:] = about.colours[rows]
    return x


def paper_batch(
    views: Sequence[ViewData], seed: tuple[int, int], size: int, drawing: Drawing
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], float]:
    """Inputs, optimal counts and budgets of a batch, in groups of one view and budget; the same for the same seed.

    Args:
        views: The data set; views without a scored budget are not drawn.
        seed: Seed of the training and number of the step.
        size: Rows; rounded down to whole groups.
        drawing: How views are drawn.

    Returns:
        Inputs float32 [B, 12], k float32 [B], fragments of the budget per pixel of the view float32 [B, 2] as
        `(F, pixels)`, and the share of the whole batch that these rows are.

    Raises:
        Problem: No view has a scored budget, or one has no `PaperInputs`.
    """
    scored = [view for view in views if len(view.anchors)]
    if not scored:
        raise unscored()
    total = max(1, size // GROUP)
    inputs, counts, budgets = [], [], []
    for g, view, rng in draw_views(scored, seed, total, replace(drawing, replay=(), hardness=())):
        rows = rng.integers(view.rows, size=GROUP)
        level = int(rng.integers(len(view.anchors)))
        if g % drawing.size == drawing.rank:
            about = _about(view)
            inputs.append(paper_inputs(view, rows, about.budgets[level]))
            price = float(np.exp(view.anchors[level]))
            counts.append(_optimal_counts(view.offsets, view.slopes, view.lengths, price, rows))
            budgets.append(np.tile(np.array([[about.budgets[level], about.pixels]], np.float32), (GROUP, 1)))
    return np.concatenate(inputs), np.concatenate(counts), np.concatenate(budgets), len(inputs) / total


def unscored() -> Problem:
    """What is wrong where no view has a price at a scored budget."""
    return Problem("No view is scored at a budget, so there are no labels K / F.", "Label views at some budgets.")


def importance_counts(weights: Weights, view: ViewData, level: int, budget: int, fill: Fill) -> NDArray[np.int32]:
    """Fragments of each row, int32 [R], that a network's importances stand for.

    Args:
        weights: The network.
        view: The view.
        level: Which of its anchors: the network reads the whole view's budget.
        budget: Fragments for these rows.
        fill: From importances to counts. `paper` may give more than n, which is cut off.
    """
    inputs = paper_inputs(view, slice(None), _about(view).budgets[level])
    importance = weights.answer(inputs)[:, 0]
    n = view.n.astype(np.int32)
    if fill == "budget":
        return budget_fill(importance, n, budget)
    return np.minimum(paper_fill(importance, budget), n)


def _window(depth: NDArray[np.floating], near: float, far: float) -> NDArray[np.float64]:
    """`gl_FragCoord.z` of a depth along the view axis, in [0, 1] from the near to the far plane."""
    return np.asarray((1.0 - near / depth.astype(np.float64)) * (far / max(far - near, 1e-30)))


def _colours(dump: FragmentDump, first: NDArray[np.int64], end: NDArray[np.int64]) -> NDArray[np.float32]:
    """float32 [R, 6], mean and nearest stored RGB / 255 of some lists, none of them empty."""
    before = np.zeros((dump.total + 1, 3))
    np.cumsum(dump.rgba[:, :3] / 255.0, axis=0, out=before[1:])
    mean = (before[end] - before[first]) / (end - first)[:, None]
    return np.concatenate([mean, dump.rgba[first, :3] / 255.0], axis=1).astype(np.float32)


def _about(view: ViewData) -> PaperInputs:
    if view.paper is None:
        raise Problem(
            f"The rows of {view.asset} do not know the depths and the size of their view.",
            "Use trainer.paper.with_paper_inputs with the view's fragment dump.",
        )
    return view.paper


@numba.njit(cache=True)
def _optimal_counts(
    offsets: NDArray[np.int64],
    slopes: NDArray[np.float32],
    lengths: NDArray[np.float32],
    price: float,
    rows: NDArray[np.int64],
) -> NDArray[np.float32]:
    """What the optimum keeps of some rows at a price: every hull segment that gains more."""
    counts = np.zeros(len(rows), dtype=np.float32)
    for i in range(len(rows)):
        for j in range(offsets[rows[i]], offsets[rows[i] + 1]):
            if slopes[j] > price:
                counts[i] += lengths[j]
    return counts
