"""Depth bins on the GPU: what is kept of them, the features that a network reads of it, and the pictures."""

from __future__ import annotations

import weakref
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import export_random, random_weights

from labeller.curves import composite
from renderer.depth_bins import place_of
from renderer.features import FEATURES, SUMS, derive, gather, texels_of
from renderer.frame import BIN_DEFINES, Frame, front_bytes
from renderer.programs import expand
from renderer.techniques import KBufferDeep, technique
from renderer.techniques.base import Budget
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import Problem
from schemas.tail import DENSITY_BINS, SHARE_LEVELS, TailName

BINNED = sorted(DENSITY_BINS)
FRONT = SUMS.index("front_1")
READ = ("log_n", "optical_depth", "rgb_nearest_g", *(name for name in FEATURES if name.startswith("front_")))


@pytest.mark.parametrize("bins", DENSITY_BINS.values())
@pytest.mark.parametrize("texels", [frozenset[int](), frozenset({1, 5}), frozenset(range(6))])
def test_what_is_kept_of_the_bins_is_what_the_dump_says(
    frame: Frame, dump: FragmentDump, bins: int, texels: frozenset[int]
) -> None:
    gathered = frame.gather("gather", texels, bins)
    assert gathered.front is not None
    words = np.frombuffer(gathered.front.read(), np.uint32)[: dump.pixels * front_bytes(bins) // 4]
    words = words.reshape(dump.pixels, -1)
    expected = gather(dump, bins)
    np.testing.assert_allclose(
        words[:, 0].view(np.float32), expected[:, SUMS.index("optical_depth")], rtol=1e-5, atol=1e-6
    )
    every = 16 // bins
    for b in range(1, bins):
        share = words[:, 1 + (b - 1) // 8] >> np.uint32(4 * ((b - 1) % 8)) & 15
        np.testing.assert_array_equal(share, np.rint(SHARE_LEVELS * expected[:, FRONT - 1 + every * b]))


@pytest.mark.parametrize("tail", BINNED)
def test_a_network_reads_the_bins_and_the_picture_is_as_simulated(
    frame: Frame, dump: FragmentDump, gl: moderngl.Context, tmp_path: Path, tail: TailName
) -> None:
    network = random_weights(11, READ)
    sums = gather(dump, DENSITY_BINS[tail])
    export_random(tmp_path, network, derive(sums)[dump.counts > 0], gl, tail)
    deep = KBufferDeep(tmp_path)
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    np.testing.assert_allclose(
        deep.features(frame, pixels), derive(sums)[pixels][:, network.columns], rtol=1e-5, atol=1e-5
    )
    for inference in ("glsl", "onnx"):
        rendered = KBufferDeep(tmp_path, inference).render(frame, Budget(dump.total // 3, tail))
        assert rendered.captured == dump.total // 3
        simulated = composite(dump, rendered.k, tail).reshape(*rendered.linear.shape)
        assert np.abs(display8(rendered.linear).astype(int) - display8(simulated).astype(int)).max() <= 1


@pytest.mark.parametrize("tail", BINNED)
def test_a_bundle_can_be_rendered_with_another_tail_than_its_own(
    frame: Frame, dump: FragmentDump, gl: moderngl.Context, tmp_path: Path, tail: TailName
) -> None:
    features = derive(gather(dump, DENSITY_BINS[tail]))[dump.counts > 0]
    export_random(tmp_path, random_weights(11, READ), features, gl, tail)
    for other in ("density", "paper", *(b for b in BINNED if b != tail)):
        rendered = KBufferDeep(tmp_path).render(frame, Budget(dump.total // 3, other))
        simulated = composite(dump, rendered.k, other).reshape(*rendered.linear.shape)
        assert np.abs(display8(rendered.linear).astype(int) - display8(simulated).astype(int)).max() <= 1


@pytest.mark.parametrize("bins", DENSITY_BINS.values())
def test_places_are_the_same_to_the_bit(ctx: moderngl.Context, tmp_path: Path, bins: int) -> None:
    """A place that is one unit in the last place off is, once in a million pixels, in another bin."""
    rng = np.random.default_rng(3)
    count = 64 * 4000
    nearest = rng.uniform(0.1, 50.0, count).astype(np.float32)
    extent = (nearest + rng.choice([1e-5, 1e-2, 0.1, 1.0, 30.0], count).astype(np.float32)) - nearest
    z = np.minimum(nearest + extent * rng.uniform(0.0, 1.0, count).astype(np.float32), nearest + extent)
    text = """
    layout(local_size_x = 64) in;
    layout(std430, binding = 0) readonly buffer In { float given[]; };
    layout(std430, binding = 1) writeonly buffer Out { float place[]; };
    void main() {
        uint i = gl_GlobalInvocationID.x;
        place[i] = bin_place(given[3u * i], given[3u * i + 1u], given[3u * i + 2u]);
    }"""
    program = ctx.compute_shader(expand("common/depth_bins.glsl", {"BINS": bins, **BIN_DEFINES}) + text)
    given, out = ctx.buffer(np.stack([z, nearest, extent], axis=1)), ctx.buffer(reserve=4 * count)
    given.bind_to_storage_buffer(0)
    out.bind_to_storage_buffer(1)
    program.run(count // 64)
    found = np.frombuffer(out.read(), np.float32)
    expected = np.array([place_of(*each, bins) for each in zip(z, nearest, extent, strict=True)], np.float32)
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("bins", DENSITY_BINS.values())
def test_beside_bins_sums_are_half_floats(frame: Frame, dump: FragmentDump, bins: int) -> None:
    gathered = frame.gather("gather", frozenset(range(6)), bins)
    expected = gather(dump, bins)
    for texel, texture in enumerate(gathered.sums):
        assert texture.dtype == "f2"
        found = np.frombuffer(texture.read(), np.float16).reshape(-1, 4)[:, :3].astype(np.float64)
        truth = expected[:, 4 * texel : 4 * texel + 3]
        # Each of the n additions, and what is added, is cut to 11 bits.
        assert (np.abs(found - truth) <= (dump.counts[:, None] + 2) * np.abs(truth) * 2.0**-10 + 1e-6).all()
    sums, binning = 5 * 8 + 4 + front_bytes(bins), 2 * bins + 4 + front_bytes(bins)
    assert gathered.pass_bytes == max(sums, binning), "the one is gone when the other is gathered"


def test_the_targets_of_the_bins_are_gone_when_they_are_packed(
    frame: Frame, monkeypatch: pytest.MonkeyPatch, ctx: moderngl.Context
) -> None:
    fresh = Frame(frame.gpu, frame.view, frame.width, frame.height)
    made: list[weakref.ref[moderngl.Texture]] = []

    def watched(bins: int) -> list[moderngl.Texture]:
        found = Frame._bin_targets(fresh, bins)
        made.extend(weakref.ref(texture) for texture in found)
        return found

    monkeypatch.setattr(fresh, "_bin_targets", watched)
    fresh.gather("gather-tail", bins=16)
    assert len(made) == 5
    assert all(texture() is None for texture in made), "what is bound is kept, beside the pool"


def test_the_targets_of_the_bins_are_gone_when_sums_are_made(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    fresh = Frame(frame.gpu, frame.view, frame.width, frame.height)
    made: list[weakref.ref[moderngl.Texture]] = []
    alive: list[int] = []
    make = fresh._zero_targets

    def watched(count: int, dtype: str) -> list[moderngl.Texture]:
        alive.append(sum(texture() is not None for texture in made))
        found = make(count, dtype)
        made.extend(weakref.ref(texture) for texture in found)
        return found

    monkeypatch.setattr(fresh, "_zero_targets", watched)
    fresh.gather("gather", frozenset({1, 3, 5}), 16)
    assert len(made) == 4 + 2
    assert alive == [0, 0]


@pytest.mark.parametrize("name", ["kbuffer-dynamic", "kbuffer-importance"])
def test_the_peak_of_a_small_pool_is_the_gather_pass(frame: Frame, dump: FragmentDump, name: str) -> None:
    few = technique(name).render(frame, Budget(dump.pixels // 2, "density-16"))
    gathering = 12 + (2 * 16 + 4) + front_bytes(16)
    assert few.early_bytes == gathering
    assert few.total_bytes == gathering * dump.pixels
    many = technique(name).render(frame, Budget(dump.total - 1, "density-16"))
    assert many.pool_bytes > 16 * dump.pixels
    assert many.pixel_bytes == 4 + 12 + 16 + front_bytes(16)
    assert many.total_bytes == many.pool_bytes + many.pixel_bytes * dump.pixels > gathering * dump.pixels


def test_beside_what_a_runtime_on_the_cpu_reads_back_the_peak_has_its_sums(
    frame: Frame, dump: FragmentDump, gl: moderngl.Context, tmp_path: Path
) -> None:
    export_random(tmp_path, random_weights(11), derive(gather(dump, 16))[dump.counts > 0], gl, "density-16")
    rendered = KBufferDeep(tmp_path, "onnx").render(frame, Budget(dump.pixels // 2))
    opened = int(np.count_nonzero(dump.counts > 1))
    sums = frame.gather("gather", texels_of(FEATURES, binned=True), 16).pixel_bytes
    reading = (12 + sums) * dump.pixels + 4 * (1 + len(FEATURES)) * opened
    assert reading <= rendered.total_bytes < reading + 2 * dump.pixels


def test_curves_beyond_a_storage_buffer_are_refused(
    frame: Frame, dump: FragmentDump, gl: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export_random(tmp_path, random_weights(11, FEATURES[:5]), derive(gather(dump))[dump.counts > 0], gl, "density")
    monkeypatch.setattr("renderer.frame.LIMITS", replace(LIMITS, buffer_bytes=6 * dump.pixels))
    with pytest.raises(Problem, match="above the limit"):
        KBufferDeep(tmp_path).render(frame, Budget(dump.pixels, "density"))
