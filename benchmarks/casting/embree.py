"""All hits of rays by embree, through trimesh: an independent caster, in float32."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.ray.ray_pyembree import RayMeshIntersector

from benchmarks.casting.rays import Camera, Hits
from schemas.scene import SceneArrays

_MOST_HITS = 4096


class Embree:
    """The triangles of a scene in embree's tree.

    Attributes:
        step: Metres along a ray within which trimesh may miss a second hit: it starts anew 1e-6 of the scene's size
            behind a hit, doubled where that finds the same triangle again.
    """

    def __init__(self, scene: SceneArrays) -> None:
        faces = scene.indices.reshape(-1, 3).astype(np.int64)
        self._mesh = trimesh.Trimesh(scene.positions.astype(np.float64), faces, process=False)
        self.step = 4e-6 * float(self._mesh.scale)
        self._caster = RayMeshIntersector(self._mesh)

    def hits(self, camera: Camera, pixels: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rays through pixel centres, from the near plane to the far plane.

        Args:
            camera: The view.
            pixels: int64 [S].

        Returns:
            Sample and triangle of each hit, int64 [M].
        """
        origins, directions = camera.rays(pixels)
        triangles, samples, places = self._caster.intersects_id(
            origins, directions, multiple_hits=True, max_hits=_MOST_HITS, return_locations=True
        )
        depth = -(places @ camera.to_view[2, :3] + camera.to_view[2, 3])
        seen = depth <= camera.far
        return np.asarray(samples[seen], dtype=np.int64), np.asarray(triangles[seen], dtype=np.int64)


def met(hits: Hits, samples: NDArray[np.int64], triangles: NDArray[np.int64]) -> tuple[NDArray[np.bool_], set[int]]:
    """Which of the exact hits embree found too, and the rays on which it found a triangle that they do not meet.

    Args:
        hits: From `rays.cast`.
        samples: int64 [M], from `Embree.hits`.
        triangles: int64 [M].

    Returns:
        bool [H], and numbers of rays.
    """
    count = int(max(hits.triangle.max(initial=0), triangles.max(initial=0))) + 1
    exact, found = hits.sample * count + hits.triangle, samples * count + triangles
    return np.isin(exact, found), set(samples[~np.isin(found, exact)].tolist())
