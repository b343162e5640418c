"""Depth bins on the GPU: where they lie, what is kept of them, fragments by bin, and the features made of it all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.scenes import SIZE, VIEW, shells
from support.training import export_random, random_weights

from labeller import reference
from labeller.curves import composite
from renderer.allocation.cuts import FULL
from renderer.bin_pass import Binned
from renderer.capture import capture
from renderer.depth_bins import OPTICAL, bin_form, keep_bins, kept_room, place_of
from renderer.features import FEATURES, LUMA_SUMS, SUMS, derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.programs import expand
from renderer.techniques import KBufferDeep, technique
from renderer.techniques.base import Budget
from renderer.tile_range import pixel_ranges, tile_grid, tile_ranges
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import Problem
from schemas.tail import (
    BINNED_TAILS,
    LUMA_SHIFT,
    LUMA_SQUARE_SHIFT,
    OPTICAL_UNIT,
    RANGE_TILE,
    TAILS,
    Tail,
    TailName,
)

SIZES = [(160, 120), (61, 45), (8, 8), (7, 5), (1, 1), (130, 3)]
"""The shared frame's, and such as are not whole tiles."""
AWAY = VIEW.model_copy(update={"target": (VIEW.eye[0], VIEW.eye[1], 2.0 * VIEW.eye[2])})
"""A view of nothing."""
NO_LUMA = tuple(name for name in FEATURES if not name.startswith("luma_"))


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


def words_of(binned: Binned) -> NDArray[np.int64]:
    """int64 [P, B], what is kept of the bins."""
    return binned.kept().astype(np.int64)


def expected_words(dump: FragmentDump, tail: Tail) -> NDArray[np.int64]:
    """The same of a dump, by the compiled account."""
    ranges, kept, form = pixel_ranges(dump), kept_room(), bin_form(tail)
    words = np.zeros((dump.pixels, tail.bins), dtype=np.int64)
    for p in np.flatnonzero(dump.counts):
        part = slice(dump.offsets[p], dump.offsets[p + 1])
        units = keep_bins(form, dump.depth[part], dump.rgba[part], ranges.nearest[p], ranges.extent[p], kept)
        shares = np.rint(tail.share_levels * kept.front[1 : tail.bins]).astype(np.int64)
        means = np.rint(tail.mean_levels * kept.mean[: tail.bins - 1]).astype(np.int64)
        words[p, :-1] = shares << 8 | means
        words[p, -1] = int(units)
    return words


def plain_words(dump: FragmentDump, p: int, tail: Tail) -> list[int]:
    """The same of one pixel, by the plain account."""
    pixel = reference.pixel_of(dump, p)
    found = reference.depth_bins(pixel, OPTICAL[np.rint(255.0 * pixel.alpha).astype(int)], tail)
    shares = [round(tail.share_levels * share) for share in found.front[1 : tail.bins]]
    means = [round(tail.mean_levels * mean) for mean in found.mean[: tail.bins - 1]]
    return [*(share << 8 | mean for share, mean in zip(shares, means, strict=True)), found.units]


def bins_of(dump: FragmentDump, tail: Tail) -> NDArray[np.int64]:
    """int64 [N], the bin of every fragment."""
    ranges, pixel = pixel_ranges(dump), np.repeat(np.arange(dump.pixels), dump.counts)
    places = [
        place_of(z, low, extent, tail.bins)
        for z, low, extent in zip(dump.depth, ranges.nearest[pixel], ranges.extent[pixel], strict=True)
    ]
    return np.minimum(np.array(places, dtype=np.float32).astype(np.int64), tail.bins - 1)


