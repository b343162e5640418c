"""The benchmark of predictors: its bins against plain code, its costs, its folds, its scores and its tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dumps import random_dump
from support.training import random_weights

from benchmarks.predicting.cost import network_cost
from benchmarks.predicting.cuts import core_of, frame_events
from benchmarks.predicting.labels import OPTIMUM, RIVALS, labels_of, oracle_of
from benchmarks.predicting.scoring import is_worse, ratio
from benchmarks.predicting.store import CODE, Store, key_of
from benchmarks.predicting.summary import by_mode, by_multiple, front, score
from benchmarks.predicting.training import Trainings, folds_of
from benchmarks.predicting.variants import variants
from benchmarks.predicting.views import MATERIALS, MOST_SHARE, MULTIPLES, ViewRow, digest_of, load_dump
from labeller.curves import UNREACHABLE, error_curves, whole_bins
from labeller.reference import depth_bins
from labeller.reference import pixel_of as plain_pixel
from labeller.shards import read_shard
from renderer.depth_bins import bin_counts
from renderer.features import FEATURES, reads_luma
from renderer.tile_range import tile_ranges
from schemas.fragments import FragmentDump
from schemas.tail import BINNED_TAILS, MOST_BINS, TAILS, TailName

DUMP = random_dump(24, 16, 12, seed=5)


def _stored(store: Store, dump: FragmentDump, mode: str = "authored", asset: str = "a") -> ViewRow:
    """A dump as a view that was captured: with the ranges of its tiles."""
    dump = replace(dump, tile_range=tile_ranges(dump))
    arrays = ("offsets", "rgba", "depth", "background", "facing", "tile_range")
    name = f"{asset}-{mode}"
    kept = {array: getattr(dump, array) for array in arrays}
    np.savez(store.path("dumps", f"{name}.npz"), size=np.array([dump.width, dump.height]), **kept)
    occupied = int(np.count_nonzero(dump.counts))
    return ViewRow(name, asset, "a.usda", mode, "front", dump.pixels, dump.total, occupied, digest_of(dump))


RANGED = replace(DUMP, tile_range=np.tile(np.array([[1.0, 9.0]], np.float32), (3 * 2, 1)))
"""Its tiles' ranges are estimates that some fragments lie beyond."""


