"""Writing of glass to USD: glTF's materials that transmit light, as MaterialX has them (`gltf_pbr`).

UsdPreviewSurface has no transmission; as a `gltf_pbr` such a material keeps all that a glTF file says of it.
"""

from __future__ import annotations

from typing import Any, Final

from pxr import Gf, Sdf, Usd, UsdShade

from renderer.authoring import GlassLook, Image, Look
from schemas.scene import Wrap

Types = Sdf.ValueTypeNames

_ADDRESSES: Final[dict[Wrap, str]] = {
    "repeat": "periodic",
    "clamp": "clamp",
    "mirror": "mirror",
    "black": "constant",
}
_CUT_OUT, _BLEND = 1, 2
"""`alpha_mode` of gltf_pbr."""


def write_glass(stage: Usd.Stage, path: Sdf.Path, look: Look, glass: GlassLook) -> UsdShade.Material:
    """A MaterialX surface with its textures at a path.

    Args:
        stage: Where it is written.
        path: Of the material.
        look: Its colour and opacity.
        glass: How it transmits light.
    """
    made = UsdShade.Material.Define(stage, path)
    shader = _node(stage, path, "Surface", "ND_gltf_pbr_surfaceshader")
    made.CreateSurfaceOutput("mtlx").ConnectToSource(shader.CreateOutput("out", Types.Token))
    _base(stage, path, shader, look)
    weight = shader.CreateInput("transmission", Types.Float)
    if glass.image is None:
        weight.Set(glass.transmission)
    else:
        image = _image(stage, path, "Transmission", glass.image, "color3", "raw")
        red = _of(stage, path, "TransmissionRed", "ND_separate3_color3", "outr", Types.Float, image)
        scaled = _node(stage, path, "TransmissionFactor", "ND_multiply_float")
        scaled.CreateInput("in1", Types.Float).ConnectToSource(red)
        scaled.CreateInput("in2", Types.Float).Set(glass.transmission)
        weight.ConnectToSource(scaled.CreateOutput("out", Types.Float))
    shader.CreateInput("ior", Types.Float).Set(glass.ior)
    if glass.thickness > 0.0 and glass.distance > 0.0:
        shader.CreateInput("attenuation_color", Types.Color3f).Set(Gf.Vec3f(*glass.attenuation))
        shader.CreateInput("attenuation_distance", Types.Float).Set(glass.distance)
        shader.CreateInput("thickness", Types.Float).Set(glass.thickness)
    return made


def _base(stage: Usd.Stage, path: Sdf.Path, shader: UsdShade.Shader, look: Look) -> None:
    """Base colour, and opacity as far as it counts."""
    colour = shader.CreateInput("base_color", Types.Color3f)
    alpha: UsdShade.Output | None = None
    if look.image is None:
        colour.Set(Gf.Vec3f(*look.base[:3]))
    else:
        image = _image(stage, path, "BaseColour", look.image, "color4", "srgb_texture")
        scaled = _node(stage, path, "BaseFactor", "ND_multiply_color4")
        scaled.CreateInput("in1", Types.Color4f).ConnectToSource(image)
        scaled.CreateInput("in2", Types.Color4f).Set(Gf.Vec4f(*look.base))
        product = scaled.CreateOutput("out", Types.Color4f)
        colour.ConnectToSource(_of(stage, path, "BaseRgb", "ND_convert_color4_color3", "out", Types.Color3f, product))
        alpha = _of(stage, path, "BaseAlpha", "ND_separate4_color4", "outa", Types.Float, product)
    if look.is_opaque:
        return
    opacity = shader.CreateInput("alpha", Types.Float)
    if alpha is None:
        opacity.Set(look.base[3])
    else:
        opacity.ConnectToSource(alpha)
    shader.CreateInput("alpha_mode", Types.Int).Set(_BLEND if look.cutoff is None else _CUT_OUT)
    if look.cutoff is not None:
        shader.CreateInput("alpha_cutoff", Types.Float).Set(look.cutoff)


def _node(stage: Usd.Stage, path: Sdf.Path, name: str, kind: str) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path.AppendChild(name))
    shader.CreateIdAttr(kind)
    return shader


def _of(
    stage: Usd.Stage, path: Sdf.Path, name: str, kind: str, output: str, of: Sdf.ValueTypeName, source: UsdShade.Output
) -> UsdShade.Output:
    """An output of a node with one input."""
    node = _node(stage, path, name, kind)
    node.CreateInput("in", source.GetTypeName()).ConnectToSource(source)
    return node.CreateOutput(output, of)


def _image(stage: Usd.Stage, path: Sdf.Path, name: str, image: Image, kind: str, space: str) -> UsdShade.Output:
    """What an image gives, with its coordinates beside it."""
    node = _node(stage, path, name, f"ND_image_{kind}")
    file = node.CreateInput("file", Types.Asset)
    file.Set(image.file)
    file.GetAttr().SetColorSpace(space)
    for axis, wrap in zip("uv", image.wrap, strict=True):
        node.CreateInput(f"{axis}addressmode", Types.String).Set(_ADDRESSES[wrap])
    coordinates = _node(stage, path, f"{name}Coordinates", "ND_geompropvalue_vector2")
    coordinates.CreateInput("geomprop", Types.String).Set(image.primvar)
    node.CreateInput("texcoord", Types.Float2).ConnectToSource(coordinates.CreateOutput("out", Types.Float2))
    out: Any = Types.Color4f if kind == "color4" else Types.Color3f
    return node.CreateOutput("out", out)
