"""The Lagrangian regret: what predicted cuts cost more than the best ones at a price `lambda` per fragment."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

SOFTNESS: Final = 0.35
"""In log gain: within about this of the price, a bin counts as partly taken, so that there is a gradient."""

EMPTY_GAIN: Final = 60.0
"""Of bins without fragments: far above any other, so that they are no reason to leave out those behind them."""


def rising_prices(gains: Tensor, counts: Tensor) -> Tensor:
    """Log prices below which bins are in the core, float32 [R, B]: none is below those of the bins in front of it.

    Args:
        gains: float32 [R, B], predicted log gain of each fragment of a bin.
        counts: float32 [R, B], fragments of each bin.
    """
    gains = torch.where(counts > 0.0, gains, EMPTY_GAIN)
    return torch.cummax(-gains, dim=1).values


def lagrangian_regret(prices: Tensor, counts: Tensor, slopes: Tensor, log_lambda: Tensor) -> tuple[Tensor, Tensor]:
    """Regret of taking the bins whose price is below `-log lambda` (METHOD.md section 4).

    `r = sum_b n_b |s_b / lambda - 1| |w_b - t_b|`: s_b what each fragment of bin b gains by the lower hull of the
    pixel's error, `w_b` whether the optimum takes it (`s_b > lambda`), `t_b` how far it is taken. It is what
    `E(cut) + lambda k` is above its least value, in units of lambda, for a `t` of whole bins.

    Args:
        prices: float32 [R, B], rising along B.
        counts: float32 [R, B], fragments of each bin.
        slopes: float32 [R, B], falling along B.
        log_lambda: float32 [R], natural logarithm of the price of a fragment.

    Returns:
        r: float32 [R] >= 0, in fragments.
        astray: float32 [R] >= 0, by how much prices are on the wrong side: the gradient that far-off bins lack.
    """
    beyond = -log_lambda[:, None] - prices
    taken = torch.sigmoid(beyond / SOFTNESS)
    ratio = slopes * torch.exp(-log_lambda)[:, None]
    wanted = (ratio > 1.0).float()
    r = (counts * (ratio - 1.0).abs() * (wanted - taken).abs()).sum(dim=1)
    astray = (torch.relu(beyond * (1.0 - 2.0 * wanted)) * (counts > 0.0)).sum(dim=1)
    return r, astray
