"""Scenes whose materials have opacities drawn at random: what a predictor is trained on beside scenes as they are."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.scene import Batch, SceneArrays

OPACITIES: Final = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Those that are drawn from."""
BASE_ALPHA: Final = 0.5
"""Opacity that such a scene is loaded with: below 1, so that every surface is drawn as a transparent one."""
_COARSE: Final = 24
"""Stored colours of a batch are one material where no channel differs by more than a step of this."""


def drawn_opacities(scene: SceneArrays, seed: int) -> SceneArrays:
    """A scene in which every material has an opacity of its own.

    Scenes rarely say where one material ends: a material is what has one coarse vertex colour within one batch. A
    texture's opacity is multiplied, as it is by one opacity for all; a cut-out keeps its shape.

    Args:
        scene: Loaded with the opacity `BASE_ALPHA` for all surfaces. Opaque batches stay as they are.
        seed: Of the draws: equal seeds give equal scenes.
    """
    rng = np.random.default_rng(seed)
    colours = scene.colours.copy()
    batches = tuple(_drawn(scene, batch, colours, rng) for batch in scene.batches)
    return replace(scene, colours=colours, batches=batches)


def _drawn(scene: SceneArrays, batch: Batch, colours: NDArray[np.uint8], rng: np.random.Generator) -> Batch:
    """The batch, after its vertices in `colours` got their opacities."""
    if batch.layer == "opaque":
        return batch
    if batch.opacity_threshold > 0.0:
        # The threshold may be compared with the vertex alpha: that is its shape.
        return replace(batch, cut_out_alpha=float(rng.choice(OPACITIES)))
    vertices = np.unique(scene.indices[batch.first : batch.first + batch.count])
    coarse = scene.colours[vertices, :3] // _COARSE
    _, material = np.unique(coarse, axis=0, return_inverse=True)
    drawn = rng.choice(OPACITIES, size=int(material.max(initial=0)) + 1)
    colours[vertices, 3] = np.round(255.0 * drawn[material.reshape(-1)])
    return batch
