"""What a pixel's squared error counts, if an allocation is to look right: by FLIP (Andersson et al. 2020).

FLIP is no sum of the pixels' own errors: it filters the picture, and grows ever more slowly with an error. Near one
picture it is taken for `sum w_p e_p`, w the FLIP that a pixel has there over its squared error: a step of iteratively
reweighted least squares. Pixels that are wrong by much count less for each unit, and those whose small errors are seen
count more. The pictures to be near to are those of the optimum without weights, one for every budget.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.curves import composite
from renderer.reference.flip import flip
from schemas.colour import display8, linear_to_srgb
from schemas.fragments import FragmentDump
from schemas.tail import DEFAULT_TAIL, DENSITY_G, TailName

MOST: Final = 100.0
"""A picture's weights are at most so many times their median, and at least one part in so many: the quotient of two
small numbers says little."""

UNSEEN_FLIP: Final = 1e-4
"""FLIP that is added everywhere: an error that is not seen yet counts a little too."""

UNSEEN_ERROR: Final = (0.5 / 255.0) ** 2
"""Squared error that is added everywhere: half a step of one channel, which no screen shows."""


def flip_weights(
    dump: FragmentDump, kept: Sequence[NDArray[np.integer]], tail: TailName = DEFAULT_TAIL, g: float = DENSITY_G
) -> NDArray[np.float64]:
    """Weights of a view's pixels.

    Args:
        dump: Fragments of a view.
        kept: Of each picture the core fragments, int [P]: the allocations that FLIP looks at; none: all weights are 1.
        tail: Of the pictures.
        g: Steepness of the density tail.

    Returns:
        float64 [P], > 0: the mean over the pictures, in each of which the pixels with more than one fragment have 1 on
        average. The others, which no budget changes, have 1.

    Raises:
        Problem: If the dump is malformed.
    """
    weights = np.ones(dump.pixels)
    open_pixels = np.flatnonzero(dump.counts > 1)
    if not kept or not len(open_pixels):
        return weights
    exact = composite(dump, dump.counts, tail, g)
    found = [_slopes(composite(dump, k, tail, g), exact, dump.width)[open_pixels] for k in kept]
    weights[open_pixels] = np.mean([_levelled(slopes) for slopes in found], axis=0)
    return weights


def _slopes(shown: NDArray[np.float32], exact: NDArray[np.float32], width: int) -> NDArray[np.float64]:
    """FLIP of every pixel over its squared error, float64 [P].

    Args:
        shown: float32 [P, 3], linear RGB.
        exact: The same of the picture that is right.
        width: Pixels per row.
    """
    test, reference = (display8(picture).reshape(-1, width, 3) for picture in (shown, exact))
    error_map = flip(test, reference)
    squared = np.square(linear_to_srgb(shown) - linear_to_srgb(exact)).sum(axis=1)
    return np.asarray((error_map.ravel() + UNSEEN_FLIP) / (squared + UNSEEN_ERROR))


def _levelled(slopes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same without extremes, 1 on average."""
    middle = np.median(slopes)
    kept = np.clip(slopes, middle / MOST, middle * MOST)
    return np.asarray(kept / kept.mean())
