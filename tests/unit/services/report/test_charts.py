"""Charts: round ticks, a true Pareto front, and points where a reader, by the ticks, finds the values."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.measured import example, measurement

from schemas.measurement import Measurement, TrainingPoint
from services.report import charts
from services.summary import rows


class Read:
    """A chart as a reader has it: the values of its ticks, between which everything else lies.

    Args:
        text: SVG of the chart.
        log: Whether its axes are logarithmic.
    """

    def __init__(self, text: str, log: bool) -> None:
        self.svg = ElementTree.fromstring(text)
        self._log = log
        ticks = [element for element in self.svg.iter("text") if element.get("class") == "tick"]
        across, up = ([one for one in ticks if one.get("text-anchor") == anchor] for anchor in ("middle", "end"))
        self._x = [(self._scale(float(one.text or "")), float(one.get("x", ""))) for one in across]
        # A label's baseline is four units below its line.
        self._y = [(self._scale(float(one.text or "")), float(one.get("y", "")) - 4) for one in up]

    def _scale(self, value: float) -> float:
        return math.log(value) if self._log else value

    def values(self, line: ElementTree.Element) -> list[tuple[float, float]]:
        """What the corners of a line stand for."""
        corners = [pair.split(",") for pair in (line.get("points") or "").split()]
        return [(self._value(float(x), self._x), self._value(float(y), self._y)) for x, y in corners]

    def _value(self, place: float, ticks: list[tuple[float, float]]) -> float:
        (low, start), (high, end) = ticks[0], ticks[-1]
        scaled = low + (place - start) / (end - start) * (high - low)
        return math.exp(scaled) if self._log else scaled

    def lines(self, css: str) -> list[ElementTree.Element]:
        """Those of a class."""
        return [line for line in self.svg.iter("polyline") if line.get("class") == css]


def marked(group: ElementTree.Element) -> list[tuple[float, float]]:
    """Centres of the marks of a technique, in SVG units."""
    found = [(float(mark.get("cx", "")), float(mark.get("cy", ""))) for mark in group.iter("circle")]
    for mark in group.iter("polygon"):
        x, y = zip(*([float(one) for one in pair.split(",")] for pair in mark.get("points", "").split()), strict=True)
        found.append(((min(x) + max(x)) / 2, (min(y) + max(y)) / 2))
    return found


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


@pytest.mark.parametrize("measured", [example(), [measurement(scene="bottles & <glass>")]], ids=["many", "one"])
def test_points_are_where_the_ticks_say_that_their_values_are(measured: list[Measurement]) -> None:
    read = Read(charts.error_chart(rows(measured), measured[0].scene), log=True)
    seen = 0
    for one in {one.technique for one in measured}:
        (group,) = (group for group in read.svg.iter("g") if group.get("class") == f"t-{one}")
        (link,) = (line for line in group.iter("polyline") if line.get("class") == "link")
        own = sorted((each.budget_factor, each.total_ms, each.mse) for each in measured if each.technique == one)
        found = read.values(link)
        assert [x for x, _ in found] == pytest.approx([ms for _, ms, _ in own], rel=0.01)
        assert [y for _, y in found] == pytest.approx([1e5 * mse for *_, mse in own], rel=0.02)
        places = [tuple(map(float, pair.split(","))) for pair in (link.get("points") or "").split()]
        assert marked(group) == [pytest.approx(place, abs=1.5) for place in places]
        told = [re.search(r": ([\d.]+) ms, ([\d.]+)e-5$", title.text or "") for title in group.iter("title")]
        assert [(float(each[1]), float(each[2])) for each in told if each] == [
            pytest.approx(value, rel=0.02) for value in found
        ]
        seen += len(found)
    assert seen == len(measured)


def test_the_oracle_is_not_on_the_front() -> None:
    measured = [
        measurement("kbuffer", 4e-5, total_ms=10.0),
        measurement("kbuffer-deep", 2e-5, total_ms=20.0),
        measurement("kbuffer-optimal", 1e-5, total_ms=30.0),
    ]
    read = Read(charts.error_chart(rows(measured), "bottles"), log=True)
    (front,) = read.lines("front")
    assert read.values(front) == [pytest.approx(point, rel=0.02) for point in ((10.0, 4.0), (20.0, 2.0))]


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


@pytest.mark.parametrize("losses", [(1.0, 0.5, 0.4), (0.0, 0.0), (1.0, 1.0)])
def test_the_training_chart_shows_the_error_of_every_step(losses: tuple[float, ...]) -> None:
    history = [TrainingPoint(step=10 * i, loss=loss, over_optimum=2 * loss) for i, loss in enumerate(losses)]
    read = Read(charts.training_chart(history), log=False)
    (line,) = read.lines("line training")
    found = read.values(line)
    assert [x for x, _ in found] == pytest.approx([point.step for point in history], abs=0.1)
    assert [y for _, y in found] == pytest.approx([point.over_optimum for point in history], abs=0.02)


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
