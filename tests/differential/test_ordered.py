"""The capture in order of submission, and the techniques that depend on it against their float64 twins."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.bands import row_bands
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference import adaptive, bevy, multilayer, storm_rules
from renderer.reference.arrivals import arriving
from renderer.techniques import Adaptive, Bevy, Budget, Multilayer, SBuffer, StormRules, Technique, bands
from renderer.techniques.bands import Part
from renderer.techniques.ordered import EnginePool, Ordered, capture_ordered
from renderer.techniques.runs import Runs
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.view import View

INSIDE = View(name="inside", eye=(0.3, 0.2, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=80.0)
"""Among the shells: many triangles are clipped, others left out."""


@pytest.fixture(scope="module")
def fragments(frame: Frame) -> Ordered:
    return capture_ordered(frame)


def pixels_of(offsets: np.ndarray) -> np.ndarray:
    return np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))


def picture(twin: ModuleType, fragments: Ordered, dump: FragmentDump, nodes: int) -> np.ndarray:
    made = twin.picture(fragments.offsets, fragments.packed, fragments.depth, dump.background, nodes)
    return made.reshape(dump.height, dump.width, 3)


def test_same_fragments_as_the_dump(fragments: Ordered, dump: FragmentDump) -> None:
    assert np.array_equal(fragments.offsets, dump.offsets)
    order = np.lexsort((fragments.packed, fragments.depth, pixels_of(dump.offsets)))
    assert np.array_equal(fragments.packed[order], dump.rgba.view("<u4").ravel())
    assert np.array_equal(fragments.depth[order], dump.depth)


@pytest.mark.parametrize("view", [VIEW, INSIDE], ids=lambda view: view.name)
def test_rank_names_the_triangle_and_rises_inside_every_pixel(gl: moderngl.Context, view: View) -> None:
    scene = shells()
    frame = Frame(GpuScene(gl, scene), view, *SIZE)
    found = capture_ordered(frame)
    pixel = pixels_of(found.offsets)
    rank = found.rank.astype(np.int64)
    assert ((np.diff(rank) > 0) | (np.diff(pixel) > 0)).all()
    # The ray of a pixel meets the plane of the triangle at the fragment's depth.
    to_view = view.world_to_view()
    corners = scene.positions[scene.indices.reshape(-1, 3)[rank]] @ to_view[:3, :3].T + to_view[:3, 3]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    half = np.tan(np.radians(view.fov) / 2.0)
    x = ((pixel % frame.width + 0.5) / frame.width * 2.0 - 1.0) * half * frame.width / frame.height
    y = (1.0 - (pixel // frame.width + 0.5) / frame.height * 2.0) * half
    ray = np.stack([x, y, -np.ones_like(x)], axis=1)
    depth = (normal * corners[:, 0]).sum(axis=1) / (normal * ray).sum(axis=1)
    np.testing.assert_allclose(found.depth, depth, rtol=1e-4)


def test_order_of_arrival_in_the_pool_does_not_matter(
    frame: Frame, fragments: Ordered, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A software driver happens to run fragments in order of submission; others do not.
    changed: list[bool] = []

    def shuffled(runs: Runs, part: Part) -> moderngl.Buffer:
        pool = kept(runs, part)
        words = np.frombuffer(pool.read(), dtype=np.uint32).reshape(-1, 3)
        order = np.lexsort((np.random.default_rng(2).random(len(words)), pixels_of(fragments.offsets)))
        pool.write(np.ascontiguousarray(words[order]))
        changed.append(not np.array_equal(words[order], words))
        return pool

    kept = Runs.capture
    monkeypatch.setattr(Runs, "capture", shuffled)
    again = capture_ordered(frame)
    assert changed == [True]
    for field in ("packed", "depth", "rank"):
        assert np.array_equal(getattr(again, field), getattr(fragments, field)), field


@pytest.mark.parametrize(
    "technique", [Multilayer(), Adaptive(), Bevy(), StormRules()], ids=lambda technique: technique.name
)
def test_bands_of_rows_give_the_same_picture__technique(
    frame: Frame, fragments: Ordered, monkeypatch: pytest.MonkeyPatch, technique: Technique
) -> None:
    whole = technique.render(frame, Budget(0))
    limits = replace(LIMITS, buffer_bytes=60_000)
    monkeypatch.setattr(bands, "LIMITS", limits)
    split: list[tuple[int, int]] = []
    monkeypatch.setattr(bands, "row_bands", lambda *args: split.extend(row_bands(*args)) or split)
    assert np.array_equal(technique.render(frame, Budget(0)).linear, whole.linear)
    assert len(split) > 2


@pytest.mark.parametrize("nodes", [1, 2, 4, 8])
def test_multilayer_equals_its_twin__nodes(frame: Frame, dump: FragmentDump, fragments: Ordered, nodes: int) -> None:
    rendered = Multilayer(nodes).render(frame, Budget(0))
    np.testing.assert_allclose(rendered.linear, picture(multilayer, fragments, dump, nodes), atol=1e-6, rtol=0)
    assert np.array_equal(rendered.k, np.minimum(dump.counts, nodes))


@pytest.mark.parametrize("nodes", [2, 4, 8, 16])
def test_adaptive_equals_its_twin__nodes(frame: Frame, dump: FragmentDump, fragments: Ordered, nodes: int) -> None:
    # 1e-6 in every pixel: both sides remove the same nodes.
    rendered = Adaptive(nodes).render(frame, Budget(0))
    np.testing.assert_allclose(rendered.linear, picture(adaptive, fragments, dump, nodes), atol=1e-6, rtol=0)
    assert np.array_equal(rendered.k, np.minimum(dump.counts, nodes))


ENGINES: dict[str, tuple[Technique, ModuleType]] = {
    "bevy": (Bevy(), bevy),
    "storm-rules": (StormRules(), storm_rules),
}


def with_slots(monkeypatch: pytest.MonkeyPatch, name: str, slots: int) -> None:
    module = f"renderer.techniques.{name.replace('-', '_')}"
    monkeypatch.setattr(f"{module}.POOL", EnginePool(slots, pixel_bytes=1))


@pytest.mark.parametrize("slots", [1, 2, 100])
@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_equals_its_twin__name_slots(
    frame: Frame, dump: FragmentDump, fragments: Ordered, monkeypatch: pytest.MonkeyPatch, name: str, slots: int
) -> None:
    technique, twin = ENGINES[name]
    with_slots(monkeypatch, name, slots)
    left = arriving(fragments, slots * frame.pixels)
    assert len(left.rank) == min(slots * frame.pixels, dump.total)
    rendered = technique.render(frame, Budget(0))
    np.testing.assert_allclose(rendered.linear, picture(twin, left, dump, 8), atol=1e-6, rtol=0)
    assert ("arrivals" in rendered.passes) == (slots < 100)
    assert np.array_equal(rendered.k, np.minimum(dump.counts, 8))


def test_a_full_pool_loses_the_last_triangles_and_cuts_one_by_pixel(frame: Frame, fragments: Ordered) -> None:
    slots = 2 * frame.pixels
    left = arriving(fragments, slots)
    lost = len(fragments.rank) - slots
    last = np.sort(fragments.rank)[slots - 1]
    assert lost > 0
    assert left.rank.max() == last
    cut = pixels_of(fragments.offsets)[fragments.rank == last]
    kept = pixels_of(left.offsets)[left.rank == last]
    assert 0 < len(kept) < len(cut)
    assert kept.max() < np.setdiff1d(cut, kept).min()


@pytest.mark.parametrize("name", ENGINES)
def test_a_pixel_of_no_more_than_eight_is_exact_while_the_pool_lasts__name(
    frame: Frame, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    with_slots(monkeypatch, name, 100)
    exact = SBuffer().render(frame, Budget(0)).linear
    untied = untied_pixels(dump).reshape(exact.shape[:2])
    few = (dump.counts <= 8).reshape(exact.shape[:2]) & untied
    found = ENGINES[name][0].render(frame, Budget(0)).linear
    assert few.sum() > 100
    np.testing.assert_allclose(found[few], exact[few], atol=1e-6, rtol=0)
    assert np.abs(found - exact)[~few].max() > 0.01


def untied_pixels(dump: FragmentDump) -> np.ndarray:
    """Pixels without fragments of equal depth, which engines order otherwise."""
    pixel = pixels_of(dump.offsets)
    tied = (np.diff(dump.depth) == 0) & (np.diff(pixel) == 0)
    return np.bincount(pixel[1:][tied], minlength=dump.pixels) == 0


@pytest.mark.parametrize("technique", [Multilayer(16), Adaptive(16)], ids=lambda technique: technique.name)
def test_a_node_for_every_fragment_is_exact__technique(frame: Frame, dump: FragmentDump, technique: Technique) -> None:
    exact = SBuffer().render(frame, Budget(0)).linear
    enough = (dump.counts <= 16).reshape(exact.shape[:2])
    assert (~enough).any()
    np.testing.assert_allclose(technique.render(frame, Budget(0)).linear[enough], exact[enough], atol=1e-6, rtol=0)


def test_four_layers_are_nearer_to_exact_than_two(frame: Frame) -> None:
    exact = SBuffer().render(frame, Budget(0)).linear
    two, four = (np.abs(Multilayer(nodes).render(frame, Budget(0)).linear - exact).mean() for nodes in (2, 4))
    assert four < 0.5 * two


@pytest.mark.parametrize("technique", [Multilayer(), Adaptive(), StormRules()], ids=lambda technique: technique.name)
def test_a_picture_is_identical_from_frame_to_frame__technique(
    gl: moderngl.Context, frame: Frame, technique: Technique
) -> None:
    again = Frame(GpuScene(gl, shells()), VIEW, *SIZE)
    assert np.array_equal(technique.render(frame, Budget(0)).linear, technique.render(again, Budget(0)).linear)


@pytest.mark.parametrize("name", ENGINES)
def test_memory_is_what_the_engine_takes__name(frame: Frame, name: str) -> None:
    rendered = ENGINES[name][0].render(frame, Budget(0))
    assert rendered.compared_bytes == {"bevy": 52, "storm-rules": 196}[name] * frame.pixels


@pytest.mark.parametrize("technique", [Multilayer(), Adaptive()], ids=lambda technique: technique.name)
def test_passes_bytes_and_skips_are_reported__technique(frame: Frame, dump: FragmentDump, technique: Technique) -> None:
    rendered = technique.render(frame, Budget(0))
    assert list(rendered.passes) == ["opaque", "count", "prefix", "capture", "sort", "resolve"]
    assert rendered.pool_bytes == 12 * dump.total
    assert rendered.total_bytes == 12 * dump.total + 4 * frame.pixels
    nodes = {"multilayer": 4, "adaptive": 8}[technique.name]
    assert rendered.node_bytes == 8 * nodes
    assert rendered.compared_bytes == 8 * nodes * frame.pixels
    assert rendered.skips["empty tiles"] > 0


@pytest.mark.parametrize(("made", "nodes"), [(Multilayer, 0), (Multilayer, 17), (Adaptive, 1), (Adaptive, 17)])
def test_nodes_out_of_range_are_a_problem(made: type[Multilayer | Adaptive], nodes: int) -> None:
    with pytest.raises(Problem, match=f"{nodes} nodes per pixel"):
        made(nodes)


def test_a_run_too_long_for_the_shaders_is_a_problem(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "MOST_FRAGMENTS", 10)
    with pytest.raises(Problem, match="transparent fragments") as caught:
        Adaptive().render(frame, Budget(0))
    assert caught.value.code is ExitCode.LIMIT
