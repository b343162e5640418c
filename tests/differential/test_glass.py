"""Glass: the alpha that is stored, against float64 at known angles; the same in every pass, and as the rays expect."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest
import trimesh
from support.scenes import SIZE, VIEW, shells, with_glass

from benchmarks.casting.check import Effort, shoot
from benchmarks.casting.coverage import CERTAIN
from benchmarks.casting.rays import Camera, cast
from labeller.curves import composite
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference.glass import levels
from renderer.techniques import Budget, KBufferOptimal
from schemas.colour import decode_gamma2
from schemas.scene import Batch, SceneArrays, Texture
from schemas.view import View

ROUNDING = 0.5 + 0.02
"""Of a stored level: to the nearest, and what float32 makes of the angle at a silhouette."""


def solid(mesh: trimesh.Trimesh, rgba: tuple[int, int, int, int], **batch: object) -> SceneArrays:
    """A mesh of one material, with smooth normals and texture coordinates that are x and y."""
    count = len(mesh.vertices)
    return SceneArrays(
        name="solid",
        positions=mesh.vertices.astype(np.float32),
        normals=mesh.vertex_normals.astype(np.float32),
        uvs=mesh.vertices[:, :2].astype(np.float32),
        colours=np.tile(np.array(rgba, np.uint8), (count, 1)),
        indices=mesh.faces.astype(np.uint32).ravel(),
        batches=(Batch(0, mesh.faces.size, **batch),),  # type: ignore[arg-type]
        textures=(),
        origin=np.zeros(3),
        bounds=mesh.bounds.astype(np.float64),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )


def pane(degrees: float) -> trimesh.Trimesh:
    """A large square that is turned by an angle from facing +z."""
    square = trimesh.Trimesh([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    square.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), (0, 1, 0)))
    return square


@pytest.mark.parametrize("ortho", [None, 0.5], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 75.0, 85.0, 89.0])
def test_a_pane_has_the_alpha_of_its_angle(gl: moderngl.Context, degrees: float, ortho: float | None) -> None:
    rgba, reflectance, presence = (200, 255, 60, 0), (0.04, 1.0), 0.9
    scene = solid(pane(degrees), rgba, layer="transparent", reflectance=reflectance, presence=presence)
    view = View(name="v", eye=(0, 0, 4), target=(0, 0, 0), up=(0, 1, 0), fov=4.0, ortho_height=ortho)
    dump = capture(Frame(GpuScene(gl, scene), view, 32, 24)).dump
    seen = dump.counts == 1
    assert seen.mean() > 0.3
    normal = scene.normals[0].astype(np.float64)
    _, rays = Camera.of(view, scene.bounds, 32, 24).view_rays(np.flatnonzero(seen))
    cosine = np.abs(rays @ normal) / np.linalg.norm(rays, axis=1)
    tint = np.tile(decode_gamma2(np.array(rgba[:3], np.uint8)), (len(rays), 1))
    level, _ = levels(reflectance, cosine, tint.mean(axis=1), np.zeros(len(rays)), np.full(len(rays), presence))
    assert np.abs(dump.rgba[:, 3] - level).max() <= ROUNDING


def test_clear_glass_shows_four_hundredths_facing_the_eye_and_never_nothing(gl: moderngl.Context) -> None:
    view = View(name="v", eye=(0, 0, 4), target=(0, 0, 0), up=(0, 1, 0), fov=1.0)
    for reflectance, wanted in (((0.04, 1.0), 10), ((0.0, 1.0), 1), ((0.0, 0.0), 1), ((1.0, 1.0), 254)):
        scene = solid(pane(0.0), (255, 255, 255, 0), layer="transparent", reflectance=reflectance)
        rgba = capture(Frame(GpuScene(gl, scene), view, 8, 8)).dump.rgba
        assert set(rgba[:, 3].tolist()) == {wanted}, reflectance


@pytest.mark.parametrize("body", [0, 90])
def test_every_fragment_of_a_sphere_has_the_alpha_of_its_interpolated_normal(gl: moderngl.Context, body: int) -> None:
    rgba, reflectance = (180, 230, 255, body), (0.17, 1.0)
    scene = solid(trimesh.creation.icosphere(3), rgba, layer="transparent", reflectance=reflectance)
    frame = Frame(GpuScene(gl, scene), VIEW, *SIZE)
    dump = capture(frame).dump
    camera = Camera.of(VIEW, scene.bounds, *SIZE)
    pixels = np.flatnonzero(dump.counts == 2)
    hits = cast(scene, camera, pixels)
    sure = np.bincount(hits.sample[hits.doubt == CERTAIN], minlength=len(pixels)) == 2
    sure &= np.bincount(hits.sample, minlength=len(pixels)) == 2
    rows = np.flatnonzero(sure[hits.sample])
    rows = rows[np.lexsort((hits.depth[rows], hits.sample[rows]))]  # as the fragments lie in the dump
    corners = scene.normals[scene.indices.reshape(-1, 3)[hits.triangle[rows]]].astype(np.float64)
    normals = np.einsum("nk,nkc->nc", hits.weights[rows], corners) @ camera.to_view[:3, :3].T
    _, rays = camera.view_rays(pixels[hits.sample[rows]])
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(rays, axis=1)
    cosine = np.abs((normals * rays).sum(axis=1)) / lengths
    tint = np.tile(decode_gamma2(np.array(rgba[:3], np.uint8)), (len(rows), 1))
    level, stored = levels(reflectance, cosine, tint.mean(axis=1), np.full(len(rows), body / 255.0), np.ones(len(rows)))
    alpha = dump.rgba[np.flatnonzero(np.isin(np.repeat(np.arange(dump.pixels), dump.counts), pixels[sure])), 3]
    assert len(alpha) == len(rows) > 500
    assert np.ptp(alpha) > 80, "the sphere is seen from every angle"
    assert np.abs(alpha - level).max() <= ROUNDING
    assert (alpha == stored).mean() > 0.98


def test_the_core_the_tail_and_the_dump_have_the_same_glass(gl: moderngl.Context) -> None:
    frame = Frame(GpuScene(gl, with_glass(shells(subdivisions=1))), VIEW, 96, 72, float_sums=True)
    dump = capture(frame).dump
    k = np.minimum(np.arange(dump.pixels) % 5, dump.counts).astype(np.int32)
    for chain in ("two-pass", "one-pass") if _one_pass(gl) else ("two-pass",):
        rendered = KBufferOptimal(lambda *_: k).render(frame, Budget(0, "binned-12", chain=chain))  # type: ignore[arg-type]
        simulated = composite(dump, k, "binned-12").reshape(rendered.linear.shape)
        np.testing.assert_allclose(rendered.linear, simulated, atol=3e-6, rtol=0)
    assert np.array_equal(capture(frame).dump.rgba, dump.rgba)


def _one_pass(gl: moderngl.Context) -> bool:
    from renderer.techniques.chain import one_pass_available

    return one_pass_available(gl)


@pytest.mark.parametrize("threshold", [0.0, 0.5])
@pytest.mark.parametrize("has_presence", [True, False])
def test_textured_glass_is_where_the_rays_say(gl: moderngl.Context, threshold: float, has_presence: bool) -> None:
    rng = np.random.default_rng(2)
    pixels = rng.integers(0, 256, (8, 8, 4)).astype(np.uint8)
    pixels[:3, :, 3], pixels[3:5, :, 3] = 0, 255
    scene = solid(
        trimesh.creation.box((3.0, 2.0, 0.4)),
        (255, 255, 255, 0 if has_presence else 255),
        layer="mixed",
        opacity_texture=0,
        opacity_threshold=threshold if has_presence else 0.0,
        reflectance=(0.04, 1.0),
        has_presence_texture=has_presence,
    )
    scene = replace(scene, textures=(Texture("t", pixels, False, ("repeat", "clamp")),))
    tally = shoot(GpuScene(gl, scene), None, VIEW, Effort(SIZE, pixels=800), seed=1)
    assert tally.unexplained == []
    assert tally.fragments > 200
    assert tally.opaque == 0 if has_presence else tally.opaque > 20


def test_glass_among_other_surfaces_is_where_the_rays_say(gl: moderngl.Context) -> None:
    scene = with_glass(shells(layers=3, duplicates=1))
    kept = tuple(batch for batch in scene.batches if batch.layer == "opaque" or batch.reflectance is not None)
    scene = replace(scene, batches=kept)  # each triangle once, which is what rays count
    tally = shoot(GpuScene(gl, scene), None, VIEW, Effort(SIZE, pixels=600), seed=1)
    assert tally.unexplained == []
