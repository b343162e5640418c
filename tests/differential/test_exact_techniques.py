"""The exact techniques against the float64 composite: ties, repeated fragments, one layer, many layers, none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support import scenes

from evaluation.stress import gl_stacks as stacks
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference import depth_peeling, dual_depth_peeling, exact
from renderer.techniques import (
    ABufferArray,
    ABufferList,
    Budget,
    DepthPeeling,
    DualDepthPeeling,
    SBuffer,
    Technique,
)
from schemas.fragments import FragmentDump
from schemas.limits import Limits
from schemas.problem import Problem
from schemas.scene import SceneArrays
from schemas.view import View

EXACT: dict[str, tuple[Technique, ModuleType]] = {
    technique.name: (technique, twin)
    for technique, twin in (
        (ABufferList(), exact),
        (ABufferArray(), exact),
        (SBuffer(), exact),
        (DepthPeeling(), depth_peeling),
        (DualDepthPeeling(), dual_depth_peeling),
    )
}
PEELING = ("depth-peeling", "dual-depth-peeling")
LAYERS = 100


@dataclass(frozen=True)
class Case:
    frame: Frame
    dump: FragmentDump
    pictures: dict[str, NDArray[np.float32]]


def drawn_twice(scene: SceneArrays) -> SceneArrays:
    """Every transparent triangle twice: every fragment has an equal one."""
    batches = tuple(batch for batch in scene.batches if batch.layer != "opaque")
    return replace(scene, batches=scene.batches + batches)


def stack(layers: int) -> dict[str, stacks.Stack]:
    some = stacks.extreme_stacks(layers)
    return {name: some[name] for name in ("any alpha", "equal depths")}


def cases() -> dict[str, tuple[SceneArrays, View, tuple[int, int]]]:
    shells = scenes.shells(subdivisions=1)
    size = (96, 72)
    opaque = tuple(batch for batch in shells.batches if batch.layer == "opaque")
    return {
        "ties": (shells, scenes.VIEW, size),
        "glass": (scenes.with_glass(shells), scenes.VIEW, size),
        "repeated": (drawn_twice(shells), scenes.VIEW, size),
        "one": (stacks.stack_scene(stack(1)), stacks.VIEW, stacks.size(2)),
        "many": (stacks.stack_scene(stack(LAYERS)), stacks.VIEW, stacks.size(2)),
        "many repeated": (drawn_twice(stacks.stack_scene(stack(LAYERS))), stacks.VIEW, stacks.size(2)),
        "none": (replace(shells, batches=opaque), scenes.VIEW, size),
    }


@pytest.fixture(scope="module")
def gpus(gl: moderngl.Context) -> dict[str, GpuScene]:
    made = {name: GpuScene(gl, scene) for name, (scene, _, _) in cases().items()}
    for gpu in made.values():  # compiled once for all scenes
        gpu.programs = made["ties"].programs
    return made


@pytest.fixture(scope="module", params=list(cases()))
def case(request: pytest.FixtureRequest, gpus: dict[str, GpuScene]) -> Case:
    frame = frame_of(gpus, request.param)
    pictures = {name: technique.render(frame, Budget(0)).linear for name, (technique, _) in EXACT.items()}
    return Case(frame, capture(frame).dump, pictures)


def frame_of(gpus: dict[str, GpuScene], name: str) -> Frame:
    _, view, size = cases()[name]
    return Frame(gpus[name], view, *size)


def test_every_exact_technique_equals_its_float64_twin(case: Case) -> None:
    for name, (_, twin) in EXACT.items():
        truth = twin.picture(case.dump).reshape(case.frame.height, case.frame.width, 3)
        np.testing.assert_allclose(case.pictures[name], truth, atol=1e-6, rtol=0, err_msg=name)


def test_all_exact_techniques_agree(case: Case) -> None:
    for name, picture in case.pictures.items():
        np.testing.assert_allclose(picture, case.pictures["sbuffer"], atol=1e-6, rtol=0, err_msg=name)


def test_the_cases_are_what_they_are_called(gpus: dict[str, GpuScene]) -> None:
    dumps = {name: capture(frame_of(gpus, name)).dump for name in gpus}
    most = {name: int(dump.counts.max()) for name, dump in dumps.items()}
    assert (most["none"], most["one"], most["many"], most["many repeated"]) == (0, 1, LAYERS, 2 * LAYERS)
    ties = dumps["ties"]
    assert (ties.depth[1:] == ties.depth[:-1]).mean() > 0.3
    repeated = dumps["repeated"]
    assert np.array_equal(repeated.depth[::2], repeated.depth[1::2])
    assert np.array_equal(repeated.rgba[::2], repeated.rgba[1::2])


@pytest.mark.parametrize("name", list(EXACT))
def test_bands_of_rows_give_the_same_picture(
    name: str, gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = frame_of(gpus, "ties")
    technique = EXACT[name][0]
    whole = technique.render(frame, Budget(0))
    largest = 12 * frame.width * int(frame.count().max())
    monkeypatch.setattr("renderer.techniques.bands.LIMITS", Limits(buffer_bytes=largest))
    drawn = count_draws(frame, monkeypatch)
    banded = technique.render(frame, Budget(0))
    assert len({scissor for _, scissor in drawn} - {None}) > 2
    assert np.array_equal(banded.linear, whole.linear)
    assert banded.total_bytes == whole.total_bytes


@pytest.mark.parametrize("name", ["abuffer-list", "abuffer-array"])
def test_a_sort_in_many_dispatches_gives_the_same_picture(
    name: str, gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = frame_of(gpus, "many repeated")
    technique = EXACT[name][0]
    whole = technique.render(frame, Budget(0)).linear
    monkeypatch.setattr(f"renderer.techniques.{name.replace('-', '_')}.TURNS", 1500)
    assert np.array_equal(technique.render(frame, Budget(0)).linear, whole)


@pytest.mark.parametrize("layers", [1, 4, 5, 8, 9, 16, 17, 64, 65, 255, 256, 257, 700])
def test_the_sbuffer_sorts_runs_of_every_class(gl: moderngl.Context, gpus: dict[str, GpuScene], layers: int) -> None:
    rng = np.random.default_rng(layers)
    some = {"apart": stacks.extreme_stacks(layers)["any alpha"], "ties": stacks.awkward_stacks(layers)["three depths"]}
    some["shorter"] = stacks.Stack(rng.uniform(10.0, 20.0, 1 + layers // 3), rng.integers(1, 255, 1 + layers // 3))
    gpu = GpuScene(gl, stacks.stack_scene(some))
    gpu.programs = gpus["ties"].programs
    frame = Frame(gpu, stacks.VIEW, *stacks.size(len(some)))
    truth = exact.picture(capture(frame).dump).reshape(frame.height, frame.width, 3)
    rendered = SBuffer().render(frame, Budget(0))
    assert rendered.k.max() == layers
    np.testing.assert_allclose(rendered.linear, truth, atol=1e-6, rtol=0)
    # Composited in another order, as where two fragments are exchanged, the last bits differ.
    assert np.array_equal(rendered.linear, ABufferList().render(frame, Budget(0)).linear)


def test_more_fragments_than_a_shader_can_order_are_a_problem(
    gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("renderer.techniques.bands.MOST_FRAGMENTS", LAYERS - 1)
    with pytest.raises(Problem, match=f"{LAYERS} transparent fragments"):
        ABufferList().render(frame_of(gpus, "many"), Budget(0))


def test_a_row_that_does_not_fit_is_a_problem(gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch) -> None:
    frame = frame_of(gpus, "ties")
    monkeypatch.setattr("renderer.techniques.bands.LIMITS", Limits(buffer_bytes=8 * frame.width))
    with pytest.raises(Problem, match="Row"):
        ABufferArray().render(frame, Budget(0))


@pytest.mark.parametrize("name", list(EXACT))
def test_a_picture_is_identical_from_run_to_run(name: str, gpus: dict[str, GpuScene]) -> None:
    first, second = (EXACT[name][0].render(frame_of(gpus, "repeated"), Budget(0)).linear for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize(("name", "passes"), [("depth-peeling", LAYERS), ("dual-depth-peeling", LAYERS)])
def test_peeling_needs_a_geometry_pass_a_fragment_at_most(
    name: str, passes: int, gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = frame_of(gpus, "many")  # one of its stacks is all ties: the worst case
    drawn = count_draws(frame, monkeypatch)
    EXACT[name][0].render(frame, Budget(0))
    assert len([fragment for fragment, _ in drawn if fragment == f"{name}/peel.frag"]) <= passes


def test_dual_peeling_needs_half_the_passes_without_ties(
    gl: moderngl.Context, gpus: dict[str, GpuScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    apart = {"apart": stacks.extreme_stacks(11)["alpha 128"]}
    gpu = GpuScene(gl, stacks.stack_scene(apart))
    gpu.programs = gpus["ties"].programs
    passes = {}
    for name in PEELING:
        frame = Frame(gpu, stacks.VIEW, *stacks.size(1))
        with monkeypatch.context() as patch:
            drawn = count_draws(frame, patch)
            EXACT[name][0].render(frame, Budget(0))
        passes[name] = len([fragment for fragment, _ in drawn if fragment == f"{name}/peel.frag"])
    assert passes == {"depth-peeling": 11, "dual-depth-peeling": 6}


def test_costs_are_reported_as_they_are(gpus: dict[str, GpuScene]) -> None:
    frame = frame_of(gpus, "ties")
    n = frame.count()
    total, most = int(n.sum()), int(n.max())
    rendered = {name: technique.render(frame, Budget(0)) for name, (technique, _) in EXACT.items()}
    for name, one in rendered.items():
        assert one.captured == total, name
        assert np.array_equal(one.k, n), name
        assert one.compared_bytes == one.total_bytes, name
    pools = {name: one.pool_bytes for name, one in rendered.items()}
    assert pools == {
        "abuffer-list": 12 * total,
        "abuffer-array": 8 * most * frame.pixels,
        "sbuffer": 8 * total,
        "depth-peeling": 0,
        "dual-depth-peeling": 0,
    }
    pixels = {name: one.pixel_bytes for name, one in rendered.items()}
    assert pixels == {
        "abuffer-list": 8,
        "abuffer-array": 4,
        "sbuffer": 4,
        "depth-peeling": 20,
        "dual-depth-peeling": 52,
    }
    assert list(rendered["sbuffer"].passes) == ["opaque", "count", "prefix", "capture", "resolve"]
    assert list(rendered["abuffer-list"].passes) == ["opaque", "count", "list", "sort", "resolve"]
    assert list(rendered["abuffer-array"].passes) == ["opaque", "count", "array", "sort", "resolve"]
    for name in PEELING:
        assert list(rendered[name].passes) == ["opaque", "count", "peel", "step", "resolve"]


def count_draws(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, object]]:
    """Fragment shader and scissor of every geometry pass from now on."""
    drawn: list[tuple[str, object]] = []
    draw = frame.draw_transparent

    def spy(fragment: str, *args: object, **kwargs: object) -> None:
        drawn.append((fragment, kwargs.get("scissor")))
        draw(fragment, *args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr(frame, "draw_transparent", spy)
    return drawn
