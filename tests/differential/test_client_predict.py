"""The client's numpy, which knows nothing of the project, gives the Python renderer's numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file
from support.dumps import random_dump
from support.training import random_weights

from diaphane_client import Bins, Predictor, Refused, allocate
from diaphane_client.prices import gain_ranks, importance_ranks
from renderer.allocation.cuts import events_of, solve_cuts
from renderer.allocation.prices import gain_prices, importance_prices, prior_gains, ranks_of
from renderer.depth_bins import bin_counts
from renderer.features import FEATURES, SUMS, derive, gather
from schemas.bundle import MANIFEST, WEIGHTS, HeadName, ParityReport, Provenance, TailSpec, file_spec
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TAILS, TailName
from trainer.bundle import Description, load_bundle, write_bundle
from trainer.weights import Weights

pytestmark = pytest.mark.usefixtures("single_thread")

EVERY: list[tuple[HeadName, TailName]] = [
    ("importance", DEFAULT_TAIL),
    *(("bin-gains", tail) for tail in BINNED_TAILS),
]
DUMP = random_dump(60, 50, 12, 3)
ROWS = derive(gather(DUMP, DEFAULT_TAIL))
N = DUMP.counts.astype(np.int64)


def gathered(tail: TailName) -> Bins:
    """What a frame gathers of the dump."""
    sums, bins = gather(DUMP, tail), TAILS[tail].bins
    first = SUMS.index("front_1")
    front, depth = sums[:, first : first + bins - 1], sums[:, SUMS.index("optical_depth")]
    return Bins(bin_counts(DUMP, tail)[:, :bins], front, depth)


BINS = gathered(DEFAULT_TAIL)
COUNTS = BINS.counts
BUDGETS = (0, 1, 500, int(np.count_nonzero(N)), int(N.sum()) // 2, int(N.sum()) - 1, int(N.sum()), 2 * int(N.sum()))


def written(folder: Path, weights: Weights, tail: TailName = DEFAULT_TAIL) -> Path:
    """A bundle whose forms nobody compared."""
    description = Description(
        name="glass",
        tail=TailSpec(name=tail, g=0.75),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="test"),
        evaluation={},
    )
    report = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    write_bundle(folder, weights, description, derive(gather(DUMP, tail))[N > 0], lambda: report)
    return folder


def expected_ranks(head: HeadName, answers: NDArray[np.float32], bins: Bins, tail: TailName) -> NDArray[np.uint8]:
    """The renderer's."""
    if head == "importance":
        return ranks_of(importance_prices(answers[:, 0], bins.counts), bins.counts)
    front = np.ones((len(answers), TAILS[tail].bins + 1), np.float32)
    front[:, 0], front[:, 1:-1] = 0.0, bins.front
    depth = np.asarray(bins.optical_depth, np.float32)
    return ranks_of(gain_prices(answers, prior_gains(front, depth, bins.counts, TAILS[tail])), bins.counts)


@pytest.mark.parametrize("head", ["bin-gains", "importance"])
@pytest.mark.parametrize(("names", "hidden"), [(FEATURES, (32, 16)), (FEATURES[:5], ()), (FEATURES[3:9], (7, 5, 3))])
def test_answers_are_those_of_the_bundle(
    head: HeadName, names: tuple[str, ...], hidden: tuple[int, ...], tmp_path: Path
) -> None:
    folder = written(tmp_path / "b", random_weights(4, names, hidden, head))
    predictor, bundle = Predictor.load(folder), load_bundle(folder)
    assert predictor.features == names
    assert (predictor.manifest.outputs, predictor.manifest.tail) == (bundle.weights.outputs, DEFAULT_TAIL)
    inputs = ROWS[:, bundle.weights.columns]
    expected = bundle.weights.answer(inputs)
    np.testing.assert_allclose(predictor.answer(inputs), expected, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(predictor.answer(inputs.astype(np.float64)), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("head", "tail"), EVERY)
def test_cuts_are_those_of_the_renderer(head: HeadName, tail: TailName, tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES, (32, 16), head, tail), tail)
    predictor, weights = Predictor.load(folder), load_bundle(folder).weights
    rows, bins = derive(gather(DUMP, tail)), gathered(tail)
    ranks = expected_ranks(head, weights.run(rows), bins, tail)
    found_ranks = predictor.ranks(rows, bins)
    # Another order of the network's sums may move a price that is next to a step; all others are the same.
    assert np.count_nonzero(found_ranks != ranks) <= 2e-3 * ranks.size
    assert np.abs(found_ranks.astype(int) - ranks).max() <= 1
    events = events_of(ranks, bins.counts)
    for budget in BUDGETS:
        found, expected = predictor.predict(rows, budget, bins), solve_cuts(events, budget)
        assert found.cut.dtype == found.k.dtype == np.int32
        assert found.k.sum() <= budget
        assert found.complete == (expected.rank is None)
        assert np.count_nonzero(found.cut != expected.cut) <= 0.005 * len(N)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_ranks_of_answers_are_the_renderers_to_the_bit(tail: TailName) -> None:
    rng, bins = np.random.default_rng(9), gathered(tail)
    answers = rng.normal(-2.0, 3.0, (len(N), TAILS[tail].bins + 1)).astype(np.float32)
    answers[:, -1] = rng.random(len(N))
    answers[:40] = rng.choice(np.array([np.nan, np.inf, -np.inf, 3e38, 0.0], np.float32), answers[:40].shape)
    found = gain_ranks(answers, bins, TAILS[tail].share_levels)
    np.testing.assert_array_equal(found, expected_ranks("bin-gains", answers, bins, tail))
    assert found[:40].max() == 255
    assert np.mean((found > 0) & (found < 255)) > 0.5
    importances = np.concatenate([[0.0, 1e-30, 0.1, 0.5, 1.0, np.nan], rng.random(len(N) - 6)]).astype(np.float32)
    expected = expected_ranks("importance", importances[:, None], bins, tail)
    np.testing.assert_array_equal(importance_ranks(importances, bins.counts), expected)


