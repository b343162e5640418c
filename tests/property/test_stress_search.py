"""Hypothesis drives the errors up; a climb of the search is the same every time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, target
from hypothesis import strategies as st

from evaluation.stress import search
from evaluation.stress.bounds import BOUNDS
from evaluation.stress.cases import dump_of
from evaluation.stress.features import EVERY, SPREADS
from evaluation.stress.predictors import networks, real_features
from evaluation.stress.search import list_finding, worst_features, worst_list
from evaluation.stress.threads import one_thread
from evaluation.stress.twins import features64, sums64
from renderer.features import FEATURES, derive, gather
from schemas.fragments import FragmentDump
from schemas.tail import METRICS, TAIL_NAMES, MetricName, TailName

level = st.one_of(st.integers(0, 255), st.sampled_from([0, 1, 254, 255]))
alpha = st.one_of(st.integers(1, 254), st.sampled_from([1, 128, 254]))
metres = st.one_of(
    st.floats(2.0**-10, 1e4, width=32), st.sampled_from([1.0, 2.0, float(np.float32(1.0000001)), 1e-44, 3e38])
)
fragments = st.lists(st.tuples(level, level, level, alpha, metres), min_size=1, max_size=24)
Fragments = list[tuple[int, int, int, int, float]]


def dump_from(given_fragments: Fragments, background: tuple[int, int, int]) -> FragmentDump:
    rgba = np.array([fragment[:4] for fragment in given_fragments], np.uint8)
    depth = np.array([fragment[4] for fragment in given_fragments], np.float32)
    return dump_of([(rgba, depth)], background)


@settings(max_examples=100, deadline=None)
@given(fragments, st.tuples(level, level, level), st.sampled_from(TAIL_NAMES), st.sampled_from(METRICS))
def test_no_list_drives_the_error_of_its_curve_beyond_the_bound(
    listed: Fragments, background: tuple[int, int, int], tail: TailName, metric: MetricName
) -> None:
    with one_thread():
        found = list_finding(dump_from(listed, background), tail, metric)
    target(found.relative)
    assert found.ok, found


@settings(max_examples=150, deadline=None)
@given(fragments, st.integers(1, 20))
def test_no_list_drives_the_error_of_its_features_beyond_the_bounds(listed: Fragments, times: int) -> None:
    dump = dump_from(listed * times, (0, 0, 0))
    with one_thread():
        found = derive(gather(dump, EVERY))[0]
    truth = features64(sums64(dump, EVERY))[0]
    error = np.abs(found - truth)
    others = np.delete(error / np.maximum(np.abs(truth), 1.0), SPREADS)
    target(float(error[SPREADS].max()))
    assert error[SPREADS].max() <= BOUNDS["features.spread"].value, FEATURES[SPREADS[int(error[SPREADS].argmax())]]
    assert others.max() <= BOUNDS["features.derive"].value


@pytest.mark.parametrize("climb", [0, 3])
def test_a_climb_is_reproducible_from_its_seed(climb: int) -> None:
    with one_thread():
        (one, tail, metric), again = worst_list(7, climb), worst_list(7, climb)
    other = again[0]
    assert again[1:] == (tail, metric)
    assert all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("rgba", "depth", "background"))
    assert list_finding(one, tail, metric) == list_finding(other, tail, metric)
    assert not np.array_equal(one.rgba, worst_list(8, climb)[0].rgba)


def test_a_climb_ends_no_lower_than_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    with one_thread():
        ends = [list_finding(*worst_list(0, climb)).error for climb in range(4)]
        monkeypatch.setattr(search, "STEPS", 0)
        starts = [list_finding(*worst_list(0, climb)).error for climb in range(4)]
    assert all(end >= start for end, start in zip(ends, starts, strict=True))
    assert sum(ends) > sum(starts)


def test_a_climb_of_features_is_reproducible_and_climbs(monkeypatch: pytest.MonkeyPatch) -> None:
    real = real_features(np.random.default_rng(0), 200)
    weights = next(iter(networks(0, real).values()))

    def predict(rows: np.ndarray) -> np.ndarray:
        return weights.run(rows)

    def climbed() -> np.ndarray:
        return worst_features(3, 1, weights, real, predict)

    one = climbed()
    assert np.array_equal(one, climbed())
    monkeypatch.setattr(search, "STEPS", 4)
    assert search._errors(weights, predict, one).max() > search._errors(weights, predict, climbed()).max()
