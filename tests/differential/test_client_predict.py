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

from diaphane_client import Predictor, Refused, allocate, fill
from renderer.allocation.fill import budget_fill, solve_lambda
from renderer.allocation.lattice import curves_of, price, solve_on_lattice
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
ROWS = derive(gather(DUMP))
N = DUMP.counts.astype(np.int64)
BUDGETS = (0, 1, 500, int(np.count_nonzero(N)) - 1, int(np.count_nonzero(N)), int(N.sum()) // 2, int(N.sum()) - 1)


def written(folder: Path, weights: Weights) -> Path:
    """A bundle whose forms nobody compared."""
    description = Description(
        name="glass",
        tail=TailSpec(name="density", g=0.75),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="test"),
        evaluation={},
    )
    report = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, driver="none")
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
    assert (predictor.manifest.outputs, predictor.manifest.tail, predictor.manifest.g) == (outputs, "density", 0.75)
    inputs = ROWS[:, bundle.weights.columns]
    expected = bundle.weights.answer(inputs)
    np.testing.assert_allclose(predictor.answer(inputs), expected, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(predictor.answer(inputs.astype(np.float64)), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("head", "outputs"), EVERY)
def test_counts_are_those_of_the_renderer(head: HeadName, outputs: tuple[OutputName, ...], tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES, (32, 16), head, outputs))
    predictor, weights = Predictor.load(folder), load_bundle(folder).weights
    answers = weights.run(ROWS)
    for budget in (*BUDGETS, int(N.sum()), 2 * int(N.sum())):
        k = predictor.predict(ROWS, budget, N)
        assert k.dtype == np.int32
        assert k.sum() == min(budget, N.sum())
        np.testing.assert_array_equal(predictor.predict(ROWS, budget), k)  # n read from log_n
        if head == "importance":
            expected = budget_fill(answers[:, 0], N, budget)
        else:
            expected = solve_on_lattice(curves_of(answers[:, 0], answers[:, 1]), N, budget).k
        # Another order of the network's sums may move a pixel at the edge; all others are the same.
        assert np.count_nonzero(k != expected) <= 2 * max(1, len(N) // 1000)
        assert np.abs(k - expected).max() <= 1


counts = st.lists(st.one_of(st.integers(0, 6), st.sampled_from([0, 1, 4096, 70_000])), min_size=1, max_size=12)
gain = st.one_of(st.sampled_from([0.0, -5.0, -1e30, 1e30, np.nan, np.inf]), st.floats(-200.0, 200.0, width=32))
decay = st.one_of(st.sampled_from([0.5, 0.02, 1e30, np.nan, np.inf]), st.floats(0.03125, 300.0, width=32))
weight = st.one_of(st.sampled_from([0.0, 1e-30, 1.0]), st.floats(0.0, 1.0, width=32))


def drawn(data: st.DataObject, n: np.ndarray, *each: st.SearchStrategy[float]) -> tuple[Any, ...]:
    occupied, total = int(np.count_nonzero(n)), int(n.sum())
    edges = {0, 1, max(occupied - 1, 0), occupied, max(total - 1, 0), total, 2 * total}
    budget = data.draw(st.one_of(st.sampled_from(sorted(edges)), st.integers(0, total + 1)))
    return *(np.array([data.draw(one) for _ in n], dtype=np.float32) for one in each), budget


@settings(max_examples=300, deadline=None)
@given(counts, st.data())
def test_allocate_is_the_lattice_to_the_fragment(lists: list[int], data: st.DataObject) -> None:
    n = np.array(lists)
    a, b, budget = drawn(data, n, gain, decay)
    k, log_lambda = allocate(a, b, n, budget)
    expected = solve_on_lattice(curves_of(a, b), n, budget)
    np.testing.assert_array_equal(k, expected.k)
    assert log_lambda == (-np.inf if expected.index is None else -price(expected.index))
    assert k.sum() == min(budget, np.minimum(n, 60_000).sum())


@settings(max_examples=300, deadline=None)
@given(counts, st.data())
def test_fill_is_the_budget_fill_but_for_ties(lists: list[int], data: st.DataObject) -> None:
    n = np.minimum(np.array(lists), 60_000)
    weights, budget = drawn(data, n, weight)
    k, expected = fill(weights, n, budget), budget_fill(weights, n, budget)
    assert k.sum() == expected.sum() == min(budget, n.sum())
    assert (k >= 0).all()
    assert (k <= n).all()
    different = np.flatnonzero(k != expected)
    shares = np.maximum(k, expected)[different] / np.where(weights[different] > 0.0, weights[different], 1.0)
    assert len(different) == 0 or np.ptp(shares) <= 1e-12 * shares.max()


def test_the_exact_search_differs_by_ties_alone() -> None:
    rng = np.random.default_rng(8)
    n = rng.integers(0, 30, 20_000)
    a, b = rng.normal(-8.0, 3.0, n.size).astype(np.float32), rng.uniform(0.02, 3.0, n.size).astype(np.float32)
    for budget in (int(np.count_nonzero(n)), int(n.sum() * 0.4), int(n.sum() * 0.9)):
        k, log_lambda = allocate(a, b, n, budget)
        expected, exact = solve_lambda(a, b, n, budget)
        assert abs(log_lambda - exact) < 1e-3  # prices are 2^-11 apart around 10
        assert np.abs(k - expected).sum() <= n.size // 500


def test_a_network_that_overflows_still_uses_the_budget(tmp_path: Path) -> None:
    weights = random_weights(4, FEATURES[:6], (7, 5))
    huge = tuple((weight * np.float32(1e30), bias) for weight, bias in weights.layers)
    folder = written(tmp_path / "b", random_weights(4, FEATURES[:6], (7, 5)))
    predictor = Predictor.load(folder)
    broken = Predictor(predictor.manifest, type(predictor.network)(weights.mean, weights.std, huge, ("a", "b")))
    assert not np.isfinite(broken.answer(ROWS[:, :6])).all()
    assert broken.predict(ROWS[:, :6], 5000, N).sum() == 5000


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
    rows, n = ROWS[:, 1:6], N
    with pytest.raises(ValueError, match="give n"):
        predictor.predict(rows, 100)
    with pytest.raises(ValueError, match="reads 5 columns: optical_depth"):
        predictor.predict(ROWS, 100, n)
    with pytest.raises(ValueError, match="finite"):
        predictor.predict(np.where(rows > 0, np.nan, rows), 100, n)
    with pytest.raises(ValueError, match="one number for each pixel"):
        predictor.predict(rows, 100, n[1:])
    for counts_of in (n - 20, n.astype(float), n[None]):
        with pytest.raises(ValueError, match=r"row of counts|for each pixel"):
            predictor.predict(rows, 100, counts_of)
    with pytest.raises(ValueError, match="budget must not be negative"):
        predictor.predict(rows, -1, n)
    with pytest.raises(ValueError, match="b must be positive"):
        allocate(np.zeros(2), np.zeros(2), np.ones(2, int), 1)
    for wrong in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="finite and not negative"):
            fill(np.array([1.0, wrong]), np.ones(2, int), 1)
