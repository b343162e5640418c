"""How near a predictor's allocations come to the optimum, on the rows of a view. Numpy only, fast.

A budget of the view is scaled to its rows: it is what the optimal allocation spends on them. The errors are those
of the hulls, so `1` is the best that any allocation could do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numba
import numpy as np
from numpy.typing import NDArray

from renderer.allocation.cuts import events_of, solve_cuts
from renderer.allocation.prices import gain_prices, ranks_of
from trainer.dataset import ViewData, lossless_error
from trainer.paper import Fill, importance_counts
from trainer.weights import Weights


@dataclass(frozen=True)
class BudgetScore:
    """One view at one budget.

    Attributes:
        asset: What the view shows.
        log_lambda: Price at which the optimum spends the budget.
        budget: Fragments spent on the rows.
        error: Squared error of the predictor's allocation, summed over rows and channels.
        optimum: The least error at that budget.
        ratio: Their quotient, after the error that counts as none was added to both.
    """

    asset: str
    log_lambda: float
    budget: int
    error: float
    optimum: float
    ratio: float


Allocate = Callable[[int, int], NDArray[np.int32]]
"""Counts of a view's rows, from the number of the price and the fragments that the rows may have."""


def evaluate_view(
    weights: Weights, view: ViewData, log_lambdas: Sequence[float], fill: Fill = "budget"
) -> list[BudgetScore]:
    """Compare a predictor with the optimum at the budgets that some prices stand for.

    Args:
        weights: The predictor.
        view: Rows of a view.
        log_lambdas: Natural logarithms of the prices, for example `view.anchors`; those for an `importance` network.
        fill: From importances to counts.
    """
    allocate = _allocation(weights, view, fill)
    return [
        score_allocation(view, float(log_lambda), partial(allocate, level))
        for level, log_lambda in enumerate(log_lambdas)
    ]


def score_allocation(view: ViewData, log_lambda: float, allocate: Callable[[int], NDArray[np.int32]]) -> BudgetScore:
    """Compare any allocation with the optimum at the budget that a price stands for.

    Args:
        view: Rows of a view.
        log_lambda: Natural logarithm of the price.
        allocate: Counts of the rows, int32 [R], from the fragments that they may have.
    """
    budget, optimum = _optimum(view.offsets, view.slopes, view.lengths, float(np.exp(log_lambda)))
    error = _hull_error(view.offsets, view.slopes, view.lengths, allocate(budget))
    floor = lossless_error(view.sampled_pixels)
    return BudgetScore(view.asset, log_lambda, budget, error, optimum, (error + floor) / (optimum + floor))


def evaluate(weights: Weights, views: Iterable[ViewData], fill: Fill = "budget") -> list[BudgetScore]:
    """Every view at its scored budgets; without any, a bin-gains network is scored in the middle of its prices.

    Args:
        weights: The predictor.
        views: Rows of views.
        fill: From the importances of such a network to counts.
    """
    if weights.head == "importance":
        return [score for view in views for score in evaluate_view(weights, view, list(view.anchors), fill)]
    return [score for view in views for score in evaluate_view(weights, view, scored_prices(view))]


def geometric_mean(scores: Sequence[BudgetScore]) -> float:
    """Geometric mean of the ratios."""
    return float(np.exp(np.mean([np.log(score.ratio) for score in scores])))


def scored_prices(view: ViewData) -> list[float]:
    """Log prices at which a view is scored."""
    return [float(price) for price in view.anchors] or [0.5 * sum(view.price_range)]


def _allocation(weights: Weights, view: ViewData, fill: Fill) -> Allocate:
    if weights.head == "importance":
        return lambda level, budget: importance_counts(weights, view, level, budget, fill)
    prices = gain_prices(weights.run(view.features), view.prior(slice(None)))
    events = events_of(ranks_of(prices, view.bin_counts), view.bin_counts)
    return lambda level, budget: solve_cuts(events, budget).k


@numba.njit(cache=True)
def _optimum(
    offsets: NDArray[np.int64],
    slopes: NDArray[np.float32],
    lengths: NDArray[np.float32],
    price: float,
) -> tuple[int, float]:
    """Fragments that the optimum spends on the rows at a price, and the error that is left."""
    spent, left = 0.0, 0.0
    for j in range(len(slopes)):
        if slopes[j] > price:
            spent += lengths[j]
        else:
            left += slopes[j] * lengths[j]
    return round(spent), left


@numba.njit(cache=True)
def _hull_error(
    offsets: NDArray[np.int64],
    slopes: NDArray[np.float32],
    lengths: NDArray[np.float32],
    k: NDArray[np.int32],
) -> float:
    """Sum over the rows of their hulls at counts k."""
    total = 0.0
    for r in range(len(k)):
        covered = float(k[r])
        for j in range(offsets[r], offsets[r + 1]):
            total += slopes[j] * max(0.0, lengths[j] - max(0.0, covered))
            covered -= lengths[j]
    return total
