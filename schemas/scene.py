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
        wrap: How `s` and `t` outside [0,1] are mapped; `black` is zero there in all four channels.
    """

    name: str
    pixels: NDArray[np.uint8]
    srgb: bool
    wrap: tuple[Wrap, Wrap]


@dataclass(frozen=True, slots=True)
class Batch:
    """A run of triangles drawn with one set of textures.

    Constant diffuse colour, display colour and constant opacity are baked into the vertex colours; colour and opacity
    textures multiply them, an emission texture is added. A sample is texel * scale + bias, clamped to [0,1].

    Attributes:
        first: First index (into `SceneArrays.indices`).
        count: Number of indices, a multiple of 3.
        layer: `opaque`: every fragment is opaque. `transparent`: every fragment has the vertex alpha < 1, or is glass.
            `mixed`: opacity varies; a fragment of stored alpha 255 is opaque, of 0 is nothing.
        colour_texture: Index into `SceneArrays.textures`, or -1.
        colour_scale: float RGBA factor on the sampled colour (UsdUVTexture `scale`).
        colour_bias: float RGBA offset on the sampled colour (UsdUVTexture `bias`).
        colour_uv: Which texture coordinates it reads: 0 `SceneArrays.uvs`, 1 and 2 the halves of `more_uvs`.
        opacity_texture: Index into `SceneArrays.textures`, or -1.
        opacity_channel: 0..3, which channel of the opacity texture is read.
        opacity_scale: Factor on that channel.
        opacity_bias: Offset on that channel.
        opacity_uv: As `colour_uv`.
        opacity_threshold: If > 0, fragments whose opacity (the texture's, or the vertex alpha where there is none) is
            below it are discarded and the others have `cut_out_alpha` (UsdPreviewSurface `opacityThreshold`); else
            the texture multiplies the vertex alpha.
        cut_out_alpha: Alpha of what the threshold leaves.
        emission_texture: Index into `SceneArrays.textures`, or -1.
        emission_scale: float RGBA factor on the sampled emission.
        emission_bias: float RGBA offset on the sampled emission.
        emission_uv: As `colour_uv`.
        reflectance: Of glass (docs/METHOD.md, section 1), what it reflects facing the eye and at a silhouette, each in
            [0,1]; None: it is no glass. Of glass the colour is the tint of what goes through, and the vertex alpha,
            times the opacity texture, the share of light that is not transmitted.
        transmittance: Of glass whose colour is not its tint, the mean of the tint; None: it is that of the colour.
        presence: Of glass, the opacity that multiplies all that; a threshold applies to it.
        has_presence_texture: Whether the opacity texture gives the presence instead.
    """

    first: int
    count: int
    layer: Layer
    colour_texture: int = -1
    colour_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    colour_bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    colour_uv: int = 0
    opacity_texture: int = -1
    opacity_channel: int = 3
    opacity_scale: float = 1.0
    opacity_bias: float = 0.0
    opacity_uv: int = 0
    opacity_threshold: float = 0.0
    cut_out_alpha: float = 1.0
    emission_texture: int = -1
    emission_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    emission_bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    emission_uv: int = 0
    reflectance: tuple[float, float] | None = None
    transmittance: float | None = None
    presence: float = 1.0
    has_presence_texture: bool = False

    @property
    def textures(self) -> tuple[int, ...]:
        """Indices of the textures it samples."""
        return tuple(t for t in (self.colour_texture, self.opacity_texture, self.emission_texture) if t >= 0)

    @property
    def is_plain(self) -> bool:
        """Whether the vertex colours alone decide colour and opacity."""
        return not self.textures and self.opacity_threshold <= 0.0


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
        more_uvs: float32 [V, 4], a second and a third pair of texture coordinates; None where no batch reads them.
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
    more_uvs: NDArray[np.float32] | None = None

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.indices) // 3

    @property
    def is_opaque(self) -> bool:
        """Whether no triangle can make a transparent fragment."""
        return all(batch.layer == "opaque" for batch in self.batches)
