"""`kbuffer-temporal` frame by frame against `kbuffer-deep`, its float64 twin, and the numbers of pixels it has seen."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.ranks import ranks_and_counts
from support.scenes import SIZE, VIEW, shells
from support.training import export_overflowing, export_random, random_weights

from benchmarks.temporal import SHOWN, STEPS, measure, page
from evaluation.bench.measure import over
from evaluation.bench.subject import Subject
from evaluation.versions import machine
from labeller.curves import composite, error_curves
from renderer.allocation.cuts import events_of, solve_cuts
from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference import temporal as twin
from renderer.techniques import Budget, KBufferDeep, KBufferTemporal
from renderer.techniques.kbuffer_temporal import FRAMES, MEMORY_BYTES, MOVING_FRAMES, SETTLED, is_cut
from schemas.bundle import load_manifest
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TailName
from schemas.view import View

SMALL = (64, 48)
"""Where many frames are rendered."""


def turned(number: int) -> View:
    """The camera a little further on."""
    x, y, z = VIEW.eye
    further: View = VIEW.model_copy(update={"eye": (x + 0.02 * number, y, z)})
    return further


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


@pytest.fixture(scope="module")
def bundle(dump: FragmentDump, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    export_random(folder, random_weights(11), derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0])
    return folder


def memory_of(technique: KBufferTemporal) -> twin.Remembered:
    assert technique._past is not None
    return twin.unpacked(np.frombuffer(technique._past.memory.read(), dtype=np.uint32))


def fragments_of(dump: FragmentDump, share: float) -> int:
    return int(share * dump.total)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_first_frame_is_that_of_kbuffer_deep_and_sees_what_last_fragments_change(
    gpu: GpuScene, dump: FragmentDump, tmp_path: Path, tail: TailName
) -> None:
    export_random(tmp_path, random_weights(11, tail=tail), derive(gather(dump, tail))[dump.counts > 0], tail)
    budget, temporal = Budget(fragments_of(dump, 0.3), tail), KBufferTemporal(tmp_path)
    first = temporal.render(Frame(gpu, VIEW, *SIZE, float_sums=True), budget)
    plain = KBufferDeep(tmp_path).render(Frame(gpu, VIEW, *SIZE, float_sums=True), budget)
    assert np.array_equal(first.linear, plain.linear)
    assert np.array_equal(first.k, plain.k)
    assert first.pixel_bytes == plain.pixel_bytes + MEMORY_BYTES
    assert first.early_bytes == plain.early_bytes + MEMORY_BYTES

    is_open = dump.counts > 0
    ranks, counts = ranks_and_counts(KBufferDeep(tmp_path), Frame(gpu, VIEW, *SIZE, float_sums=True))
    _, before = twin.corrected(twin.nothing(dump.pixels), ranks, dump.counts, is_open, still=False)
    cut = solve_cuts(events_of(ranks, counts), budget.fragments).cut
    last = np.where(cut > 0, counts[np.arange(dump.pixels), np.maximum(cut - 1, 0)], 0)
    pictures = (composite(dump, k, tail, budget.g).astype(np.float64) for k in (first.k, first.k - last))
    expected, found = twin.observed(before, cut, last, *pictures), memory_of(temporal)
    for field in ("is_open", "correction", "cut", "frames", "n"):
        assert np.array_equal(getattr(found, field), getattr(expected, field)), field
    # A change of the colour below 1e-4 is found by subtraction in float32.
    clear = expected.seen > 80
    assert clear.any()
    apart = np.abs(found.seen - expected.seen)
    assert apart[clear].max() <= 1
    assert (apart[clear] == 0).mean() > 0.97


@pytest.mark.parametrize("moves", [False, True])
def test_next_frames_are_those_of_the_twin(gpu: GpuScene, bundle: Path, moves: bool) -> None:
    temporal, deep = KBufferTemporal(bundle), KBufferDeep(bundle)
    budget = Budget(3 * SIZE[0] * SIZE[1] // 2)
    before, learnt = None, 0
    for number in range(4):
        frame = Frame(gpu, turned(number if moves else 0), *SIZE)
        rendered = temporal.render(frame, budget)
        n = frame.count()
        assert budget.fragments - int(n.max()) < rendered.captured <= budget.fragments
        assert (rendered.k >= 0).all()
        assert (rendered.k <= n).all()
        found = memory_of(temporal)
        if before is not None:
            is_open = n > 0
            ranks, counts = ranks_and_counts(deep, frame)
            corrected, expected = twin.corrected(before, ranks, n, is_open, still=not moves)
            assert np.array_equal(found.is_open, is_open)
            for field in ("correction", "frames", "n"):
                apart = np.abs(getattr(found, field) - getattr(expected, field))
                assert apart.max() <= (field == "correction"), field
                assert (apart == 0).mean() > 0.99, field
            k = solve_cuts(events_of(corrected, counts), budget.fragments).k
            # Corrections are whole steps: a pixel whose correction is rounded the other way may have another cut.
            assert (rendered.k == k).mean() > 0.99
            learnt += int(np.count_nonzero(found.correction))
        before = found
    assert learnt > 1000


def test_it_learns_and_then_stands_still(gpu: GpuScene, bundle: Path, dump: FragmentDump) -> None:
    curves = error_curves(dump, DEFAULT_TAIL)
    temporal, budget = KBufferTemporal(bundle), Budget(fragments_of(dump, 0.3))
    errors, ks = [], []
    # A pixel without a core sees nothing in a frame, so that it takes some of them longer.
    for _ in range(4 * FRAMES):
        rendered = temporal.render(Frame(gpu, VIEW, *SIZE), budget)
        errors.append(curves.total(rendered.k))
        ks.append(rendered.k)
    assert errors[SETTLED - 1] < 0.9 * errors[0]
    assert np.array_equal(ks[-1], ks[-2])
    found = memory_of(temporal)
    assert found.frames[found.cut > 0].max() == FRAMES


def test_the_same_frames_are_the_same_pictures(gpu: GpuScene, bundle: Path) -> None:
    budget = Budget(SMALL[0] * SMALL[1])

    def pictures() -> list[bytes]:
        temporal = KBufferTemporal(bundle)
        return [temporal.render(Frame(gpu, turned(i), *SMALL), budget).linear.tobytes() for i in (0, 0, 1, 2)]

    first = pictures()
    assert len(set(first)) == len(first)
    assert pictures() == first


def test_it_begins_anew_with_whatever_is_another(gpu: GpuScene, bundle: Path, gl: moderngl.Context) -> None:
    temporal, deep = KBufferTemporal(bundle), KBufferDeep(bundle)
    one, two = Budget(SMALL[0] * SMALL[1]), Budget(SMALL[0] * SMALL[1] + 500)
    other = GpuScene(gl, shells(layers=4))
    turns = [
        (gpu, VIEW, SMALL, one, "first"),
        (gpu, VIEW, SMALL, two, "budget"),
        (gpu, VIEW, (48, 64), two, "size, of as many pixels"),
        (other, VIEW, (48, 64), two, "scene"),
        (other, turned(50), (48, 64), two, "view, after a cut"),
    ]
    for scene, view, size, budget, what in turns:
        new = temporal.render(Frame(scene, view, *size), budget).k
        assert np.array_equal(new, deep.render(Frame(scene, view, *size), budget).k), what
        again = temporal.render(Frame(scene, view, *size), budget).k
        assert not np.array_equal(new, again), what


@pytest.mark.parametrize("counted", [False, True])
def test_after_a_frame_with_all_its_fragments_it_begins_anew(gpu: GpuScene, bundle: Path, counted: bool) -> None:
    # A step back from a view in which the budget holds all fragments.
    near, far = VIEW, VIEW.model_copy(update={"eye": tuple(1.02 * x for x in VIEW.eye)})
    low, high = gpu.scene.bounds
    assert not is_cut(near, far, float(np.linalg.norm(high - low)))
    budget = Budget(int(Frame(gpu, far, *SMALL).count().sum()))
    assert budget.fragments < Frame(gpu, near, *SMALL).count().sum()
    temporal, deep = KBufferTemporal(bundle), KBufferDeep(bundle)
    plain = deep.render(Frame(gpu, near, *SMALL), budget)
    for view in (near, near, far, near):
        frame = Frame(gpu, view, *SMALL)
        if counted:
            frame.count()
        rendered = temporal.render(frame, budget)
        assert rendered.captured <= budget.fragments
        if view is far:
            assert rendered.captured == budget.fragments
            assert np.array_equal(rendered.linear, deep.render(Frame(gpu, view, *SMALL), budget).linear)
    assert np.array_equal(rendered.linear, plain.linear)


def test_a_frame_that_fails_leaves_nothing_behind(gpu: GpuScene, bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    temporal, budget = KBufferTemporal(bundle), Budget(SMALL[0] * SMALL[1])
    first = temporal.render(Frame(gpu, VIEW, *SMALL), budget)
    with monkeypatch.context() as patch:
        patch.setattr(KBufferDeep, "_predict_ranks", lambda *_: (_ for _ in ()).throw(Problem("Full.", "Smaller.")))
        with pytest.raises(Problem):
            temporal.render(Frame(gpu, turned(1), *SMALL), budget)
    assert np.array_equal(temporal.render(Frame(gpu, VIEW, *SMALL), budget).linear, first.linear)


def test_a_camera_by_another_name_stands_still(gpu: GpuScene, bundle: Path) -> None:
    temporal, budget = KBufferTemporal(bundle), Budget(SMALL[0] * SMALL[1])
    for number in range(MOVING_FRAMES + 3):
        view = VIEW.model_copy(update={"name": f"frame {number}"})
        temporal.render(Frame(gpu, view, *SMALL), budget)
    assert memory_of(temporal).frames.max() > MOVING_FRAMES


@pytest.mark.parametrize(("size", "away"), [((1, 1), False), ((3, 2), False), ((8, 8), True)])
def test_small_and_empty_pictures(gpu: GpuScene, bundle: Path, size: tuple[int, int], away: bool) -> None:
    view = VIEW.model_copy(update={"target": (VIEW.eye[0], VIEW.eye[1], 2.0 * VIEW.eye[2])}) if away else VIEW
    n = Frame(gpu, view, *size).count()
    assert n.any() != away
    for fragments in {0, 1, max(int(n.sum()) - 1, 0), int(n.sum())}:
        temporal = KBufferTemporal(bundle)
        for _ in range(2):
            rendered = temporal.render(Frame(gpu, view, *size), Budget(fragments))
            assert min(fragments, int(n.sum())) - int(n.max()) <= rendered.captured <= fragments
            assert np.isfinite(rendered.linear).all()


def test_answers_that_are_no_numbers_stay_within_the_budget(gpu: GpuScene, dump: FragmentDump, tmp_path: Path) -> None:
    export_overflowing(tmp_path, random_weights(3), derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0])
    temporal = KBufferTemporal(tmp_path)
    for fragments in (0, int(np.count_nonzero(dump.counts)) - 1, dump.total // 3, dump.total - 1):
        for _ in range(2):
            rendered = temporal.render(Frame(gpu, VIEW, *SIZE), Budget(fragments))
            assert fragments - int(dump.counts.max()) < rendered.captured <= fragments
            assert np.isfinite(rendered.linear).all()
        assert np.abs(memory_of(temporal).correction).max() <= twin.LARGEST


def test_without_prices_on_the_gpu_there_is_nothing_to_correct(
    gpu: GpuScene, bundle: Path, dump: FragmentDump, tmp_path: Path
) -> None:
    weights = random_weights(5, ("log_n",), (8,), "importance")
    export_random(tmp_path, weights, derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0])
    for temporal in (KBufferTemporal(tmp_path), KBufferTemporal(bundle, "onnx")):
        with pytest.raises(Problem, match="corrects prices of bins on the GPU") as caught:
            temporal.render(Frame(gpu, VIEW, *SMALL), Budget(1000))
        assert caught.value.code == ExitCode.LIMIT


def test_the_benchmark_measures_the_frames_that_it_names(gpu: GpuScene, bundle: Path) -> None:
    subject = Subject(gpu, VIEW, SMALL)
    fragments = fragments_of(subject.dump, 0.4)
    found = measure(subject, fragments, bundle)
    tail = load_manifest(bundle).tail
    budget, technique = Budget(fragments, tail.name, tail.g), KBufferTemporal(bundle)
    errors = []
    for _ in range(max(SHOWN) + 1):
        linear = technique.render(subject.frame(), budget).linear
        errors.append(subject.reference.display_error(linear.reshape(-1, 3)))
    assert len(set(errors)) > 1
    assert found["still"] == pytest.approx({str(frame): over(errors[frame], errors[0]) for frame in SHOWN}, rel=1e-4)
    for step in STEPS:
        moving = found["moving"][str(step)]
        assert min(moving["error"], moving["flicker"], *moving["k"]) > 0.0
    rows = [{"scene": "shells", "budget_factor": 0.5, **found}]
    table = page({"command": "c", "machine": machine(), "bundle": "b", "created": "now", "rows": rows})
    assert f"| shells | 0.5 | {found['still']['1']:.2f} |" in table
