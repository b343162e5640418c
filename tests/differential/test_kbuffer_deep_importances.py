"""`kbuffer-deep` with importances: solved as curves in the frame, against `budget_fill` on the CPU and the twin."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.scenes import SIZE, VIEW, shells
from support.training import export_random, random_weights

from renderer.allocation.gpu import FrameAllocation
from renderer.allocation.lattice import importance_curves, price, solve_on_lattice
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame, Gathered
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBufferDeep
from renderer.techniques.kbuffer_deep import Solver
from renderer.techniques.skips import PREDICTOR
from schemas.fragments import FragmentDump
from services.stress.allocations import edge_budgets

_GIVEN = 4
"""A storage binding that `curves.comp` does not use."""
NETWORK = f"""
#define DIAPHANE_FEATURES 1
layout(std430, binding = {_GIVEN}) readonly buffer Given {{ float given[]; }};
void diaphane_features(in vec4 s[11], out float x[DIAPHANE_FEATURES]) {{ x[0] = 0.0; }}
float diaphane_predict(in float x[DIAPHANE_FEATURES]) {{
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return given[64u * group + gl_LocalInvocationIndex];
}}
"""
"""Answers what a buffer holds for the pixel."""


class Given(KBufferDeep):
    """With importances that a test gives, float32 [P], in place of a network's."""

    def __init__(self, bundle: Path, importance: NDArray[np.float32], solver: Solver) -> None:
        super().__init__(bundle, solver=solver)
        self._texts = {"bundle/predict.glsl": NETWORK}
        self._importance = importance

    def predict(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        return self._importance[pixels][:, None]

    def _curves(self, frame: Frame, gathered: Gathered, allocation: FrameAllocation) -> moderngl.Buffer:
        given = frame.ctx.buffer(self._importance)  # bound for as long as it is held
        given.bind_to_storage_buffer(_GIVEN)
        return super()._curves(frame, gathered, allocation)


@pytest.fixture(scope="module")
def bundle(dump: FragmentDump, gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    network = random_weights(5, FEATURES[:6], (8,), "importance", ("importance",))
    export_random(folder, network, derive(gather(dump))[dump.counts > 0], gl)
    return folder


@pytest.fixture
def fresh(gl: moderngl.Context) -> Frame:
    """A frame of which nothing is known yet."""
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE)


SOLVERS: tuple[Solver, Solver] = ("gpu", "cpu")
TIED = ("all 0", "all NaN", "all equal", "0, NaN or equal", "1 and 1e-7", "one")
"""Cases whose pixels all grow at the same few prices: nothing is rounded otherwise than in float64."""


def cases(rng: np.random.Generator, pixels: int) -> dict[str, NDArray[np.float32]]:
    values = {
        "random": rng.random(pixels),
        "labels of DHOIT": 1.0 / (1.0 + np.exp(rng.normal(13.0, 2.0, pixels))),
        "1e-13 to 1": 10.0 ** rng.uniform(-13.0, 0.0, pixels),
        "0 or random": rng.random(pixels) * rng.integers(0, 2, pixels),
        "NaN or random": np.where(rng.integers(0, 2, pixels) == 0, np.nan, rng.random(pixels)),
        "all 0": np.zeros(pixels),
        "all NaN": np.full(pixels, np.nan),
        "all equal": np.full(pixels, 1 / 3),
        "0, NaN or equal": rng.choice([0.0, np.nan, 0.3], pixels),
        "1 and 1e-7": np.where(rng.integers(0, 2, pixels) == 0, 1.0, 1e-7),
        "one": np.arange(pixels) == pixels // 2,
    }
    return {name: np.asarray(each, np.float32) for name, each in values.items()}


def are_near_ties(
    k: NDArray[np.int32],
    expected: NDArray[np.int32],
    importance: NDArray[np.float32],
    n: NDArray[np.integer],
    fragments: int,
) -> bool:
    """Whether the fragments that only one of two counts has come at the scale `k / w` of the next prices."""
    curves, differ = importance_curves(importance), k != expected
    index = solve_on_lattice(curves, n, fragments).index
    if index is None or not differ.any():
        return not differ.any()
    t, following = float(price(index)), float(price(index + 1))
    scale = np.maximum(k, expected)[differ] / curves.rate[differ].astype(np.float64)
    is_near = np.abs(scale - t) <= 2.0 * (following - t) + 1e-6 * t
    return bool(is_near.all() and np.abs(k - expected).max() <= 1)


@pytest.mark.parametrize("name", list(cases(np.random.default_rng(0), 1)))
def test_both_solvers_meet_the_budget_with_the_same_counts(
    bundle: Path, frame: Frame, fresh: Frame, dump: FragmentDump, name: str
) -> None:
    """From no fragment to more than there are; the GPU knows nothing of the frame before."""
    importance, n = cases(np.random.default_rng(3), dump.pixels)[name], dump.counts
    on_gpu, on_cpu = (Given(bundle, importance, solver) for solver in SOLVERS)
    for fragments in (*edge_budgets(n), 1, dump.total // 10, dump.total // 3):
        budget = Budget(fragments, "density")
        k, expected = on_gpu.render(fresh, budget).k, on_cpu.render(frame, budget).k
        assert k.sum() == min(fragments, dump.total)
        assert ((k >= 0) & (k <= n)).all()
        assert np.array_equal(k, solve_on_lattice(importance_curves(importance), n, fragments).k)
        assert are_near_ties(k, expected, importance, n, fragments)
        assert np.count_nonzero(k != expected) <= (0.0 if name in TIED else 1e-3) * np.count_nonzero(n)
    assert not fresh.counted


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_importance_that_is_nan_is_none(bundle: Path, fresh: Frame, dump: FragmentDump, solver: Solver) -> None:
    odd = np.arange(dump.pixels) % 2 == 1
    budget = int(dump.counts[~odd].sum()) // 2
    importance = np.where(odd, np.nan, 0.5).astype(np.float32)
    rendered = Given(bundle, importance, solver).render(fresh, Budget(budget, "density"))
    assert rendered.captured == budget
    assert (rendered.k[odd] == 0).all()


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9, 1.5])
def test_nothing_is_read_back_before_the_picture(
    bundle: Path, fresh: Frame, dump: FragmentDump, share: float, unread_until_pictured: list[bool]
) -> None:
    rendered = KBufferDeep(bundle).render(fresh, Budget(int(share * dump.total)))
    assert rendered.captured == min(int(share * dump.total), dump.total)
    assert rendered.skips[PREDICTOR] == (share > 1.0)
    assert len(unread_until_pictured) == 1


def test_a_networks_importances_are_solved_alike(bundle: Path, fresh: Frame, dump: FragmentDump) -> None:
    listed = np.flatnonzero(dump.counts).astype(np.uint32)
    importance = np.zeros(dump.pixels, np.float32)
    importance[listed] = KBufferDeep(bundle).predict(fresh, listed)[:, 0]
    for fragments in (dump.total // 50, dump.total // 5, dump.total // 2):
        on_gpu, on_cpu = (KBufferDeep(bundle, solver=solver).render(fresh, Budget(fragments)) for solver in SOLVERS)
        assert on_gpu.captured == on_cpu.captured == fragments
        assert are_near_ties(on_gpu.k, on_cpu.k, importance, dump.counts, fragments)
        assert (on_gpu.k != on_cpu.k).mean() < 1e-3


def test_another_budget_of_a_frame_needs_no_inference(bundle: Path, fresh: Frame, dump: FragmentDump) -> None:
    deep = KBufferDeep(bundle, keeps_curves=True)
    first, again = (deep.render(fresh, Budget(dump.total // part)) for part in (2, 3))
    assert again.passes["predict"] == first.passes["predict"]
    assert np.array_equal(again.k, KBufferDeep(bundle).render(fresh, Budget(dump.total // 3)).k)
