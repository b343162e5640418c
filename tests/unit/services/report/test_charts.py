"""Charts: round ticks, a true Pareto front, well-formed SVG, and points where the values are."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.measured import example, measurement

from schemas.measurement import TrainingPoint
from services.report import charts
from services.summary import rows


@given(st.floats(1e-6, 1e6), st.floats(1.1, 1e9))
def test_log_ticks_are_few_ascending_and_inside(low: float, ratio: float) -> None:
    high = low * ratio
    ticks = charts.log_ticks(low, high)
    assert len(ticks) <= 8
    assert ticks == sorted(set(ticks))
    assert all(low * (1 - 1e-6) <= tick <= high * (1 + 1e-6) for tick in ticks)


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (290, 810, "300 400 500 600 800"),
        (0.03, 30, "0.03 0.1 0.3 1 3 10 30"),
        (1, 100, "1 2 5 10 20 50 100"),
    ],
)
def test_log_ticks_are_round(low: float, high: float, ticks: str) -> None:
    assert " ".join(f"{tick:g}" for tick in charts.log_ticks(low, high)) == ticks


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e4))
def test_linear_ticks_are_few_and_inside(low: float, span: float) -> None:
    ticks = charts.linear_ticks(low, low + span)
    assert 2 <= len(ticks) <= 7
    assert all(low - 1e-6 * span <= tick <= low + span * (1 + 1e-6) for tick in ticks)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=20))
def test_the_pareto_front_is_what_nothing_dominates(points: list[tuple[int, int]]) -> None:
    def dominated(p: tuple[int, int]) -> bool:
        return any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)

    assert charts.pareto_front(points) == sorted({p for p in points if not dominated(p)})


def test_the_scatter_has_a_point_for_every_technique_and_budget() -> None:
    svg = ElementTree.fromstring(charts.error_chart(rows(example()), "bottles"))
    titles = [element.text for element in svg.iter("title")]
    assert len(titles) == 8
    assert "this bundle, F = 2 W H: 20.0 ms, 1.00e-5" in titles


def test_lower_error_is_drawn_lower_and_more_time_further_right() -> None:
    frame = charts.Frame((1.0, 100.0), (0.1, 10.0))
    assert frame.px(1.0) == frame.left
    assert frame.px(100.0) == frame.width - frame.right
    assert frame.py(0.1) == frame.height - frame.bottom
    assert frame.py(10.0) == frame.top
    assert frame.px(10.0) == pytest.approx((frame.left + frame.width - frame.right) / 2)


def test_the_oracle_is_not_on_the_front() -> None:
    measured = [
        measurement("kbuffer", 4e-5, total_ms=10.0),
        measurement("kbuffer-deep", 2e-5, total_ms=20.0),
        measurement("kbuffer-optimal", 1e-5, total_ms=30.0),
    ]
    svg = ElementTree.fromstring(charts.error_chart(rows(measured), "bottles"))
    (front,) = [element for element in svg.iter("polyline") if element.get("class") == "front"]
    assert len((front.get("points") or "").split()) == 2


def test_rows_without_times_make_no_scatter() -> None:
    assert charts.error_chart(rows([measurement(total_ms=None)]), "bottles") == ""
    assert charts.error_chart(rows([measurement(mse=0.0, exact=True)]), "bottles") == ""


def test_labels_of_neighbours_stand_apart() -> None:
    names = ("adaptive", "multilayer", "moment")
    measured = [replace(rows([measurement(name, total_ms=10.0)])[0], budget_factor=0.0) for name in names]
    svg = ElementTree.fromstring(charts.error_chart(measured, "bottles"))
    labels = [text for text in svg.iter("text") if text.get("class") == "point"]
    assert {text.text for text in labels} == set(names)
    assert len({(text.get("text-anchor"), text.get("y")) for text in labels}) == len(names)


def test_one_point_is_drawn_too() -> None:
    ElementTree.fromstring(charts.error_chart(rows([measurement()]), "bottles & <glass>"))


@pytest.mark.parametrize("losses", [(1.0, 0.5, 0.4), (0.0, 0.0), (1.0, 1.0)])
def test_the_training_chart_is_well_formed(losses: tuple[float, ...]) -> None:
    history = [TrainingPoint(step=10 * i, loss=loss, over_optimum=2 * loss) for i, loss in enumerate(losses)]
    svg = ElementTree.fromstring(charts.training_chart(history))
    lines = list(svg.iter("polyline"))
    assert [len((line.get("points") or "").split()) for line in lines] == [len(losses)]


def test_a_training_of_one_point_makes_no_chart() -> None:
    assert charts.training_chart([TrainingPoint(step=0, loss=1.0, over_optimum=2.0)]) == ""


def test_the_exact_technique_is_a_line_at_its_time() -> None:
    exact = [m.model_copy(update={"technique": "sbuffer", "exact": True, "mse": 0.0}) for m in example()[:1]]
    made = rows([*example(), *exact])
    assert [row.technique for row in made].count("sbuffer") == 1
    svg = ElementTree.fromstring(charts.error_chart(made, "all"))
    assert [path for path in svg.iter("path") if path.get("class") == "exact"]
    assert not [group for group in svg.iter("g") if group.get("class") == "t-sbuffer"]


def test_a_history_marks_what_got_worse_and_leaves_gaps_out() -> None:
    series = {"<a>": [1e-4, None, 2e-4], "b": [1e-4, 1e-4, 1e-4]}
    svg = ElementTree.fromstring(charts.history_chart(series, ["1.0.0", "1.1.0", "1.2.0"], {("<a>", 2)}, "errors"))
    marks = [group for group in svg.iter("g") if (group.get("class") or "").startswith("mark")]
    worse = [mark.findtext("title") for mark in marks if mark.get("class") == "mark worse"]
    assert (len(marks), worse) == (5, ["<a>, 1.2.0: 20.0e-5, worse than before"])
    assert [len((line.get("points") or "").split()) for line in svg.iter("polyline")] == [2, 3]
    assert {"1.0.0", "1.1.0", "1.2.0"} <= {text.text for text in svg.iter("text")}


def test_a_history_of_one_version_makes_no_chart() -> None:
    assert charts.history_chart({"a": [1e-4]}, ["1.0.0"], set(), "errors") == ""
    assert charts.history_chart({"a": [1e-4, None]}, ["1.0.0", "1.1.0"], set(), "errors") == ""
    assert charts.history_chart({}, [], set(), "errors") == ""


def test_a_curve_shows_its_hull_and_who_chose_what() -> None:
    svg = charts.curve_chart([4e-5, 1e-5, 3e-5, 0.0], [1, 3], {1: ["A", "VKB <x>"], 2: ["B"]}, "a pixel")
    assert svg.count("<polyline") == 2
    assert 'class="front"' in svg
    assert "k = 1, 1.00e-5: A, VKB &lt;x&gt;" in svg
    assert svg.count('class="mark"') == 2
    assert charts.curve_chart([0.0, 0.0], [], {}, "exact") == ""
