"""Writing of USD: triangle meshes and UsdPreviewSurface materials, for whatever is converted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from schemas.scene import Wrap

RGBA = tuple[float, float, float, float]

COORDINATES = "st"
"""Primvar of the first texture coordinates."""


@dataclass(frozen=True, slots=True)
class Image:
    """An image and how it is sampled.

    Attributes:
        file: Asset path.
        wrap: How s and t outside [0,1] are mapped.
        primvar: Name of the texture coordinates.
    """

    file: str
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    primvar: str = COORDINATES


@dataclass(frozen=True, slots=True)
class GlassLook:
    """How a material transmits light, as glTF says it.

    Attributes:
        transmission: How much of the light that is not reflected; the factor of the image's red where there is one.
        image: Image of the transmission.
        ior: Index of refraction.
        attenuation: Linear RGB that white light becomes on its way through the volume.
        distance: Length of that way, metres; 0: the volume takes nothing.
        thickness: Of the volume beneath the surface, in the mesh's units; 0: it is a sheet.
    """

    transmission: float
    image: Image | None = None
    ior: float = 1.5
    attenuation: tuple[float, float, float] = (1.0, 1.0, 1.0)
    distance: float = 0.0
    thickness: float = 0.0


@dataclass(frozen=True, slots=True)
class Look:
    """What is written of a material.

    Attributes:
        base: Linear RGB and opacity; factors of the images' where there are some.
        image: sRGB-encoded colour.
        mask: Image of the opacity, and its channel `r` or `a`.
        is_image_alpha: Whether the colour image's alpha is the opacity, where there is no mask.
        is_opaque: Whether no opacity counts.
        cutoff: Opacity below which nothing is there, and above which the surface is opaque; None: it is blended.
    """

    base: RGBA = (1.0, 1.0, 1.0, 1.0)
    image: Image | None = None
    mask: tuple[Image, str] | None = None
    is_image_alpha: bool = True
    is_opaque: bool = False
    cutoff: float | None = None


def write_material(stage: Usd.Stage, path: Sdf.Path, look: Look) -> UsdShade.Material:
    """A UsdPreviewSurface with its textures at a path."""
    made = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, path.AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    made.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    opacity = shader.CreateInput("opacity", Sdf.ValueTypeNames.Float)
    alpha: UsdShade.Output | None = None
    if look.image is None:
        colour.Set(Gf.Vec3f(*look.base[:3]))
    else:
        reader = _reader(stage, path.AppendChild("BaseColour"), look.image, look.base, "sRGB")
        colour.ConnectToSource(reader.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
        if look.is_image_alpha and not look.is_opaque and look.mask is None:
            alpha = reader.CreateOutput("a", Sdf.ValueTypeNames.Float)
    if look.mask is not None and not look.is_opaque:
        image, channel = look.mask
        reader = _reader(stage, path.AppendChild("Opacity"), image, (look.base[3],) * 4, "raw")
        alpha = reader.CreateOutput(channel, Sdf.ValueTypeNames.Float)
    if alpha is not None:
        opacity.ConnectToSource(alpha)
    else:
        opacity.Set(1.0 if look.is_opaque else look.base[3])
    if look.cutoff is not None:
        shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(look.cutoff)
    return made


def _reader(stage: Usd.Stage, path: Sdf.Path, image: Image, scale: RGBA, space: str) -> UsdShade.Shader:
    """The reader of an image, with its coordinates beside it."""
    reader = UsdShade.Shader.Define(stage, path)
    reader.CreateIdAttr("UsdUVTexture")
    reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(image.file)
    reader.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
    reader.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*scale))
    for side, wrap in zip("ST", image.wrap, strict=True):
        reader.CreateInput(f"wrap{side}", Sdf.ValueTypeNames.Token).Set(wrap)
    coordinates = UsdShade.Shader.Define(stage, path.GetParentPath().AppendChild("Coordinates"))
    coordinates.CreateIdAttr("UsdPrimvarReader_float2")
    coordinates.CreateInput("varname", Sdf.ValueTypeNames.String).Set(image.primvar)
    output = coordinates.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(output)
    return reader


@dataclass(frozen=True, slots=True)
class Geometry:
    """Triangles as they are written.

    Attributes:
        points: [V, 3].
        faces: Corners [T, 3], counter-clockwise seen from outside.
        normals: Unit, [V, 3], or None.
        coordinates: Primvar -> [V, 2], v upwards.
        is_double_sided: Whether the material shows both sides.
    """

    points: NDArray[Any]
    faces: NDArray[np.integer]
    normals: NDArray[Any] | None
    coordinates: Mapping[str, NDArray[Any]]
    is_double_sided: bool = False


def write_mesh(stage: Usd.Stage, path: Sdf.Path, geometry: Geometry) -> UsdGeom.Mesh:
    """A mesh of triangles that is not subdivided."""
    points = geometry.points
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(vectors(points, Vt.Vec3fArray))
    mesh.CreateExtentAttr(vectors(np.stack((points.min(axis=0), points.max(axis=0))), Vt.Vec3fArray))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(geometry.faces), 3, dtype=np.int32)))
    corners = np.ascontiguousarray(geometry.faces, dtype=np.int32).ravel()
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if geometry.normals is not None:
        mesh.CreateNormalsAttr(vectors(geometry.normals, Vt.Vec3fArray))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    api = UsdGeom.PrimvarsAPI(mesh)
    for name, values in geometry.coordinates.items():
        primvar = api.CreatePrimvar(name, Sdf.ValueTypeNames.TexCoord2fArray)
        primvar.SetInterpolation(UsdGeom.Tokens.vertex)
        primvar.Set(vectors(values, Vt.Vec2fArray))
    mesh.CreateDoubleSidedAttr(geometry.is_double_sided)
    return mesh


def vectors(values: NDArray[Any], kind: Any) -> Any:
    """Rows of numbers as an array of USD's vectors of floats.

    Args:
        values: [rows, width], the numbers; stored as float32.
        kind: Array type of USD, such as `Vt.Vec3fArray`, whose vectors have that width.
    """
    return kind.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))
