"""Trials on what a network is given to read. Nothing of this is in the product.

`density-8` leaves every other column of the 16 bins' shares empty: inputs that are added take the place of two of
those, so that the product's own training reads them.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from renderer.features import FEATURES, texels_of
from renderer.frame import NEAREST

Inputs = Literal["plain", "neighbourhood", "view-means", "view-normalised", "half-resolution", "quarter-resolution"]
"""`neighbourhood`: also the mean of log n and of the optical depth over the 3x3 pixels; `view-means`: over the view;
`view-normalised`: every feature relative to mean and spread in its view; `half-resolution`, `quarter-resolution`: sums
and nearest fragment are those of one pixel in each block of 2x2 or 4x4 (`stand_ins`)."""

BLOCKS: Final[dict[Inputs, int]] = {"half-resolution": 2, "quarter-resolution": 4}
"""Pixels across a block that has one pixel's sums."""

_SPARE: Final = [FEATURES.index(name) for name in ("front_1", "front_3")]
_AVERAGED: Final = [FEATURES.index(name) for name in ("log_n", "optical_depth")]
_GATHERED: Final = [i for i, name in enumerate(FEATURES) if texels_of([name], binned=True) & set(range(NEAREST + 1))]
"""Those that read what only a gather pass has. Number and depths of the fragments, the depth bins, with them the
optical depth, and the background are there for every pixel."""


def changed(features: NDArray[np.float32], inputs: Inputs, width: int) -> NDArray[np.float32]:
    """Features of all pixels of a view as a trial wants them.

    Args:
        features: float32 [P, C], columns `FEATURES`; without fragments zero. For `neighbourhood` and `view-means` with
            two columns to spare: `density-8`. For lower resolutions with depth bins: they know every optical depth.
        inputs: What is tried.
        width: Pixels per row.
    """
    if inputs == "plain":
        return features
    out = features.copy()
    seen = features[:, FEATURES.index("log_n")] > 0.0  # more than one fragment: those that a network is asked for
    if inputs == "view-normalised":
        mean, std = features[seen].mean(axis=0), features[seen].std(axis=0)
        out = (features - mean) / np.where(std > 1e-4, std, np.float32(1.0))
    elif inputs == "view-means":
        out[:, _SPARE] = features[seen][:, _AVERAGED].mean(axis=0)
    elif inputs in BLOCKS:
        occupied = features[:, FEATURES.index("optical_depth")] > 0.0
        out[:, _GATHERED] = features[stand_ins(occupied, width, BLOCKS[inputs])][:, _GATHERED]
        out[~occupied] = 0.0
    else:
        out[:, _SPARE] = _around(features[:, _AVERAGED].reshape(-1, width, 2)).reshape(-1, 2)
    return np.asarray(out, dtype=np.float32)


def stand_ins(occupied: NDArray[np.bool_], width: int, block: int) -> NDArray[np.int64]:
    """For every pixel the one of its block whose sums it reads, int64 [P].

    It is the one whose centre is nearest to that of the block, the first of equals, if it has a fragment; else the
    nearest that has one. What a renderer would do: draw the gather pass at `1 / block` of the size, the projection
    moved so that samples fall on those first centres, and give every pixel the sums of its block. It would have none
    of a block that is occupied elsewhere only: there the trial is better off, by what a second draw would cost.

    Args:
        occupied: bool [P], pixels with fragments.
        width: Pixels per row.
        block: Pixels across a block; those at the right and lower edges may be smaller.
    """
    place = np.arange(len(occupied))
    y, x = np.divmod(place, width)
    middle = 0.5 * (block - 1)
    away = np.square(y % block - middle) + np.square(x % block - middle)
    blocks = (y // block) * -(-width // block) + x // block
    order = np.lexsort((place, away, ~occupied, blocks))
    first = order[np.unique(blocks[order], return_index=True)[1]]
    return np.asarray(first[blocks], dtype=np.int64)


def _around(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean of float32 [H, W, C] over 3x3 pixels, the border repeated."""
    height, width = values.shape[:2]
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    parts = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(parts, axis=0), dtype=np.float32)
