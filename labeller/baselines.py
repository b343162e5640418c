"""Allocations that look at no error: what the optimum and the networks are compared with (METHOD section 3)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from renderer.allocation.fill import budget_fill, paper_fill
from renderer.allocation.importance import VkbOptions, vkb_importance
from schemas.fragments import FragmentDump

WeightRule = Literal["importance", "uniform", "proportional"]
FillName = Literal["exact", "paper"]


def fixed(n: NDArray[np.integer], budget: int) -> NDArray[np.int32]:
    """int32 [P]: the classic k-buffer, `k = floor(F / P)` slots for every pixel, used or not; clipped to n.

    Args:
        n: Integers [P], fragments of each pixel.
        budget: F, fragments.
    """
    return np.asarray(np.minimum(budget // max(len(n), 1), n), dtype=np.int32)


def weighted(
    dump: FragmentDump, rule: WeightRule, budget: int, options: VkbOptions, fill: FillName
) -> NDArray[np.int32]:
    """int32 [P]: fragments in proportion to a weight of the pixel.

    Args:
        dump: Fragments of a view.
        rule: `importance`: VKB; `uniform`: 1 where occupied; `proportional`: n.
        budget: F.
        options: Factors of VKB.
        fill: `exact`: the budget fill; `paper`: DHOIT's Eq. 3, here clipped to n (its other slots stay empty).
    """
    n = dump.counts
    if rule == "importance":
        weights = vkb_importance(n, dump.facing, dump.width, dump.height, options)
    else:
        weights = (np.minimum(n, 1) if rule == "uniform" else n).astype(np.float32)
    if fill == "paper":
        return np.minimum(paper_fill(weights, budget), n).astype(np.int32)
    return budget_fill(weights, n, budget)
