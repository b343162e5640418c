"""Every technique that keeps fragments apart, on random triangles under awkward cameras: holes, repeats, any scale."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np
import pytest

from labeller.curves import composite
from renderer import culling
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.programs import Programs
from renderer.reference import exact
from renderer.techniques import TECHNIQUES, Budget, KBuffer, KBufferDynamic, KBufferImportance, technique
from schemas.fragments import FragmentDump
from schemas.limits import Limits
from schemas.scene import Batch, Layer, SceneArrays, Texture
from schemas.view import View

CLEAR = (0.3, 0.6, 0.9)
BOUNDED = (KBuffer(), KBufferDynamic(), KBufferImportance())
ALPHAS = (1, 2, 84, 128, 253, 254)


@dataclass(frozen=True)
class Hard:
    """A scene of random triangles in the cube -1..1, times `scale`, and a camera in the same unit.

    Attributes:
        layers: Each gets its share of the triangles; those that are not opaque are drawn twice.
        flat: Triangles face the axis z at few distances, so that depths tie.
    """

    layers: tuple[Layer, ...]
    size: tuple[int, int]
    triangles: int = 60
    scale: float = 1.0
    flat: bool = False
    eye: tuple[float, float, float] = (0.3, 0.4, 3.0)
    fov: float = 50.0
    parallel: bool = False
    shift: tuple[float, float] = (0.0, 0.0)


CASES = {
    "holes and glass": Hard(("mixed",), (33, 20), flat=True),
    "all layers, a lens shifted": Hard(("transparent", "mixed", "opaque"), (33, 40), shift=(0.4, -0.3)),
    "parallel rays": Hard(("transparent", "mixed", "opaque"), (17, 5), parallel=True, shift=(0.2, 0.1), flat=True),
    "among ten million metres": Hard(("transparent", "mixed"), (20, 33), scale=1e7, eye=(0.1, 0.1, 0.2), fov=110.0),
    "a micrometre": Hard(("transparent", "opaque"), (16, 16), scale=1e-6),
    "one pixel": Hard(("transparent", "mixed"), (1, 1), triangles=900),
    "one row": Hard(("mixed", "transparent"), (50, 1), triangles=200, fov=5.0),
}


def scene_of(hard: Hard) -> SceneArrays:
    rng = np.random.default_rng(5)
    corners = rng.uniform(-1.0, 1.0, (hard.triangles, 3, 3))
    if hard.flat:
        corners[:, :, 2] = 0.25 * rng.integers(-2, 3, (hard.triangles, 1))
    colours = np.repeat(rng.integers(0, 256, (hard.triangles, 4)), 3, axis=0).astype(np.uint8)
    colours[:, 3] = np.repeat(rng.choice(ALPHAS, hard.triangles), 3)
    batches: list[Batch] = []
    for share, layer in zip(np.array_split(np.arange(hard.triangles), len(hard.layers)), hard.layers, strict=True):
        if layer != "transparent":
            colours[3 * share[0] : 3 * (share[-1] + 1), 3] = 255
        batch = Batch(first=3 * int(share[0]), count=3 * len(share), layer=layer)
        batches += [batch] if layer == "opaque" else 2 * [replace(batch, opacity_texture=0 if layer == "mixed" else -1)]
    texels = rng.integers(1, 255, (8, 8, 4)).astype(np.uint8)
    texels[:6, :, 3], texels[6:7, :, 3] = 0, 255
    return flat_scene(hard.scale * corners, colours, tuple(batches), Texture("t", texels, False, ("mirror", "black")))


def flat_scene(corners: np.ndarray, colours: np.ndarray, batches: tuple[Batch, ...], *textures: Texture) -> SceneArrays:
    positions = corners.reshape(-1, 3).astype(np.float32)
    return SceneArrays(
        name="hard",
        positions=positions,
        normals=np.tile(np.array([0.0, 0.0, 1.0], dtype=np.float32), (len(positions), 1)),
        uvs=np.random.default_rng(6).uniform(-0.5, 1.5, (len(positions), 2)).astype(np.float32),
        colours=colours,
        indices=np.arange(len(positions), dtype=np.uint32),
        batches=batches,
        textures=textures,
        origin=np.zeros(3),
        bounds=np.stack([positions.min(axis=0), positions.max(axis=0)]).astype(np.float64),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )


def view_of(hard: Hard) -> View:
    eye = (hard.scale * hard.eye[0], hard.scale * hard.eye[1], hard.scale * hard.eye[2])
    height = 1.5 * hard.scale if hard.parallel else None
    return View(
        name="hard", eye=eye, target=(0, 0, 0), up=(0, 1, 0), fov=hard.fov, ortho_height=height, shift=hard.shift
    )


@pytest.fixture(scope="module", params=list(CASES))
def case(request: pytest.FixtureRequest, gl: moderngl.Context) -> tuple[Frame, FragmentDump]:
    hard = CASES[request.param]
    gpu = GpuScene(gl, scene_of(hard))
    gpu.programs = _shared(gl)  # compiled once for all scenes
    frame = Frame(gpu, view_of(hard), *hard.size, clear=CLEAR, float_sums=True)
    dump = capture(frame).dump
    assert dump.total > 30 or hard.size == (1, 1)
    return frame, dump


_PROGRAMS: dict[int, Programs] = {}


def _shared(gl: moderngl.Context) -> Programs:
    return _PROGRAMS.setdefault(id(gl), GpuScene(gl, scene_of(CASES["one pixel"])).programs)


@pytest.mark.parametrize("name", [name for name, entry in TECHNIQUES.items() if entry.family == "exact"])
def test_exact_techniques_are_exact__name(case: tuple[Frame, FragmentDump], name: str) -> None:
    frame, dump = case
    truth = exact.picture(dump).reshape(frame.height, frame.width, 3)
    np.testing.assert_allclose(technique(name).render(frame, Budget(0)).linear, truth, atol=2e-6, rtol=0)


@pytest.mark.parametrize("name", [one.name for one in BOUNDED])
def test_bounded_techniques_spend_at_most_their_budget_and_look_as_simulated__name(
    case: tuple[Frame, FragmentDump], name: str
) -> None:
    frame, dump = case
    n = dump.counts
    for budget in sorted({0, 1, dump.total // 3, dump.total - 1, dump.total, 2 * dump.total, 10**12}):
        rendered = technique(name).render(frame, Budget(budget))
        assert ((rendered.k >= 0) & (rendered.k <= n)).all()
        assert rendered.k.sum() == rendered.captured <= budget
        if budget >= n.max() * dump.pixels or (budget >= dump.total and name != KBuffer.name):
            assert np.array_equal(rendered.k, n)
        simulated = composite(dump, rendered.k).reshape(rendered.linear.shape)
        np.testing.assert_allclose(rendered.linear, simulated, atol=1e-5, rtol=0, err_msg=f"{budget} of {dump.total}")


def test_approximate_techniques_make_no_light(case: tuple[Frame, FragmentDump]) -> None:
    frame, _ = case
    for name in [name for name, entry in TECHNIQUES.items() if entry.family == "approximate"]:
        linear = technique(name).render(frame, Budget(0)).linear
        assert linear.min() >= 0.0, name
        assert linear.max() <= 1.0 + 1e-5, name


def test_culling_allows_for_what_float32_positions_far_from_the_origin_lose(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culling, "CLUSTER", 2)
    rng = np.random.default_rng(20)
    there = np.array([1e7, 3e6, -5e6])
    around = rng.uniform(-3, 3, (200, 1, 3)) + rng.uniform(-0.3, 0.3, (200, 3, 3))
    corners = np.concatenate([there + around, -there + around])
    colours = np.tile(np.array([200, 90, 40, 128], dtype=np.uint8), (3 * len(corners), 1))
    batch = Batch(first=0, count=3 * len(corners), layer="transparent")
    gpu = GpuScene(gl, flat_scene(corners, colours, (batch,)))
    gpu.programs = _shared(gl)
    for number in range(12):
        eye = there + rng.uniform(-4, 4, 3)
        fov = float(rng.uniform(10, 60))
        view = View(name="far", eye=tuple(eye), target=tuple(there), up=(0, 1, 0), fov=fov, far=20.0)
        culled = Frame(gpu, view, 64, 48)
        assert culled.culled_triangles >= 200, "what is at the other end"
        with monkeypatch.context() as patch:
            patch.setattr(gpu.clusters, "visible", lambda *_: ([[(0, len(corners))]], 0))
            whole = Frame(gpu, view, 64, 48)
        ours, all_of_it = capture(culled).dump, capture(whole).dump
        assert np.array_equal(ours.offsets, all_of_it.offsets), number
        assert np.array_equal(ours.depth, all_of_it.depth), number


def test_one_triangle_of_holes_glass_and_solid_parts_hides_nothing(gl: moderngl.Context) -> None:
    corners = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], dtype=np.float64)
    alpha = np.zeros((4, 4, 4), dtype=np.uint8)
    alpha[:2, :, 3], alpha[2:, :, 3] = 255, 128
    batch = Batch(first=0, count=3, layer="mixed", opacity_texture=0)
    scene = flat_scene(
        corners, np.full((3, 4), 255, np.uint8), (batch,), Texture("t", alpha, False, ("clamp", "clamp"))
    )
    frame = Frame(GpuScene(gl, scene), view_of(Hard((), (1, 1))), 64, 48, clear=(0.0, 0.0, 0.0))
    solid = np.frombuffer(frame.background.read(), dtype=np.uint8).reshape(-1, 4)[:, :3].any(axis=1)
    assert solid.any()
    assert frame.count().any()
    assert hidden_fragments(frame) == 0, "a solid part is no transparent fragment behind itself"


def test_the_sbuffer_in_bands_of_rows_is_the_same_picture(
    case: tuple[Frame, FragmentDump], monkeypatch: pytest.MonkeyPatch
) -> None:
    frame, dump = case
    whole = technique("sbuffer").render(frame, Budget(0)).linear
    rows = np.add.reduceat(dump.counts, np.arange(0, dump.pixels, dump.width))
    monkeypatch.setattr("renderer.techniques.bands.LIMITS", Limits(buffer_bytes=8 * int(rows.max())))
    assert np.array_equal(technique("sbuffer").render(frame, Budget(0)).linear, whole)
