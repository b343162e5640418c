"""What follows from bytes and errors."""

from __future__ import annotations

import itertools
import math

from hypothesis import given
from hypothesis import strategies as st
from support.advice import FRAME, MIB, sample, scene

from evaluation.advice.rules import SIZES, TIE, advise, affordable, best, candidates, choose, front, shown_instead
from evaluation.summary import EXACT, MSE_FLOOR
from renderer.exact_bytes import exact_bytes
from schemas.advice import AdvisedScene, Candidate, Size, sbuffer_bytes, sbuffer_load

BUDGETED = sample("kbuffer-deep", 40.0, 1e-6, 1.0, tail="binned-12", bundle="b@1")
SUMS = sample("weighted-blended", 20.0, 1e-3)

found = st.builds(
    sample,
    st.sampled_from(["moment", "multilayer", "binned", "stochastic"]),
    st.floats(1.0, 200.0),
    st.floats(0.0, 1e-2),
)
scenes = st.builds(lambda load, samples: scene(load, *samples), st.floats(0.0, 60.0), st.lists(found, max_size=4))
memories = st.integers(1, 512).map(lambda count: count * MIB)


def test_the_s_buffer_is_used_where_it_fits() -> None:
    choice = choose(scene(2.0, BUDGETED, SUMS), FRAME, 64 * MIB)
    assert (choice.verdict, choice.chosen and choice.chosen.technique) == ("exact", EXACT)
    assert choice.pays_above == (64 * MIB / 1e6 - 4) / 8


def test_the_least_error_that_fits_is_used_where_it_does_not() -> None:
    crowded = scene(20.0, BUDGETED, SUMS)
    assert choose(crowded, FRAME, 64 * MIB).chosen == crowded.candidates[1]
    assert choose(crowded, FRAME, 30 * MIB).chosen == crowded.candidates[2]
    assert choose(crowded, FRAME, 10 * MIB).verdict == "none"


def test_a_scene_without_transparency_needs_nothing() -> None:
    assert choose(scene(0.0), FRAME, MIB).verdict == "nothing"


def test_of_errors_that_are_as_good_as_equal_the_smaller_one_is_used_and_the_other_told() -> None:
    near = sample("moment", 30.0, 1e-6 * 0.95)
    choice = choose(scene(20.0, BUDGETED, near, SUMS), FRAME, 64 * MIB)
    assert choice.chosen is not None
    assert (choice.chosen.technique, [one.technique for one in choice.ties]) == ("moment", ["kbuffer-deep"])


def test_peeling_is_never_the_choice_and_not_on_the_front() -> None:
    peeled = sample("depth-peeling", 20.0, 0.0, family="exact")
    advice = advise(scene(20.0, peeled, BUDGETED), FRAME, 64 * MIB)
    assert advice.choice.chosen is not None
    assert advice.choice.chosen.technique == "kbuffer-deep"
    assert [one.technique for one in advice.front] == ["kbuffer-deep", EXACT]
    assert [one.technique for one in advice.best] == ["depth-peeling", "kbuffer-deep", EXACT]


def test_a_technique_that_was_not_measured_on_every_view_is_left_out() -> None:
    there = [sample("moment", 8.0, 1e-4, view=name) for name in ("a", "b")]
    partly = sample("binned", 8.0, 1e-9, view="a")
    made = candidates([*there, partly], ["a", "b"])
    assert [one.technique for one in made] == ["moment"]
    assert math.isclose(made[0].mse, 1e-4)


def test_means_are_geometric_with_a_floor_and_bytes_the_largest() -> None:
    made = candidates([sample("moment", 8.0, 0.0, view="a"), sample("moment", 9.0, 1e-4, view="b")], ["a", "b"])[0]
    assert abs(made.mse - (MSE_FLOOR * 1e-4) ** 0.5) < 1e-12
    assert (made.pixel_bytes, made.worst, made.worst_view) == (9.0, 1e-4, "b")


def test_where_exact_fits_what_takes_less_is_shown() -> None:
    assert getattr(shown_instead(advise(scene(9.0, BUDGETED, SUMS), FRAME, 100 * MIB)), "technique", "") == (
        "kbuffer-deep"
    )
    assert shown_instead(advise(scene(1.0, BUDGETED, SUMS), FRAME, 100 * MIB)) is None


def test_other_sizes_are_advised_on_with_the_size_asked_for_among_them() -> None:
    asked = advise(scene(2.0), FRAME, 64 * MIB).resolutions
    assert [choice.size for choice in asked] == sorted([FRAME, *SIZES], key=lambda size: size.pixels)
    assert len(advise(scene(2.0), SIZES[0], 64 * MIB).resolutions) == len(SIZES)


@given(scenes, memories)
def test_what_is_chosen_fits_and_nothing_that_fits_is_better(one: AdvisedScene, memory: int) -> None:
    choice = choose(one, FRAME, memory)
    fitting = [each for each in one.candidates if each.bytes_at(FRAME.pixels) <= memory]
    assert (choice.chosen is None) == (not fitting or not one.load)
    if choice.chosen is not None:
        assert choice.chosen in fitting
        assert choice.chosen.mse <= min(each.mse for each in fitting) * TIE
        assert all(each in fitting and each.pixel_bytes >= choice.chosen.pixel_bytes for each in choice.ties)


@given(scenes, memories, memories)
def test_more_memory_is_never_worse_by_more_than_a_tie(one: AdvisedScene, memory: int, more: int) -> None:
    less, much = choose(one, FRAME, memory).chosen, choose(one, FRAME, memory + more).chosen
    if less is not None:
        assert much is not None
        assert much.mse <= less.mse * TIE


@given(scenes, memories)
def test_the_s_buffer_is_chosen_exactly_up_to_what_the_memory_holds(one: AdvisedScene, memory: int) -> None:
    choice = choose(one, FRAME, memory)
    if one.load and abs(one.load - choice.pays_above) > 1e-5:
        assert (choice.verdict == "exact") == (one.load < choice.pays_above)


@given(scenes)
def test_the_front_falls_in_error_as_bytes_rise_and_ends_exact(one: AdvisedScene) -> None:
    points: tuple[Candidate, ...] = front(one)
    assert all(a.pixel_bytes <= b.pixel_bytes and a.mse > b.mse for a, b in itertools.pairwise(points))
    if one.load:
        assert points[-1].technique == EXACT


@given(scenes, memories)
def test_every_technique_is_told_once(one: AdvisedScene, memory: int) -> None:
    names = [each.technique for each in best(one, FRAME, memory)]
    assert sorted(names) == sorted({each.technique for each in one.candidates})


@given(st.integers(1, 4096), st.integers(256, 10**7), st.floats(0.0, 80.0), st.floats(0.0, 80.0))
def test_a_budget_that_a_memory_buys_fits_it(count: int, pixels: int, beside: float, early: float) -> None:
    bought = affordable(count * MIB, pixels, beside, early, 8)
    if bought:
        assert max(beside + 8 * bought, early) * pixels <= count * MIB * (1 + 1e-9)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=30))
def test_the_bytes_of_the_s_buffer_are_those_that_it_takes(n: list[int]) -> None:
    import numpy as np

    taken = exact_bytes("sbuffer", np.array(n))
    assert taken is not None
    assert abs(taken.total - sbuffer_bytes(sum(n) / len(n)) * len(n)) < 1e-6
    assert abs(sbuffer_load(taken.total, len(n)) - sum(n) / len(n)) < 1e-9


def test_bytes_follow_the_pixels() -> None:
    one = scene(2.0).candidates[0]
    assert one.bytes_at(Size(width=10, height=10).pixels) == 2000
