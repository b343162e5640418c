"""Transforms of texture coordinates as 3x3 matrices on (u, v, 1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Pair = Sequence[float]


def transform2d(scale: Pair, rotation: float, translation: Pair) -> Matrix:
    """UsdTransform2d: scaled, then rotated counter-clockwise (degrees), then moved."""
    return _move(translation) @ _turn(rotation) @ _scale(scale)


def place2d(pivot: Pair, scale: Pair, rotate: float, offset: Pair, move_first: bool) -> Matrix:
    """MaterialX `place2d` (specification 1.39, its node graph).

    It finds the place in the image, so it divides by `scale`, turns clockwise (degrees) and moves back by `offset`,
    about `pivot`; with `operationorder` 1 in the opposite order.
    """
    steps = [_scale(_inverse(scale)), _turn(-rotate), _move(-np.asarray(offset, dtype=np.float64))]
    first, second, third = reversed(steps) if move_first else steps
    return _move(pivot) @ third @ second @ first @ _move(-np.asarray(pivot, dtype=np.float64))


def tiling(repeats: Pair, offset: Pair, tile_size: Pair, image_size: Pair) -> Matrix:
    """What MaterialX `tiledimage` does to its coordinates (specification 1.39, its node graph)."""
    moved = _move(-np.asarray(offset, dtype=np.float64)) @ _scale(repeats)
    return _scale(tile_size) @ _scale(_inverse(image_size)) @ moved


def _inverse(pair: Pair) -> Matrix:
    """Reciprocals; 0 of 0."""
    values = np.asarray(pair, dtype=np.float64)
    return np.divide(1.0, values, out=np.zeros(2), where=values != 0.0)


def _scale(pair: Pair | Matrix) -> Matrix:
    return np.diag([pair[0], pair[1], 1.0])


def _move(pair: Pair | Matrix) -> Matrix:
    matrix = np.eye(3)
    matrix[:2, 2] = pair
    return matrix


def _turn(degrees: float) -> Matrix:
    """Counter-clockwise."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
