"""The account of a frame against counts from its dump: every technique, on spheres that tie and a card of holes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells
from support.training import random_weights, write_unproven

from renderer.account.glsl import BINDING, LOADED
from renderer.account.ledger import count_frame
from renderer.account.programs import TalliedPrograms
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, Needs, Rendered, technique
from renderer.techniques.binned import DEFAULT_BINS
from renderer.techniques.ordered import capture_ordered
from renderer.tiles import TILE
from schemas.fragments import FragmentDump
from schemas.tail import DEFAULT_TAIL, TAILS, TailName
from schemas.work import Device, PassWork, total_work

SLOTS = 2
"""Of every pixel in `kbuffer`."""


@dataclass(frozen=True, slots=True)
class Counts:
    """What accounts are compared with.

    Attributes:
        dump: All transparent fragments.
        shaded: Fragments that a geometry pass shades: those of the card's holes too.
        in_tiles: Pixels of tiles with a fragment.
        deep: Fragments in tiles whose fullest pixel has more than 16.
        nearest: Fragments at the nearest depth of their pixel.
    """

    dump: FragmentDump
    shaded: int
    in_tiles: int
    deep: int
    nearest: int


@dataclass(frozen=True, slots=True)
class Counted:
    """A frame rendered twice, once counted."""

    plain: Rendered
    counted: Rendered
    work: Mapping[str, PassWork]


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


@pytest.fixture(scope="module")
def counts(gpu: GpuScene) -> Counts:
    frame = Frame(gpu, VIEW, *SIZE)
    dump = capture(frame).dump
    query = gpu.ctx.query(samples=True)
    with query:
        frame.draw_transparent("benchmark/empty.frag", frame.target([]))
    n = dump.counts.reshape(dump.height, dump.width)
    most = np.zeros_like(n)
    for y in range(0, dump.height, TILE):
        for x in range(0, dump.width, TILE):
            most[y : y + TILE, x : x + TILE] = n[y : y + TILE, x : x + TILE].max()
    pixel = np.repeat(np.arange(dump.pixels), dump.counts)
    first = dump.depth[np.minimum(dump.offsets[:-1], dump.total - 1)]
    return Counts(
        dump, query.samples, int((most > 0).sum()), int(n[most > 16].sum()), int((dump.depth == first[pixel]).sum())
    )


@pytest.fixture(scope="module")
def frames(gpu: GpuScene, counts: Counts, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Counted]:
    """Every technique's."""
    made = {}
    bundle = write_unproven(tmp_path_factory.mktemp("bundles") / "random", random_weights(5))
    k = np.minimum(counts.dump.counts, SLOTS).astype(np.int32)
    for name in TECHNIQUES:
        needs, budget = Needs(bundle, lambda *_: k), Budget(SLOTS * counts.dump.pixels, chain="two-pass")
        plain = technique(name, needs).render(Frame(gpu, VIEW, *SIZE), budget)
        frame, rendered = Frame(gpu, VIEW, *SIZE), []
        again = technique(name, needs)
        work = count_frame(gpu, lambda: rendered.append(again.render(frame, budget)))  # noqa: B023
        made[name] = Counted(plain, rendered[0], work)
    return made


@pytest.mark.parametrize("name", TECHNIQUES)
def test_a_counted_frame_is_the_same_to_the_bit__name(frames: dict[str, Counted], name: str) -> None:
    found = frames[name]
    assert np.array_equal(found.plain.linear, found.counted.linear)
    assert found.work.keys() == found.plain.passes.keys() - {"opaque"}


GEOMETRY: Mapping[str, Mapping[str, int]] = {
    "abuffer-list": {"count": 1, "list": 1},
    "abuffer-array": {"count": 1, "array": 1},
    "sbuffer": {"count": 1, "capture": 1},
    "kbuffer": {"count": 1, "range": 1, "bins": 1, "chain-depth": 1, "chain-colour": 1},
    "kbuffer-dynamic": {"count": 1, "range": 1, "bins": 1, "chain-depth": 1, "chain-colour": 1},
    "kbuffer-importance": {"count": 1, "range": 1, "bins": 1, "facing": 1, "chain-depth": 1, "chain-colour": 1},
    "kbuffer-optimal": {"count": 1, "range": 1, "bins": 1, "chain-depth": 1, "chain-colour": 1},
    "kbuffer-deep": {"range": 1, "bins": 1, "capture": 1},
    "kbuffer-temporal": {"range": 1, "bins": 1, "capture": 1},
    "binned": {"range": 1, "bins": 1, "tail": 1},
    "weighted-average": {"sums": 1},
    "weighted-blended": {"sums": 1},
    "moment": {"count": 1, "moments": 1, "blend": 1},
    "multilayer": {"count": 1, "capture": 1},
    "adaptive": {"count": 1, "capture": 1},
    "stochastic": {"samples": 1, "blend": 1},
    "wavelet": {"count": 1, "coefficients": 1, "blend": 1},
    "bevy": {"count": 1, "capture": 1},
    "storm-rules": {"count": 1, "capture": 1},
}