@pytest.mark.parametrize("dump", [DUMP, RANGED], ids=["own ranges", "estimated ranges"])
@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_fragments_are_counted_by_bin(dump: FragmentDump, tail: TailName) -> None:
    found = bin_counts(dump, tail)
    for p in range(dump.pixels):
        pixel = plain_pixel(dump, p)
        bins = depth_bins(pixel, -np.log1p(-pixel.alpha), TAILS[tail]).bin if pixel.n else np.zeros(0, np.int64)
        assert np.array_equal(found[p], np.bincount(bins, minlength=MOST_BINS))


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_cores_are_whole_bins_within_the_budget(tail: TailName) -> None:
    curves = whole_bins(DUMP, error_curves(DUMP, tail))
    events = frame_events(DUMP, tail, random_weights(3, tail=tail))
    most = int(bin_counts(DUMP, tail).max())
    for budget in (0, 40, DUMP.total // 2, DUMP.total, DUMP.total + 5):
        k = core_of(DUMP, *events, budget)
        assert curves.total(k) < UNREACHABLE
        assert min(budget, DUMP.total) - most < k.sum() <= budget


def test_costs_are_those_of_the_frame() -> None:
    lean = network_cost(random_weights(1, ("log_n", "optical_depth"), (8,)), "binned-12")
    assert (lean.weights, lean.multiply_adds) == (2 * 8 + 8 + 8 * 13 + 13, 2 * 8 + 8 * 13)
    full = network_cost(random_weights(1, FEATURES, (8,)), "binned-12")
    assert (lean.early_bytes, full.early_bytes) == (58, 62)
    assert lean.free_slots == full.free_slots == 2
    assert [full.peak_bytes(m) for m in (0.125, 1.0, 4.0)] == [62, 62, 62 + 32], "in the words, or beside all"
    # A word for each bin, with or without means.
    assert network_cost(random_weights(1, ("log_n",), (8,)), "density-16").early_bytes == 64 + 10


def test_every_size_is_trained_for_every_tail() -> None:
    every = variants()
    assert len(every) == 3 * len(BINNED_TAILS)
    assert len({(variant.tail, variant.config.decisive) for variant in every.values()}) == len(every)
    assert not reads_luma(every["tiny, binned-12"].config.features)


def test_budgets_leave_something_to_decide() -> None:
    row = ViewRow("", "", "", "authored", "", 1000, 1060, 900, "")
    assert row.multiples == [0.125, 0.25, 0.5, 1.0]
    assert row.budgets == [125, 250, 500, 1000]
    assert replace(row, fragments=int(1000 / MOST_SHARE)).multiples == [0.125, 0.25, 0.5]


@given(st.lists(st.text("abcdef", min_size=1), unique=True, min_size=2), st.integers(2, 6), st.randoms())
def test_folds_do_not_depend_on_the_order(names: list[str], folds: int, random: object) -> None:
    shuffled = list(names)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    found = folds_of(names, folds)
    assert found == folds_of([*shuffled, names[0]], folds)
    sizes = np.bincount(list(found.values()))
    assert len(sizes) == min(folds, len(names))
    assert sizes.max() - sizes.min() <= 1


def test_views_of_drawn_materials_are_trained_on_and_not_scored(tmp_path: Path) -> None:
    store = Store(tmp_path)
    rows = [_stored(store, DUMP, mode, asset) for asset in "ab" for mode in ("authored", MATERIALS)]
    trainings = Trainings(store, rows, 2)
    for fold in trainings.folds:
        assert [row.mode for row in trainings.unseen(fold)] == ["authored"]
        assert {row.mode for row in rows if trainings.sees(row, fold)} == {"authored", MATERIALS}


@pytest.mark.parametrize("dump", [DUMP, RANGED], ids=["own ranges", "estimated ranges"])
def test_a_view_is_labelled_with_whole_bins(tmp_path: Path, dump: FragmentDump) -> None:
    store = Store(tmp_path)
    row = _stored(store, dump)
    kept = load_dump(store, row)
    assert digest_of(kept) == row.digest
    assert np.array_equal(tile_ranges(kept), tile_ranges(dump))
    labels = labels_of(store, row, "binned-8")
    assert np.array_equal(labels.curves(kept).error, whole_bins(dump, error_curves(dump, "binned-8")).error)
    assert set(labels.mse) == {OPTIMUM, *RIVALS}
    assert all(len(errors) == len(row.multiples) for errors in (*labels.mse.values(), oracle_of(store, row)))
    shard = read_shard(labels.shard)
    ends = np.cumsum(bin_counts(dump, "binned-8"), axis=1)
    first = shard.hull_offsets
    for r, p in enumerate(shard.pixel):
        assert set(shard.hull_k[first[r] : first[r + 1]].tolist()) <= {0, *ends[p].tolist()}


def test_results_are_remembered_by_key(tmp_path: Path) -> None:
    store, made = Store(tmp_path), []

    def make() -> dict[str, float]:
        made.append(1)
        return {"x": 0.5}

    assert store.remember("a", key_of("one"), make) == store.remember("a", key_of("one"), make) == {"x": 0.5}
    assert len(made) == 1
    store.remember("a", key_of("two"), make)
    assert len(made) == 2
    assert all(len(store.code(kind)) == 64 for kind in CODE)


def test_a_result_that_was_not_finished_is_not_there(tmp_path: Path) -> None:
    store = Store(tmp_path)

    def fail(path: Path) -> None:
        path.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.write(store.path("a", "b.json"), fail)
    assert not store.path("a", "b.json").exists()


def test_means_are_over_views_that_have_the_budget() -> None:
    rows = [
        {"mode": "authored", "multiples": [0.125, 0.25], "q": [0.1, 4.0]},
        {"mode": "authored", "multiples": [0.125], "q": [0.4]},
    ]
    means = [pytest.approx(0.2), pytest.approx(4.0), *[None] * (len(MULTIPLES) - 2)]
    assert by_multiple(rows, "q") == means
    found = by_mode(rows, "q")
    assert found == {"alpha .33": [None] * len(MULTIPLES), "authored": means}
    assert score(found) == pytest.approx(0.8**0.5)
    assert ratio(0.0, 0.0) == 1.0


def test_errors_that_nobody_sees_are_not_worse() -> None:
    assert is_worse(2e-6, 1e-6)
    assert not is_worse(1.04e-6, 1e-6)
    assert not is_worse(9e-8, 1e-9)


@given(st.dictionaries(st.text(min_size=1), st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1))
def test_the_front_is_what_nothing_beats(points: dict[str, tuple[int, int]]) -> None:
    kept = front(points)
    assert kept
    for name, point in points.items():
        beaten = any(o[0] <= point[0] and o[1] <= point[1] and o != point for o in points.values())
        assert (name in kept) != beaten
