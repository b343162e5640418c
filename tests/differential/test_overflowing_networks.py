"""`kbuffer-deep` with a bundle whose network overflows: the budget holds all the same, wherever cuts are chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.ranks import expected_k, ranks_and_counts
from support.training import export_overflowing, export_random, random_weights

from renderer.allocation.prices import feature_prior, gain_prices, ranks_of
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame
from renderer.onnx_network import OnnxNetwork
from renderer.techniques import Budget, KBufferDeep
from schemas.fragments import FragmentDump
from schemas.tail import DEFAULT_TAIL, TAILS


@pytest.fixture(scope="module")
def folder(dump: FragmentDump, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("networks")
    features, network = features_of(dump)[dump.counts > 0], random_weights(3, FEATURES)
    export_random(folder / "plain", network, features)
    export_overflowing(folder / "overflowing", network, features)
    return folder


def features_of(dump: FragmentDump) -> NDArray[np.float32]:
    return derive(gather(dump, DEFAULT_TAIL))


def budgets(dump: FragmentDump) -> list[int]:
    occupied = int(np.count_nonzero(dump.counts))
    return [0, 1, occupied - 1, occupied, dump.total // 3, dump.total - 1]


def test_its_answers_are_not_numbers_and_its_cuts_the_twins(frame: Frame, dump: FragmentDump, folder: Path) -> None:
    deep = KBufferDeep(folder / "overflowing")
    listed = np.flatnonzero(dump.counts).astype(np.uint32)
    answers = deep.predict(frame, listed)
    assert np.isnan(answers).any()
    assert np.isinf(answers).any()
    ranks, counts = ranks_and_counts(deep, frame)
    answered = gain_prices(answers, feature_prior(features_of(dump)[listed], counts[listed], TAILS[DEFAULT_TAIL]))
    assert np.isnan(answered).any()
    apart = np.abs(ranks[listed].astype(int) - ranks_of(answered, counts[listed]).astype(int))
    assert (apart.max(), (apart > 0).mean() < 1e-3) == (pytest.approx(0, abs=1), True)
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget))
        expected = expected_k(deep, frame, budget)
        assert np.array_equal(rendered.k, expected)
        assert rendered.captured == expected.sum() <= budget
        assert np.isfinite(rendered.linear).all()


def test_a_runtime_on_the_cpu_keeps_the_budget_too(
    frame: Frame, dump: FragmentDump, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = KBufferDeep(folder / "plain", "onnx")
    bad = np.full((5, 13), -8.0, np.float32)
    bad[:, -1] = 0.5
    bad[0], bad[1], bad[2, 3:7], bad[3, -1] = np.nan, np.inf, -np.inf, np.nan
    monkeypatch.setattr(OnnxNetwork, "run", lambda self, rows: bad[np.arange(len(rows)) % len(bad)])
    most = int(dump.counts.max())
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget))
        assert budget - most < rendered.captured <= budget
        assert ((rendered.k >= 0) & (rendered.k <= dump.counts)).all()
        assert np.isfinite(rendered.linear).all()
