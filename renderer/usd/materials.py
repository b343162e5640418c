"""UsdPreviewSurface networks as surfaces: constants, primvars and at most one texture for colour and for opacity."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdShade

from renderer.usd import materialx
from renderer.usd.stage import WarningLog
from renderer.usd.textures import TextureTable, TextureUnreadable
from schemas.scene import Wrap

GREY = (0.7, 0.7, 0.7)
"""Linear RGB of what has neither a material nor a display colour."""

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]

ONES: Vec4 = (1.0, 1.0, 1.0, 1.0)
ZEROS: Vec4 = (0.0, 0.0, 0.0, 0.0)
IDENTITY: tuple[Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
WRAPS: dict[str, Wrap] = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black"}


@dataclass(frozen=True, slots=True)
class Sampler:
    """A texture read by a material.

    Attributes:
        texture: Index into the texture table.
        channel: 0..3 for a single channel; 3 where RGB is read as a colour.
        scale: RGBA factor.
        bias: RGBA offset.
        uv: Name of the texture coordinates' primvar.
        uv_transform: Two rows (a, b, c): u' = a u + b v + c (UsdTransform2d).
    """

    texture: int
    channel: int
    scale: Vec4
    bias: Vec4
    uv: str
    uv_transform: tuple[Vec3, Vec3]


@dataclass(frozen=True, slots=True)
class Surface:
    """What a material says about colour and opacity.

    Attributes:
        colour: Linear RGB where no primvar and no texture gives one.
        colour_primvar: Primvar that gives the colour.
        colour_sampler: Texture that gives the colour.
        emission: Linear RGB that is added.
        opacity: Opacity in [0,1] where no primvar and no texture gives one.
        opacity_primvar: Primvar that gives the opacity.
        opacity_sampler: Texture that gives the opacity.
        threshold: `opacityThreshold`; above 0 the surface is a cut-out.
    """

    colour: Vec3 = GREY
    colour_primvar: str | None = None
    colour_sampler: Sampler | None = None
    emission: Vec3 = (0.0, 0.0, 0.0)
    opacity: float = 1.0
    opacity_primvar: str | None = None
    opacity_sampler: Sampler | None = None
    threshold: float = 0.0


DISPLAY = Surface(colour_primvar="displayColor", opacity_primvar="displayOpacity")
"""A prim without a material: its display colour and opacity."""


@dataclass
class MaterialTable:
    """Surfaces of a stage's materials at one time, each read once.

    Attributes:
        time: The time to read at.
        textures: Gets the images.
        log: Gets a line for everything that is not supported.
    """

    time: Usd.TimeCode
    textures: TextureTable
    log: WarningLog
    _surfaces: dict[Sdf.Path, Surface | None] = field(default_factory=dict)

    def surface(self, stage: Usd.Stage, path: Sdf.Path) -> Surface | None:
        """The surface of the material at a path; None, with a warning, if it has none that is supported."""
        if path not in self._surfaces:
            material = UsdShade.Material(stage.GetPrimAtPath(path))
            self._surfaces[path] = self._read(material) if material else self._read_materialx(stage, path)
        return self._surfaces[path]

    def _read_materialx(self, stage: Usd.Stage, path: Sdf.Path) -> Surface | None:
        """The surface of a material that is only in a MaterialX document which an ancestor refers to."""
        parent = stage.GetPrimAtPath(path.GetParentPath())
        document = materialx.referenced_document(parent) if parent else None
        found = materialx.read_surface(document, path.name) if document else None
        if found is None:
            self.log.add("the bound material is missing or not supported, display colour used", path)
            return None
        surface = Surface(colour=found.colour, opacity=found.opacity)
        if found.image is None:
            return surface
        try:
            index = self.textures.colour(str(found.image), found.image.name, "sRGB", ("repeat", "repeat"))
        except TextureUnreadable as error:
            self.log.add(f"{error} ({found.image.name}), grey is used", path)
            return replace(surface, colour=GREY)
        return replace(surface, colour_sampler=Sampler(index, 3, ONES, ZEROS, "st", IDENTITY))

    def _read(self, material: UsdShade.Material) -> Surface | None:
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader or shader.GetShaderId() != "UsdPreviewSurface":
            kind = (
                f"its surface is a {shader.GetShaderId() or 'shader without an id'}" if shader else "it has no surface"
            )
            self.log.add(f"material not supported ({kind}), display colour used", material.GetPath())
            return None
        surface = self._with_colour(Surface(), shader.GetInput("diffuseColor"))
        surface = replace(surface, emission=self._emission(shader.GetInput("emissiveColor")))
        surface = self._with_opacity(surface, shader.GetInput("opacity"))
        return replace(surface, threshold=number_of(self._value(shader.GetInput("opacityThreshold")), 0.0))

    def _with_colour(self, surface: Surface, shade_input: UsdShade.Input) -> Surface:
        source, output = self._source(shade_input)
        if source is None:
            return replace(surface, colour=colour_of(self._value(shade_input), (0.18, 0.18, 0.18)))
        if _is_reader(source):
            fallback = colour_of(self._value(source.GetInput("fallback")), GREY)
            return replace(surface, colour=fallback, colour_primvar=self._text(source, "varname", "displayColor"))
        return self._textured(surface, source, output, "colour")

    def _with_opacity(self, surface: Surface, shade_input: UsdShade.Input) -> Surface:
        source, output = self._source(shade_input)
        if source is None:
            return replace(surface, opacity=number_of(self._value(shade_input), 1.0))
        if _is_reader(source):
            fallback = number_of(self._value(source.GetInput("fallback")), 1.0)
            return replace(surface, opacity=fallback, opacity_primvar=self._text(source, "varname", "displayOpacity"))
        return self._textured(surface, source, output, "opacity")

    def _textured(self, surface: Surface, source: UsdShade.Shader, output: str, role: str) -> Surface:
        if source.GetShaderId() != "UsdUVTexture":
            self.log.add(f"{source.GetShaderId()} cannot drive {role}, a constant is used", source.GetPath())
            return surface
        fallback = self._value(source.GetInput("fallback"))
        try:
            sampler = self._sampler(source, output, role)
        except TextureUnreadable as error:
            asset = self._value(source.GetInput("file"))
            name = getattr(asset, "path", "") or "no file"
            self.log.add(f"{error} ({name}), its fallback is used", source.GetPath())
            if role == "colour":
                return replace(surface, colour=colour_of(fallback, GREY))
            given = 1.0 if fallback is None else float(fallback[CHANNELS.get(output, 3)])
            return replace(surface, opacity=given)
        if role == "colour":
            return replace(surface, colour=(1.0, 1.0, 1.0), colour_sampler=sampler)
        low, high = self.textures.channel_range(sampler.texture, sampler.channel)
        ends = [sampler.scale[sampler.channel] * x + sampler.bias[sampler.channel] for x in (low, high)]
        if low == high or min(ends) >= 1.0:
            # An image without a varying opacity (most often: without an alpha channel) is a constant.
            return replace(surface, opacity=min(max(ends[0], 0.0), 1.0))
        return replace(surface, opacity_sampler=sampler)

    def _sampler(self, source: UsdShade.Shader, output: str, role: str) -> Sampler:
        asset = self._value(source.GetInput("file"))
        if not isinstance(asset, Sdf.AssetPath) or not asset.resolvedPath:
            raise TextureUnreadable("the texture is missing")
        wrap = tuple(WRAPS.get(self._text(source, name, "useMetadata"), "black") for name in ("wrapS", "wrapT"))
        space = self._text(source, "sourceColorSpace", "auto")
        channel = CHANNELS.get(output, 3)
        if role == "colour":
            index = self.textures.colour(asset.resolvedPath, asset.path, space, (wrap[0], wrap[1]))
        else:
            index = self.textures.opacity(asset.resolvedPath, asset.path, space, (wrap[0], wrap[1]), channel)
        uv, transform = self._coordinates(source)
        scale = vec4_of(self._value(source.GetInput("scale")), ONES)
        bias = vec4_of(self._value(source.GetInput("bias")), ZEROS)
        return Sampler(index, channel, scale, bias, uv, transform)

    def _coordinates(self, source: UsdShade.Shader) -> tuple[str, tuple[Vec3, Vec3]]:
        """Primvar name and the transform of all UsdTransform2d between it and the texture."""
        matrix = np.eye(3)
        node, _ = self._source(source.GetInput("st"))
        for _ in range(8):
            if node is None or node.GetShaderId() != "UsdTransform2d":
                break
            matrix = matrix @ self._transform2d(node)
            node, _ = self._source(node.GetInput("in"))
        if node is None or not _is_reader(node):
            if node is not None:
                self.log.add(f"{node.GetShaderId()} cannot give texture coordinates, st is used", node.GetPath())
            name = "st"
        else:
            name = self._text(node, "varname", "st")
        rows = [(float(row[0]), float(row[1]), float(row[2])) for row in matrix[:2]]
        return name, (rows[0], rows[1])

    def _transform2d(self, node: UsdShade.Shader) -> NDArray[np.float64]:
        """Scaled, then rotated, then translated; rotation counter-clockwise in degrees."""
        angle = np.radians(number_of(self._value(node.GetInput("rotation")), 0.0))
        scale = _floats(self._value(node.GetInput("scale")), 2) or [1.0, 1.0]
        move = _floats(self._value(node.GetInput("translation")), 2) or [0.0, 0.0]
        c, s = float(np.cos(angle)), float(np.sin(angle))
        return np.array([[c * scale[0], -s * scale[1], move[0]], [s * scale[0], c * scale[1], move[1]], [0, 0, 1]])

    def _emission(self, shade_input: UsdShade.Input) -> Vec3:
        source, _ = self._source(shade_input)
        if source is not None:
            self.log.add("emission from a texture or primvar is left out", source.GetPath())
            return (0.0, 0.0, 0.0)
        return colour_of(self._value(shade_input), (0.0, 0.0, 0.0))

    def _source(self, shade_input: UsdShade.Input) -> tuple[UsdShade.Shader | None, str]:
        """The shader and its output's name that an input gets its value from, through node graphs and interfaces."""
        if not shade_input:
            return None, ""
        for attribute in UsdShade.Utils.GetValueProducingAttributes(shade_input):
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim()), UsdShade.Output(attribute).GetBaseName()
        return None, ""

    def _value(self, shade_input: UsdShade.Input) -> Any:
        """The constant that an input has, through interfaces; None if there is none."""
        if not shade_input:
            return None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(shade_input):
            if not UsdShade.Output.IsOutput(attribute):
                return attribute.Get(self.time)
        return shade_input.Get(self.time)

    def _text(self, shader: UsdShade.Shader, name: str, default: str) -> str:
        return str(self._value(shader.GetInput(name)) or default)


def _is_reader(shader: UsdShade.Shader) -> bool:
    return str(shader.GetShaderId() or "").startswith("UsdPrimvarReader_")


def _floats(value: Any, size: int) -> list[float] | None:
    """A number or vector as `size` finite floats (a number is repeated); None if it is none."""
    try:
        array = np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        return None
    if array.size == 1:
        array = np.repeat(array, size)
    return [float(x) for x in array[:size]] if array.size >= size and np.isfinite(array).all() else None


def number_of(value: Any, default: float) -> float:
    """A finite number, else the default."""
    floats = _floats(value, 1)
    return floats[0] if floats else default


def colour_of(value: Any, default: Vec3) -> Vec3:
    """The first three finite numbers of a value, else the default."""
    floats = _floats(value, 3)
    return (floats[0], floats[1], floats[2]) if floats else default


def vec4_of(value: Any, default: Vec4) -> Vec4:
    """Four finite numbers, else the default."""
    floats = _floats(value, 4)
    return (floats[0], floats[1], floats[2], floats[3]) if floats else default
