"""The chain in both its forms: the same core, the same tails; the one-pass form where the driver has 64-bit atomics."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.scenes import SIZE, VIEW, shells

from labeller.curves import composite
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBuffer, KBufferDynamic, KBufferImportance, KBufferOptimal, Rendered
from renderer.techniques.base import ChainForm
from renderer.techniques.chain import one_pass_available
from renderer.techniques.skips import PREDICTOR, TAIL
from schemas.fragments import FragmentDump
from schemas.limits import Limits
from schemas.problem import Problem
from schemas.tail import TAILS, TailName


@pytest.fixture(scope="module", params=["two-pass", "one-pass"])
def form(request: pytest.FixtureRequest, gl: moderngl.Context) -> ChainForm:
    chosen: ChainForm = request.param
    if chosen == "one-pass" and not one_pass_available(gl):
        pytest.skip("this driver has no 64-bit atomics; tests/integration/test_zink.py runs this with one that has")
    return chosen


@pytest.fixture(scope="module")
def k(dump: FragmentDump) -> NDArray[np.int32]:
    drawn = np.random.default_rng(3).integers(0, 12, dump.pixels)
    return np.minimum(drawn, dump.counts).astype(np.int32)


def render(frame: Frame, k: NDArray[np.int32], form: ChainForm, tail: TailName = "density") -> Rendered:
    return KBufferOptimal(lambda *_: k).render(frame, Budget(0, tail, chain=form))


@pytest.mark.parametrize("tail", TAILS)
def test_both_forms_look_as_simulated(
    frame: Frame, dump: FragmentDump, k: NDArray[np.int32], form: ChainForm, tail: TailName
) -> None:
    rendered = render(frame, k, form, tail)
    simulated = composite(dump, k, tail).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, simulated, atol=3e-6, rtol=0)


@pytest.mark.parametrize("tail", TAILS)
def test_forms_differ_only_by_the_order_of_the_tails_sums(
    frame: Frame, k: NDArray[np.int32], form: ChainForm, tail: TailName
) -> None:
    one, two = render(frame, k, form, tail), render(frame, k, "two-pass", tail)
    # A sum of up to 26 float32 numbers in another order: half an ulp each, on values below 1.
    np.testing.assert_allclose(one.linear, two.linear, atol=1e-6, rtol=0)
    assert np.array_equal(one.k, two.k)
    assert (one.pool_bytes, one.pixel_bytes) == (two.pool_bytes, two.pixel_bytes)


def test_passes_are_named_by_the_form(frame: Frame, k: NDArray[np.int32], form: ChainForm) -> None:
    chain = ["chain"] if form == "one-pass" else ["chain-depth", "chain-colour"]
    assert list(render(frame, k, form).passes) == ["opaque", "count", "gather", "prefix", *chain, "resolve"]


def test_the_best_form_that_the_driver_has_is_chosen(
    gl: moderngl.Context, frame: Frame, k: NDArray[np.int32], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ("chain" in render(frame, k, "auto").passes) == one_pass_available(gl)
    pool = 8 * int(k.sum())
    monkeypatch.setattr("renderer.techniques.chain.LIMITS", Limits(buffer_bytes=pool - 8))
    assert "chain-depth" in render(frame, k, "auto").passes, "one buffer for all would be too large"


def test_one_pass_without_the_extension_is_a_problem(
    frame: Frame, k: NDArray[np.int32], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("renderer.techniques.chain._EXTENSIONS", frozenset({"GL_NONE_such"}))
    assert "chain-depth" in render(frame, k, "auto").passes
    with pytest.raises(Problem, match="64-bit"):
        render(frame, k, "one-pass")


def test_a_picture_is_identical_from_run_to_run(
    gl: moderngl.Context, frame: Frame, k: NDArray[np.int32], form: ChainForm
) -> None:
    again = Frame(GpuScene(gl, shells()), VIEW, *SIZE)
    assert np.array_equal(render(frame, k, form).linear, render(again, k, form).linear)


def test_enough_slots_need_no_tail(gl: moderngl.Context, dump: FragmentDump, form: ChainForm) -> None:
    fresh = Frame(GpuScene(gl, shells()), VIEW, *SIZE)
    exact = composite(dump, dump.counts).reshape(dump.height, dump.width, 3)
    most = int(dump.counts.max())
    chain = {"chain"} if form == "one-pass" else {"chain-depth", "chain-colour"}
    for technique, budget, pool in (
        (KBuffer(), most * dump.pixels, 8 * most * dump.pixels),
        (KBufferDynamic(), dump.total, 8 * dump.total),
    ):
        rendered = technique.render(fresh, Budget(budget, chain=form))
        np.testing.assert_allclose(rendered.linear, exact, atol=1e-6, rtol=0)
        assert rendered.skips[TAIL] == 1
        assert set(rendered.passes) - {"histogram"} == {"opaque", "count", "prefix", "resolve"} | chain
        assert (rendered.pool_bytes, rendered.pixel_bytes) == (pool, 12 + 4)
    one_less = KBuffer().render(fresh, Budget((most - 1) * dump.pixels, "density", chain=form))
    assert one_less.skips[TAIL] == 0
    assert one_less.pixel_bytes == 12 + 4 + 16 + 32


def test_importance_is_not_computed_where_all_fits(gl: moderngl.Context, dump: FragmentDump, form: ChainForm) -> None:
    fresh = Frame(GpuScene(gl, shells()), VIEW, *SIZE)
    rendered = KBufferImportance().render(fresh, Budget(dump.total, chain=form))
    assert (rendered.skips[PREDICTOR], rendered.skips[TAIL]) == (1, 1)
    assert not {"importance", "facing"} & set(rendered.passes)
    exact = composite(dump, dump.counts).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, exact, atol=1e-6, rtol=0)
    less = KBufferImportance().render(fresh, Budget(dump.total - 1, chain=form))
    assert PREDICTOR not in less.skips
    assert {"importance", "facing"} < set(less.passes)


def test_no_slots_at_all_is_all_tail(frame: Frame, dump: FragmentDump, form: ChainForm) -> None:
    none = np.zeros(dump.pixels, dtype=np.int32)
    rendered = render(frame, none, form, "density")
    assert rendered.pool_bytes == 0
    np.testing.assert_allclose(
        rendered.linear, composite(dump, none, "density").reshape(rendered.linear.shape), atol=3e-6, rtol=0
    )
