"""Binary glTF (.glb) to USD: geometry, transforms, base colour, opacity and glass, which is all that is rendered.

The same file makes the same bytes, whenever and wherever it is converted. This is the way of files that somebody else
uploaded: what is read of them has passed `renderer.gate`, byte by byte, and no library parses them. Files of one's own,
of any format that trimesh reads, go through `renderer.convert_meshes`.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from renderer.authoring import COORDINATES, Geometry, GlassLook, Image, Look, write_material, write_mesh
from renderer.authoring_glass import write_glass
from renderer.gate.gltf import GlbContent, Object, damaged, floats, read_glb, walk_nodes
from renderer.gate.images import PNG
from renderer.gltf_materials import glass_of, left_out
from renderer.usd.left_out import write_left_out
from renderer.usd.licence import write_licence
from schemas.scene import Wrap

VERSION = "4"
"""Changes whenever the same file is converted to something else."""
TRIANGLES, STRIP, FAN = 4, 5, 6
WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}


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


def _write_node(world: Sdf.PrimSpec, name: str, matrix: NDArray[np.float64], mesh: Sdf.Path) -> None:
    """A place of a mesh; the matrix [4, 4] acts on columns, USD's on rows."""
    node = Sdf.PrimSpec(world, name, Sdf.SpecifierDef, "Xform")
    transform = Sdf.AttributeSpec(node, "xformOp:transform", Sdf.ValueTypeNames.Matrix4d)
    transform.default = Gf.Matrix4d(*matrix.T.ravel().tolist())
    order = Sdf.AttributeSpec(node, UsdGeom.Tokens.xformOpOrder, Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    order.default = ["xformOp:transform"]
    node.referenceList.Prepend(Sdf.Reference("", mesh))
    node.instanceable = True


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
        nodes = enumerate(walk_nodes(self._content))
        placed = [(number, matrix, self._mesh(node["mesh"])) for number, (node, matrix) in nodes if "mesh" in node]
        # On a stage every node would be composed as it is written, each time with all that came before it.
        layer = Sdf.Layer.CreateAnonymous(".usdc")
        layer.TransferContent(self._stage.GetRootLayer())
        write_licence(layer, self._content.document.get("asset"))
        write_left_out(layer, left_out(self._content.document))
        with Sdf.ChangeBlock():
            for number, matrix, mesh in placed:
                _write_node(layer.GetPrimAtPath("/World"), f"Node{number}", matrix, mesh)
        layer.Export(str(file))

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
        index = primitive.get("material")
        material = {} if index is None else content.pick("materials", index)
        geometry = Geometry(
            points=points,
            faces=_triangles(indices, primitive.get("mode", TRIANGLES)),
            normals=self._unit(attributes["NORMAL"], 3) if "NORMAL" in attributes else None,
            coordinates=dict(self._coordinates(attributes)),
            is_double_sided=bool(material.get("doubleSided", False)),
        )
        mesh = write_mesh(self._stage, path, geometry)
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._material(index, material))

    def _coordinates(self, attributes: Object) -> Iterator[tuple[str, NDArray[np.float64]]]:
        for number in (0, 1):
            if f"TEXCOORD_{number}" in attributes:
                uv = self._unit(attributes[f"TEXCOORD_{number}"], 2)
                # glTF's v goes down
                yield f"{COORDINATES}{number or ''}", np.column_stack((uv[:, 0], 1.0 - uv[:, 1]))

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
        metal = material.get("pbrMetallicRoughness", {})
        if not isinstance(metal, dict):
            raise damaged(self._content.name)
        factor = floats(self._content.name, metal.get("baseColorFactor", (1, 1, 1, 1)), 4).clip(0.0, 1.0)
        mode = material.get("alphaMode", "OPAQUE")
        cutoff = None
        if mode == "MASK":
            cutoff = float(floats(self._content.name, [material.get("alphaCutoff", 0.5)], 1)[0])
        texture = metal.get("baseColorTexture")
        look = Look(
            base=(float(factor[0]), float(factor[1]), float(factor[2]), float(factor[3])),
            image=None if texture is None else self._texture(texture),
            is_opaque=mode == "OPAQUE",
            cutoff=cutoff,
        )
        path, glass = Sdf.Path(f"/World/Looks/{name}"), self._glass(material)
        if glass is not None:
            self._materials[index] = write_glass(self._stage, path, look, glass)
        else:
            self._materials[index] = write_material(self._stage, path, look)
        return self._materials[index]

    def _glass(self, material: Object) -> GlassLook | None:
        found = glass_of(self._content.name, material)
        if found is None:
            return None
        glass, texture = found
        return glass if texture is None else replace(glass, image=self._texture(texture))

    def _texture(self, reference: Any) -> Image:
        """A base colour texture and how it is sampled."""
        if not isinstance(reference, dict):
            raise damaged(self._content.name)
        texture = self._content.pick("textures", reference.get("index"))
        sampler = self._content.pick("samplers", texture["sampler"]) if "sampler" in texture else {}
        wraps = [WRAPS.get(sampler.get(f"wrap{side}", 10497), "repeat") for side in "ST"]
        name = f"{COORDINATES}1" if reference.get("texCoord", 0) == 1 else COORDINATES
        return Image(self._image(texture.get("source")), (wraps[0], wraps[1]), name)

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
