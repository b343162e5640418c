"""GL passes against the dump of the same frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from labeller.curves import composite
from renderer.bands import row_bands
from renderer.capture import capture
from renderer.csr import offsets_of
from renderer.culling import Ranges
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.samples import SAMPLES
from renderer.scene import load_scene
from renderer.techniques import Budget, SBuffer
from renderer.views import scene_views
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.scene import Batch


def test_dump_is_sorted_by_depth_then_colour_inside_every_pixel(dump: FragmentDump) -> None:
    keys = dump.depth.view(np.uint32).astype(np.uint64) << np.uint64(32) | dump.rgba.view("<u4").ravel()
    rising = keys[1:] >= keys[:-1]
    first = np.zeros(dump.total, dtype=bool)
    first[dump.offsets[:-1][dump.counts > 0]] = True
    assert (rising | first[1:]).all()
    assert dump.total > 10_000


def test_dump_holds_no_invisible_and_no_opaque_fragment(dump: FragmentDump) -> None:
    alpha = dump.rgba[:, 3]
    assert alpha.min() > 0
    assert alpha.max() < 255


def test_equal_depths_are_in_the_dump(dump: FragmentDump) -> None:
    ties = (dump.depth[1:] == dump.depth[:-1]).mean()
    assert ties > 0.3, "the scene has every sphere twice, else the ties below test nothing"


def test_dump_is_identical_from_frame_to_frame_and_for_any_bands(
    ctx: moderngl.Context, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    again = capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE)).dump
    for module in ("capture", "fragment_list"):
        monkeypatch.setattr(f"renderer.{module}.CAPACITY", 20_000)
    split = capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE))
    assert split.bands > 1
    monkeypatch.setattr("renderer.capture._PIXELS", 4000)
    narrow = capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE))
    assert narrow.bands >= SIZE[0] * SIZE[1] // 4000
    for other in (again, split.dump, narrow.dump):
        _assert_same(dump, other)


def test_a_list_that_was_guessed_too_short_is_made_longer_once(
    ctx: moderngl.Context, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("renderer.capture._GUESS", 0)
    gpu = GpuScene(ctx, shells())
    first, second = (capture(Frame(gpu, VIEW, *SIZE)) for _ in range(2))
    assert (first.repeated, second.repeated) == (1, 0)
    assert dump.total <= gpu.fragment_list.capacity < 16 * dump.total
    _assert_same(dump, first.dump)
    _assert_same(dump, second.dump)


def test_a_view_whose_fragments_are_all_in_one_tile_is_captured_with_one_cursor(
    ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = (60, 48)
    expected = capture(Frame(GpuScene(ctx, shells()), VIEW, *size))
    for module in ("capture", "fragment_list"):
        monkeypatch.setattr(f"renderer.{module}.CAPACITY", 2 * expected.dump.total)
    squeezed = capture(Frame(GpuScene(ctx, shells()), VIEW, *size))
    assert (squeezed.repeated, squeezed.bands) == (1, 1)
    _assert_same(expected.dump, squeezed.dump)


def test_a_row_with_more_than_a_list_holds_is_refused(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("capture", "fragment_list"):
        monkeypatch.setattr(f"renderer.{module}.CAPACITY", 100)
    with pytest.raises(Problem, match="alone has"):
        capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE))


def test_capture_and_sbuffer_have_the_same_fragments(frame: Frame, dump: FragmentDump) -> None:
    rendered = SBuffer().render(frame, Budget(1))
    assert np.array_equal(rendered.k, dump.counts)
    exact = composite(dump, dump.counts.astype(np.int32), "density", 0.0).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, exact, atol=1e-6)


def test_triangles_outside_the_frustum_are_left_out_and_the_dump_stays_the_same(ctx: moderngl.Context) -> None:
    near = VIEW.model_copy(update={"eye": (0.0, 0.0, 9.0), "target": (1.5, 0.0, 0.0), "fov": 4.0})
    gpu = GpuScene(ctx, shells(subdivisions=4))
    culled = Frame(gpu, near, *SIZE)
    assert 0 < culled.culled_triangles < len(gpu.scene.indices) // 3
    gpu.clusters = _Everything(gpu.scene.batches)
    whole = Frame(gpu, near, *SIZE)
    assert whole.culled_triangles == 0
    _assert_same(capture(whole).dump, capture(culled).dump)


def test_a_cleared_texture_is_zero_everywhere_after_a_pass_over_some_rows(ctx: moderngl.Context, frame: Frame) -> None:
    texture = ctx.texture(SIZE, 4, data=np.ones(4 * frame.pixels, dtype=np.float32).tobytes(), dtype="f4")
    frame.draw_transparent("hidden/hidden.frag", frame.target([]), scissor=(3, 5))
    frame.zero(texture)
    assert not np.frombuffer(texture.read(), dtype=np.float32).any()


def test_hidden_fragments_are_those_that_only_the_opaque_depth_removes(ctx: moderngl.Context, frame: Frame) -> None:
    scene = shells()
    glass = [batch for batch in scene.batches if batch.layer != "opaque"]
    without_cube = Frame(GpuScene(ctx, replace(scene, batches=tuple(glass))), VIEW, *SIZE)
    # The card's own solid texels hide fragments in both frames.
    card = hidden_fragments(without_cube)
    cube = int(without_cube.count().sum()) - int(frame.count().sum())
    assert hidden_fragments(frame) == card + cube
    assert cube > 100
    assert card > 100


class _Everything:
    def __init__(self, runs: tuple[Batch, ...]) -> None:
        self._runs = [[(batch.first // 3, batch.count // 3)] for batch in runs]

    def visible(self, *_: np.ndarray) -> tuple[list[Ranges], int]:
        return self._runs, 0


def _assert_same(dump: FragmentDump, other: FragmentDump) -> None:
    for field in ("offsets", "rgba", "depth", "background", "facing", "tile_range"):
        assert np.array_equal(getattr(dump, field), getattr(other, field)), field


def test_row_bands_cover_every_fragment_once_within_capacity() -> None:
    counts = np.random.default_rng(1).integers(0, 9, 12 * 10)
    offsets = offsets_of(counts)
    bands = row_bands(offsets, 12, 130)
    sizes = [offsets[(row + rows) * 12] - offsets[row * 12] for row, rows in bands]
    assert sum(sizes) == offsets[-1]
    assert max(sizes) <= 130


def test_ranges_of_pixels_and_what_the_density_tail_reads_equal_those_of_the_dump(
    frame: Frame, dump: FragmentDump
) -> None:
    occupied, first, end = dump.counts > 0, dump.offsets[:-1], dump.offsets[1:]
    n, z_min, z_max = (np.frombuffer(buffer.read(), dtype=np.uint32)[: dump.pixels] for buffer in frame.depth_range())
    assert np.array_equal(n, dump.counts)
    assert np.array_equal(z_min.view(np.float32)[occupied], dump.depth[first[occupied]])
    assert np.array_equal(z_max.view(np.float32)[occupied], dump.depth[end[occupied] - 1])
    alpha, pixel = dump.rgba[:, 3] / 255.0, np.repeat(np.arange(dump.pixels), dump.counts)
    sums = [np.ones(dump.total), alpha, alpha * alpha, -np.log(1.0 - alpha)]
    expected = np.stack([np.bincount(pixel, weights, dump.pixels) for weights in sums], axis=1)
    texels = np.frombuffer(frame.gather_density().read(), dtype=np.float32).reshape(-1, 4)
    np.testing.assert_allclose(texels, expected, rtol=2e-5, atol=2e-5)


def test_ranges_of_tiles_are_in_front_of_an_eye_that_is_inside_of_a_scene(
    ctx: moderngl.Context, tmp_path: Path
) -> None:
    scene = load_scene(SAMPLES["voxel_town"](tmp_path))
    inside = scene_views(scene, 2, 0)[1]
    found = capture(Frame(GpuScene(ctx, scene), inside, 715, 480)).dump.tile_range
    assert found is not None
    nearest, farthest = found.T
    assert (nearest >= 0.0).all()
    assert (farthest >= nearest).all()


def test_facing_is_that_of_the_nearest_fragment(frame: Frame, dump: FragmentDump) -> None:
    facing = np.frombuffer(frame.gather_facing().read(), dtype=np.uint32)[: dump.pixels]
    assert np.array_equal(facing, dump.facing)
    assert facing.any()
