"""Skinned prims: every pose is compared with what UsdSkel's own baking writes into a copy of the stage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt
from support.stages import stage, world

from renderer.scene import LoadOptions, load_scene
from schemas.scene import SceneArrays

RIG = """
def SkelRoot "Root" ( prepend apiSchemas = ["SkelBindingAPI"] )
{
    rel skel:animationSource = </Root/Anim>
    double3 xformOp:translate = (0, 3, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Skeleton "Skel" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {
        uniform token[] joints = ["A", "A/B"]
        uniform matrix4d[] bindTransforms = [
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,2,0,1))]
        uniform matrix4d[] restTransforms = [
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,2,0,1))]
        double3 xformOp:translate = (1, 0, 0)
        float xformOp:rotateZ = 20
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
    }
    def SkelAnimation "Anim"
    {
        uniform token[] joints = ["A/B", "A"]
        float3[] translations.timeSamples = { 0: [(0,2,0), (0,0,0)], 10: [(0,2.5,0), (1,0,0)] }
        quatf[] rotations.timeSamples = { 0: [(1,0,0,0), (1,0,0,0)], 10: [(0.8,0,0.6,0), (0.6,0,0,0.8)] }
        half3[] scales = [(1,1,1), (1,2,1)]
        uniform token[] blendShapes = ["smile", "frown"]
        float[] blendShapeWeights.timeSamples = { 0: [0, 0], 10: [0.75, 0.5] }
    }
    def Mesh "Body" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {
        rel skel:skeleton = </Root/Skel>
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4]
        point3f[] points = [(-1,0,0), (1,0,0), (-1,2,0), (1,2,0), (-1,4,0), (1,4,0.5)]
        uniform token subdivisionScheme = "none"
        double3 xformOp:translate = (0, 0, 7)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        matrix4d primvars:skel:geomBindTransform = ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0.5,0,0,1))
        %s
    }
}
"""

JOINTS = """
        int[] primvars:skel:jointIndices = [0,1, 0,1, 0,1, 0,1, 0,1, 1,0] ( elementSize = 2; interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1,0, 1,0, 0.5,0.5, 0.5,0.5, 0.25,0.75, 1,0] (
            elementSize = 2; interpolation = "vertex" )
"""

SHAPES = """
        uniform token[] skel:blendShapes = ["frown", "smile"]
        rel skel:blendShapeTargets = [</Root/Body/Frown>, </Root/Body/Smile>]
        def BlendShape "Smile" {
            uniform vector3f[] offsets = [(0,0,1), (0,0,2)]
            uniform int[] pointIndices = [5, 1]
            uniform vector3f[] inbetweens:half = [(1,0,0), (0,1,0)] ( weight = 0.5 ) }
        def BlendShape "Frown" { uniform vector3f[] offsets = [(0,0,1),(1,0,0),(0,1,0),(0,0,1),(1,1,0),(0,1,0)] }
"""


def rig(folder: Path, extra: str, name: str = "scene.usda") -> Path:
    return stage(folder, RIG % extra, "metersPerUnit = 1\nstartTimeCode = 0\nendTimeCode = 10", name)


def baked(file: Path) -> Path:
    opened = Usd.Stage.Open(str(file))
    assert UsdSkel.BakeSkinning(opened.Traverse(), Gf.Interval(0, 10))
    result = file.with_name("baked.usda")
    opened.Export(str(result))
    return result


def same(file: Path, time: float, atol: float = 1e-5) -> SceneArrays:
    scene, expected = (load_scene(f, LoadOptions(time=time)) for f in (file, baked(file)))
    np.testing.assert_allclose(world(scene), world(expected), atol=atol)
    return scene


@pytest.mark.parametrize("time", [0.0, 5.0, 10.0])
@pytest.mark.parametrize("method", ["classicLinear", "dualQuaternion"])
@pytest.mark.parametrize("extra", [JOINTS, SHAPES, JOINTS + SHAPES], ids=["joints", "shapes", "both"])
def test_points_are_those_that_usdskel_bakes(tmp_path: Path, extra: str, method: str, time: float) -> None:
    same(rig(tmp_path, f'uniform token primvars:skel:skinningMethod = "{method}"\n' + extra), time)


def test_the_pose_moves_and_its_place_is_the_skeletons(tmp_path: Path) -> None:
    file = rig(tmp_path, JOINTS)
    first, last = (world(load_scene(file, LoadOptions(time=t))) for t in (0.0, 10.0))
    assert np.abs(first - last).max() > 0.5
    # At time 0 the second joint is at rest and the first is scaled by (1, 2, 1); (-1, 0, 0) hangs on the first.
    turn = np.radians(20.0)
    expected = np.array([1.0, 3.0, 0.0]) + (0.5 - 1.0) * np.array([np.cos(turn), np.sin(turn), 0.0])
    np.testing.assert_allclose(first[0, 0], expected, atol=1e-6)


def test_without_a_start_time_the_first_sample_poses(tmp_path: Path) -> None:
    first = world(load_scene(rig(tmp_path, JOINTS), LoadOptions(time=0.0)))
    timeless = stage(tmp_path, RIG % JOINTS, name="timeless.usda")
    np.testing.assert_array_equal(world(load_scene(timeless)), first)


def test_a_subset_of_joints_in_another_order_is_remapped(tmp_path: Path) -> None:
    own = 'uniform token[] skel:joints = ["A/B", "A"]\n'
    same(rig(tmp_path, own + JOINTS), 10.0)


RIGID = """
        int[] primvars:skel:jointIndices = [1] ( elementSize = 1; interpolation = "constant" )
        float[] primvars:skel:jointWeights = [1] ( elementSize = 1; interpolation = "constant" )
