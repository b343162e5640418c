"""`kbuffer-deep` with a bundle whose network overflows: the budget is met all the same, wherever it is solved."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from renderer.allocation.lattice import curves_of, solve_on_lattice
from renderer.frame import Frame
from renderer.onnx_network import OnnxNetwork
from renderer.techniques import Budget, KBufferDeep
from schemas.fragments import FragmentDump
from services.stress.gl_network import Networks, random_networks
from services.stress.predictors import networks, real_features
from trainer.weights import Weights


@pytest.fixture(scope="module")
def weights() -> Weights:
    return next(iter(networks(0, real_features(np.random.default_rng(0), 50)).values()))


@pytest.fixture(scope="module")
def made(gl: moderngl.Context, weights: Weights, tmp_path_factory: pytest.TempPathFactory) -> Networks:
    return random_networks(tmp_path_factory.mktemp("networks"), weights, "here")


def budgets(dump: FragmentDump) -> list[int]:
    occupied = int(np.count_nonzero(dump.counts))
    return [0, 1, occupied - 1, occupied, dump.total // 3, dump.total - 1]


def test_its_answers_are_not_numbers_and_its_counts_the_twins(frame: Frame, dump: FragmentDump, made: Networks) -> None:
    deep, n = KBufferDeep(made.overflowing), dump.counts
    listed = np.flatnonzero(n).astype(np.uint32)
    answers = np.ones((dump.pixels, 2), np.float32)
    answers[listed] = deep.predict(frame, listed)
    assert np.isnan(answers[listed]).sum() > len(listed) / 4
    assert np.isinf(answers[listed]).any()
    curves = curves_of(answers[:, 0], answers[:, 1])
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget, "density"))
        assert rendered.captured == budget
        assert np.array_equal(rendered.k, solve_on_lattice(curves, n, budget).k)
        assert np.isfinite(rendered.linear).all()


@pytest.mark.parametrize("where", ["glsl", "onnx"])
def test_a_solver_on_the_cpu_meets_the_budget_too(
    frame: Frame, dump: FragmentDump, made: Networks, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = KBufferDeep(made.overflowing, "glsl", "cpu")
    if where == "onnx":
        deep = KBufferDeep(made.plain, "onnx")
        bad = np.array([[np.nan, 1.0], [np.inf, np.inf], [-np.inf, 0.5], [-8.0, np.nan], [-3.0, 0.02]], np.float32)
        monkeypatch.setattr(OnnxNetwork, "run", lambda self, rows: bad[np.arange(len(rows)) % len(bad)])
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget, "density"))
        assert rendered.captured == budget
        assert (rendered.k >= 0).all()
        assert (rendered.k <= dump.counts).all()
        assert np.isfinite(rendered.linear).all()
