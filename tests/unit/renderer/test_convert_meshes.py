"""Files of other formats, converted and loaded as any scene is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attacks import glbs, make
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade
from trimesh.visual.material import PBRMaterial

from renderer.convert import stage_file
from renderer.convert_meshes import convert_meshes
from renderer.scene import load_scene
from schemas.colour import encode_gamma2, srgb_to_linear
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays

MTL = """
newmtl glass
Kd 0.2 0.6 0.9
d 0.35
newmtl tinted
Kd 0.1 0.9 0.1
Tr 0.75
newmtl painted
Kd 0.5 1 1
map_Kd paint.png
newmtl leaf
map_Kd paint.png
map_d mask.png
newmtl lost
map_d nowhere.png
"""
QUADS = "".join(
    f"o part{i}\nusemtl {name}\nf {' '.join(f'{4 * i + j}/{j}' for j in range(1, 5))}\n"
    for i, name in enumerate(("glass", "tinted", "painted", "leaf", "lost"))
)
POINTS = "".join(f"v {x} {y} {z}\n" for z in range(5) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
OBJ = f"mtllib m.mtl\n{POINTS}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n{QUADS}"


@pytest.fixture
def obj(tmp_path: Path) -> Path:
    (tmp_path / "m.mtl").write_text(MTL)
    (tmp_path / "model.obj").write_text(OBJ)
    Image.new("RGBA", (4, 4), (255, 128, 0, 99)).save(tmp_path / "paint.png")
    Image.fromarray(np.arange(0, 256, 16, dtype=np.uint8).reshape(4, 4)).save(tmp_path / "mask.png")
    return tmp_path / "model.obj"


@pytest.fixture
def glb(tmp_path: Path) -> Path:
    scene = trimesh.Scene()
    box = trimesh.creation.box((1, 1, 1))
    material = PBRMaterial(name="glass", baseColorFactor=[51, 102, 204, 102], alphaMode="BLEND", doubleSided=True)
    box.visual = trimesh.visual.TextureVisuals(material=material)
    scene.geometry["box"] = box
    for name, x in (("left", -2.0), ("right", 3.0)):
        matrix = np.diag([0.5, 0.5, 0.5, 1.0])
        matrix[0, 3] = x
        scene.graph.update(frame_to=name, matrix=matrix, geometry="box")
    scene.export(tmp_path / "boxes.glb")
    return tmp_path / "boxes.glb"


def converted(source: Path, suffix: str = ".usdc", **options: object) -> SceneArrays:
    target = source.parent / "out" / f"made{suffix}"
    convert_meshes(source, target, **options)  # type: ignore[arg-type]
    return load_scene(target)


def alphas(scene: SceneArrays) -> set[int]:
    return set(np.unique(scene.colours[:, 3]).tolist())


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd", ".usdz"])
def test_an_obj_keeps_names_colours_opacity_and_images(obj: Path, suffix: str) -> None:
    scene = converted(obj, suffix)
    assert scene.triangles == 10
    assert scene.metres_per_unit == 1.0
    assert scene.up == (0.0, 1.0, 0.0)
    stage = Usd.Stage.Open(str(obj.parent / "out" / f"made{suffix}"))
    names = {prim.GetName() for prim in stage.GetDefaultPrim().GetChildren()}
    assert {"part0_glass", "part1_tinted", "part2_painted", "Looks"} <= names
    by_layer = {batch.layer: batch for batch in scene.batches}
    assert set(by_layer) == {"opaque", "transparent", "mixed"}
    # 0.35 and 1 - 0.75 of 255; the image of the leaf multiplies full opacity.
    assert {89, 64, 255} == alphas(scene)
    assert encode_gamma2(np.array([0.2, 0.6, 0.9])).tolist() in scene.colours[:, :3].tolist()
    assert by_layer["mixed"].opacity_channel == 0
    colour = [batch for batch in scene.batches if batch.colour_texture >= 0 and batch.layer == "opaque"]
    assert [batch.colour_scale for batch in colour] == [(0.5, 1.0, 1.0, 1.0)]


def test_what_an_obj_refers_to_and_is_missing_is_named(obj: Path) -> None:
    found = convert_meshes(obj, obj.parent / "out.usdc")
    assert found.warnings == ("the opacity image nowhere.png cannot be read, and is left out",)
    assert (found.meshes, found.instances, found.triangles, found.textures) == (5, 5, 10, 2)


def test_a_mesh_that_stands_twice_is_written_once(glb: Path) -> None:
    found = convert_meshes(glb, glb.parent / "made.usda")
    assert (found.meshes, found.instances, found.triangles, found.materials) == (1, 2, 24, 1)
    stage = Usd.Stage.Open(str(glb.parent / "made.usda"))
    assert len(stage.GetPrototypes()) == 1
    scene = load_scene(glb.parent / "made.usda")
    np.testing.assert_allclose(scene.bounds + scene.origin, [[-2.25, -0.25, -0.25], [3.25, 0.25, 0.25]], atol=1e-6)
    assert [batch.layer for batch in scene.batches] == ["transparent"]
    assert set(map(tuple, scene.colours.tolist())) == {(*encode_gamma2(np.array([0.2, 0.4, 0.8])).tolist(), 102)}


@pytest.mark.parametrize("name", ["triangle.glb", "texture.glb", "texture-data.glb", "instances.glb"])
def test_a_glb_means_the_same_as_on_the_server(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(glbs.good(make.png())[name])
    ours = converted(tmp_path / name)
    theirs = load_scene(stage_file(tmp_path, name, tmp_path / "cache"))
    assert ours.triangles == theirs.triangles
    np.testing.assert_allclose(ours.bounds + ours.origin, theirs.bounds + theirs.origin, atol=1e-6)
    assert [batch.layer for batch in ours.batches] == [batch.layer for batch in theirs.batches]
    assert np.array_equal(np.unique(ours.colours, axis=0), np.unique(theirs.colours, axis=0))
    for mine, other in zip(ours.textures, theirs.textures, strict=True):
        assert np.array_equal(mine.pixels, other.pixels)
        assert mine.srgb == other.srgb
    corners = [scene.uvs[scene.indices][np.lexsort(scene.positions[scene.indices].T)] for scene in (ours, theirs)]
    np.testing.assert_allclose(*corners, atol=1e-6)


def test_gltf_in_several_files_and_its_cut_outs(tmp_path: Path) -> None:
    document = glbs.document()
    document["materials"][0] |= {"alphaMode": "MASK", "alphaCutoff": 0.25}
    document["animations"], document["cameras"] = [{}], [{}]
    document["buffers"][0]["uri"] = "data.bin"
    (tmp_path / "data.bin").write_bytes(glbs.BUFFER)
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    found = convert_meshes(tmp_path / "a.gltf", tmp_path / "a.usda")
    assert found.warnings == ("animations are left out: the scene is as at rest", "cameras are left out")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    shaders = [UsdShade.Shader(prim) for prim in stage.Traverse() if prim.IsA(UsdShade.Shader)]
    assert [shader.GetInput("opacityThreshold").Get() for shader in shaders] == [0.25]


@pytest.mark.parametrize(("suffix", "up"), [(".ply", (0.0, 0.0, 1.0)), (".stl", (0.0, 0.0, 1.0))])
def test_scans_and_prints_are_z_up_unless_told_otherwise(tmp_path: Path, suffix: str, up: tuple[float, ...]) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / f"a{suffix}")
    assert converted(tmp_path / f"a{suffix}").up == up
    scene = converted(tmp_path / f"a{suffix}", up="Y", metres_per_unit=0.001)
    assert scene.up == (0.0, 1.0, 0.0)
    np.testing.assert_allclose(scene.bounds[1], [0.0005, 0.001, 0.0015], rtol=1e-5)


def test_colours_of_points_are_display_colours(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1)
    rgba = np.tile(np.array([200, 100, 50, 128], np.uint8), (len(ball.vertices), 1))
    ball.visual = trimesh.visual.ColorVisuals(ball, vertex_colors=rgba)
    ball.export(tmp_path / "a.ply")
    scene = converted(tmp_path / "a.ply")
    linear = srgb_to_linear(np.array([200, 100, 50]) / 255.0)
    assert np.unique(scene.colours, axis=0).tolist() == [[*encode_gamma2(linear).tolist(), 128]]
    assert [batch.layer for batch in scene.batches] == ["transparent"]


def test_texture_coordinates_alone_make_no_material(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    found = convert_meshes(tmp_path / "a.obj", tmp_path / "a.usda")
    assert (found.materials, found.textures) == (0, 0)
    assert found.warnings == ("the materials gone.mtl are missing",)


def test_normals_of_a_file_are_kept_and_none_are_invented(tmp_path: Path) -> None:
    for name, normals in (("with", "vn 0 0 1\nf 1//1 2//1 3//1\n"), ("without", "f 1 2 3\n")):
        (tmp_path / f"{name}.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{normals}")
        convert_meshes(tmp_path / f"{name}.obj", tmp_path / f"{name}.usda")
        stage = Usd.Stage.Open(str(tmp_path / f"{name}.usda"))
        (mesh,) = (UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
        assert mesh.GetNormalsAttr().HasAuthoredValue() == (name == "with")


def test_points_without_triangles_are_no_scene(tmp_path: Path) -> None:
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "a.ply")
    with pytest.raises(Problem, match="no triangles"):
        convert_meshes(tmp_path / "a.ply", tmp_path / "a.usda")
    assert not (tmp_path / "a.usda").exists()


@pytest.mark.parametrize(
    ("source", "target", "options", "words"),
    [
        ("missing.obj", "a.usda", {}, "no file"),
        ("m.mtl", "a.usda", {}, "not of a kind"),
        ("model.obj", "a.obj", {}, "no name of a USD file"),
        ("model.obj", "a.usda", {"up": "W"}, "no up axis"),
        ("model.obj", "a.usda", {"metres_per_unit": 0.0}, "not possible"),
        ("broken.glb", "a.usda", {}, "cannot be read"),
        ("boxes.glb", "a.usda", {"up": "Z"}, "glTF is Y-up"),
    ],
)
def test_what_cannot_be_converted_is_said_so(
    obj: Path, glb: Path, source: str, target: str, options: dict[str, object], words: str
) -> None:
    (obj.parent / "broken.glb").write_bytes(b"glTF....")
    with pytest.raises(Problem, match=words) as caught:
        convert_meshes(obj.parent / source, obj.parent / target, **options)  # type: ignore[arg-type]
    assert caught.value.code == (ExitCode.NOT_FOUND if source == "missing.obj" else ExitCode.USAGE)
    assert not (obj.parent / target).exists() or target == "a.obj"


@pytest.mark.parametrize(
    ("face", "x", "words"),
    [([0, 1, 77], 1.0, "do not exist"), ([0, 1, -2], 1.0, "do not exist"), ([0, 1, 2], 1e39, "huge")],
)
def test_what_usd_could_not_hold_is_not_written(tmp_path: Path, face: list[int], x: float, words: str) -> None:
    source = tmp_path / "odd.obj"
    source.write_text(f"v 0 0 0\nv {x} 0 0\nv 0 1 0\nf 1 2 3\n")
    if face != [0, 1, 2]:
        source = source.with_suffix(".ply")
        corners = "".join(f"{p}\n" for p in ("0 0 0", "1 0 0", "0 1 0"))
        head = "".join(f"property float {axis}\n" for axis in "xyz")
        source.write_text(
            f"ply\nformat ascii 1.0\nelement vertex 3\n{head}element face 1\n"
            f"property list uchar int vertex_indices\nend_header\n{corners}3 {face[0]} {face[1]} {face[2]}\n"
        )
    with pytest.raises(Problem, match=words):
        convert_meshes(source, tmp_path / "out.usda")
    assert not (tmp_path / "out.usda").exists()


def test_a_compressed_gltf_is_a_problem(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(Problem, match="KHR_draco_mesh_compression"):
        convert_meshes(tmp_path / "a.gltf", tmp_path / "out.usda")


def test_textures_of_an_obj_may_be_beside_its_folder_and_missing_ones_are_named(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "images").mkdir()
    Image.new("RGB", (2, 2), "red").save(tmp_path / "images" / "red.png")
    (tmp_path / "model" / "a.mtl").write_text(
        "newmtl red\nmap_Kd ../images/red.png\nnewmtl lost\nmap_Kd ../images/lost.png\n"
    )
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    (tmp_path / "model" / "a.obj").write_text(f"mtllib a.mtl\n{corners}usemtl red\nf 1/1 2/2 3/3\n")
    made = convert_meshes(tmp_path / "model" / "a.obj", tmp_path / "out.usda")
    assert made.textures == 1
    assert any("lost.png" in warning for warning in made.warnings)


def test_missing_images_of_a_gltf_are_named(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(
        uv=box.vertices[:, :2], material=PBRMaterial(baseColorTexture=Image.new("RGB", (2, 2), "red"))
    )
    box.export(tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["images"] = [{"uri": "../gone.png"}]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert any("gone.png" in warning for warning in convert_meshes(tmp_path / "a.gltf", tmp_path / "o.usda").warnings)


def test_where_nothing_can_be_written_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(Problem, match="cannot be written") as caught:
        convert_meshes(tmp_path / "a.obj", tmp_path / "file" / "out.usda")
    assert caught.value.code == ExitCode.TRY_AGAIN