"""


def test_rigid_meshes_move_as_one_body(tmp_path: Path) -> None:
    same(rig(tmp_path, RIGID), 7.0)


def test_rigid_gprims_follow_their_joint_with_their_normals(tmp_path: Path) -> None:
    text = rig(tmp_path, RIGID).read_text()
    start = text.index("int[] faceVertexCounts")
    end = text.index("double3 xformOp:translate = (0, 0, 7)")
    file = tmp_path / "gprim.usda"
    file.write_text(text[:start] + text[end:].replace("(1,0,0,0),(0,1,0,0),(0,0,1,0),(0.5,0,0,1)", "X"))
    file.write_text((text[:start] + "double size = 2\n" + text[end:]).replace('def Mesh "Body"', 'def Cube "Body"'))
    scene = same(file, 10.0)
    corners = world(scene)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = scene.normals[scene.indices.reshape(-1, 3)][:, 0]
    assert np.all(np.einsum("ij,ij->i", flat, normals) > 0.9 * np.linalg.norm(flat, axis=1))


NORMALS = {
    "vertex": "(0,0,1), (0,0,1), (0,0.6,0.8), (0,0,1), (1,0,0), (0,0,1)",
    "faceVarying": "(0,0,1), (0,0,1), (0,0.6,0.8), (0,0,1), (1,0,0), (0,0,1), (0,1,0), (0,0,1)",
}


@pytest.mark.parametrize("interpolation", NORMALS)
def test_authored_normals_turn_with_the_joints(tmp_path: Path, interpolation: str) -> None:
    extra = JOINTS + f'normal3f[] normals = [{NORMALS[interpolation]}] ( interpolation = "{interpolation}" )'
    file = rig(tmp_path, extra)
    scene, expected = (load_scene(f, LoadOptions(time=10.0)) for f in (file, baked(file)))
    corners = [s.normals[s.indices.reshape(-1, 3)] for s in (scene, expected)]
    np.testing.assert_allclose(corners[0], corners[1], atol=2e-3)
    rest = load_scene(file, LoadOptions(time=0.0))
    assert np.abs(rest.normals[rest.indices.reshape(-1, 3)] - corners[0]).max() > 0.1


def test_instanced_roots_share_a_pose_only_with_the_same_animation(tmp_path: Path) -> None:
    text = rig(tmp_path, JOINTS).read_text().replace('def SkelRoot "Root"', 'class SkelRoot "Root"')
    text = text.replace("rel skel:animationSource = </Root/Anim>\n", "").replace(
        "double3 xformOp:translate = (0, 3, 0)", "double3 xformOp:translate = (0, 0, 0)"
    )
    for i, anim in enumerate(("Anim", "Still", "Anim")):
        text += (
            f'def SkelRoot "I{i}" ( references = </Root>\ninstanceable = true\n'
            f'prepend apiSchemas = ["SkelBindingAPI"]\n)\n{{\nrel skel:animationSource = </{anim}>\n'
            f"double3 xformOp:translate = ({100 * i}, 0, 0)\n}}\n"
        )
    text += 'def SkelAnimation "Still" {\nuniform token[] joints = ["A"]\nfloat3[] translations = [(0,0,5)]\n'
    text += "quatf[] rotations = [(1,0,0,0)]\nhalf3[] scales = [(1,1,1)]\n}\n"
    start = text.index('def SkelAnimation "Anim"')
    text += text[start : text.index('def Mesh "Body"')]
    file = tmp_path / "crowd.usda"
    file.write_text(text)
    scene = load_scene(file, LoadOptions(time=10.0))
    groups = world(scene).reshape(-1, 4, 3, 3)
    groups = groups[np.argsort(groups[:, 0, 0, 0])]
    assert len(groups) == 3
    np.testing.assert_allclose(groups[2] - groups[0], np.broadcast_to([200.0, 0, 0], groups[0].shape), atol=1e-5)
    assert np.abs(groups[1] - groups[0] - [100.0, 0, 0]).max() > 1.0


def test_skinned_instances_in_point_instancers_stand_where_the_instancer_puts_them(tmp_path: Path) -> None:
    text = rig(tmp_path, JOINTS).read_text()
    alone = world(load_scene(tmp_path / "scene.usda", LoadOptions(time=10.0)))
    body = text[text.index('def SkelRoot "Root"') :].replace("</Root", "</Many/Root")
    head = text[: text.index('def SkelRoot "Root"')]
    file = tmp_path / "many.usda"
    file.write_text(
        f'{head}def PointInstancer "Many" {{\nrel prototypes = [</Many/Root>]\nint[] protoIndices = [0, 0]\n'
        f"point3f[] positions = [(0, 0, 0), (0, 0, 40)]\n{body}}}\n"
    )
    corners = world(load_scene(file, LoadOptions(time=10.0)))
    np.testing.assert_allclose(corners[:4], alone, atol=1e-5)
    np.testing.assert_allclose(corners[4:], alone + np.array([0, 0, 40.0]), atol=1e-5)


def test_outside_a_skelroot_nothing_is_skinned(tmp_path: Path) -> None:
    text = rig(tmp_path, JOINTS).read_text().replace("def SkelRoot", "def Xform")
    file = tmp_path / "plain.usda"
    file.write_text(text)
    np.testing.assert_allclose(world(load_scene(file, LoadOptions(time=10.0)))[0, 0], [-1.0, 3.0, 7.0], atol=1e-6)


def test_weights_that_do_not_fit_are_a_warning_and_the_bind_pose(tmp_path: Path) -> None:
    wrong = JOINTS.replace("[0,1, 0,1, 0,1, 0,1, 0,1, 1,0]", "[0,1]").replace(
        "[1,0, 1,0, 0.5,0.5, 0.5,0.5, 0.25,0.75, 1,0]", "[1,0]"
    )
    scene = load_scene(rig(tmp_path, wrong), LoadOptions(time=10.0))
    assert scene.triangles == 4
    assert any("/Root/Body" in line for line in scene.warnings)


def test_a_blend_shape_that_does_not_fit_is_named(tmp_path: Path) -> None:
    wrong = SHAPES.replace("[5, 1]", "[5, 99]")
    scene = load_scene(rig(tmp_path, wrong), LoadOptions(time=10.0))
    assert any("blend shape /Root/Body/Smile" in line for line in scene.warnings)


def _sample_near(file: Path, time: float) -> float:
    opened = Usd.Stage.Open(str(file))
    (animation,) = (UsdSkel.Animation(p) for p in opened.Traverse() if p.IsA(UsdSkel.Animation))
    samples = animation.GetRotationsAttr().GetTimeSamples()
    return float(min(samples, key=lambda sample: abs(sample - time)))


def test_a_whole_character_is_what_usdskel_bakes(tmp_path: Path) -> None:
    file = Path(__file__).parents[3].parent / "shared/scenes/brainstem/BrainStem.usdz"
    if not file.exists():
        pytest.skip("the shared scenes are not there")
    # Baking writes only times at which something is authored.
    time = _sample_near(file, 400.0)
    scene, still = (load_scene(file, LoadOptions(time=t)) for t in (time, 0.0))
    opened = Usd.Stage.Open(str(file))
    assert UsdSkel.BakeSkinning(opened.Traverse(), Gf.Interval(time, time))
    cache = UsdGeom.XformCache(time)
    expected = []
    for prim in opened.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            points = np.asarray(Vt.Vec3fArray(UsdGeom.Mesh(prim).GetPointsAttr().Get(time)), dtype=np.float64)
            matrix = np.array(cache.GetLocalToWorldTransform(prim))
            expected.append(points @ matrix[:3, :3] + matrix[3, :3])
    low = np.min([p.min(axis=0) for p in expected], axis=0)
    high = np.max([p.max(axis=0) for p in expected], axis=0)
    np.testing.assert_allclose(scene.bounds + scene.origin, [low, high], atol=1e-5)
    assert np.abs(still.bounds + still.origin - [low, high]).max() > 0.01


def test_a_blend_shape_that_does_not_exist_moves_nothing(tmp_path: Path) -> None:
    scene = load_scene(rig(tmp_path, SHAPES.replace("/Body/Smile>", "/Body/Gone>")), LoadOptions(time=10))
    assert scene.triangles == 4
    assert any("/Root/Body/Gone" in line for line in scene.warnings)


@pytest.mark.parametrize("first", ["(0,0,0,0)", "(nan,0,0,0)"])
def test_a_bind_pose_without_an_inverse_is_named_and_poses_nothing(tmp_path: Path, first: str) -> None:
    file = rig(tmp_path, JOINTS)
    file.write_text(file.read_text().replace("((1,0,0,0),(0,1,0,0)", f"({first},(0,1,0,0)", 1))
    scene = load_scene(file, LoadOptions(time=10))
    assert scene.triangles == 4
    assert any("no pose" in line and "/Root/Skel" in line for line in scene.warnings)