counts = st.lists(st.lists(st.sampled_from([0, 0, 1, 2, 5, 200, 254, 255, 300]), min_size=8, max_size=8), max_size=9)
rank = st.one_of(st.sampled_from([0, 1, 254, 255]), st.integers(0, 255))


@settings(max_examples=300, deadline=None)
@given(counts.filter(bool), st.data())
def test_allocate_is_the_renderers_to_the_bit(lists: list[list[int]], data: st.DataObject) -> None:
    given_counts = np.array(lists)
    drawn = [data.draw(st.lists(rank, min_size=8, max_size=8)) for _ in lists]
    ranks = np.sort(np.array(drawn, dtype=np.uint8), axis=1)
    events = events_of(ranks, given_counts)
    usable = int(events.growth.sum())
    budget = data.draw(st.one_of(st.sampled_from([0, 1, usable, 2 * usable]), st.integers(0, usable + 1)))
    found, expected = allocate(ranks, given_counts, budget), solve_cuts(events, budget)
    np.testing.assert_array_equal(found.cut, expected.cut)
    np.testing.assert_array_equal(found.k, expected.k)
    assert found.complete == (expected.rank is None)


def test_a_frame_of_many_pixels_is_the_renderers_to_the_bit() -> None:
    rng = np.random.default_rng(8)
    frame = np.minimum(rng.poisson(0.4, (50_000, 12)), 255)
    ranks = np.sort(rng.integers(0, 256, frame.shape), axis=1)
    for budget in (int(frame.sum() * share) for share in (0.01, 0.4, 0.9)):
        found, expected = allocate(ranks, frame, budget), solve_cuts(events_of(ranks, frame), budget)
        np.testing.assert_array_equal(found.cut, expected.cut)
        assert budget - 10 < found.k.sum() <= budget


def test_a_network_that_overflows_still_uses_the_budget(tmp_path: Path) -> None:
    weights = random_weights(4, FEATURES[:6], (7, 5))
    huge = tuple((weight * np.float32(1e30), bias) for weight, bias in weights.layers)
    folder = written(tmp_path / "b", random_weights(4, FEATURES[:6], (7, 5)))
    predictor = Predictor.load(folder)
    broken = Predictor(predictor.manifest, type(predictor.network)(weights.mean, weights.std, huge, weights.outputs))
    assert not np.isfinite(broken.answer(ROWS[:, :6])).all()
    assert 4990 < broken.predict(ROWS[:, :6], 5000, BINS).k.sum() <= 5000


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
        predictor.predict(ROWS, 100, BINS)
    with pytest.raises(ValueError, match="finite"):
        predictor.predict(np.where(rows > 0, np.nan, rows), 100, BINS)
    with pytest.raises(ValueError, match="of the same pixels"):
        predictor.predict(rows[1:], 100, BINS)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"counts": COUNTS[1:]}, "must be finite"),
        ({"counts": COUNTS[:, :8]}, "the tail has 12 bins"),
        ({"counts": COUNTS[None]}, "a row for each pixel"),
        ({"counts": COUNTS.astype(float)}, "whole numbers"),
        ({"counts": COUNTS.astype(int) - 200}, "not be negative"),
        ({"front": BINS.front[:, 1:]}, "must be finite"),
        ({"front": BINS.front * np.nan}, "must be finite"),
        ({"optical_depth": BINS.optical_depth[:, None]}, "must be finite"),
    ]
    for change, why in wrong:
        with pytest.raises(ValueError, match=why):
            predictor.predict(rows, 100, replace(BINS, **change))
    with pytest.raises(ValueError, match="budget must not be negative"):
        predictor.predict(rows, -1, BINS)
    ones = np.ones((2, 8), int)
    for ranks, why in (
        (ones[:, :7], "one for each count"),
        (ones / 2, "whole"),
        (300 * ones, "0 to 255"),
        (ones - 2, "0"),
    ):
        with pytest.raises(ValueError, match=f"ranks must be .*{why}"):
            allocate(ranks, ones, 1)
    with pytest.raises(ValueError, match="not fall from bin to bin"):
        allocate(ones - np.arange(8) // 7, ones, 1)


def test_a_bundle_of_a_tail_without_bins_or_of_others_is_refused(tmp_path: Path) -> None:
    folder = written(tmp_path / "b", random_weights(4, FEATURES[1:6], (3,)))
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["tail"]["name"] = "density"
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Refused, match="the tail 'density' is not one of binned-8"):
        Predictor.load(folder)
    manifest["tail"]["name"] = "binned-8"
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Refused, match=r"does not answer gain_0, .*, gain_11, prior"):
        Predictor.load(folder)
