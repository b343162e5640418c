"""The GL part of the stress suite sees what is wrong: a broken shader, twin, capture, budget or process."""

from __future__ import annotations

import sys
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from evaluation.stress import (
    gl,
    gl_allocation,
    gl_bins,
    gl_bounds,
    gl_capture,
    gl_child,
    gl_moment,
    gl_network,
    gl_refused,
    gl_techniques,
)
from evaluation.stress.findings import Broken, Finding, Options
from evaluation.stress.gl_cases import EVERY_BUDGET, Case, make_case, sceneries
from evaluation.stress.gl_drivers import GPU, LLVMPIPE, ZINK
from evaluation.stress.gl_twins import Truth, unbounded
from evaluation.stress.predictors import networks, real_features
from labeller import reference
from renderer import programs
from renderer.programs import Programs
from renderer.reference import moment
from renderer.techniques import TECHNIQUES, Budget, KBufferDynamic, KBufferOptimal, Needs
from renderer.techniques.ordered import Ordered, capture_ordered
from schemas.tail import TAILS, TailKind

QUICK = Options(quick=True)
CASES = {scenery.name: scenery for scenery in sceneries(QUICK)}


@pytest.fixture(scope="module")
def shared(gl: moderngl.Context) -> Programs:
    return Programs(gl)


