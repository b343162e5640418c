"""Whether two sets of triangles are the same, whatever their order and whichever corner comes first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TOLERANCE = 4e-6
"""Of the scene's size: some 30 times the rounding of its float32 positions."""
_ROUNDS = 40


@dataclass(frozen=True, slots=True)
class Unmatched:
    """Rows of two sets that have no partner in the other, int64 each."""

    ours: NDArray[np.int64]
    theirs: NDArray[np.int64]


def match(ours: Floats, theirs: Floats, size: float) -> Unmatched:
    """Pairs triangles that agree within TOLERANCE, one to one.

    Triangles become seven lengths: centre, normal times height, and size. These are rounded to a grid; triangles in
    one cell are pairs. Rounding parts some true pairs, so what is left is tried again on grids that are shifted at
    random: the share of true pairs that is left halves each time at least.

    Args:
        ours: float64 [T, 3, 3].
        theirs: float64 [U, 3, 3].
        size: The scene's extent, same unit.
    """
    rng = np.random.default_rng(3)
    mine, other = features(ours), features(theirs)
    left, right = np.arange(len(mine)), np.arange(len(other))
    for shift in rng.uniform(0.0, 1.0, (_ROUNDS, mine.shape[1])):
        one = _ranked(_cells(mine[left], shift, size))
        two = _ranked(_cells(other[right], shift, size))
        left, right = left[~np.isin(one, two)], right[~np.isin(two, one)]
        if not len(left) or not len(right):
            break
    return Unmatched(left, right)


def features(triangles: Floats) -> Floats:
    """float64 [T, 7], metres; the same for any first corner, another for the other winding."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    edges = np.stack([b - a, c - b, a - c], axis=1)
    length = np.linalg.norm(edges, axis=2)
    longest = length.max(axis=1, keepdims=True)
    area = np.cross(b - a, c - a)
    height = np.divide(area, longest, out=np.zeros_like(area), where=longest > 0.0)
    spread = np.sqrt((length**2).sum(axis=1, keepdims=True))
    return np.concatenate([triangles.mean(axis=1), height, spread], axis=1)


def _cells(rows: Floats, shift: Floats, size: float) -> NDArray[np.uint64]:
    """A hash of each row's cell, uint64 [n]."""
    cells = np.floor(rows / (TOLERANCE * size) + shift).astype(np.int64).view(np.uint64)
    keys = np.zeros(len(rows), dtype=np.uint64)
    for column in cells.T:
        keys = (keys ^ column) * np.uint64(0x9E3779B97F4A7C15)
        keys ^= keys >> np.uint64(29)
    return keys


def _ranked(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Keys that also say which of several equal ones it is, so that as many pair up as both sides have."""
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    starts = np.flatnonzero(np.concatenate(([True], ordered[1:] != ordered[:-1]))) if len(keys) else np.zeros(0, int)
    rank = np.arange(len(keys)) - np.repeat(starts, np.diff(np.append(starts, len(keys))))
    out = np.empty_like(keys)
    out[order] = ordered + rank.astype(np.uint64) * np.uint64(0xD1B54A32D192ED03)
    return out
