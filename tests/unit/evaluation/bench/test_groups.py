"""Means over views, Pareto fronts, plots, the page, and the committed schema."""

from __future__ import annotations

import re
from typing import Any

import pytest
from support.bench import cell, view

from benchmarks.comparing.work import work as work_table
from evaluation.bench.account import COLUMNS
from evaluation.bench.groups import group, groups_of, offline
from evaluation.bench.page import page
from evaluation.bench.plots import specifications
from evaluation.bench.schema import FILE, schema_text
from schemas.bench import BenchResult, Times
from schemas.work import Device, PassWork

VIEWS = (
    view(
        cell("kbuffer", mse=1e-4, score=2.0),
        cell("kbuffer-optimal", mse=1e-6, frame=Times(median=5.0, least=5.0, most=5.0)),
        cell("kbuffer-importance", mse=1e-5, frame=Times(median=20.0, least=20.0, most=20.0)),
        cell("moment", mse=1e-3),
        cell("sbuffer"),
    ),
    view(cell("kbuffer", mse=1e-6, score=0.5), cell("sbuffer"), key="b", view="side"),
    view(cell("kbuffer", exact=True, mse=0.0), key="c", view="far"),
)


def result() -> BenchResult:
    return BenchResult(command="diaphane bench", created="2026", versions={}, bundle=None, views=VIEWS)


def test_errors_are_geometric_means_without_the_views_that_the_budget_holds() -> None:
    row = next(row for row in group("", VIEWS).rows if row.key.technique == "kbuffer")
    assert row.mse == pytest.approx(1e-5)
    assert row.score == pytest.approx(1.0)
    assert (row.views, row.exact_views) == (3, 1)
    assert row.ms == 10.0
    assert row.spread == pytest.approx(0.3)
    assert row.of_all == pytest.approx(150 / 400)


def test_a_row_that_fits_nowhere_has_the_most_bytes_of_all_its_views() -> None:
    large = cell("abuffer-array", problem="A pixel has 9 fragments.", pool_bytes=9000, total_bytes=9900, fits=False)
    alone = group("", [view(large)]).rows[0]
    assert (alone.problem, alone.pool_bytes, alone.total_bytes, alone.fits) == (large.problem, 9000, 9900, False)
    among = group("", [view(cell("abuffer-array")), view(large, key="b")]).rows[0]
    assert (among.problem, among.views, among.pool_bytes, among.fits) == (None, 1, 9000, False)
    assert group("", VIEWS).rows[0].fits


def test_an_account_is_over_the_views_that_were_counted() -> None:
    work = {"sums": PassWork(geometry_passes=1, fragments=400, blended_bytes=16_000), "resolve": PassWork(pixels=100)}
    views = [view(cell("moment", work=work), key=key) for key in "ab"] + [view(cell("moment"), key="c")]
    account = group("", views).rows[0].account
    assert account is not None
    assert (account.views, account.pixels, account.fragments) == (2, 200, 800)
    assert account.total == PassWork(geometry_passes=2, fragments=800, pixels=200, blended_bytes=32_000)
    assert account.a_pixel(account.total.blended_bytes) == 160.0
    assert account.a_fragment(account.total.blended_bytes) == 40.0
    device = Device(bandwidth=1.0, fill_rate=0.01)
    assert account.bound(device) == pytest.approx(0.04 + 0.01)
    assert account.bound(device, "resolve") == pytest.approx(0.01)
    assert account.columns(device)[:4] == ["1.00", "5.00", "160", "160"]
    assert len(account.columns(device)) == len(COLUMNS)
    assert group("", VIEWS).rows[0].account is None
    assert "| moment | 1.00 | 5.00 | 160 | 160 |" in work_table(views, 2.0, device)
    assert work_table(VIEWS, 2.0, device) == ""


def test_a_group_is_as_deep_as_its_views_are_on_average() -> None:
    assert group("", [view(), view(fragments=1000, key="b")]).depth == pytest.approx(7.0)


def test_rows_come_without_budget_first_then_by_budget_and_technique() -> None:
    cells = [cell("kbuffer", 4.0), cell("kbuffer-optimal", 1.0), cell("kbuffer", 1.0), cell("moment"), cell("sbuffer")]
    rows = group("", [view(*cells)]).rows
    assert [(r.key.technique, r.key.budget_factor) for r in rows] == [
        ("sbuffer", None),
        ("moment", None),
        ("kbuffer", 1.0),
        ("kbuffer-optimal", 1.0),
        ("kbuffer", 4.0),
    ]


