"""Temporal feedback, tried: a pixel that has been resolved corrects its gain curve for the next frame."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.variants import Feedback
from labeller.curves import Curves, composite
from schemas.colour import linear_to_srgb
from schemas.fragments import FragmentDump

DAMPING: Final = 0.5
"""Share of the difference that is believed."""

MOST: Final = 3.0
"""Largest difference of log gains that is."""

_NOTHING: Final = 1e-12
"""Gains below this are taken for this."""


def corrected(
    a: NDArray[np.floating], b: NDArray[np.floating], k: NDArray[np.int32], gains: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Log gains of first fragments after a frame.

    Args:
        a: [R], as predicted.
        b: [R], > 0, decay per fragment.
        k: int32 [R], what each pixel kept; where it kept nothing, nothing is known.
        gains: [R], what fragment k gained.

    Returns:
        float64 [R]: the curve `a - b (k - 1)` comes nearer to the logarithm of the gain at k.
    """
    wrong = np.log(np.maximum(gains, _NOTHING)) - (a - b * (k - 1.0))
    return np.asarray(np.where(k > 0, a + DAMPING * np.clip(wrong, -MOST, MOST), a), dtype=np.float64)


def observed(kind: Feedback, dump: FragmentDump, curves: Curves, k: NDArray[np.int32]) -> NDArray[np.float64]:
    """What the last core fragment of each pixel gained, float64 [P].

    Args:
        kind: The fall of the error, or the squared change of the displayed colour.
        dump: The view.
        curves: Of its tail.
        k: int32 [P], core fragments.
    """
    fewer = np.maximum(k - 1, 0)
    if kind == "error":
        return np.asarray(curves.at(fewer).astype(np.float64) - curves.at(k))
    with_last, without = (linear_to_srgb(composite(dump, count, curves.tail)) for count in (k, fewer))
    return np.asarray(np.square(with_last - without).sum(axis=1))
