"""Costs against errors: a chart's data are the figures, exact is on it and on its front, and labels do not collide."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.measured import example, measurement

from evaluation.looks import LOOKS, title
from evaluation.report import labels
from evaluation.report.dots import Dot, error_dots
from evaluation.report.fronts import MEMORY, TIME, Point, error_chart, front_of, pareto_front, points_of
from evaluation.report.labels import HEIGHT, Span, place
from evaluation.summary import MSE_FLOOR, rows

MANY = [
    Point(name, factor, 5.0 + i + 1.3 * j, 1e-4 / (1 + i) / 3**j, is_runnable=name != "kbuffer-optimal")
    for i, name in enumerate(("kbuffer", "kbuffer-dynamic", "kbuffer-importance", "kbuffer-optimal"))
    for j, factor in enumerate((1.0, 2.0, 4.0))
]


def shown(spec: dict[str, Any] | None) -> list[dict[str, Any]]:
    """The data of a chart."""
    assert spec is not None
    return list(spec["data"]["values"])


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=20))
def test_the_pareto_front_is_what_nothing_dominates(points: list[tuple[int, int]]) -> None:
    def dominated(p: tuple[int, int]) -> bool:
        return any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)

    assert pareto_front(points) == sorted({p for p in points if not dominated(p)})


def test_the_data_of_a_chart_are_the_figures() -> None:
    measured = example()
    found = {(row["technique"], row["budget"]): row for row in shown(error_chart(points_of(rows(measured), TIME), "x"))}
    assert len(found) == len(measured)
    for one in measured:
        row = found[one.technique, one.budget_factor]
        assert (row["cost"], row["mse"]) == pytest.approx((one.total_ms, 1e5 * (one.mse or 0.0)))
        assert row["y"] == row["mse"]
        assert row["series"] == title(one.technique)
        assert f"F = {one.budget_factor:g} W H: " in row["said"]


def test_memory_is_in_mebibytes_and_rows_without_a_cost_are_left_out() -> None:
    measured = [measurement(total_bytes=3 * 2**20), measurement("kbuffer-deep", total_bytes=None)]
    (row,) = shown(error_chart(points_of(rows(measured), MEMORY), "x", MEMORY))
    assert row["cost"] == pytest.approx(3.0)
    assert error_chart(points_of(rows([measurement(total_ms=None)]), TIME), "x") is None


def test_the_oracle_is_not_on_the_front_and_exact_is() -> None:
    points = [
        Point("kbuffer", 1.0, 10.0, 4e-5),
        Point("kbuffer-deep", 1.0, 20.0, 2e-5),
        Point("kbuffer-optimal", 1.0, 15.0, 1e-5, is_runnable=False),
        Point("sbuffer", None, 30.0, 0.0),
        Point("abuffer-list", None, 40.0, 0.0),
    ]
    assert [point.technique for point in front_of(points)] == ["kbuffer", "kbuffer-deep", "sbuffer"]
    on_it = {row["technique"] for row in shown(error_chart(points, "x")) if row["front"]}
    assert on_it == {"kbuffer", "kbuffer-deep", "sbuffer"}


def test_exact_stands_below_every_error_and_the_axis_says_0() -> None:
    spec = error_chart([*MANY, Point("sbuffer", None, 30.0, 0.0)], "x")
    *others, exact = shown(spec)
    assert spec is not None
    low, _ = spec["layer"][0]["encoding"]["y"]["scale"]["domain"]
    assert low < exact["y"] < min(row["y"] for row in others)
    assert exact["mse"] == 0.0
    assert "exact" in exact["said"]
    assert exact["y"] in spec["layer"][0]["encoding"]["y"]["axis"]["values"]
    assert error_chart([Point("sbuffer", None, 30.0, 0.0)], "x") is not None


def test_what_a_budget_holds_entirely_is_exact_but_with_the_fixed_k() -> None:
    held = [measurement(name, exact=True, mse=0.0) for name in ("kbuffer", "kbuffer-deep")]
    assert [point.technique for point in points_of(rows(held), TIME)] == ["kbuffer-deep"]


def test_an_error_below_the_floor_is_said_to_be_no_more() -> None:
    (row,) = shown(error_chart([Point("kbuffer", 1.0, 1.0, MSE_FLOOR)], "x"))
    assert "MSE ≤ 0.00100e-5" in row["said"]


def test_a_series_looks_the_same_in_every_chart() -> None:
    first, second = (error_chart(points, "x") for points in (MANY, MANY[3:6]))
    dots = error_dots([Dot("a", point.technique, point.mse) for point in MANY[:6:3]], "x")
    looks: dict[str, set[tuple[str, ...]]] = {}
    for spec in (first, second, dots):
        assert spec is not None
        (marks,) = (layer["encoding"] for layer in spec["layer"] if layer.get("name") == "marks")
        scales = [marks[of]["scale"] for of in ("fill", "stroke", "shape")]
        assert len({tuple(scale["domain"]) for scale in scales}) == 1
        for name, *look in zip(scales[0]["domain"], *(scale["range"] for scale in scales), strict=True):
            looks.setdefault(name, set()).add(tuple(look))
    dynamic = LOOKS["kbuffer-dynamic"]
    assert looks[dynamic.title] == {(dynamic.light, dynamic.light, dynamic.shape)}
    assert all(len(found) == 1 for found in looks.values())


def test_another_tail_is_hollow() -> None:
    spec = error_chart([MANY[0], replace(MANY[0], tail="exact-coverage")], "x")
    assert spec is not None
    (marks,) = (layer["encoding"] for layer in spec["layer"] if layer.get("name") == "marks")
    fills, outlines = (marks[of]["scale"]["range"] for of in ("fill", "stroke"))
    assert fills[0] == outlines[0] == outlines[1] != fills[1]
    assert marks["fill"]["scale"]["domain"][1] == "fixed k (kbuffer), exact-coverage"


def test_a_chart_needs_nothing_that_its_data_have_not() -> None:
    spec = error_chart(MANY, "x")
    text = json.dumps(spec)
    assert '"url"' not in text
    fields = {part.partition('"')[0] for part in text.split('"field": "')[1:]}
    assert fields
    assert all(fields <= set(row) for row in shown(spec))


values = st.floats(0.11, 99.0)


@given(st.lists(st.tuples(values, values, st.sampled_from(["", "1", "0.125", "16"])), max_size=25))
def test_labels_collide_neither_with_labels_nor_with_marks_at_any_width(points: list[tuple[float, float, str]]) -> None:
    x, y = Span(0.1, 100.0), Span(0.1, 100.0)
    made = place(points, x, y)
    for width in labels._WIDTHS:
        at = [(width * x.fraction(a), HEIGHT * (1 - y.fraction(b))) for a, b, _ in points]
        boxes = [
            labels._box(where, label.text, label.align, label.dx, label.dy)
            for where, label in zip(at, made, strict=True)
            if label.text
        ]
        for (l0, t0, r0, b0), (l1, t1, r1, b1) in combinations(boxes, 2):
            assert r0 <= l1 or r1 <= l0 or b0 <= t1 or b1 <= t0
        for left, top, right, bottom in boxes:
            assert 0 <= left < right <= width
            assert 0 <= top < bottom <= HEIGHT
            assert not any(left < px < right and top < py < bottom for px, py in at)
    assert all(label.text in ("", text) for label, (*_, text) in zip(made, points, strict=True))


def test_a_point_alone_has_its_label() -> None:
    (label,) = place([(1.0, 1.0, "2")], Span(0.1, 10.0), Span(0.1, 10.0))
    assert label.text == "2"


def test_dots_are_the_errors_of_each_scene() -> None:
    dots = [Dot("a, x", "kbuffer", 1e-4), Dot("a, x", "sbuffer", 0.0), Dot("b", "kbuffer", 3e-5, "exact-coverage")]
    spec = error_dots(dots, "x")
    found = shown(spec)
    assert [(row["row"], row["series"]) for row in found] == [
        ("a, x", "fixed k (kbuffer)"),
        ("a, x", "exact (sbuffer)"),
        ("b", "fixed k (kbuffer), exact-coverage"),
    ]
    assert [row["mse"] for row in found] == pytest.approx([10.0, 0.0, 3.0])
    assert 0.0 < found[1]["x"] < 3.0
    assert spec is not None
    assert spec["layer"][0]["encoding"]["y"]["sort"] == ["a, x", "b"]
    assert error_dots([Dot("a", "sbuffer", 0.0)], "x") is None
