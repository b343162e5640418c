"""Free places inside a scene from which an inside view makes sense, found on a coarse grid of its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.scene import SceneArrays

Floats = NDArray[np.float64]

CELLS = 40
"""Cells along the longest side of the bounds."""
SAMPLES = 200_000
"""Points on the surface; enough to hit every cell of a surface that spans the grid."""
ROOM_SHARE = 0.06
"""A room is a place with this share of the bounds' diagonal free before the nearest of the walls around it."""

WALLS = 8
"""A room has at least this many walls on the two level lines through it: a hollow object has four."""


@dataclass(frozen=True, slots=True)
class Room:
    """Places to stand.

    Attributes:
        places: float64 [n, 3], metres, relative to the scene's origin; the most spacious ones.
        ahead: float64 [n, 3], unit direction along a horizontal axis with the longest free line there.
    """

    places: Floats
    ahead: Floats


def find_room(scene: SceneArrays) -> Room | None:
    """The room of a scene: places with a floor below and walls on all four sides, at some distance.

    None where there is none: most objects, and hollow ones, from whose inside there is only their skin to see.
    """
    up = int(np.argmax(np.abs(scene.up)))
    low = scene.bounds[0]
    size = scene.bounds[1] - low
    cell = float(size.max()) / CELLS
    if not cell > 0.0:
        return None
    filled = _surface_cells(scene, low, cell)
    sides = [_free_run(filled, axis, step) for axis in range(3) if axis != up for step in (1, -1)]
    around = np.stack(sides)
    floor = _free_run(filled, up, -1)
    walls = sum(_runs(filled, axis) for axis in range(3) if axis != up)
    closed = np.isfinite(around).all(axis=0) & np.isfinite(floor)
    nearest = np.where(closed & (walls >= WALLS), around.min(axis=0), 0.0)
    best = float(nearest.max())
    if best * cell < ROOM_SHARE * float(np.linalg.norm(size)):
        return None
    spacious = np.argwhere(nearest >= 0.7 * best)
    directions = [step * np.eye(3)[axis] for axis in range(3) if axis != up for step in (1, -1)]
    longest = around[:, spacious[:, 0], spacious[:, 1], spacious[:, 2]].argmax(axis=0)
    return Room(np.minimum(low + (spacious + 0.5) * cell, scene.bounds[1] - 0.25 * cell), np.array(directions)[longest])


def _surface_cells(scene: SceneArrays, low: Floats, cell: float) -> NDArray[np.bool_]:
    """Which cells of the grid the surface passes through, bool [nx, ny, nz]."""
    corners = scene.positions[scene.indices.reshape(-1, 3)].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rng = np.random.default_rng(0)
    edges = np.cumsum(area)
    pick = np.minimum(np.searchsorted(edges, rng.uniform(0.0, edges[-1], SAMPLES)), len(area) - 1)
    u, v = rng.uniform(0.0, 1.0, (2, SAMPLES))
    # Folding the square of (u, v) along its diagonal covers the triangle evenly.
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = corners[pick, 0], corners[pick, 1], corners[pick, 2]
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    shape = np.maximum(np.ceil((scene.bounds[1] - low) / cell - 1e-9).astype(int), 1)
    index = np.clip(((points - low) / cell).astype(int), 0, shape - 1)
    filled = np.zeros(tuple(shape), dtype=bool)
    filled[tuple(index.T)] = True
    return filled


def _free_run(filled: NDArray[np.bool_], axis: int, step: int) -> Floats:
    """Number of free cells from each cell until a filled one along an axis; infinite where there is none."""
    cells = np.moveaxis(filled, axis, 0)
    cells = cells[::-1] if step > 0 else cells
    run = np.empty(cells.shape)
    current = np.full(cells.shape[1:], np.inf)
    for i, layer in enumerate(cells):
        current = np.where(layer, 0.0, current + 1.0)
        run[i] = current
    run = run[::-1] if step > 0 else run
    return np.asarray(np.moveaxis(run, 0, axis))


def _runs(filled: NDArray[np.bool_], axis: int) -> NDArray[np.int64]:
    """Number of separate walls on the line through each cell along an axis, broadcastable to the grid."""
    edges = np.diff(filled.astype(np.int8), axis=axis, prepend=0)
    return np.asarray((edges == 1).sum(axis=axis, keepdims=True))
