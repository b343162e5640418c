"""Opacities that vary from material to material, drawn at random: what training sees beside a scene's own."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from schemas.scene import SceneArrays

OPACITIES: Final = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)

_COARSE: Final = 24
"""Stored colours this far apart may be different materials: those without textures share a batch."""


def drawn_opacities(scene: SceneArrays, seed: int) -> SceneArrays:
    """The scene with an opacity of its own for every material.

    A material is a coarse colour of the vertices of a batch.

    Args:
        scene: Loaded with one opacity below 1 for all surfaces, so that every batch is drawn as transparent.
        seed: Of the draw.
    """
    rng = np.random.default_rng(seed)
    stored = np.round(255.0 * np.array(OPACITIES)).astype(np.uint8)
    key = (scene.colours[:, :3] // _COARSE).astype(np.int64) @ np.array([1, 16, 256])
    colours = scene.colours.copy()
    for batch in scene.batches:
        vertices = np.unique(scene.indices[batch.first : batch.first + batch.count])
        materials, own = np.unique(key[vertices], return_inverse=True)
        colours[vertices, 3] = stored[rng.integers(len(stored), size=len(materials))][own]
    return replace(scene, colours=colours)
