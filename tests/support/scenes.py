"""Small scenes as arrays, for tests that need no USD."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from schemas.scene import Batch, SceneArrays, Texture
from schemas.view import View

VIEW = View(name="front", eye=(2.0, 1.5, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=45.0)
SIZE = (160, 120)
"""Pixels of the pictures that differential tests make of it."""


class _Builder:
    def __init__(self) -> None:
        self.parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        self.batches: list[Batch] = []

    def add(self, meshes: list[trimesh.Trimesh], colours: list[tuple[int, int, int, int]], **batch: object) -> None:
        first = sum(len(part[3]) for part in self.parts)
        for mesh, colour in zip(meshes, colours, strict=True):
            base = sum(len(part[0]) for part in self.parts)
            unit = mesh.vertices - mesh.vertices.min(axis=0)
            uvs = unit[:, :2] / np.maximum(unit[:, :2].max(axis=0), 1e-9)
            rgba = np.tile(np.array(colour, np.uint8), (len(mesh.vertices), 1))
            self.parts.append((mesh.vertices, mesh.vertex_normals, uvs, mesh.faces.ravel() + base, rgba))
        count = sum(len(part[3]) for part in self.parts) - first
        self.batches.append(Batch(first=first, count=count, **batch))  # type: ignore[arg-type]

    def scene(self, textures: tuple[Texture, ...] = ()) -> SceneArrays:
        positions, normals, uvs, indices, colours = (np.concatenate(column) for column in zip(*self.parts, strict=True))
        return SceneArrays(
            name="spheres",
            positions=positions.astype(np.float32),
            normals=normals.astype(np.float32),
            uvs=uvs.astype(np.float32),
            colours=colours,
            indices=indices.astype(np.uint32),
            batches=tuple(self.batches),
            textures=textures,
            origin=np.zeros(3),
            bounds=np.stack([positions.min(axis=0), positions.max(axis=0)]).astype(np.float64),
            up=(0.0, 1.0, 0.0),
            metres_per_unit=1.0,
        )


def shells(layers: int = 6, duplicates: int = 2, subdivisions: int = 2) -> SceneArrays:
    """Nested transparent spheres, an opaque cube inside, a card with a textured opacity (holes, glass, solid).

    Args:
        layers: Spheres.
        duplicates: Copies of each sphere in another colour, so that depths tie exactly.
        subdivisions: Of the icospheres.
    """
    rng = np.random.default_rng(7)
    builder = _Builder()
    meshes, colours = [], []
    for layer in range(layers):
        for _ in range(duplicates):
            meshes.append(trimesh.creation.icosphere(subdivisions, radius=0.5 + 0.2 * layer))
            colours.append((*rng.integers(20, 256, 3).tolist(), int(rng.integers(20, 230))))
    builder.add(meshes, colours, layer="transparent")
    builder.add([trimesh.creation.box((0.6, 0.6, 0.6))], [(200, 90, 60, 255)], layer="opaque")
    card = trimesh.creation.box((3.0, 2.0, 0.01))
    card.apply_translation((0.0, 0.0, 1.2))
    builder.add([card], [(255, 255, 255, 255)], layer="mixed", colour_texture=0, opacity_texture=0)
    pixels = rng.integers(0, 256, (16, 16, 4)).astype(np.uint8)
    pixels[:5, :, 3], pixels[5:10, :, 3] = 0, 255
    return builder.scene((Texture("noise", pixels, True, ("repeat", "clamp")),))


def with_glass(scene: SceneArrays) -> SceneArrays:
    """The scene with all that is not opaque twice: the second time as glass, whose texture gives the presence."""
    seen = [batch for batch in scene.batches if batch.layer != "opaque"]
    panes = [replace(b, reflectance=(0.04, 1.0), has_presence_texture=b.opacity_texture >= 0) for b in seen]
    return replace(scene, batches=(*scene.batches, *panes))
