"""Sampling of a texture as its definition says, in float64: the twin of `renderer/shaders/common/texture.glsl`."""

from __future__ import annotations

import numpy as np

from schemas.colour import srgb_to_linear
from schemas.scene import Batch, Texture, Wrap


def texel_of(index: int, size: int, wrap: Wrap) -> int | None:
    """The texel that a whole-numbered place is, on an endless axis; None where it is black."""
    if wrap == "repeat":
        return index % size
    if wrap == "mirror":
        place = index % (2 * size)
        return place if place < size else 2 * size - 1 - place
    if 0 <= index < size:
        return index
    return None if wrap == "black" else min(max(index, 0), size - 1)


def bilinear(texture: Texture, u: float, v: float) -> np.ndarray:
    """Linear RGBA in [0,1] of the four nearest texels, float64 [4]."""
    texels = texture.pixels / 255.0
    if texture.srgb:
        texels[..., :3] = srgb_to_linear(texels[..., :3])
    height, width = texels.shape[:2]
    x, y = u * width - 0.5, v * height - 0.5
    left, low = int(np.floor(x)), int(np.floor(y))
    total = np.zeros(4)
    for row, wy in ((low, 1.0 - (y - low)), (low + 1, y - low)):
        for column, wx in ((left, 1.0 - (x - left)), (left + 1, x - left)):
            i, j = texel_of(row, height, texture.wrap[1]), texel_of(column, width, texture.wrap[0])
            if i is not None and j is not None:
                total += wx * wy * texels[i, j]
    return total


def colour(texture: Texture, u: float, v: float, scale: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Linear RGB, times scale plus bias, clamped; float64 [3]."""
    return np.clip(bilinear(texture, u, v)[:3] * scale[:3] + bias[:3], 0.0, 1.0)


def alpha(batch: Batch, texture: Texture, u: float, v: float, vertex: float) -> float:
    """A fragment's opacity: 0 where a threshold discards it."""
    value = bilinear(texture, u, v)[batch.opacity_channel] * batch.opacity_scale + batch.opacity_bias
    opacity = float(np.clip(value, 0.0, 1.0))
    if batch.opacity_threshold > 0.0:
        return 0.0 if opacity < batch.opacity_threshold else batch.cut_out_alpha
    return vertex * opacity
