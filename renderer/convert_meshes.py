"""OBJ, glTF, PLY and STL to USD: geometry, where it stands, names, colours, opacity and textures.

These are files of one's own, read by trimesh with whatever they refer to; what strangers upload goes through
`renderer.convert` instead. What is not taken along is named in a warning.

Conventions, where a format has none of its own: OBJ is Y-up, PLY and STL are Z-up, a unit is a metre; options change
both. Colours of materials are linear, and so are glTF's vertex colours; those of the other formats are sRGB-encoded.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image as PillowImage
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, UsdUtils, Vt
from trimesh.resolvers import FilePathResolver

from renderer.authoring import COORDINATES, Geometry, GlassLook, Image, Look, vectors, write_material, write_mesh
from renderer.authoring_glass import write_glass
from renderer.convert_looks import Looks, is_invented
from renderer.gltf_materials import document_of, glass_of, image_bytes, left_out, numbered, transmits
from renderer.usd.assemble import FARTHEST
from renderer.usd.left_out import write_left_out
from renderer.usd.licence import write_licence
from schemas.colour import srgb_to_linear
from schemas.problem import ExitCode, Problem

MESH_SUFFIXES = (".obj", ".gltf", ".glb", ".ply", ".stl")
"""Kinds of files that are converted."""
_GLTF = (".gltf", ".glb")
_TARGETS = (".usd", ".usda", ".usdc", ".usdz")
_READING: dict[str, dict[str, bool]] = {".obj": {"split_objects": True, "group_material": True}}
"""What trimesh shall do, by suffix: here, keep the names of objects."""
_UP = {".ply": "Z", ".stl": "Z"}
_COMPRESSIONS = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}


@dataclass(frozen=True, slots=True)
class Converted:
    """What a conversion took along.

    Attributes:
        meshes: Distinct meshes.
        instances: How often they stand in the scene, all together.
        triangles: Of all instances.
        materials: Distinct materials.
        textures: Images written.
        up: Up axis, `Y` or `Z`.
        metres_per_unit: Scale of the stage.
        warnings: What was left out.
    """

    meshes: int
    instances: int
    triangles: int
    materials: int
    textures: int
    up: str
    metres_per_unit: float
    warnings: tuple[str, ...]


def convert_meshes(source: Path, target: Path, up: str | None = None, metres_per_unit: float = 1.0) -> Converted:
    """Write a file of another format as USD.

    Args:
        source: A file with one of MESH_SUFFIXES.
        target: .usda (text), .usdc or .usd (binary), with the textures in a folder beside it; .usdz: with them inside.
        up: Up axis of the source, `Y` or `Z`; None: as its format has it.
        metres_per_unit: Metres per unit of the source; glTF's is always a metre.

    Raises:
        Problem: The source cannot be read or has no triangles, or the target is of another kind or cannot be written.
    """
    _check(source, target, up, metres_per_unit)
    is_gltf = source.suffix.lower() in _GLTF
    if is_gltf and (up not in (None, "Y") or metres_per_unit != 1.0):
        raise Problem("glTF is Y-up, and its unit is the metre.", "Leave --up and --metersPerUnit out.")
    scene = _read(source)
    up = up or _UP.get(source.suffix.lower(), "Y")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="convert-", dir=target.parent) as folder:
            # A usdz package is made of a stage on disk.
            stage_path = Path(folder) / (target.stem + (".usdc" if target.suffix.lower() == ".usdz" else target.suffix))
            writer = _Writer(scene, source, f"{target.stem}_textures", stage_path.parent)
            converted = writer.write(stage_path, up, metres_per_unit)
            _publish(stage_path, Path(folder) / writer.textures, target)
    except (OSError, Tf.ErrorException) as error:
        # USD does not say why.
        reason = f": {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
        raise Problem(
            f"{target} cannot be written{reason}.", "Make room, or name another place.", ExitCode.TRY_AGAIN
        ) from error
    return converted


def _check(source: Path, target: Path, up: str | None, metres_per_unit: float) -> None:
    if not source.is_file():
        what = f"{source} is a folder." if source.is_dir() else f"There is no file {source}."
        raise Problem(what, "Name the file to convert.", ExitCode.NOT_FOUND)
    if source.suffix.lower() not in MESH_SUFFIXES:
        raise Problem(f"{source} is not of a kind that is converted.", f"Use {', '.join(MESH_SUFFIXES)}.")
    if target.suffix.lower() not in _TARGETS:
        raise Problem(f"{target} is no name of a USD file.", f"End it in {', '.join(_TARGETS)}.")
    if up not in (None, "Y", "Z"):
        raise Problem(f"There is no up axis '{up}'.", "Use --up Y or --up Z.")
    if not (np.isfinite(metres_per_unit) and metres_per_unit > 0.0):
        raise Problem(f"A scale of {metres_per_unit} metres per unit is not possible.", "Give a number above 0.")


def _read(source: Path) -> trimesh.Scene:
    try:
        # Unprocessed: trimesh would merge points, and so make facets smooth and move texture seams.
        wanted: dict[str, Any] = {"process": False, **_READING.get(source.suffix.lower(), {})}
        # Textures of an OBJ are often beside its folder; glTF comes as one folder.
        resolver = FilePathResolver(str(source), allow_anywhere=source.suffix.lower() not in _GLTF)
        data = source.read_bytes() if source.suffix.lower() in _GLTF else b""
        document = document_of(data) if source.suffix.lower() in _GLTF else {}
        needed = document.get("extensionsRequired", [])
        given: Any = source
        if transmits(document):
            given, wanted["file_type"] = BytesIO(numbered(data)), source.suffix.lower()[1:]
        scene: trimesh.Scene = trimesh.load_scene(given, resolver=resolver, **wanted)
    except Exception as error:  # every reader has its own kinds
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise Problem(f"{source} cannot be read ({reason[:200]}).", "Export it again.") from error
    for extension in _COMPRESSIONS.intersection(needed):
        raise Problem(f"{source} is compressed with {extension}.", "Export it without compression.")
    return scene


def _publish(stage: Path, textures: Path, target: Path) -> None:
    """Moves what was written to where it belongs, the stage last."""
    if target.suffix.lower() == ".usdz":
        package = stage.with_suffix(".usdz")
        if not UsdUtils.CreateNewUsdzPackage(str(stage), str(package)):
            raise Problem(f"{target} could not be packed.", "Write a .usdc instead.", ExitCode.CHECK_FAILED)
        package.replace(target)
        return
    if textures.is_dir():
        kept = target.parent / textures.name
        kept.mkdir(exist_ok=True)
        for image in textures.iterdir():
            image.replace(kept / image.name)
    stage.replace(target)


@dataclass
class _Writer:
    """One conversion.

    Attributes:
        scene: As trimesh read it.
        source: Its file.
        textures: Name of the folder of textures.
        folder: Where that folder and the stage are written.
    """

    scene: trimesh.Scene
    source: Path
    textures: str
    folder: Path
    _stage: Usd.Stage = field(default_factory=Usd.Stage.CreateInMemory)
    _materials: dict[tuple[Look, GlassLook | None], UsdShade.Material] = field(default_factory=dict)
    _transmissions: dict[int, Image] = field(default_factory=dict)
    _warnings: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._looks = Looks(self.source.parent, self.folder, self.textures, self._warn)
        is_gltf = self.source.suffix.lower() in _GLTF
        self._document = document_of(self.source.read_bytes()) if is_gltf else {}
        self._is_numbered = transmits(self._document)

    def write(self, path: Path, up: str, metres_per_unit: float) -> Converted:
        """Writes the stage and the images."""
        UsdGeom.SetStageUpAxis(self._stage, up)
        UsdGeom.SetStageMetersPerUnit(self._stage, metres_per_unit)
        self._stage.SetDefaultPrim(UsdGeom.Xform.Define(self._stage, "/World").GetPrim())
        places = self._places()
        for name, stands in places.items():
            self._geometry(name, stands)
        self._name_what_is_left_out()
        if self.source.suffix.lower() in _GLTF:
            write_licence(self._stage.GetRootLayer(), self._document.get("asset"))
        warnings = tuple(f"{text} ({count}x)" if count > 1 else text for text, count in self._warnings.items())
        write_left_out(self._stage.GetRootLayer(), warnings)
        self._stage.GetRootLayer().Export(str(path))
        return Converted(
            meshes=len(places),
            instances=sum(len(stands) for stands in places.values()),
            triangles=sum(len(self.scene.geometry[name].faces) * len(stands) for name, stands in places.items()),
            materials=len(self._materials),
            textures=self._looks.images,
            up=up,
            metres_per_unit=metres_per_unit,
            warnings=warnings,
        )

    def _warn(self, text: str) -> None:
        self._warnings[text] = self._warnings.get(text, 0) + 1

    def _places(self) -> dict[str, list[tuple[str, NDArray[np.float64]]]]:
        """Name of each mesh with triangles -> name and matrix of every node that shows it."""
        places: dict[str, list[tuple[str, NDArray[np.float64]]]] = {}
        for node in self.scene.graph.nodes_geometry:
            matrix, found = self.scene.graph[node]
            name = str(found)
            mesh = self.scene.geometry[name]
            if not isinstance(mesh, trimesh.Trimesh):
                self._warn("points and lines are left out")
            elif len(mesh.faces) == 0:
                self._warn("meshes without triangles are left out")
            elif not (np.all(np.abs(mesh.vertices) <= FARTHEST) and np.isfinite(matrix).all()):
                raise Problem(f"{self.source} has coordinates that are not finite, or huge.", "Export it again.")
            elif mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
                raise Problem(f"{self.source} has triangles of points that do not exist.", "Export it again.")
            else:
                places.setdefault(name, []).append((str(node), np.asarray(matrix, dtype=np.float64)))
        if not places:
            raise Problem(f"{self.source} has no triangles.", "Export the surfaces of the model.")
        return places

    def _geometry(self, name: str, stands: list[tuple[str, NDArray[np.float64]]]) -> None:
        """A mesh where it stands; one that stands in several places is written once, for native instances."""
        if len(stands) == 1:
            xform = self._place(*stands[0])
            self._mesh(xform.GetPath().AppendChild("Mesh"), self.scene.geometry[name])
            return
        prototype = self._stage.CreateClassPrim(self._free(Sdf.Path("/Prototypes"), name)).GetPath()
        self._mesh(prototype.AppendChild("Mesh"), self.scene.geometry[name])
        for stand in stands:
            xform = self._place(*stand)
            xform.GetPrim().GetReferences().AddInternalReference(prototype)
            xform.GetPrim().SetInstanceable(True)

    def _place(self, node: str, matrix: NDArray[np.float64]) -> UsdGeom.Xform:
        xform = UsdGeom.Xform.Define(self._stage, self._free(Sdf.Path("/World"), node))
        # USD's matrices act on rows.
        xform.AddTransformOp().Set(Gf.Matrix4d(*matrix.T.ravel().tolist()))
        return xform

    def _free(self, parent: Sdf.Path, name: str) -> Sdf.Path:
        """A path that no prim has, as near to a name as USD's rules allow."""
        wanted = Tf.MakeValidIdentifier(Path(name).stem if name == self.source.name else name)
        path, number = parent.AppendChild(wanted), 2
        while self._stage.GetPrimAtPath(path):
            path, number = parent.AppendChild(f"{wanted}_{number}"), number + 1
        return path

    def _mesh(self, path: Sdf.Path, mesh: trimesh.Trimesh) -> None:
        visual: Any = mesh.visual
        uv: Any = getattr(visual, "uv", None)
        has_uv = uv is not None and len(uv) == len(mesh.vertices)
        if "color" in mesh.vertex_attributes and visual.kind == "texture":
            self._warn("colours of points that have a material too are left out")
        made = write_mesh(
            self._stage,
            path,
            Geometry(
                points=mesh.vertices,
                faces=mesh.faces,
                # Only the file's own: others are for the renderer to make. trimesh's exporters ask the same.
                normals=mesh.vertex_normals if "vertex_normals" in mesh._cache else None,
                coordinates={COORDINATES: uv} if has_uv else {},
                is_double_sided=bool(getattr(getattr(visual, "material", None), "doubleSided", False)),
            ),
        )
        if visual.kind == "texture" and not is_invented(visual.material):
            UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(self._material(visual.material, has_uv))
        elif visual.kind in ("vertex", "face"):
            self._display(made, visual)
        elif self.source.suffix.lower() in _GLTF:  # without a material glTF is white
            made.CreateDisplayColorAttr([Gf.Vec3f(1.0)])

    def _display(self, mesh: UsdGeom.Mesh, visual: Any) -> None:
        """Colours of points or triangles as displayColor and displayOpacity."""
        is_vertex = visual.kind == "vertex"
        rgba = np.asarray(visual.vertex_colors if is_vertex else visual.face_colors, dtype=np.float64) / 255.0
        linear = rgba[:, :3] if self.source.suffix.lower() in _GLTF else srgb_to_linear(rgba[:, :3])
        kind = UsdGeom.Tokens.vertex if is_vertex else UsdGeom.Tokens.uniform
        mesh.CreateDisplayColorPrimvar(kind).Set(vectors(linear, Vt.Vec3fArray))
        if (rgba[:, 3] < 1.0).any():
            opacity = np.ascontiguousarray(rgba[:, 3], dtype=np.float32)
            mesh.CreateDisplayOpacityPrimvar(kind).Set(Vt.FloatArray.FromNumpy(opacity))

    def _material(self, material: Any, has_uv: bool) -> UsdShade.Material:
        look = self._looks.look_of(material, has_uv)
        number, colon, name = str(getattr(material, "name", None) or "").partition(":")
        is_numbered = bool(colon) and self._is_numbered
        glass = self._glass(int(number), has_uv) if is_numbered else None
        if (look, glass) not in self._materials:
            self._stage.DefinePrim("/World/Looks", "Scope")
            named = (name if is_numbered else number + colon + name) or "Material"
            path = self._free(Sdf.Path("/World/Looks"), named)
            if glass is None:
                made = write_material(self._stage, path, look)
            else:
                made = write_glass(self._stage, path, look, glass)
            self._materials[look, glass] = made
        return self._materials[look, glass]

    def _glass(self, index: int, has_uv: bool) -> GlassLook | None:
        """How the material of a glTF file with that index transmits light."""
        found = glass_of(self.source.name, self._document["materials"][index])
        if found is None:
            return None
        glass, texture = found
        if not has_uv or not isinstance(texture, dict):
            return glass
        try:
            number = texture["index"]
            if number not in self._transmissions:  # meshes share a material: its image is read once
                data = image_bytes(self.source.read_bytes(), self.source.parent, number)
                with PillowImage.open(BytesIO(data)) as image:
                    self._transmissions[number] = self._looks.image(image)
            return replace(glass, image=self._transmissions[number])
        except (OSError, LookupError, TypeError, ValueError):
            self._warn("an image of the transmission cannot be read, and is left out")
            return glass

    def _name_what_is_left_out(self) -> None:
        if self.source.suffix.lower() == ".obj":
            for name in re.findall(rb"^mtllib\s+(.+?)\s*$", self.source.read_bytes(), re.MULTILINE):
                library = self.source.parent / name.decode(errors="replace")
                if not library.is_file():
                    self._warn(f"the materials {name.decode(errors='replace')} are missing")
                for image in _missing_images(library) if library.is_file() else ():
                    self._warn(f"the image {image} is missing, and left out")
        if self.source.suffix.lower() not in _GLTF:
            return
        document = self._document
        for image in document.get("images", []):
            uri = str(image.get("uri", "data:"))
            if not uri.startswith("data:") and not _is_beneath(self.source.parent, unquote(uri)):
                self._warn(f"the image {uri} is missing, or outside of the file's folder")
        for text in left_out(document):
            self._warn(text)
        if any(set(sampler) & {"wrapS", "wrapT"} for sampler in document.get("samplers", [])):
            self._warn("textures repeat, whatever their samplers say")


def _is_beneath(folder: Path, name: str) -> bool:
    """Whether a name leads to a file in a folder or further down."""
    file = (folder / name).resolve()
    return file.is_file() and file.is_relative_to(folder.resolve())


def _missing_images(library: Path) -> list[str]:
    """Colour images that a material library names and that do not exist."""
    names = re.findall(rb"^\s*map_Kd\s+(.+?)\s*$", library.read_bytes(), re.MULTILINE | re.IGNORECASE)
    # Before the name there may be options.
    found = [name.decode(errors="replace").replace("\\", "/") for name in names]
    return [name for name in found if not any((library.parent / n).is_file() for n in (name, name.split()[-1]))]
