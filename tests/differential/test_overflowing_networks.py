"""`kbuffer-deep` with a bundle whose network overflows: the budget holds all the same, wherever cuts are chosen."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import export_overflowing, export_random, random_weights

from renderer.allocation.cuts import events_of, solve_cuts
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame
from renderer.onnx_network import OnnxNetwork
from renderer.techniques import Budget, KBufferDeep
from schemas.fragments import FragmentDump
from schemas.tail import DEFAULT_TAIL


@pytest.fixture(scope="module")
def folder(dump: FragmentDump, gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("networks")
    features, network = derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0], random_weights(3, FEATURES)
    export_random(folder / "plain", network, features, gl)
    export_overflowing(folder / "overflowing", network, features, gl)
    return folder


def budgets(dump: FragmentDump) -> list[int]:
    occupied = int(np.count_nonzero(dump.counts))
    return [0, 1, occupied - 1, occupied, dump.total // 3, dump.total - 1]


def test_its_answers_are_not_numbers_and_its_cuts_the_twins(frame: Frame, dump: FragmentDump, folder: Path) -> None:
    deep = KBufferDeep(folder / "overflowing")
    listed = np.flatnonzero(dump.counts).astype(np.uint32)
    answers = deep.predict(frame, listed)
    assert np.isnan(answers).any()
    assert np.isinf(answers).any()
    by_bin = frame.kept_bins(DEFAULT_TAIL).counts()[listed]
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget))
        expected = solve_cuts(events_of(*answers.T, by_bin), budget)
        assert np.array_equal(rendered.k[listed], expected.k)
        assert rendered.captured == expected.k.sum() <= budget
        assert np.isfinite(rendered.linear).all()


def test_a_runtime_on_the_cpu_keeps_the_budget_too(
    frame: Frame, dump: FragmentDump, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = KBufferDeep(folder / "plain", "onnx")
    bad = np.array([[np.nan, 1.0], [np.inf, np.inf], [-np.inf, 0.5], [-8.0, np.nan], [-3.0, 0.02]], np.float32)
    monkeypatch.setattr(OnnxNetwork, "run", lambda self, rows: bad[np.arange(len(rows)) % len(bad)])
    most = int(dump.counts.max())
    for budget in budgets(dump):
        rendered = deep.render(frame, Budget(budget))
        assert budget - most < rendered.captured <= budget
        assert ((rendered.k >= 0) & (rendered.k <= dump.counts)).all()
        assert np.isfinite(rendered.linear).all()
