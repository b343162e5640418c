"""The Lagrangian regret: what a predicted count costs more than the best one at a price `lambda` per fragment."""

from __future__ import annotations

import torch
from torch import Tensor


def lagrangian_regret(
    a: Tensor,
    b: Tensor,
    n: Tensor,
    slopes: Tensor,
    lengths: Tensor,
    log_lambda: Tensor,
) -> tuple[Tensor, Tensor]:
    """Regret of `k = clamp(1 + (a - log lambda) / b, 0, n)` (METHOD.md section 4).

    `r = (E(k) + lambda k - min_j (E(j) + lambda j)) / lambda` with E the lower hull of the pixel's error curve,
    interpolated: `E(k) = sum_j s_j (len_j - clamp(k - k_j, 0, len_j))`. The optimum takes exactly the segments
    with `s_j > lambda`. Each segment's two terms are subtracted before they are scaled, so r is 0, not nearly 0,
    at the optimum.

    Args:
        a: float32 [R], predicted log gain of the first fragment.
        b: float32 [R], predicted fall of the log gain per fragment, > 0.
        n: float32 [R], fragments.
        slopes: float32 [R, H], error gained per fragment, falling along H; 0 where a hull has ended.
        lengths: float32 [R, H], fragments of each segment; 0 where a hull has ended.
        log_lambda: float32 [R], natural logarithm of the price.

    Returns:
        r: float32 [R] >= 0, in fragments.
        overshoot: float32 [R] >= 0, by how far the count was beyond a clamp although the optimum is not there:
            the gradient that the clamp hides.
    """
    wanted = 1.0 + (a - log_lambda) / b
    k = torch.minimum(torch.relu(wanted), n)
    ratio = slopes * torch.exp(-log_lambda)[:, None]
    taken = lengths * (ratio > 1.0)
    start = torch.cumsum(lengths, dim=1) - lengths
    covered = torch.minimum(torch.clamp(k[:, None] - start, min=0.0), lengths)
    best = taken.sum(dim=1)
    r = (ratio * (taken - covered)).sum(dim=1) + (k - best)
    above = torch.relu(wanted - n) * (best < n)
    below = torch.relu(-wanted) * (best > 0)
    return r, above + below
