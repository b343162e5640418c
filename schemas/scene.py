"""A scene as flat arrays, ready for upload: what `renderer.scene` makes of a USD stage."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from schemas.view import View

Wrap = Literal["repeat", "clamp", "mirror", "black"]
Layer = Literal["opaque", "transparent", "mixed"]


@dataclass(frozen=True, slots=True)
class Texture:
    """An image that materials sample.

    Attributes:
        name: Asset name, for messages.
        pixels: uint8 [h, w, 4], row 0 at the bottom (the GL and USD `st` convention).
        srgb: Whether RGB is sRGB-encoded (decoded to linear when sampled); alpha never is.
        wrap: How `s` and `t` outside [0,1] are mapped.
    """

    name: str
    pixels: NDArray[np.uint8]
    srgb: bool
    wrap: tuple[Wrap, Wrap]


@dataclass(frozen=True, slots=True)
class Batch:
    """A run of triangles drawn with one set of textures.

    Constant diffuse colour, display colour and constant opacity are baked into the vertex colours; a texture
    multiplies them.

    Attributes:
        first: First index (into `SceneArrays.indices`).
        count: Number of indices, a multiple of 3.
        layer: `opaque`: every fragment is opaque. `transparent`: every fragment has the vertex alpha < 1.
            `mixed`: opacity comes from a texture; a fragment of stored alpha 255 is opaque, of 0 is nothing.
        colour_texture: Index into `SceneArrays.textures`, or -1.
        colour_scale: float RGBA factor on the sampled colour (UsdUVTexture `scale`).
        colour_bias: float RGBA offset on the sampled colour (UsdUVTexture `bias`).
        opacity_texture: Index into `SceneArrays.textures`, or -1.
        opacity_channel: 0..3, which channel of the opacity texture is read.
        opacity_scale: Factor on that channel.
        opacity_bias: Offset on that channel.
        opacity_threshold: If > 0, fragments with texture opacity below it are discarded and the others keep
            the vertex alpha (UsdPreviewSurface `opacityThreshold`); else the texture multiplies the vertex alpha.
    """

    first: int
    count: int
    layer: Layer
    colour_texture: int = -1
    colour_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    colour_bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    opacity_texture: int = -1
    opacity_channel: int = 3
    opacity_scale: float = 1.0
    opacity_bias: float = 0.0
    opacity_threshold: float = 0.0


@dataclass(frozen=True, slots=True)
class SceneArrays:
    """World-space triangles of a stage, in metres, relative to `origin`.

    Attributes:
        name: Short name (the file's stem).
        positions: float32 [V, 3], metres, relative to `origin`, stage axes.
        normals: float32 [V, 3], unit length, world space.
        uvs: float32 [V, 2], already transformed by UsdTransform2d where a material has one.
        colours: uint8 [V, 4], RGB gamma-2 encoded linear colour (schemas.colour), alpha linear.
        indices: uint32 [3*T], batches one after the other.
        batches: Runs of `indices`.
        textures: Images the batches refer to.
        origin: float64 [3], metres, stage space; the centre of the bounds.
        bounds: float64 [2, 3], min and max of `positions`.
        up: Unit up axis of the stage.
        metres_per_unit: The stage's scale, already applied.
        cameras: Views of the stage's own cameras (already relative to `origin`, metres).
        warnings: What was not supported or was missing, each naming the prim's path.
    """

    name: str
    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    colours: NDArray[np.uint8]
    indices: NDArray[np.uint32]
    batches: tuple[Batch, ...]
    textures: tuple[Texture, ...]
    origin: NDArray[np.float64]
    bounds: NDArray[np.float64]
    up: tuple[float, float, float]
    metres_per_unit: float
    cameras: tuple[View, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.indices) // 3

    @property
    def is_opaque(self) -> bool:
        """Whether no triangle can make a transparent fragment."""
        return all(batch.layer == "opaque" for batch in self.batches)
