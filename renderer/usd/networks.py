"""Shading networks as drivers: what nodes of UsdPreviewSurface and MaterialX give an input.

A driver is one texture or primvar, times a factor plus an offset; what does not reduce to that is named in a warning.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from renderer.usd.coordinates import place2d, tiling, transform2d
from renderer.usd.drivers import (
    ONES,
    ZEROS,
    Driver,
    Sampler,
    Vec3,
    Vec4,
    constant,
    floats_of,
    number_of,
    product,
    total,
    vec4_of,
)
from renderer.usd.stage import WarningLog
from renderer.usd.textures import ImageFile, TextureTable, TextureUnreadable
from renderer.usd.udim import is_udim, tiles_of, to_atlas
from schemas.scene import Wrap

DEPTH = 32
"""Nodes between a surface and its texture."""

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}
WRAPS: dict[str, Wrap] = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black"}
"""`useMetadata` is black where a file says nothing, and the wrap metadata of files is not read."""
ADDRESSES: dict[str, Wrap] = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black"}
"""MaterialX names of wrap modes."""
COLOUR_SPACES = {
    "": "auto",
    "srgb_texture": "sRGB",
    "srgb_rec709_scene": "sRGB",
    "sRGB": "sRGB",
    "lin_rec709": "raw",
    "lin_rec709_scene": "raw",
    "linear": "raw",
    "raw": "raw",
    "none": "raw",
    "data": "raw",
}
"""MaterialX and OpenUSD names of colour spaces as `sourceColorSpace`."""

_TYPES = "surfaceshader|color[34]|float|integer|boolean|vector[234]|string|filename|matrix[34]3?"


def category_of(shader: UsdShade.Shader) -> str:
    """The kind of a node: its id, without the prefix and the types of a MaterialX definition."""
    name = str(shader.GetShaderId() or "")
    if not name.startswith("ND_"):
        return "UsdPrimvarReader" if name.startswith("UsdPrimvarReader_") else name
    name = re.sub(r"(_\d+)+$", "", name[3:])
    return re.sub(rf"(_(?:{_TYPES})(?:FA|[A-Z]*))+$", "", name)


@dataclass
class Network:
    """Follows connections at one time.

    Attributes:
        time: The time to read at.
        textures: Gets the images.
        log: Gets a line for everything that is not supported.
    """

    time: Usd.TimeCode
    textures: TextureTable
    log: WarningLog

    def drive(self, shade_input: UsdShade.Input, default: Vec4, depth: int = 0) -> Driver:
        """What drives an input; the default where nothing does or what does is not supported (then with a warning)."""
        node, output = self.source(shade_input)
        if node is None:
            return constant(vec4_of(self.value(shade_input), default))
        found = self._driver(node, output, default, depth) if depth < DEPTH else None
        if found is None:
            kind = node.GetShaderId() or "a shader without an id"
            self.log.add(f"{kind} cannot drive {shade_input.GetBaseName()}, a constant is used", node.GetPath())
            return constant(default)
        return found

    def source(self, shade_input: UsdShade.Input) -> tuple[UsdShade.Shader | None, str]:
        """The shader and its output's name that an input gets its value from, through node graphs and interfaces."""
        if not shade_input:
            return None, ""
        for attribute in UsdShade.Utils.GetValueProducingAttributes(shade_input):
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim()), UsdShade.Output(attribute).GetBaseName()
        for gone in shade_input.GetConnectedSources()[1]:
            self.log.add(f"{shade_input.GetBaseName()} is connected to what does not exist", gone)
        return None, ""

    def value(self, shade_input: UsdShade.Input) -> Any:
        """The constant that an input has, through interfaces; None if there is none."""
        attribute = self._value_attribute(shade_input)
        return attribute.Get(self.time) if attribute else None

    def text(self, shader: UsdShade.Shader, name: str, default: str) -> str:
        """A string or token input."""
        value = self.value(shader.GetInput(name))
        return str(value) if value not in (None, "") else default

    def number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """A number that does not vary over the surface; the default, with a warning, where a node gives it."""
        node, _ = self.source(shader.GetInput(name))
        if node is not None:
            self.log.add(f"{node.GetShaderId()} cannot drive {name}, a constant is used", node.GetPath())
            return default
        return number_of(self.value(shader.GetInput(name)), default)

    def _value_attribute(self, shade_input: UsdShade.Input) -> Usd.Attribute | None:
        if not shade_input:
            return None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(shade_input):
            if not UsdShade.Output.IsOutput(attribute):
                return attribute
        return shade_input.GetAttr()

    def _driver(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver | None:
        """What an output of a node gives."""
        reader = _NODES.get(category_of(node))
        return reader(self, node, output, default, depth + 1) if reader else None

    def _uv_texture(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver:
        wrap = [WRAPS.get(self.text(node, name, "useMetadata"), "black") for name in ("wrapS", "wrapT")]
        space = self.text(node, "sourceColorSpace", "auto")
        sampler = self._sampler(node, space, (wrap[0], wrap[1]), "st")
        if sampler is None:
            given = node.GetInput("fallback")
            found = self.drive(given, default, depth) if given else constant(default)
        else:
            scale = vec4_of(self.value(node.GetInput("scale")), ONES)
            bias = vec4_of(self.value(node.GetInput("bias")), ZEROS)
            found = Driver(sampler=sampler, scale=scale, bias=bias)
        return _picked(found, output)

    def _image(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver:
        """MaterialX `image` and `tiledimage` (MaterialX specification 1.39, Standard Source Nodes)."""
        wrap = [ADDRESSES.get(self.text(node, f"{axis}addressmode", "periodic"), "repeat") for axis in "uv"]
        attribute = self._value_attribute(node.GetInput("file"))
        named = str(attribute.GetColorSpace()) if attribute and attribute.HasColorSpace() else ""
        if named not in COLOUR_SPACES:
            self.log.add(f"colour space {named} is not known, linear is used", node.GetPath())
        sampler = self._sampler(node, COLOUR_SPACES.get(named, "raw"), (wrap[0], wrap[1]), "texcoord")
        if sampler is None:
            return constant(vec4_of(self.value(node.GetInput("default")), default))
        single = re.search(r"_float(_\d+)*$", str(node.GetShaderId())) is not None
        found = Driver(sampler=sampler)
        return found.only(0) if single else _picked(found, output)

    def _sampler(self, node: UsdShade.Shader, space: str, wrap: tuple[Wrap, Wrap], coordinates: str) -> Sampler | None:
        """The sampler of a texture node; None, with a warning, where the image cannot be read."""
        attribute = self._value_attribute(node.GetInput("file"))
        asset = attribute.Get(self.time) if attribute else None
        name = getattr(asset, "path", "") or "no file"
        # In a converted document names are absolute, which helps nobody.
        name = PurePosixPath(name).name if name.startswith("/") else name
        try:
            if not isinstance(asset, Sdf.AssetPath):
                raise TextureUnreadable("the texture is missing")
            tiles = tiles_of(asset.path, attribute, self.time) if is_udim(asset.path) else ()
            file = ImageFile(asset.path if tiles else asset.resolvedPath, name, space, tiles)
            image = self.textures.load(file)
        except TextureUnreadable as error:
            self.log.add(f"{error} ({name}), its fallback is used", node.GetPath())
            return None
        uv, transform, missing = self._coordinates(node, coordinates)
        if coordinates == "st" and self.source(node.GetInput("st"))[0] is None:
            self.log.add("its texture coordinates are not connected, st or else one texel is used", node.GetPath())
            missing = _texel_at(floats_of(self.value(node.GetInput("st")), 2) or [0.0, 0.0], image.pixels.shape)
        if tiles:
            return Sampler(file, ("black", "black"), uv, to_atlas(transform, image.grid), missing)
        return Sampler(file, wrap, uv, transform, missing)

    def _coordinates(
        self, texture: UsdShade.Shader, name: str
    ) -> tuple[str, tuple[Vec3, Vec3], tuple[float, float] | None]:
        """Primvar of the texture coordinates, what is done to them, and what they are where it is missing."""
        matrix = np.eye(3)
        if category_of(texture) == "tiledimage":
            inputs = (("uvtiling", 1.0), ("uvoffset", 0.0), ("realworldtilesize", 1.0), ("realworldimagesize", 1.0))
            matrix = tiling(*(self._pair(texture, *given) for given in inputs))
        node, _ = self.source(texture.GetInput(name))
        for _ in range(DEPTH):
            kind = category_of(node) if node is not None else ""
            if node is not None and kind == "UsdTransform2d":
                scale, move = self._pair(node, "scale", 1.0), self._pair(node, "translation", 0.0)
                matrix = matrix @ transform2d(scale, self.number(node, "rotation", 0.0), move)
                node, _ = self.source(node.GetInput("in"))
            elif node is not None and kind == "place2d":
                pivot, scale = self._pair(node, "pivot", 0.0), self._pair(node, "scale", 1.0)
                turn, order = self.number(node, "rotate", 0.0), self.number(node, "operationorder", 0.0)
                matrix = matrix @ place2d(pivot, scale, turn, self._pair(node, "offset", 0.0), order >= 1.0)
                node, _ = self.source(node.GetInput("texcoord"))
            else:
                break
        rows = [(float(row[0]), float(row[1]), float(row[2])) for row in matrix[:2]]
        uv, missing = self._primvar_of(node)
        return uv, (rows[0], rows[1]), missing

    def _pair(self, node: UsdShade.Shader, name: str, default: float) -> list[float]:
        return floats_of(self.value(node.GetInput(name)), 2) or [default, default]

    def _primvar_of(self, node: UsdShade.Shader | None) -> tuple[str, tuple[float, float] | None]:
        kind = category_of(node) if node is not None else ""
        if node is None or kind == "texcoord":
            return "st", None
        if kind in _PRIMVAR_INPUTS:
            name, fallback = _PRIMVAR_INPUTS[kind]
            given = self.value(node.GetInput(fallback))
            pair = floats_of(given, 2)
            return self.text(node, name, "st"), (pair[0], pair[1]) if pair else None
        self.log.add(f"{node.GetShaderId()} cannot give texture coordinates, st is used", node.GetPath())
        return "st", None

    def _primvar(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver | None:
        name, fallback = _PRIMVAR_INPUTS[category_of(node)]
        varname = self.text(node, name, "")
        missing = vec4_of(self.value(node.GetInput(fallback)), default)
        return Driver(primvar=varname, missing=missing) if varname else constant(missing)

    def _vertex_colour(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver:
        return Driver(primvar="displayColor", missing=default)

    def _pass(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver:
        name = "value" if category_of(node) == "constant" else "in"
        return self.drive(node.GetInput(name), default, depth)

    def _channel(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver | None:
        """`extract`, `separate` and the one-channel kind of `swizzle`."""
        found = self.drive(node.GetInput("in"), default, depth)
        kind = category_of(node)
        if kind == "extract":
            return found.only(min(max(int(number_of(self.value(node.GetInput("index")), 0.0)), 0), 3))
        letters = self.text(node, "channels", "r") if kind == "swizzle" else output.removeprefix("out")
        if letters in ("rgb", "rgba", "xyz", "xyzw"):
            return found
        return found.only(CHANNELS[letters[0]]) if len(set(letters)) == 1 and letters[0] in CHANNELS else None

    def _operation(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver | None:
        """`multiply`, `add`, `subtract`: at most one of both sides may vary."""
        kind = category_of(node)
        neutral = ONES if kind == "multiply" else ZEROS
        a = self.drive(node.GetInput("in1"), ZEROS, depth)
        b = self.drive(node.GetInput("in2"), neutral, depth)
        if kind == "multiply":
            return product(a, b)
        return total(a, b if kind == "add" else b.times((-1.0, -1.0, -1.0, -1.0)))

    def _invert(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver:
        amount = vec4_of(self.value(node.GetInput("amount")), ONES)
        return self.drive(node.GetInput("in"), ZEROS, depth).times((-1.0, -1.0, -1.0, -1.0)).plus(amount)

    def _mix(self, node: UsdShade.Shader, output: str, default: Vec4, depth: int) -> Driver | None:
        """`mix`: bg (1 - mix) + fg mix."""
        mix = self.drive(node.GetInput("mix"), ZEROS, depth)
        front = self.drive(node.GetInput("fg"), ZEROS, depth)
        back = self.drive(node.GetInput("bg"), ZEROS, depth)
        left, right = product(front, mix), product(back, mix.times((-1.0, -1.0, -1.0, -1.0)).plus(ONES))
        return total(left, right) if left is not None and right is not None else None


def _texel_at(st: list[float], shape: tuple[int, ...]) -> tuple[float, float]:
    """The centre of the texel at texture coordinates, so that a point on the edge is not mixed with what is outside."""
    centres = [
        (min(max(np.floor(x * size), 0.0), size - 1.0) + 0.5) / size if 0.0 <= x <= 1.0 else x
        for x, size in zip(st, (shape[1], shape[0]), strict=True)
    ]
    return float(centres[0]), float(centres[1])


def _picked(driver: Driver, output: str) -> Driver:
    """The output r, g, b or a of a texture node; any other output is all of it."""
    return driver.only(CHANNELS[output]) if output in ("r", "g", "b", "a") else driver


_PRIMVAR_INPUTS = {"UsdPrimvarReader": ("varname", "fallback"), "geompropvalue": ("geomprop", "default")}
"""Inputs with the name and the fallback, by node category."""

_Reader = Callable[[Network, UsdShade.Shader, str, Vec4, int], Driver | None]
_NODES: dict[str, _Reader] = {
    "UsdUVTexture": Network._uv_texture,
    "UsdPrimvarReader": Network._primvar,
    "geompropvalue": Network._primvar,
    "geomcolor": Network._vertex_colour,
    "image": Network._image,
    "tiledimage": Network._image,
    "constant": Network._pass,
    "dot": Network._pass,
    "convert": Network._pass,
    "extract": Network._channel,
    "swizzle": Network._channel,
    "separate2": Network._channel,
    "separate3": Network._channel,
    "separate4": Network._channel,
    "multiply": Network._operation,
    "add": Network._operation,
    "subtract": Network._operation,
    "invert": Network._invert,
    "mix": Network._mix,
}