def test_offline_allocations_are_those_of_undecided_views() -> None:
    marks = offline(group("", VIEWS))
    assert [(mark.rule.partition(",")[0], mark.gap) for mark in marks] == [
        ("Algorithm 1 (offline)", None),
        ("certified optimum", 1e-6),
    ]
    assert marks[0].mse == pytest.approx(2e-5)
    assert offline(group("", [view(cell(), fragments=200)])) == []


def test_the_front_of_a_plot_is_what_a_renderer_can_run_exact_included() -> None:
    slow = Times(median=30.0, least=30.0, most=30.0)
    shown = view(*(one for one in VIEWS[0].cells if one.technique != "sbuffer"), cell("sbuffer", frame=slow))
    plots = specifications(groups_of([shown]))
    points = {point["technique"]: point for point in plots["time-error"]["data"]["values"]}
    assert {name for name, point in points.items() if point["front"]} == {"kbuffer", "kbuffer-importance", "sbuffer"}
    assert points["sbuffer"]["mse"] == 0.0
    assert points["moment"]["mse"] == pytest.approx(100.0)
    dots = {dot["series"]: dot["mse"] for dot in plots["figure6-2"]["data"]["values"]}
    assert dots == pytest.approx(
        {
            "fixed k (kbuffer)": 10.0,
            "oracle (kbuffer-optimal)": 0.1,
            "VKB (kbuffer-importance)": 1.0,
            "exact (sbuffer)": 0.0,
            "moment": 100.0,
            "Algorithm 1 (offline)": 2.0,
        }
    )
    assert "figure6-7" not in plots


def test_points_tell_techniques_and_their_tails_apart() -> None:
    tails: list[dict[str, Any]] = [{}, {"g": 0.5}, {"tail": "exact-coverage", "g": None}]
    cells = [cell(name, **tail) for name in ("kbuffer", "kbuffer-dynamic") for tail in tails]
    plots = specifications(groups_of([view(*cells, cell("moment"), cell("sbuffer"))]))
    assert len(plots) == 3
    for plot in plots.values():
        series = {row["series"] for row in plot["data"]["values"]}
        assert {
            "fixed k (kbuffer)",
            "fixed k (kbuffer), binned-12 g = 0.5",
            "fixed k (kbuffer), exact-coverage",
            "dynamic k+ (kbuffer-dynamic), exact-coverage",
        } < series


def test_every_budget_averages_the_same_views() -> None:
    """Else the error would rise with the budget, which leaves the hard views over."""
    easy = [cell("kbuffer", 1.0, mse=1e-6), cell("kbuffer", 2.0, mse=0.0, exact=True), cell("moment", mse=1e-6)]
    hard = [cell("kbuffer", 1.0, mse=1e-3), cell("kbuffer", 2.0, mse=1e-4), cell("moment", mse=1e-3)]
    rows = {r.key.budget_factor: r for r in group("", [view(*easy, key="e"), view(*hard, key="h")]).rows}
    assert {budget: row.mse for budget, row in rows.items()} == pytest.approx({None: 1e-3, 1.0: 1e-3, 2.0: 1e-4})
    assert {(row.averaged, row.views) for row in rows.values()} == {(1, 2)}
    html = page(result().model_copy(update={"views": (view(*easy, key="e"), view(*hard, key="h"))}), [], None)
    assert "<td>1 of 2</td>" in html


def test_a_budget_that_holds_every_fragment_is_not_called_exact() -> None:
    """The fixed k-buffer spreads it over all pixels, and still errs."""
    html = page(result().model_copy(update={"views": VIEWS[2:]}), [], None)
    assert "F holds every fragment" in html
    assert "exact" not in html.partition("<tbody>")[2].partition("</tbody>")[0]


def test_the_page_shows_its_charts_without_a_network() -> None:
    html = page(result(), ["time-error"], "Two versions.")
    assert html.count('<script type="application/json">') == 4
    assert "vega.expressionInterpreter" in html
    assert not re.search(r'(src|href)="https?://', html)
    assert "@import" not in html
    assert "Two versions." in html
    assert "kbuffer-deep was left out" in html


def test_results_survive_json() -> None:
    text = result().model_dump_json(exclude_defaults=True)
    assert BenchResult.model_validate_json(text) == result()


def test_the_committed_schema_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == schema_text(), "run `python -m evaluation.bench.schema`"