@pytest.mark.parametrize("name", TECHNIQUES)
def test_geometry_passes_shade_what_the_depth_test_leaves__name(
    frames: dict[str, Counted], counts: Counts, name: str
) -> None:
    work = frames[name].work
    drawn = {one: found.geometry_passes for one, found in work.items() if found.geometry_passes}
    most = int(counts.dump.counts.max())
    if name == "depth-peeling":
        assert drawn == {"count": 1, "peel": most}
    elif name == "dual-depth-peeling":  # ties may take a few passes more than half
        assert drawn.keys() == {"count", "peel"}
        assert -(-most // 2) <= drawn["peel"] <= most
    else:
        assert drawn == GEOMETRY[name]
    for one, found in work.items():
        if one != "range":  # drawn smaller
            assert found.fragments == found.geometry_passes * counts.shaded
        assert found.pixels % counts.dump.pixels == 0 or one == "step"


def resolved(counts: Counts, name: str) -> dict[str, int]:
    """What compositing reads and writes, of the techniques whose shaders have no loops that depend on colours."""
    pixels, total, occupied = counts.dump.pixels, counts.dump.total, int((counts.dump.counts > 0).sum())
    runs = 8 * counts.in_tiles
    loaded = {
        "abuffer-list": 4 * counts.in_tiles + 8 * total,
        "abuffer-array": 4 * counts.in_tiles + 4 * total,
        "sbuffer": runs + 8 * total + 8 * counts.deep,  # blocks are read again as they are merged
        "multilayer": runs + 12 * total,
        "adaptive": runs + 2 * 12 * total,
        "weighted-average": 4 * pixels + 16 * occupied,
        "weighted-blended": 16 * pixels + 4 * occupied,
        "stochastic": 16 * pixels + 4 * occupied,
        "binned": sums_of(DEFAULT_BINS) * (4 * pixels + occupied) // 5,
        "moment": 16 * counts.in_tiles + 4 * occupied,
        "wavelet": 16 * counts.in_tiles + 4 * occupied,
        "bevy": runs + 12 * total,
        "storm-rules": runs + 12 * int(np.minimum(counts.dump.counts, 8).sum()),
    }[name]
    stored = 8 * counts.deep if name == "sbuffer" else 0
    return {"pixels": pixels, "loaded_bytes": 4 * pixels + loaded, "stored_bytes": 16 * pixels + stored}


def sums_of(tail: TailName) -> int:
    """Bytes of a pixel of a tail's sums: four of five are of weighted colours."""
    return TAILS[tail].sum_bytes


def blended(fragments: int, target_bytes: int, loaded: int, cleared: int) -> dict[str, int]:
    """An additive pass without atomics."""
    return {
        **{"blended_bytes": 2 * target_bytes * fragments, "loaded_bytes": loaded, "stored_bytes": 0, "atomics": 0},
        **{"cleared_bytes": cleared},
    }


def closed_forms(counts: Counts, found: Counted, name: str) -> dict[str, dict[str, int]]:
    """What follows from the dump for a technique: pass -> field -> number."""
    total, pixels, shaded = counts.dump.total, counts.dump.pixels, counts.shaded
    counted = {"atomics": total, "atomic_bytes": 8 * total, "stored_bytes": 4 * 80, "loaded_bytes": 4 * pixels}
    with_range = {"atomics": 3 * total, "atomic_bytes": 24 * total, "cleared_bytes": 12 * pixels}
    sums = blended(total, 20, 0, 20 * pixels)
    if name in ("weighted-average", "weighted-blended"):
        return {"sums": sums, "resolve": resolved(counts, name)}
    if name == "moment":
        moments = blended(total, 20, 8 * total, 20 * pixels)
        return {
            "count": with_range,
            "moments": moments,
            "blend": blended(total, 16, 28 * total, 16 * pixels),
            "resolve": resolved(counts, name),
        }
    if name == "wavelet":
        return {
            "count": with_range,
            "coefficients": blended(total, 68, 8 * total, 68 * pixels),
            "blend": blended(total, 16, 72 * total, 16 * pixels),
            "resolve": resolved(counts, name),
        }
    if name == "stochastic":
        blend = blended(total, 20, 32 * total, 0)
        return {"samples": {"cleared_bytes": 52 * pixels}, "blend": blend, "resolve": resolved(counts, name)}
    if name == "abuffer-list":
        stored = {"atomics": 2 * total, "stored_bytes": 12 * total, "cleared_bytes": 4 * pixels + 4, "loaded_bytes": 0}
        return {"count": {"atomics": total}, "list": stored, "resolve": resolved(counts, name)}
    if name == "abuffer-array":
        stored = {"atomics": total, "stored_bytes": 8 * total, "loaded_bytes": 0}
        return {"count": {"atomics": total}, "array": stored, "resolve": resolved(counts, name)}
    if name in ("sbuffer", "multilayer", "adaptive", "bevy", "storm-rules"):
        words = 2 if name == "sbuffer" else 3
        captured = {"atomics": total, "stored_bytes": 4 * words * total, "loaded_bytes": 0, "cleared_bytes": 0}
        return {
            "count": {**counted, "cleared_bytes": 4 * (pixels + 1)},
            "prefix": {"transferred_bytes": 8},
            "capture": captured,
            "resolve": resolved(counts, name),
        }
    if name in ("depth-peeling", "dual-depth-peeling"):
        sides = 1 + (name == "dual-depth-peeling")
        return {
            "count": {"atomics": (1 + sides) * total, "cleared_bytes": 4 * sides * pixels},
            "resolve": {"pixels": pixels, "blended_bytes": 32 * pixels},
        }
    if name == "binned":
        tail = {"blended_bytes": 2 * sums_of(DEFAULT_BINS) * shaded, "cleared_bytes": sums_of(DEFAULT_BINS) * pixels}
        return {"tail": {**tail, "stored_bytes": 0, "atomics": 0}, "resolve": resolved(counts, name)}
    captured = int(found.counted.captured)
    tail = {"blended_bytes": 2 * sums_of(DEFAULT_TAIL) * shaded}
    if TECHNIQUES[name].needs_bundle:
        return {
            "capture": {
                **{**tail, "atomics": captured, "stored_bytes": 8 * captured},
                "cleared_bytes": sums_of(DEFAULT_TAIL) * pixels,
            },
            "resolve": {"pixels": pixels},
        }
    forms = {"count": {**with_range, "transferred_bytes": 4 * pixels}, "chain-colour": tail}
    if name == "kbuffer-importance":
        forms["facing"] = {"loaded_bytes": 4 * total, "atomics": counts.nearest, "cleared_bytes": 4 * pixels}
    return forms


@pytest.mark.parametrize("name", TECHNIQUES)
def test_passes_do_what_follows_from_the_dump__name(frames: dict[str, Counted], counts: Counts, name: str) -> None:
    found = frames[name]
    for one, fields in closed_forms(counts, found, name).items():
        assert {field: getattr(found.work[one], field) for field in fields} == fields, one


def test_the_chains_loops_are_counted_turn_by_turn(gpu: GpuScene, frames: dict[str, Counted], counts: Counts) -> None:
    ordered = capture_ordered(Frame(gpu, VIEW, *SIZE))
    loads = atomics = 0
    for p in np.flatnonzero(counts.dump.counts):
        slots = [np.inf] * SLOTS
        for z in ordered.depth[ordered.offsets[p] : ordered.offsets[p + 1]].tolist():
            loads += 2  # where the slots begin and end
            for i in range(SLOTS):
                loads += 1
                if slots[i] <= z:
                    continue
                atomics += 1
                slots[i], z = z, slots[i]
                if z == np.inf:
                    break
    work = frames["kbuffer"].work["chain-depth"]
    assert (work.loaded_bytes, work.atomics) == (4 * loads, atomics)


def test_sums_beyond_32_bits_are_exact(ctx: moderngl.Context) -> None:
    text = """#version 450
    layout(local_size_x = 64) in;
    struct Line { mat; };
    layout(std430, binding = 0) buffer Lines { Line line[]; };
    void main() {
        vec4 sum = vec4(0.0);
        for (int i = 0; i < 1000; ++i) { Line one = line[i & 1]; sum += one.a; }
        if (sum.x == 1.0) line[0].a.x = 1.0;
    }"""
    parts = "abcdefghijklmnopqrstuvwxyzABCDEF"
    programs = TalliedPrograms(ctx)
    program = programs.computing(text.replace("mat;", f"vec4 {', '.join(parts)};"))
    lines = ctx.buffer(bytes(2 * 16 * len(parts)))
    programs.bind()
    lines.bind_to_storage_buffer(0)
    program.run(160)
    assert programs.read()[0, LOADED] == 160 * 64 * 1000 * 16 * len(parts) > 2**32
    assert not programs.read().any()
    ctx.buffer(reserve=16).bind_to_storage_buffer(BINDING)


def test_a_program_that_nobody_counts_is_refused(gpu: GpuScene) -> None:
    frame, before = Frame(gpu, VIEW, *SIZE), gpu.programs
    uncounted = before.compute("common/tiles.comp", {"TILE": TILE})
    with pytest.raises(RuntimeError, match="is not one of the scene's"):
        count_frame(gpu, lambda: uncounted.run(1))
    assert gpu.programs is before
    assert moderngl.Buffer.clear.__qualname__ == "Buffer.clear"
    assert frame.clock.passes.keys() == {"opaque"}


def test_the_bound_is_that_of_each_passs_slower_side() -> None:
    passes = [PassWork(fragments=2_000_000), PassWork(loaded_bytes=3_000_000, pixels=1_000_000)]
    assert Device(bandwidth=1.0, fill_rate=1.0).bound(passes) == pytest.approx(2.0 + 3.0)
    assert total_work(passes).moved_bytes == 3_000_000
    assert total_work(passes).shaded == 3_000_000