def counted(dump: FragmentDump, tail: Tail) -> NDArray[np.int64]:
    """int64 [P, B], fragments of each bin; FULL for that many or more."""
    pixel = np.repeat(np.arange(dump.pixels), dump.counts)
    found = np.zeros((dump.pixels, tail.bins), dtype=np.int64)
    np.add.at(found, (pixel, bins_of(dump, tail)), 1)
    return np.minimum(found, FULL)


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_what_is_kept_of_the_bins_is_what_the_dump_says(gpu: GpuScene, tail: TailName, size: tuple[int, int]) -> None:
    frame = Frame(gpu, VIEW, *size)
    dump, row = capture(frame).dump, TAILS[tail]
    words = words_of(frame.gather_bins(tail))
    assert np.array_equal(words, expected_words(dump, row))
    some = np.random.default_rng(1).choice(np.flatnonzero(dump.counts), min(40, np.count_nonzero(dump.counts)), False)
    assert [words[p].tolist() for p in some] == [plain_words(dump, p, row) for p in some]


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("size", [(61, 45), (7, 5)], ids=str)
def test_fragments_are_counted_by_bin(gpu: GpuScene, tail: TailName, size: tuple[int, int]) -> None:
    frame = Frame(gpu, VIEW, *size)
    dump = capture(frame).dump
    for luma in (False, True):
        binned = frame.gather_bins(tail, luma=luma)
        assert np.array_equal(binned.counts(), counted(dump, TAILS[tail]))
        assert np.array_equal(words_of(binned), expected_words(dump, TAILS[tail])), "whatever is gathered beside them"


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_what_is_kept_is_the_same_from_run_to_run(gpu: GpuScene, tail: TailName) -> None:
    first, again = (Frame(gpu, VIEW, *SIZE).gather_bins(tail, luma=True) for _ in range(2))
    assert np.array_equal(first.read(), again.read())


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_ranges_are_of_the_picture_s_tiles_and_hold_most_of_their_fragments(
    gpu: GpuScene, size: tuple[int, int]
) -> None:
    dump = capture(Frame(gpu, VIEW, *size)).dump
    columns, rows = tile_grid(*size)
    assert dump.tile_range is not None
    assert dump.tile_range.shape == (columns * rows, 2)
    assert (dump.tile_range[:, 0] <= dump.tile_range[:, 1]).all()
    ranges, pixel = pixel_ranges(dump), np.repeat(np.arange(dump.pixels), dump.counts)
    x, y = np.arange(dump.pixels) % size[0], np.arange(dump.pixels) // size[0]
    own = dump.tile_range[y // RANGE_TILE * columns + x // RANGE_TILE]
    assert np.array_equal(ranges.nearest, own[:, 0])
    assert np.array_equal(ranges.extent, own[:, 1] - own[:, 0])
    if size == SIZE:
        inside = (dump.depth >= own[pixel, 0]) & (dump.depth <= own[pixel, 1])
        assert inside.mean() > 0.95, "an estimate from one pixel of sixteen"


def test_without_a_fragment_there_are_no_ranges_and_the_picture_is_the_background(gpu: GpuScene) -> None:
    frame = Frame(gpu, AWAY, 61, 45)
    dump = capture(frame).dump
    assert dump.total == 0
    assert not tile_ranges(dump).any()
    for tail in BINNED_TAILS:
        assert not frame.gather_bins(tail, luma=True).read().any()
    exact = composite(dump, dump.counts).reshape(45, 61, 3)
    for name in ("binned", "kbuffer", "kbuffer-importance"):
        np.testing.assert_allclose(technique(name).render(frame, Budget(10)).linear, exact, atol=1e-6, rtol=0)


@pytest.mark.parametrize(("away", "met"), [(12.0, True), (60.0, False)])
def test_a_tile_whose_samples_meet_no_surface_has_its_neighbours_range_or_the_view_s(
    gpu: GpuScene, away: float, met: bool
) -> None:
    """Far away, some samples or none meet the scene: in a tile without, what others found stands for it."""
    view = VIEW.model_copy(update={"eye": tuple(away * x for x in VIEW.eye)})
    frame = Frame(gpu, view, *SIZE)
    dump = capture(frame).dump
    assert dump.total > 0
    assert dump.tile_range is not None
    occupied = np.flatnonzero(dump.counts)
    columns, _ = tile_grid(*SIZE)
    tiles = set((occupied // SIZE[0] // RANGE_TILE * columns + occupied % SIZE[0] // RANGE_TILE).tolist())
    assert (dump.tile_range[:, 1] > 0.0).all() == met
    assert dump.tile_range.any() == met
    assert len(tiles) < len(dump.tile_range) / 10
    for tail in BINNED_TAILS:
        assert np.array_equal(words_of(frame.gather_bins(tail)), expected_words(dump, TAILS[tail]))


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("given", ["none", "nearer", "farther", "narrow", "one depth", "turned round", "zero"])
def test_with_any_ranges_the_picture_is_as_simulated(
    gpu: GpuScene, monkeypatch: pytest.MonkeyPatch, tail: TailName, given: str
) -> None:
    """A wrong range costs quality and never correctness: what lies outside of it counts as at its end."""
    size = (61, 45)
    plain = capture(Frame(gpu, VIEW, *size)).dump
    assert plain.tile_range is not None
    own = tile_ranges(replace(plain, tile_range=None))
    low, high = own.T
    ranges = {
        "none": own,
        "nearer": 0.25 * own,
        "farther": 4.0 * own,
        "narrow": np.stack([0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high], axis=1),
        "one depth": np.stack([high, high], axis=1),
        "turned round": own[:, ::-1],
        "zero": np.zeros_like(own),
    }[given]
    ranges = np.ascontiguousarray(ranges, dtype=np.float32)
    frame = Frame(gpu, VIEW, *size, float_sums=True)
    monkeypatch.setattr(Frame, "_estimated_range", lambda self: self.ctx.buffer(ranges))
    dump = replace(plain, tile_range=None if given == "none" else ranges)
    binned = frame.gather_bins(tail)
    assert np.array_equal(words_of(binned), expected_words(dump, TAILS[tail]))
    assert np.array_equal(binned.counts(), counted(dump, TAILS[tail]))
    rendered = technique("kbuffer").render(frame, Budget(2 * dump.pixels, tail))
    simulated = composite(dump, rendered.k, tail).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, simulated, atol=3e-6, rtol=0)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_places_are_the_same_to_the_bit(ctx: moderngl.Context, tail: TailName) -> None:
    """A place that is one unit in the last place off is, once in a million pixels, in another bin."""
    rng = np.random.default_rng(3)
    count, row = 64 * 1000, TAILS[tail]
    nearest = rng.uniform(0.1, 50.0, count).astype(np.float32)
    extent = (nearest + rng.choice([0.0, 1e-5, 1e-2, 0.1, 1.0, 30.0], count).astype(np.float32)) - nearest
    z = nearest + extent * rng.uniform(-0.1, 1.1, count).astype(np.float32)
    text = """
    layout(local_size_x = 64) in;
    layout(std430, binding = 0) readonly buffer In { float given[]; };
    layout(std430, binding = 1) writeonly buffer Out { float place[]; };
    void main() {
        uint i = gl_GlobalInvocationID.x;
        place[i] = bin_place(given[3u * i], vec2(given[3u * i + 1u], given[3u * i + 2u]));
    }"""
    program = ctx.compute_shader(expand("common/depth_bins.glsl", row.defines) + text)
    given, out = ctx.buffer(np.stack([z, nearest, extent], axis=1)), ctx.buffer(reserve=4 * count)
    given.bind_to_storage_buffer(0)
    out.bind_to_storage_buffer(1)
    program.run(count // 64)
    found = np.frombuffer(out.read(), np.float32)
    expected = np.array([place_of(*each, row.bins) for each in zip(z, nearest, extent, strict=True)], np.float32)
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_sums_of_luma_are_those_of_the_dump_to_the_unit(frame: Frame, dump: FragmentDump, tail: TailName) -> None:
    words = frame.gather_bins(tail, luma=True).read()[:, TAILS[tail].bins]
    units = np.array([2**LUMA_SHIFT / 255.0, 2**LUMA_SQUARE_SHIFT / 255.0**2]) / OPTICAL_UNIT
    expected = gather(dump, tail)[:, [SUMS.index(name) for name in LUMA_SUMS]] / units
    assert words.any()
    np.testing.assert_allclose(np.stack([words >> 16, words & 0xFFFF], axis=1), expected, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("names", [FEATURES, NO_LUMA], ids=["all", "no luma"])
def test_a_network_reads_what_the_dump_says(
    frame: Frame, dump: FragmentDump, tmp_path: Path, tail: TailName, names: tuple[str, ...]
) -> None:
    network, features = random_weights(11, names, tail=tail), derive(gather(dump, tail))
    export_random(tmp_path, network, features[dump.counts > 0], tail)
    deep, pixels = KBufferDeep(tmp_path), np.flatnonzero(dump.counts).astype(np.uint32)
    found, expected = deep.features(frame, pixels), features[pixels][:, network.columns]
    # The root of a difference makes up to 16 times what that is wrong by.
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("luma", [False, True])
def test_what_a_pixel_s_words_say_they_need_is_what_is_allocated(frame: Frame, tail: TailName, luma: bool) -> None:
    binned = frame.gather_bins(tail, luma=luma)
    assert binned.words.size == binned.pixel_bytes * frame.pixels
    assert binned.pixel_bytes == TAILS[tail].gathered_bytes + 4 * luma
    needed = TAILS[tail].kept_bytes + 8 + 8 * binned.free_slots
    assert needed <= binned.pixel_bytes < needed + 8, "what is kept, a core, and slots"


def test_more_words_than_a_buffer_holds_are_refused(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.bin_pass.LIMITS", replace(LIMITS, words_bytes=32 * frame.pixels))
    frame.gather_bins("binned-8")
    with pytest.raises(Problem, match="smaller picture or a tail of fewer bins"):
        frame.gather_bins("binned-8", luma=True)


def test_words_beyond_what_software_drivers_advertise_are_kept(gpu: GpuScene) -> None:
    """They say 128 MiB, and hold what is bound; graphics cards say gigabytes."""
    size = 1900, 1200
    frame = Frame(gpu, VIEW, *size)
    assert 4 * 16 * frame.pixels > LIMITS.buffer_bytes
    binned = frame.gather_bins("binned-16")
    n = frame.count()
    assert n[-size[0] * 300 :].any()
    assert np.array_equal(binned.counts().sum(axis=1), n)


def test_ranges_are_an_eighth_of_a_byte_a_pixel(gpu: GpuScene) -> None:
    frame = Frame(gpu, VIEW, *SIZE)
    assert frame.tile_range().size == frame.pixels // 8


@pytest.mark.parametrize("name", ["kbuffer-dynamic", "kbuffer-importance"])
@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_a_pool_comes_beside_the_words(frame: Frame, dump: FragmentDump, name: str, tail: TailName) -> None:
    row = TAILS[tail]
    few = technique(name).render(frame, Budget(dump.pixels // 4, tail))
    assert few.early_bytes == 12 + (4 if name == "kbuffer-importance" else 0)
    assert few.pixel_bytes == 4 + 12 + row.gathered_bytes + row.sum_bytes
    many = technique(name).render(frame, Budget(dump.total - 1, tail))
    assert many.pool_bytes > 16 * dump.pixels
    assert many.total_bytes == many.pool_bytes + many.pixel_bytes * dump.pixels > few.total_bytes
