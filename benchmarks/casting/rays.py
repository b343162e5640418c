"""Rays through the centres of pixels, and every triangle that they meet, or may meet once corners are rounded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.casting.coverage import search
from schemas.scene import SceneArrays
from schemas.view import View

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Camera:
    """A view for one picture size, in float64.

    Attributes:
        to_view: float64 [4, 4].
        projection: float64 [4, 4], clip space, row 0 of the picture at the top.
        near: Near distance, metres.
        far: Far distance, metres.
        width: Pixels per row.
        height: Rows.
        orthographic: Whether rays are parallel.
    """

    to_view: Floats
    projection: Floats
    near: float
    far: float
    width: int
    height: int
    orthographic: bool

    @classmethod
    def of(cls, view: View, bounds: Floats, width: int, height: int) -> Camera:
        """The camera of a view of a scene with these bounds (float64 [2, 3])."""
        near, far = view.clip_range(bounds)
        projection = view.projection(width / height, near, far)
        projection[1] *= -1.0
        return cls(view.world_to_view(), projection, near, far, width, height, view.ortho_height is not None)

    def rays(self, pixels: Integers) -> tuple[Floats, Floats]:
        """Rays through the centres of pixels, from the near plane on.

        Args:
            pixels: int64 [S], `y * width + x`.

        Returns:
            Origins and directions in the scene's space, float64 [S, 3]; a direction advances one metre of depth.
        """
        origins, directions = self.view_rays(pixels)
        turn = self.to_view[:3, :3]
        start = origins + self.near * directions - self.to_view[:3, 3]
        return start @ turn, directions @ turn

    def view_rays(self, pixels: Integers) -> tuple[Floats, Floats]:
        """Points at depth 0 and directions of depth 1 in view space, float64 [S, 3]."""
        p = self.projection
        x = 2.0 * (pixels % self.width + 0.5) / self.width - 1.0
        y = 2.0 * (pixels // self.width + 0.5) / self.height - 1.0
        flat = np.stack([(x - p[0, 3]) / p[0, 0], (y - p[1, 3]) / p[1, 1], np.zeros_like(x)], axis=1)
        ahead = np.tile([0.0, 0.0, -1.0], (len(pixels), 1))
        if self.orthographic:
            return flat, ahead
        slanted = np.stack([(x + p[0, 2]) / p[0, 0], (y + p[1, 2]) / p[1, 1], -np.ones_like(x)], axis=1)
        return np.zeros_like(slanted), slanted


@dataclass(frozen=True, slots=True)
class Hits:
    """Triangles that rays meet or may meet, in no order.

    Attributes:
        sample: int64 [H], which ray.
        triangle: int64 [H].
        depth: float64 [H], where the ray meets the triangle's plane, metres along the view axis.
        inside: bool [H], whether the ray itself, without any tolerance, goes through the triangle.
        doubt: int8 [H], CERTAIN, AT_EDGE or AT_CLIP.
        low: float64 [H], least depth that float32 rasterisation may give this fragment.
        high: float64 [H], the greatest.
        slope: float64 [H], metres of depth per pixel.
        weights: float64 [H, 3], barycentric coordinates of the hit.
        weights_x: float64 [H, 3], their change from this pixel to the next in the row.
        weights_y: float64 [H, 3], and in the column.
    """

    sample: Integers
    triangle: Integers
    depth: Floats
    inside: NDArray[np.bool_]
    doubt: NDArray[np.int8]
    low: Floats
    high: Floats
    slope: Floats
    weights: Floats
    weights_x: Floats
    weights_y: Floats


def cast(scene: SceneArrays, camera: Camera, pixels: Integers) -> Hits:
    """All hits of the rays through the centres of `pixels` (int64 [S], distinct)."""
    grid = np.full(camera.width * camera.height, -1, dtype=np.int64)
    grid[pixels] = np.arange(len(pixels))
    origins, directions = camera.view_rays(pixels)
    numbers, reals = search(
        scene.positions,
        scene.indices,
        camera.to_view,
        camera.projection,
        np.array([camera.near, camera.far]),
        grid.reshape(camera.height, camera.width),
        origins,
        directions,
        camera.orthographic,
    )
    return Hits(
        sample=numbers[:, 0],
        triangle=numbers[:, 1],
        depth=reals[:, 0],
        inside=numbers[:, 2] == 1,
        doubt=numbers[:, 3].astype(np.int8),
        low=reals[:, 1],
        high=reals[:, 2],
        slope=reals[:, 3],
        weights=reals[:, 4:7],
        weights_x=reals[:, 7:10],
        weights_y=reals[:, 10:13],
    )