@pytest.fixture(scope="module")
def made(gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> gl_network.Networks:
    weights = next(iter(networks(0, real_features(np.random.default_rng(0), 50), small=True).values()))
    return gl_network.random_networks(tmp_path_factory.mktemp("networks"), weights, "here")


def replaced(patch: pytest.MonkeyPatch, file: str, old: str, new: str) -> None:
    """Another text in a shader file."""
    source = programs.source
    assert old in source(file)
    patch.setattr(programs, "source", lambda name: source(name).replace(old, new) if name == file else source(name))


def picture(case: Case, name: str) -> list[Finding]:
    (each,) = (each for each in unbounded(QUICK) if each.name == name)
    return list(gl_techniques.picture_rows(case, Truth.of(case), each, "here"))


def chain(case: Case) -> list[Finding]:
    needs = Needs(allocate=gl_techniques.random_allocation)
    return list(gl_techniques.bounded_rows(case, Truth.of(case), KBufferOptimal.name, needs, "here"))


@pytest.mark.parametrize("name", ["alpha 0 and 1", "slanted triangles", "lengths of 1e-30 m"])
def test_a_sound_renderer_is_within_its_bounds(
    gl: moderngl.Context, shared: Programs, made: gl_network.Networks, name: str
) -> None:
    case = make_case(gl, CASES[name], shared)
    rows = [
        *gl_capture.rows(case, "here"),
        *gl_bins.rows(case, "here"),
        *gl_network.rows(case, made, "here"),
        *(row for _, work in gl_techniques.steps(case, QUICK, "here", made) for row in work()),
    ]
    assert [row for row in rows if not row.ok] == []
    assert any(row.absolute > 0.0 for row in rows), "nothing was compared"
    assert set(gl_bounds.PATHS) >= set(TECHNIQUES)
    assert {row.path.split(" · ")[0].split(".")[0] for row in rows} <= {path.split(".")[0] for path in gl_bounds.PATHS}


def test_a_layer_stays_in_front_of_a_merged_one_as_deep_as_it(gl: moderngl.Context, shared: Programs) -> None:
    # Equal fragments, the farther of them merged with what is behind it: what comes before both moves both.
    for seed in (0, 4, 11):
        ties = next(iter(sceneries(Options(quick=True, seed=seed))))
        assert [row for row in picture(make_case(gl, ties, shared), "multilayer") if not row.ok] == []


@pytest.mark.parametrize(
    ("technique", "file", "old", "new"),
    [
        ("sbuffer", "common/composite.glsl", "light.a *= 1.0 - a;", "light.a *= 1.0 - 0.9999 * a;"),
        ("abuffer-array", "abuffer-array/sort.comp", "if (make)", "if (!make)"),
        ("weighted-average", "weighted-average/sums.frag", "/ 255.0", "/ 255.01"),
        ("multilayer", "common/composite.glsl", "return root * root;", "return pow(root, vec3(2.001));"),
        ("stochastic", "stochastic/coverage.glsl", "255u", "254u"),
        ("moment", "moment/reconstruct.glsl", "OVERESTIMATION * mass", "0.26 * mass"),
        ("wavelet", "wavelet/blend.frag", "(1.0 - t)", "(1.001 - t)"),
        ("bevy", "bevy/resolve.frag", "else if (is_nearer(kept[0], carried))", "else if (false)"),
        ("storm-rules", "storm-rules/resolve.frag", "int i = 0; i < NODES; ++i) add", "int i = 1; i < NODES; ++i) add"),
    ],
)
def test_a_broken_shader_is_a_violation__technique(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch, technique: str, file: str, old: str, new: str
) -> None:
    replaced(monkeypatch, file, old, new)
    rows = picture(make_case(gl, CASES["stacks"], Programs(gl)), technique)
    assert not all(row.ok for row in rows)


def test_a_broken_tail_is_a_violation_and_named(gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    replaced(monkeypatch, "kbuffer/resolve.frag", "exp(-opacity.x)", "exp(-1.0001 * opacity.x)")
    rows = chain(make_case(gl, CASES["stacks"], Programs(gl)))
    wrong = {row.path for row in rows if not row.ok}
    tails = {name for name, tail in TAILS.items() if tail.kind not in (TailKind.WEIGHTED_AVERAGE, TailKind.PAPER)}
    assert wrong == {f"kbuffer-optimal.{name} · here" for name in tails}
    assert all("F = " in row.where and "pixel" in row.where for row in rows if not row.ok)


@pytest.mark.parametrize(
    ("file", "old", "new", "paths"),
    [
        (
            "gather/pack.comp",
            "level(front, total,",
            "level(front / 2u, total,",
            {"bins.kept", "features.kept"},
        ),
        (
            "gather/pack.comp",
            "level(moment_of(word[b]),",
            "level(moment_of(word[b]) / 2u,",
            {"bins.kept", "features.kept"},
        ),
        (
            "common/depth_bins.glsl",
            "precise float root = float(ROOT_SHARE)",
            "precise float root = 0.9",
            {"bins.kept", "bins.counts"},
        ),
        ("gather/bins.frag", "place - float(bin)) + 0.5", "place - float(bin)) + 0.9", {"bins.kept"}),
        ("gather/bins.frag", "count_of(before) + 1u", "count_of(before) + 2u", {"bins.counts", "features"}),
        (
            "gather/bins.frag",
            "units * luma * luma +",
            "2u * units * luma * luma +",
            {"bins.luma", "features.spread"},
        ),
        (
            "kbuffer-deep/inputs.glsl",
            "for (int b = 0; b < BINS - 1; ++b)",
            "for (int b = 1; b < BINS - 1; ++b)",
            {"features.kept"},
        ),
    ],
)
def test_a_broken_pass_over_bins_is_a_violation_and_named(
    gl: moderngl.Context,
    made: gl_network.Networks,
    monkeypatch: pytest.MonkeyPatch,
    file: str,
    old: str,
    new: str,
    paths: set[str],
) -> None:
    replaced(monkeypatch, file, old, new)
    case = make_case(gl, CASES["stacks"], Programs(gl))
    rows = [*gl_bins.rows(case, "here"), *gl_network.rows(case, made, "here")]
    assert {row.path.split(" · ")[0] for row in rows if not row.ok} >= paths


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("range/range.frag", "atomicMin(tile_range[2 * tile], floatBitsToUint(v_depth - reach))", ""),
        ("range/range.frag", "v_depth + reach", "v_depth * 1.1"),
        ("range/fill.comp", "uvec2 range = found[tile]", "uvec2 range = found[tiles - 1 - tile]"),
    ],
)
def test_a_wrong_range_of_tiles_is_a_violation(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch, file: str, old: str, new: str
) -> None:
    replaced(monkeypatch, file, old, new)
    case = make_case(gl, CASES["slanted triangles"], Programs(gl))
    assert not gl_bins._ranges(case, "here").ok


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("allocation/cut.glsl", "found <= rank", "found < rank"),
        ("allocation/place.comp", "taken > room", "taken >= room"),
    ],
)
def test_a_broken_allocation_is_a_violation(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch, file: str, old: str, new: str
) -> None:
    replaced(monkeypatch, file, old, new)
    assert not all(row.ok for row in gl_allocation.rows(gl, QUICK, "here"))


