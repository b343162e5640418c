"""From placed parts to one set of world-space arrays with as few batches as there are texture sets and layers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.usd.parts import Part
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.scene import Batch

FARTHEST = 1e30
"""Metres from the stage's origin, along each axis."""

LAYER_ORDER = {"opaque": 0, "mixed": 1, "transparent": 2}


@dataclass(frozen=True, slots=True)
class Placed:
    """A part, where its copies stand (float64 [M, 4, 4], `p' = p @ M`, to metres in stage space), and its prim."""

    part: Part
    matrices: NDArray[np.float64]
    path: str


@dataclass(frozen=True, slots=True)
class Arrays:
    """The geometry fields of SceneArrays, under the same names."""

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    colours: NDArray[np.uint8]
    indices: NDArray[np.uint32]
    batches: tuple[Batch, ...]
    origin: NDArray[np.float64]
    bounds: NDArray[np.float64]
    more_uvs: NDArray[np.float32] | None


def assemble(placed: list[Placed]) -> Arrays:
    """Puts all copies of all parts into world space, relative to the centre of their bounds.

    Raises:
        Problem: Too many triangles, or coordinates beyond float32.
    """
    vertices = sum(len(p.matrices) * len(p.part.positions) for p in placed)
    triangles = sum(len(p.matrices) * len(p.part.triangles) for p in placed)
    if triangles > LIMITS.triangles:
        raise Problem(
            f"The scene has {triangles} triangles with all instances, more than {LIMITS.triangles}.",
            "Split it, or deactivate parts of it.",
            ExitCode.LIMIT,
        )
    low, high = _bounds(placed)
    origin = 0.5 * (low + high)
    filler = _Filler(vertices, triangles, origin, any(p.part.more_uvs is not None for p in placed))
    batches = filler.fill(placed)
    bounds = np.stack((filler.positions.min(axis=0), filler.positions.max(axis=0))).astype(np.float64)
    return Arrays(
        *(filler.positions, filler.normals, filler.uvs, filler.colours, filler.indices),
        *(batches, origin, bounds, filler.more_uvs),
    )


def _bounds(placed: list[Placed]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for item in placed:
        for matrices in _chunks(item):
            points = _transform(item.part.positions, matrices)
            low, high = np.minimum(low, points.min(axis=(0, 1))), np.maximum(high, points.max(axis=(0, 1)))
            if not np.all(np.abs((low, high)) <= FARTHEST):
                raise Problem(
                    f"{item.path} has copies at coordinates that are not finite, or huge.",
                    "Look for NaN, infinite or huge numbers in its points, its transforms and its instancers.",
                    ExitCode.USAGE,
                )
    return low, high


def _chunks(item: Placed) -> list[NDArray[np.float64]]:
    """Matrices in groups of about a million vertices, so that temporaries stay small."""
    step = max(1, 1_000_000 // max(1, len(item.part.positions)))
    return [item.matrices[i : i + step] for i in range(0, len(item.matrices), step)]


def _transform(points: NDArray[np.float64], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64 [M, V, 3]."""
    placed = _times(points, matrices[:, :3, :3])
    placed += matrices[:, None, 3, :3]
    return placed


def _times(rows: NDArray[np.floating], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows [V, 3] by each of the matrices [M, 3, 3], float64 [M, V, 3]."""
    result = np.empty((len(matrices), len(rows), 3))
    x, y, z = rows.T
    # Column by column: numpy's product of many rows with so small a matrix takes nine times as long.
    with np.errstate(invalid="ignore", over="ignore"):
        # Whatever is not finite is found, and named, in the bounds.
        for axis in range(3):
            a, b, c = (matrices[:, k, axis, None] for k in range(3))
            result[:, :, axis] = a * x + b * y + c * z
    return result


class _Filler:
    """Final arrays, filled part by part."""

    def __init__(self, vertices: int, triangles: int, origin: NDArray[np.float64], more_uvs: bool) -> None:
        self.positions = np.empty((vertices, 3), dtype=np.float32)
        self.normals = np.empty((vertices, 3), dtype=np.float32)
        self.uvs = np.empty((vertices, 2), dtype=np.float32)
        self.colours = np.empty((vertices, 4), dtype=np.uint8)
        self.indices = np.empty(3 * triangles, dtype=np.uint32)
        self.more_uvs = np.zeros((vertices, 4), dtype=np.float32) if more_uvs else None
        self._origin = origin
        self._vertex = 0
        self._index = 0

    def fill(self, placed: list[Placed]) -> tuple[Batch, ...]:
        """Fills everything; one batch for each style, opaque ones first."""
        by_style: dict[Batch, list[Placed]] = {}
        for item in placed:
            by_style.setdefault(item.part.style, []).append(item)
        batches = []
        for style in sorted(by_style, key=lambda s: LAYER_ORDER[s.layer]):
            first = self._index
            for item in by_style[style]:
                for matrices in _chunks(item):
                    self._copy(item.part, matrices)
            batches.append(replace(style, first=first, count=self._index - first))
        return tuple(batches)

    def _copy(self, part: Part, matrices: NDArray[np.float64]) -> None:
        copies, size = len(matrices), len(part.positions)
        rows = slice(self._vertex, self._vertex + copies * size)
        self.positions[rows] = (_transform(part.positions, matrices) - self._origin).reshape(-1, 3)
        self.normals[rows] = _turned(part.normals, matrices).reshape(-1, 3)
        self.uvs[rows] = np.tile(part.uvs, (copies, 1))
        self.colours[rows] = np.tile(part.colours, (copies, 1))
        if self.more_uvs is not None and part.more_uvs is not None:
            self.more_uvs[rows] = np.tile(part.more_uvs, (copies, 1))
        base = self._vertex + size * np.arange(copies, dtype=np.int64)
        triangles = np.broadcast_to(part.triangles[None].astype(np.int64), (copies, *part.triangles.shape))
        # A mirroring transform turns the winding round; exchanging two corners keeps the outside outside.
        mirrored = np.linalg.det(matrices[:, :3, :3]) < 0.0
        triangles = np.where(mirrored[:, None, None], triangles[:, :, ::-1], triangles) + base[:, None, None]
        self.indices[self._index : self._index + triangles.size] = triangles.ravel()
        self._vertex += copies * size
        self._index += triangles.size


def _turned(normals: NDArray[np.float32], matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Unit normals in world space, float32 [M, V, 3].

    Normals go with the inverse transpose; its multiple, the cofactor matrix, also exists where a scale is 0.
    """
    m = matrices[:, :3, :3]
    cofactors = np.stack([np.cross(m[:, (i + 1) % 3], m[:, (i + 2) % 3]) for i in range(3)], axis=1)
    sign = np.where(np.linalg.det(m) < 0.0, -1.0, 1.0)
    scale = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    cofactors = cofactors * sign[:, None, None] / np.where(scale > 0.0, scale, 1.0)
    turned = _times(normals.astype(np.float64), cofactors)
    length = np.sqrt(np.einsum("mvi,mvi->mv", turned, turned))[:, :, None]
    turned = np.where(length > 0.0, turned / np.where(length > 0.0, length, 1.0), np.array([0.0, 0.0, 1.0]))
    return turned.astype(np.float32)
