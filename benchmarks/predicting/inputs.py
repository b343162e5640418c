"""Trials on what a network is given to read, and on more to train on. Nothing of this is in the product.

`density-8` leaves every other column of the 16 bins' shares empty: inputs that are tried take the place of two of
those, so that the product's own training reads them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from renderer.features import FEATURES
from schemas.fragments import FragmentDump

Inputs = Literal["plain", "neighbourhood", "view-means", "view-normalised"]
"""`neighbourhood`: also the mean of log n and of the optical depth over the 3x3 pixels; `view-means`: over the view;
`view-normalised`: every feature relative to mean and spread in its view."""

Remap = Literal["0.15", "0.6", "by colour"]
"""What every opacity of a view is replaced with."""

REMAPS: Final[tuple[Remap, ...]] = get_args(Remap)

_SPARE: Final = [FEATURES.index(name) for name in ("front_1", "front_3")]
_AVERAGED: Final = [FEATURES.index(name) for name in ("log_n", "optical_depth")]
_COARSE: Final = 32
"""Colours this far apart, of 256, may be different materials."""
_ALPHAS: Final = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])


def changed(features: NDArray[np.float32], inputs: Inputs, width: int) -> NDArray[np.float32]:
    """Features of all pixels of a view as a trial wants them.

    Args:
        features: float32 [P, C], columns `FEATURES`; without fragments zero. With two columns to spare: `density-8`.
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
    else:
        out[:, _SPARE] = _around(features[:, _AVERAGED].reshape(-1, width, 2)).reshape(-1, 2)
    return np.asarray(out, dtype=np.float32)


def remapped(dump: FragmentDump, remap: Remap) -> FragmentDump:
    """The same fragments with other opacities."""
    rgba = dump.rgba.copy()
    if remap == "by colour":
        cell = (dump.rgba[:, :3] // _COARSE).astype(np.uint32) @ np.array([1, 8, 64], dtype=np.uint32)
        mixed = (cell * np.uint32(2654435761)) >> np.uint32(16)  # Knuth's multiplicative hash
        rgba[:, 3] = np.round(255.0 * _ALPHAS[mixed % len(_ALPHAS)])
    else:
        rgba[:, 3] = round(255.0 * float(remap))
    return replace(dump, rgba=rgba)


def _around(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean of float32 [H, W, C] over 3x3 pixels, the border repeated."""
    height, width = values.shape[:2]
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    parts = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(parts, axis=0), dtype=np.float32)
