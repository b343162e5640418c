"""Trainings, histories, curves and logarithmic lines: their data are what was measured."""

from __future__ import annotations

from typing import Any

import pytest

from evaluation.report.lines import curve_chart, history_chart, log_log, loss_chart, training_chart
from evaluation.report.vega import Spec
from schemas.measurement import TrainingPoint


def shown(spec: Spec | None) -> list[dict[str, Any]]:
    """The data of a chart."""
    assert spec is not None
    return list(spec["data"]["values"])


@pytest.mark.parametrize("losses", [(1.0, 0.5, 0.4), (0.0, 0.0), (1.0, 1.0)])
def test_the_training_chart_shows_the_error_of_every_step(losses: tuple[float, ...]) -> None:
    history = [TrainingPoint(step=10 * i, loss=loss, over_optimum=2 * loss) for i, loss in enumerate(losses)]
    spec = training_chart(history)
    found = shown(spec)
    assert [(row["x"], row["y"]) for row in found] == [(point.step, point.over_optimum) for point in history]
    assert spec is not None
    low, high = spec["layer"][0]["encoding"]["y"]["scale"]["domain"]
    assert all(low < row["y"] < high for row in found)
    assert [(row["x"], row["y"]) for row in shown(loss_chart([(1, 3.0), (2, 2.5)]))] == [(1.0, 3.0), (2.0, 2.5)]


def test_a_training_of_one_point_makes_no_chart() -> None:
    assert training_chart([TrainingPoint(step=0, loss=1.0, over_optimum=2.0)]) is None


def test_a_history_marks_what_got_worse_and_leaves_gaps_out() -> None:
    series = {"<a>": [1e-4, None, 2e-4], "b": [1e-4, 1e-4, 1e-4]}
    found = shown(history_chart(series, ["1.0.0", "1.1.0", "1.2.0"], {("<a>", 2)}, "errors"))
    assert [row["said"] for row in found if row["worse"]] == ["<a>, 1.2.0: 20.0e-5, worse than before"]
    assert [(row["series"], row["version"]) for row in found] == [
        *(("<a>", "1.0.0"), ("<a>", "1.2.0")),
        *(("b", version) for version in ("1.0.0", "1.1.0", "1.2.0")),
    ]
    assert [row["mse"] for row in found] == pytest.approx([10.0, 20.0, 10.0, 10.0, 10.0])


def test_a_history_of_one_version_makes_no_chart() -> None:
    assert history_chart({"a": [1e-4]}, ["1.0.0"], set(), "errors") is None
    assert history_chart({"a": [1e-4, None]}, ["1.0.0", "1.1.0"], set(), "errors") is None
    assert history_chart({}, [], set(), "errors") is None


def test_a_curve_shows_its_hull_and_who_chose_what() -> None:
    found = shown(curve_chart([4e-5, 1e-5, 3e-5, 0.0], [0, 1, 3], {1: ["A", "VKB <x>"], 2: ["B"]}, "a pixel"))
    assert [row["error"] for row in found] == pytest.approx([4.0, 1.0, 3.0, 0.0])
    assert [row["k"] for row in found if row["hull"]] == [0, 1, 3]
    assert [row["label"] for row in found] == ["", "A", "B", ""]
    assert found[1]["said"] == "k = 1, 1.00e-5: A, VKB <x>"
    assert curve_chart([0.0, 0.0], [], {}, "exact") is None


def test_logarithmic_lines_have_the_points_of_every_series() -> None:
    series = {"front": [(2.0, 0.5), (1.0, 1.0)], "others": [(1.5, 2.0), (3.0, 3.0)]}
    spec = log_log("t", ("x", "y"), series, proportional=True, apart=["others"])
    found = shown(spec)
    assert [(row["series"], row["x"], row["y"]) for row in found] == [
        *(("front", 1.0, 1.0), ("front", 2.0, 0.5)),
        *(("others", 1.5, 2.0), ("others", 3.0, 3.0)),
    ]
    assert {row["series"] for row in found if row["joined"]} == {"front"}
    ends = spec["layer"][0]["data"]["values"]
    assert [end["y"] / end["x"] for end in ends] == pytest.approx([1.0, 1.0]), "through the last point that was given"