def test_a_picture_that_is_not_finite_is_a_violation(gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    replaced(monkeypatch, "sbuffer/resolve.frag", "vec4(over(light", "vec4(sqrt(light.rgb - 9.0) + over(light")
    replaced(monkeypatch, "kbuffer/resolve.frag", "light.rgb + light.a", "sqrt(light.rgb - 9.0) + light.a")
    case = make_case(gl, CASES["alpha 0 and 1"], Programs(gl))
    assert not picture(case, "sbuffer")[0].ok
    limits = [row for row in chain(case) if "F and K" in row.path]
    assert [row.ok for row in limits] == [False]
    assert "not finite" in limits[0].where


def test_a_broken_twin_is_a_violation(gl: moderngl.Context, shared: Programs, monkeypatch: pytest.MonkeyPatch) -> None:
    case = make_case(gl, CASES["alpha 0 and 1"], shared)
    composite, share = reference.composite, moment.share_before
    monkeypatch.setattr(reference, "composite", lambda *args: composite(*args) + 1e-5)
    assert not any(row.ok for row in chain(case) if "F and K" not in row.path)
    monkeypatch.setattr(moment, "share_before", lambda *args: 0.99 * share(*args))
    assert not picture(case, "moment")[0].ok


@pytest.mark.parametrize("what", ["fragments", "depth", "colour", "alpha", "bits"])
def test_a_wrong_capture_is_a_violation__what(
    gl: moderngl.Context, shared: Programs, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    case = make_case(gl, CASES["slanted triangles"], shared)

    def wrong(frame: object) -> Ordered:
        found = capture_ordered(case.frame)
        some = found.packed.copy()
        if what == "fragments":
            rank = found.rank.copy()
            rank[7] += 1
            return replace(found, rank=rank)
        if what == "depth":
            return replace(found, depth=found.depth * np.float32(1.00001))
        some[7] += {"colour": 2, "alpha": 1 << 24, "bits": 1}[what]
        return replace(found, packed=some)

    monkeypatch.setattr(gl_capture, "capture_ordered", wrong)
    rows = list(gl_capture.rows(case, "here"))
    assert not next(row for row in rows if row.path.startswith(f"capture.{what} ")).ok


def test_every_way_to_break_a_budget_is_named(gl: moderngl.Context, shared: Programs) -> None:
    case = make_case(gl, CASES["alpha 0 and 1"], shared)
    n, occupied = case.dump.counts, int(np.count_nonzero(case.dump.counts))
    budget = 2 * occupied
    sound = KBufferDynamic().render(case.frame, Budget(budget))
    assert gl_techniques.broken_limits(KBufferDynamic.name, sound, case, budget) == []

    def broken(name: str, **fields: object) -> str:
        return "; ".join(gl_techniques.broken_limits(name, replace(sound, **fields), case, budget))  # type: ignore[arg-type]

    assert "above F" in broken(KBufferDynamic.name, k=n.astype(np.int32))
    assert "above n" in broken(KBufferDynamic.name, k=sound.k + 1)
    assert "below 0" in broken(KBufferDynamic.name, k=sound.k - n.max().astype(np.int32) - 1)
    assert broken(KBufferDynamic.name, k=np.zeros_like(sound.k), captured=0) == "", "k = 0 everywhere is legal"
    assert "leaves a part" in broken(KBufferOptimal.name, k=np.zeros_like(sound.k))
    assert "captured" in broken(KBufferDynamic.name, captured=0)
    assert "finite" in broken(KBufferDynamic.name, linear=np.full_like(sound.linear, np.nan))


def test_all_budgets_of_the_method_are_tried() -> None:
    tried = {name: gl_techniques.BUDGETS[name](100, 10) for name in EVERY_BUDGET}
    assert set(tried.values()) >= {0, 9, 10, 99, 100, 200}
    assert sum(scenery.budgets == EVERY_BUDGET for scenery in CASES.values()) >= 2


def test_an_exception_is_a_row_and_not_the_end(gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    replaced(monkeypatch, "stochastic/samples.frag", "void main()", "void mian()")
    monkeypatch.setattr(gl_child, "sceneries", lambda _: [CASES["alpha 0 and 1"]])
    monkeypatch.setattr(gl_moment, "rows", lambda *_: iter([]))
    said: list[dict[str, object]] = []
    rows = list(gl_child.Suite(gl, QUICK, "here", said.append).rows())
    broken = [row for row in rows if isinstance(row, Broken)]
    assert [row.path for row in broken] == ["stochastic · here"]
    assert "Error" in broken[0].why
    assert all(row.ok for row in rows if isinstance(row, Finding))
    assert {"sbuffer · here", "kbuffer-deep.density-16 · here", "kbuffer-optimal.paper · here"} < {
        row.path for row in rows
    }
    assert {"at": "stochastic, alpha 0 and 1"} in said


def test_rows_of_the_same_path_and_case_become_the_worst_one() -> None:
    nan = replace(finding(float("nan")), where="there")
    (worst,) = gl_child.worst_rows([finding(2.0), replace(finding(3.0), relative=9.0), replace(finding(1.0))])
    assert (worst.absolute, worst.relative) == (3.0, 9.0)  # type: ignore[union-attr]
    (undefined,) = gl_child.worst_rows([finding(2.0), nan])
    assert not undefined.ok  # type: ignore[union-attr]


def finding(error: float) -> Finding:
    return Finding("sbuffer", "case", error, error, "pixel 1", 10.0, "absolute")


def child(code: str) -> list[object]:
    made = gl.Child("here", [sys.executable, "-c", code], {})
    try:
        return list(made.rows())
    finally:
        made.close()


def test_a_crash_is_a_violation_that_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    line = """print('{"at": "moment, stacks"}', flush=True)"""
    (crashed,) = child(f"{line}; import os, sys; print('lost', file=sys.stderr, flush=True); os.abort()")
    assert isinstance(crashed, Broken)
    assert "moment, stacks" in crashed.why
    assert "lost" in crashed.why
    (early,) = child(line)
    assert isinstance(early, Broken), "it ended before its last line"
    monkeypatch.setattr(gl, "SILENCE", 1.0)
    (hung,) = child(f"{line}; import time; time.sleep(60)")
    assert isinstance(hung, Broken)
    assert "hung" in hung.why
    assert "moment, stacks" in hung.why


def test_drivers_whose_captures_differ_are_a_violation() -> None:
    assert [row.ok for row in gl.agreement({"a": "1", "b": "2"}, {"a": "1", "b": "2"})] == [True]
    (differ,) = gl.agreement({"a": "1", "b": "2"}, {"a": "1", "b": "3"})
    assert not differ.ok
    assert differ.where == "b"
    assert list(gl.agreement({"a": "1"}, {})) == []


def test_drivers_are_known_by_what_they_say_they_are() -> None:
    says = {
        LLVMPIPE.name: "llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5",
        ZINK.name: "zink (llvmpipe (LLVM 15.0.6, 256 bits)), OpenGL 4.6",
        GPU.name: "NVIDIA H100/PCIe/SSE2, OpenGL 4.6",
    }
    for driver in (LLVMPIPE, ZINK, GPU):
        assert [name for name, text in says.items() if driver.is_it(text)] == [driver.name]


def test_scenes_that_are_not_finite_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert all(row.ok for row in gl_refused.rows())
    monkeypatch.setattr(gl_refused, "load_scene", lambda path: None)
    rows = list(gl_refused.rows())
    assert not any(row.ok for row in rows)
    assert "a mesh's points" in rows[0].where
