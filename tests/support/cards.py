"""Stages of one textured card, authored through USD's own API, for tests of materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from renderer.scene import LoadOptions, load_scene
from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.scene import SceneArrays

Types = Sdf.ValueTypeNames


class Card:
    """A unit square of one face, its points counter-clockwise from the lower left, bound to a preview surface.

    Args:
        folder: Where the stage and its images are written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stage = Usd.Stage.CreateInMemory()
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)
        self.mesh = self.square("/Card")
        self.material = UsdShade.Material.Define(self.stage, "/Looks/M")
        self.surface = self.shader("S", "UsdPreviewSurface")
        self.material.CreateSurfaceOutput().ConnectToSource(self.surface.ConnectableAPI(), "surface")
        bind(self.mesh, self.material)

    def square(self, path: str, depth: float = 0.0) -> UsdGeom.Mesh:
        """Another square, with texture coordinates `st` that are its points."""
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        points = [(0, 0, depth), (1, 0, depth), (1, 1, depth), (0, 1, depth)]
        mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in points])
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        mesh.CreateSubdivisionSchemeAttr("none")
        self.primvar(mesh, "st", Types.TexCoord2fArray, [p[:2] for p in points], "vertex")
        return mesh

    def primvar(self, mesh: UsdGeom.Mesh, name: str, kind: Sdf.ValueTypeName, values: object, where: str) -> None:
        """Authors a primvar."""
        UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, kind, where).Set(values)

    def shader(self, name: str, kind: str, **inputs: object) -> UsdShade.Shader:
        """A shader of the material; an input that is an output is connected, any other is a value."""
        shader = UsdShade.Shader.Define(self.stage, f"/Looks/M/{name}")
        shader.CreateIdAttr(kind)
        for key, value in inputs.items():
            put(shader, key, value)
        return shader

    def texture(self, name: str, file: str, connected: bool = True, **inputs: object) -> UsdShade.Shader:
        """A UsdUVTexture of a file beside the stage; its coordinates are the primvar `st`."""
        texture = self.shader(name, "UsdUVTexture", file=Sdf.AssetPath(file), **inputs)
        if connected:
            reader = self.shader("St", "UsdPrimvarReader_float2", varname="st")
            put(texture, "st", reader.CreateOutput("result", Types.Float2))
        return texture

    def load(self, alpha: float | None = None, glass: GlassReading = DEFAULT_GLASS) -> SceneArrays:
        """The stage, written and read."""
        file = self.folder / "card.usda"
        self.stage.GetRootLayer().Export(str(file))
        return load_scene(file, LoadOptions(alpha=alpha, glass=glass))


def put(shader: UsdShade.Shader, key: str, value: object) -> None:
    """Sets or connects an input."""
    made = shader.CreateInput(key, _kind(value))
    if isinstance(value, (UsdShade.Output, UsdShade.Input)):
        made.ConnectToSource(value)
    else:
        made.Set(value)


def out(shader: UsdShade.Shader, name: str) -> UsdShade.Output:
    """An output: `rgb` and `out` are colours, all others numbers."""
    return shader.CreateOutput(name, Types.Color3f if name in ("rgb", "out") else Types.Float)


def bind(mesh: UsdGeom.Mesh, material: UsdShade.Material) -> UsdShade.MaterialBindingAPI:
    """Binds a prim directly, for all purposes."""
    api = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
    api.Bind(material)
    return api


def save(path: Path, pixels: object, mode: str = "RGBA") -> None:
    """Writes rows of pixels, the first row at the top, as an image of a Pillow mode."""
    array = np.array(pixels, dtype=np.uint8)
    Image.fromarray(array, "RGBA" if array.shape[-1] == 4 else "RGB").convert(mode).save(path)


def _kind(value: object) -> Sdf.ValueTypeName:
    if isinstance(value, (UsdShade.Output, UsdShade.Input)):
        return value.GetTypeName()
    if isinstance(value, Sdf.AssetPath):
        return Types.Asset
    if isinstance(value, str):
        return Types.Token
    if isinstance(value, (tuple, list)):
        return {2: Types.Float2, 3: Types.Color3f, 4: Types.Float4}[len(value)]
    return Types.Int if isinstance(value, int) else Types.Float
