"""Binary glTF (.glb) to USD: geometry, transforms, base colour and opacity, which is all that is rendered.

The same file makes the same bytes, whenever and wherever it is converted.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from renderer.gate.gltf import GlbContent, Object, damaged, floats, read_glb, walk_nodes
from renderer.gate.images import PNG

VERSION = "1"
"""Changes whenever the same file is converted to something else."""
TRIANGLES, STRIP, FAN = 4, 5, 6
WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}


def stage_file(folder: Path, root: str, cache: Path) -> Path:
    """The USD file to open for a scene.

    Args:
        folder: Holds the scene's files.
        root: Relative name of the one that is the scene.
        cache: Where a conversion is kept, by content; only used for a .glb.

    Returns:
        The root itself, or what it was converted to.

    Raises:
        Problem: The .glb is damaged or needs what is not supported.
    """
    source = folder / root
    if source.suffix.lower() != ".glb":
        return source
    with source.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256")
    digest.update(f"convert {VERSION}".encode())
    home = cache / f"glb-{digest.hexdigest()[:32]}"
    stage = home / f"{source.stem}.usdc"
    if not stage.exists():
        cache.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix="glb-", dir=cache))
        try:
            _Converter(read_glb(source, root), work).convert(work / stage.name)
            # Whoever else converted the same file made the same bytes.
            work.rename(home)
        except OSError:
            if not stage.exists():
                raise
        finally:
            shutil.rmtree(work, ignore_errors=True)
    return stage


class _Converter:
    def __init__(self, content: GlbContent, folder: Path) -> None:
        self._content = content
        self._folder = folder
        self._stage = Usd.Stage.CreateInMemory()
        self._materials: dict[int | None, UsdShade.Material] = {}
        self._meshes: dict[int, Sdf.Path] = {}

    def convert(self, file: Path) -> None:
        """Writes the stage, and its images beside it."""
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        self._stage.SetDefaultPrim(UsdGeom.Xform.Define(self._stage, "/World").GetPrim())
        for number, (node, matrix) in enumerate(walk_nodes(self._content)):
            if "mesh" in node:
                xform = UsdGeom.Xform.Define(self._stage, f"/World/Node{number}")
                # USD's matrices act on rows.
                xform.AddTransformOp().Set(Gf.Matrix4d(*matrix.T.ravel().tolist()))
                xform.GetPrim().GetReferences().AddInternalReference(self._mesh(node["mesh"]))
                xform.GetPrim().SetInstanceable(True)
        self._stage.GetRootLayer().Export(str(file))

    def _mesh(self, index: int) -> Sdf.Path:
        """Where a mesh is written, once for all nodes that show it."""
        if index not in self._meshes:
            home = self._stage.CreateClassPrim(f"/Meshes/Mesh{index}").GetPath()
            for number, primitive in enumerate(self._content.pick("meshes", index)["primitives"]):
                if primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN):
                    self._primitive(home.AppendChild(f"Part{number}"), primitive)
            self._meshes[index] = home
        return self._meshes[index]

    def _primitive(self, path: Sdf.Path, primitive: Object) -> None:
        content, attributes = self._content, primitive["attributes"]
        points = content.array(attributes["POSITION"])
        if "indices" in primitive:
            indices = content.array(primitive["indices"])[:, 0].astype(np.int32)
        else:
            indices = np.arange(len(points), dtype=np.int32)
        faces = _triangles(indices, primitive.get("mode", TRIANGLES))
        mesh = UsdGeom.Mesh.Define(self._stage, path)
        mesh.CreatePointsAttr(_vectors(points, Vt.Vec3fArray))
        mesh.CreateExtentAttr(_vectors(np.stack((points.min(axis=0), points.max(axis=0))), Vt.Vec3fArray))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces).ravel()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        if "NORMAL" in attributes:
            mesh.CreateNormalsAttr(_vectors(self._unit(attributes["NORMAL"], 3), Vt.Vec3fArray))
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        self._primvars(UsdGeom.PrimvarsAPI(mesh), attributes)
        index = primitive.get("material")
        material = {} if index is None else content.pick("materials", index)
        mesh.CreateDoubleSidedAttr(bool(material.get("doubleSided", False)))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._material(index, material))

    def _primvars(self, api: UsdGeom.PrimvarsAPI, attributes: Object) -> None:
        for number in (0, 1):
            if f"TEXCOORD_{number}" in attributes:
                uv = self._unit(attributes[f"TEXCOORD_{number}"], 2)
                uv = np.column_stack((uv[:, 0], 1.0 - uv[:, 1]))  # glTF's v goes down
                primvar = api.CreatePrimvar(f"st{number or ''}", Sdf.ValueTypeNames.TexCoord2fArray)
                primvar.SetInterpolation(UsdGeom.Tokens.vertex)
                primvar.Set(_vectors(uv, Vt.Vec2fArray))

    def _unit(self, index: Any, width: int) -> NDArray[np.float64]:
        """An accessor's values, normalised where they are integers."""
        array = self._content.array(index)
        if array.shape[1] < width:
            raise damaged(self._content.name)
        values = array[:, :width].astype(np.float64)
        if array.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(array.dtype).max, -1.0)
        return values

    def _material(self, index: int | None, material: Object) -> UsdShade.Material:
        if index in self._materials:
            return self._materials[index]
        name = "Default" if index is None else f"Material{index}"
        made = UsdShade.Material.Define(self._stage, f"/World/Looks/{name}")
        shader = UsdShade.Shader.Define(self._stage, made.GetPath().AppendChild("Surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        made.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
        metal = material.get("pbrMetallicRoughness", {})
        if not isinstance(metal, dict):
            raise damaged(self._content.name)
        factor = floats(self._content.name, metal.get("baseColorFactor", (1, 1, 1, 1)), 4).clip(0.0, 1.0)
        mode = material.get("alphaMode", "OPAQUE")
        colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        opacity = shader.CreateInput("opacity", Sdf.ValueTypeNames.Float)
        texture = metal.get("baseColorTexture")
        if texture is None:
            colour.Set(Gf.Vec3f(*factor[:3].tolist()))
            opacity.Set(1.0 if mode == "OPAQUE" else float(factor[3]))
        else:
            reader = self._texture(made.GetPath(), texture, factor)
            colour.ConnectToSource(reader.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
            if mode == "OPAQUE":
                opacity.Set(1.0)
            else:
                opacity.ConnectToSource(reader.CreateOutput("a", Sdf.ValueTypeNames.Float))
        if mode == "MASK":
            cutoff = floats(self._content.name, [material.get("alphaCutoff", 0.5)], 1)[0]
            shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(float(cutoff))
        self._materials[index] = made
        return made

    def _texture(self, home: Sdf.Path, reference: Any, factor: NDArray[np.float64]) -> UsdShade.Shader:
        """The reader of a base colour texture, with its coordinates."""
        if not isinstance(reference, dict):
            raise damaged(self._content.name)
        texture = self._content.pick("textures", reference.get("index"))
        reader = UsdShade.Shader.Define(self._stage, home.AppendChild("BaseColour"))
        reader.CreateIdAttr("UsdUVTexture")
        reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(self._image(texture.get("source")))
        reader.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        reader.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*factor.tolist()))
        sampler = self._content.pick("samplers", texture["sampler"]) if "sampler" in texture else {}
        for side in ("S", "T"):
            wrap = WRAPS.get(sampler.get(f"wrap{side}", 10497), "repeat")
            reader.CreateInput(f"wrap{side}", Sdf.ValueTypeNames.Token).Set(wrap)
        coordinates = UsdShade.Shader.Define(self._stage, home.AppendChild("Coordinates"))
        coordinates.CreateIdAttr("UsdPrimvarReader_float2")
        name = "st1" if reference.get("texCoord", 0) == 1 else "st"
        coordinates.CreateInput("varname", Sdf.ValueTypeNames.String).Set(name)
        output = coordinates.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(output)
        return reader

    def _image(self, index: Any) -> str:
        """Writes an image as it is, and how the stage names it."""
        data = self._content.image(index)
        name = f"image{index}.png" if data.startswith(PNG) else f"image{index}.jpg"
        (self._folder / name).write_bytes(data)
        return f"./{name}"


def _triangles(indices: NDArray[np.int32], mode: int) -> NDArray[np.int32]:
    """Corners [T, 3] of a list, strip or fan."""
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if len(indices) < 3:
        return np.empty((0, 3), dtype=np.int32)
    if mode == FAN:
        return np.column_stack((np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:])).astype(np.int32)
    strip = np.column_stack((indices[:-2], indices[1:-1], indices[2:]))
    strip[1::2] = strip[1::2, ::-1]
    return strip


def _vectors(values: NDArray[Any], kind: Any) -> Any:
    return kind.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))
