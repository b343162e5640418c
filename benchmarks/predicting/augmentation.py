"""Trials on more to train on: other scenes made of a view's own fragments. They are never scored."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from renderer.features import FEATURES
from schemas.fragments import FragmentDump

Augmentation = Literal["opacities", "colours", "cuts"]
"""`opacities`: views with other opacities; `colours`: with R, G and B in other orders; `cuts`: with half of what is in
them gone."""

Remap = Literal["0.15", "0.6", "by colour", "one half", "other half"]
"""What every opacity of a view is replaced with; `one half`, `other half`: what has one half of the coarse colours,
drawn at random, or the other half, is gone."""

REMAPS: Final[dict[Augmentation, tuple[Remap, ...]]] = {
    "opacities": ("0.15", "0.6", "by colour"),
    "colours": (),
    "cuts": ("one half", "other half"),
}
"""The views with labels of their own that each adds."""

_COARSE: Final = 32
"""Colours this far apart, of 256, may be different materials."""
_ALPHAS: Final = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
_CHANNELS: Final = [
    [FEATURES.index(f"{name.removesuffix('_r')}_{c}") for c in "rgb"] for name in FEATURES if name.endswith("_r")
]
"""Columns of the features that are colours."""
_OTHER_ORDERS: Final = np.array(list(permutations(range(3)))[1:])


def remapped(dump: FragmentDump, remap: Remap) -> FragmentDump:
    """The same fragments with other opacities, or some of them.

    The nearest fragment's `facing` stays what it was, even of one that is gone: no network reads it.
    """
    if remap == "one half" or remap == "other half":
        return _kept(dump, _mixed(dump) % 2 == int(remap == "other half"))
    rgba = dump.rgba.copy()
    if remap == "by colour":
        rgba[:, 3] = np.round(255.0 * _ALPHAS[_mixed(dump) % len(_ALPHAS)])
    else:
        rgba[:, 3] = round(255.0 * float(remap))
    return replace(dump, rgba=rgba)


def recoloured(features: NDArray[np.float32], seed: int) -> NDArray[np.float32]:
    """Features of a view whose R, G and B are in one of the five other orders, each pixel's in one of its own.

    Labels stay: display error is a sum over channels that are treated alike, and weights of a tail are of alpha and
    depth.

    Args:
        features: float32 [R, C], columns `FEATURES`.
        seed: Of the orders.
    """
    orders = _OTHER_ORDERS[np.random.default_rng(seed).integers(len(_OTHER_ORDERS), size=len(features))]
    out = features.copy()
    for columns in _CHANNELS:
        out[:, columns] = np.take_along_axis(features[:, columns], orders, axis=1)
    return out


def _mixed(dump: FragmentDump) -> NDArray[np.uint32]:
    """A hash of every fragment's coarse colour, 16 bits, [N]."""
    cell = (dump.rgba[:, :3] // _COARSE).astype(np.uint32) @ np.array([1, 8, 64], dtype=np.uint32)
    return (cell * np.uint32(2654435761)) >> np.uint32(16)  # Knuth's multiplicative hash


def _kept(dump: FragmentDump, kept: NDArray[np.bool_]) -> FragmentDump:
    offsets = np.concatenate([[0], np.cumsum(kept)])[dump.offsets].astype(np.int64)
    return replace(dump, offsets=offsets, rgba=dump.rgba[kept], depth=dump.depth[kept])
