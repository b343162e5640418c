"""The client's numpy, which knows nothing of the project, gives the Python renderer's numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load_file, save_file
from support.dumps import random_dump
from support.training import random_weights

from diaphane_client import Predictor, Refused, allocate
from diaphane_client import importance_curve as client_curve
from renderer.allocation.cuts import events_of, importance_curve, solve_cuts
from renderer.features import FEATURES, derive, gather
from schemas.bundle import (
    HEADS,
    MANIFEST,
    WEIGHTS,
    HeadName,
    OutputName,
    ParityReport,
    Provenance,
    TailSpec,
    file_spec,
)
from trainer.bundle import Description, load_bundle, write_bundle
from trainer.weights import Weights

pytestmark = pytest.mark.usefixtures("single_thread")

EVERY = [(head, outputs) for head, choices in HEADS.items() for outputs in choices]
DUMP = random_dump(60, 50, 12, 3)
ROWS = derive(gather(DUMP, "binned-12"))
N = DUMP.counts.astype(np.int64)
COUNTS = np.random.default_rng(5).multinomial(N, np.full(12, 1.0 / 12.0)).astype(np.uint8)
BUDGETS = (0, 1, 500, int(np.count_nonzero(N)), int(N.sum()) // 2, int(N.sum()) - 1, int(N.sum()), 2 * int(N.sum()))


def written(folder: Path, weights: Weights) -> Path:
    """A bundle whose forms nobody compared."""
    description = Description(
        name="glass",
        tail=TailSpec(name="binned-12", g=0.75),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="test"),
        evaluation={},
    )
    report = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    write_bundle(folder, weights, description, ROWS[N > 0], lambda: report)
    return folder


@pytest.mark.parametrize(("head", "outputs"), EVERY)
@pytest.mark.parametrize(("names", "hidden"), [(FEATURES, (32, 16)), (FEATURES[:5], ()), (FEATURES[3:9], (7, 5, 3))])
def test_answers_are_those_of_the_bundle(
    head: HeadName, outputs: tuple[OutputName, ...], names: tuple[str, ...], hidden: tuple[int, ...], tmp_path: Path
) -> None:
    folder = written(tmp_path / "b", random_weights(4, names, hidden, head, outputs))
    predictor, bundle = Predictor.load(folder), load_bundle(folder)
    assert predictor.features == names
    assert (predictor.manifest.outputs, predictor.manifest.tail) == (outputs, "binned-12")
    inputs = ROWS[:, bundle.weights.columns]
    expected = bundle.weights.answer(inputs)
    np.testing.assert_allclose(predictor.answer(inputs), expected, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(predictor.answer(inputs.astype(np.float64)), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("head", "outputs"), EVERY)
def test_cuts_are_those_of_the_renderer(head: HeadName, outputs: tuple[OutputName, ...], tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES, (32, 16), head, outputs))
    predictor, weights = Predictor.load(folder), load_bundle(folder).weights
    answers = weights.run(ROWS)
    curve = importance_curve(answers[:, 0]) if head == "importance" else (answers[:, 0], answers[:, 1])
    events = events_of(*curve, COUNTS)
    for budget in BUDGETS:
        found, expected = predictor.predict(ROWS, budget, COUNTS), solve_cuts(events, budget)
        assert found.cut.dtype == found.k.dtype == np.int32
        assert found.k.sum() <= budget
        assert found.complete == (expected.rank is None)
        # Another order of the network's sums may move a pixel at the edge; all others are the same.
        assert np.count_nonzero(found.cut != expected.cut) <= 2 * max(1, len(N) // 1000)


counts = st.lists(st.lists(st.sampled_from([0, 0, 1, 2, 5, 200, 254, 255, 300]), min_size=8, max_size=8), max_size=9)
gain = st.one_of(st.sampled_from([0.0, -5.0, -1e30, 1e30, np.nan, np.inf]), st.floats(-200.0, 200.0, width=32))
fall = st.one_of(st.sampled_from([0.5, 0.02, 1e30, np.nan, np.inf]), st.floats(0.03125, 300.0, width=32))


@settings(max_examples=300, deadline=None)
@given(counts.filter(bool), st.data())
def test_allocate_is_the_renderers_to_the_bit(lists: list[list[int]], data: st.DataObject) -> None:
    given_counts = np.array(lists)
    a, b = (np.array([data.draw(one) for _ in lists], dtype=np.float32) for one in (gain, fall))
    events = events_of(a, b, given_counts)
    usable = int(events.growth.sum())
    budget = data.draw(st.one_of(st.sampled_from([0, 1, usable, 2 * usable]), st.integers(0, usable + 1)))
    found, expected = allocate(a, b, given_counts, budget), solve_cuts(events, budget)
    np.testing.assert_array_equal(found.cut, expected.cut)
    np.testing.assert_array_equal(found.k, expected.k)
    assert found.complete == (expected.rank is None)
    wide = allocate(a.astype(np.float64), b.astype(np.float64), given_counts, budget)
    np.testing.assert_array_equal(wide.cut, found.cut)


def test_curves_of_importances_are_those_of_the_renderer() -> None:
    importances = np.array([0.0, 1e-30, 0.1, 0.5, 1.0, np.nan], np.float32)
    np.testing.assert_array_equal(client_curve(importances), importance_curve(importances))


def test_a_frame_of_many_pixels_is_the_renderers_to_the_bit() -> None:
    rng = np.random.default_rng(8)
    frame = np.minimum(rng.poisson(0.4, (50_000, 12)), 255)
    a, b = rng.normal(-8.0, 3.0, len(frame)).astype(np.float32), rng.uniform(0.02, 3.0, len(frame)).astype(np.float32)
    for budget in (int(frame.sum() * share) for share in (0.01, 0.4, 0.9)):
        found, expected = allocate(a, b, frame, budget), solve_cuts(events_of(a, b, frame), budget)
        np.testing.assert_array_equal(found.cut, expected.cut)
        assert budget - 10 < found.k.sum() <= budget


def test_a_network_that_overflows_still_uses_the_budget(tmp_path: Path) -> None:
    weights = random_weights(4, FEATURES[:6], (7, 5))
    huge = tuple((weight * np.float32(1e30), bias) for weight, bias in weights.layers)
    folder = written(tmp_path / "b", random_weights(4, FEATURES[:6], (7, 5)))
    predictor = Predictor.load(folder)
    broken = Predictor(predictor.manifest, type(predictor.network)(weights.mean, weights.std, huge, ("a", "b")))
    assert not np.isfinite(broken.answer(ROWS[:, :6])).all()
    assert 4990 < broken.predict(ROWS[:, :6], 5000, COUNTS).k.sum() <= 5000


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda tensors: tensors.pop("layer0.bias"), "do not hold the tensors"),
        (lambda tensors: tensors.update({"layer0.bias": np.zeros(4, np.float32)}), "layer0.bias is not float32"),
        (lambda tensors: tensors.update({"layer0.bias": np.zeros(3, np.float16)}), "layer0.bias is not float32"),
        (lambda tensors: tensors["layer0.bias"].fill(np.nan), "not finite"),
        (lambda tensors: tensors["layer1.bias"].fill(1.0), "its own test rows"),
    ],
)
def test_weights_that_are_not_the_manifest_s_are_refused(change: Any, why: str, tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES[:6], (3,)))
    tensors = load_file(folder / WEIGHTS)
    change(tensors)
    save_file(tensors, folder / WEIGHTS)
    with pytest.raises(Refused, match="not the file that the manifest lists"):
        Predictor.load(folder)
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["files"][WEIGHTS] = file_spec(folder / WEIGHTS).model_dump()
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Refused, match=why):
        Predictor.load(folder)


@pytest.mark.parametrize("content", [b"", b"\xff" * 8, b"\x02" + b"\0" * 7 + b"[]", b"\x02" + b"\0" * 7 + b"{"])
def test_a_file_that_is_no_safetensors_is_refused(content: bytes, tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES[:6], (3,)))
    (folder / WEIGHTS).write_bytes(content)
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["files"][WEIGHTS] = file_spec(folder / WEIGHTS).model_dump()
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Refused, match="cannot be used"):
        Predictor.load(folder)


def test_arguments_that_cannot_be_are_refused(tmp_path: Path) -> None:
    predictor = Predictor.load(written(tmp_path / "b", random_weights(4, FEATURES[1:6], (3,))))
    rows = ROWS[:, 1:6]
    with pytest.raises(ValueError, match="reads 5 columns: optical_depth"):
        predictor.predict(ROWS, 100, COUNTS)
    with pytest.raises(ValueError, match="finite"):
        predictor.predict(np.where(rows > 0, np.nan, rows), 100, COUNTS)
    with pytest.raises(ValueError, match="one number for each pixel"):
        predictor.predict(rows, 100, COUNTS[1:])
    for wrong_counts in (N, COUNTS[:, :8], COUNTS[None]):
        with pytest.raises(ValueError, match="binned-12 has 12 bins"):
            predictor.predict(rows, 100, wrong_counts)
    for wrong_counts, why in ((COUNTS.astype(float), "whole numbers"), (COUNTS.astype(int) - 200, "not be negative")):
        with pytest.raises(ValueError, match=why):
            predictor.predict(rows, 100, wrong_counts)
    with pytest.raises(ValueError, match="budget must not be negative"):
        predictor.predict(rows, -1, COUNTS)
    with pytest.raises(ValueError, match="b must be positive"):
        allocate(np.zeros(2), np.zeros(2), np.ones((2, 8), int), 1)


def test_a_bundle_of_a_tail_without_bins_is_refused(tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES[1:6], (3,)))
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["tail"]["name"] = "density"
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Refused, match="the tail 'density' is not one of binned-8"):
        Predictor.load(folder)
