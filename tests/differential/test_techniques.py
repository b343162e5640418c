"""Every technique's GL picture against the CPU's composite of the same dump and allocation."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from labeller.curves import composite
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBuffer, KBufferImportance, KBufferOptimal, SBuffer
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.tail import TAILS, TailName


def simulate(dump: FragmentDump, k: np.ndarray, tail: TailName, g: float = 0.75) -> np.ndarray:
    return composite(dump, k, tail, g).reshape(dump.height, dump.width, 3)


@pytest.mark.parametrize("tail", TAILS)
def test_any_allocation_looks_as_simulated__tail(frame: Frame, dump: FragmentDump, tail: TailName) -> None:
    k = np.random.default_rng(3).integers(0, 12, dump.pixels).astype(np.int32)
    rendered = KBufferOptimal(lambda *_: np.minimum(k, dump.counts).astype(np.int32)).render(frame, Budget(0, tail))
    np.testing.assert_allclose(rendered.linear, simulate(dump, rendered.k, tail), atol=3e-6, rtol=0)


@pytest.mark.parametrize("g", [0.0, 2.0])
def test_the_density_tails_constant_is_the_budgets__g(frame: Frame, dump: FragmentDump, g: float) -> None:
    one = np.minimum(dump.counts, 1).astype(np.int32)
    rendered = KBufferOptimal(lambda *_: one).render(frame, Budget(0, "density", g))
    np.testing.assert_allclose(rendered.linear, simulate(dump, one, "density", g), atol=3e-6, rtol=0)


def test_slots_beyond_n_stay_empty_and_the_picture_is_exact(frame: Frame, dump: FragmentDump) -> None:
    most = int(dump.counts.max())
    rendered = KBuffer().render(frame, Budget(most * frame.pixels))
    assert rendered.captured == dump.total
    np.testing.assert_allclose(rendered.linear, simulate(dump, dump.counts.astype(np.int32), "density"), atol=1e-6)


def test_sbuffer_equals_the_float64_composite(frame: Frame, dump: FragmentDump) -> None:
    rendered = SBuffer().render(frame, Budget(dump.total))
    np.testing.assert_allclose(rendered.linear, simulate(dump, dump.counts.astype(np.int32), "density"), atol=1e-6)
    assert rendered.pool_bytes == 8 * dump.total


def test_fixed_k_reserves_the_same_everywhere(frame: Frame, dump: FragmentDump) -> None:
    rendered = KBuffer().render(frame, Budget(3 * frame.pixels + 5))
    assert np.array_equal(rendered.k, np.minimum(dump.counts, 3))
    assert rendered.pool_bytes == 8 * 3 * frame.pixels


def test_importance_spends_its_budget_exactly_and_looks_as_simulated(frame: Frame, dump: FragmentDump) -> None:
    budget = Budget(dump.total // 3, "density")
    rendered = KBufferImportance().render(frame, budget)
    assert rendered.captured == budget.fragments
    exact = np.abs(
        display8(rendered.linear).astype(int) - display8(simulate(dump, rendered.k, "density")).astype(int)
    ).max()
    assert exact <= 1


def test_a_picture_is_identical_from_run_to_run(gl: moderngl.Context, frame: Frame, dump: FragmentDump) -> None:
    budget = Budget(dump.total // 4)
    again = Frame(GpuScene(gl, shells()), VIEW, *SIZE, float_sums=True)
    assert np.array_equal(
        KBufferImportance().render(frame, budget).linear, KBufferImportance().render(again, budget).linear
    )


def test_every_pass_and_byte_is_reported(frame: Frame, dump: FragmentDump) -> None:
    rendered = KBufferImportance().render(frame, Budget(dump.total // 4, chain="two-pass"))
    assert {
        "opaque",
        "count",
        "facing",
        "importance",
        "range",
        "bins",
        "prefix",
        "chain-depth",
        "chain-colour",
        "resolve",
    } == set(rendered.passes)
    assert rendered.total_bytes > rendered.pool_bytes == 8 * (dump.total // 4)
