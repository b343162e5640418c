"""Means over views, Pareto fronts, plots, the page, and the committed schema."""

from __future__ import annotations

import json
import math
import re
from typing import Any
from xml.etree import ElementTree

import pytest
from support.bench import cell, view

from benchmarks.comparing.work import work as work_table
from schemas.bench import BenchResult, Times
from schemas.work import Device, PassWork
from services.bench.account import COLUMNS
from services.bench.bars import error_bars
from services.bench.groups import group, groups_of, offline
from services.bench.page import charts_of, page
from services.bench.plots import specifications
from services.bench.schema import FILE, schema_text

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


def test_the_front_of_a_plot_is_what_a_renderer_can_run() -> None:
    plots = specifications(groups_of(VIEWS[:1]))
    points = {point["technique"]: point for point in plots["time-error.vl.json"]["data"]["values"]}
    assert {name for name, point in points.items() if point["front"]} == {"kbuffer", "kbuffer-importance"}
    assert points["sbuffer"]["mse"] is None
    assert points["moment"]["mse"] == pytest.approx(100.0)
    bars = plots["figure6.vl.json"]["data"]["values"]
    assert {bar["technique"] for bar in bars} == {"kbuffer", "kbuffer-optimal", "kbuffer-importance"}


def test_points_tell_techniques_and_their_tails_apart() -> None:
    tails: list[dict[str, Any]] = [{}, {"g": 0.5}, {"tail": "exact-coverage", "g": None}]
    cells = [cell(name, **tail) for name in ("kbuffer", "kbuffer-dynamic") for tail in tails]
    for plot in specifications(groups_of([view(*cells, cell("moment"), cell("sbuffer"))])).values():
        layers = plot["spec"]["layer"] if "spec" in plot else [plot]
        (points,) = [layer["encoding"] for layer in layers if layer["mark"]["type"] == "point"]
        looks: dict[tuple[str, str], set[str]] = {}
        for datum in plot["data"]["values"]:
            look = (datum[points["color"]["field"]], datum[points["shape"]["field"]])
            looks.setdefault(look, set()).add(datum["technique"])
        assert all(len(shown) == 1 for shown in looks.values())
        assert {"kbuffer", "kbuffer (binned-12 g = 0.5)", "kbuffer (exact-coverage)"} < set().union(*looks.values())
        assert len({colour for colour, _ in looks if colour.startswith("kbuffer")}) == 2, "one for all of its tails"


def test_every_field_of_a_plot_is_in_its_data() -> None:
    for plot in specifications(groups_of(VIEWS)).values():
        fields = set(re.findall(r'"field": "(\w+)"', json.dumps(plot)))
        assert fields
        assert all(fields <= set(row) for row in plot["data"]["values"])


def test_bars_are_higher_where_the_error_is_larger() -> None:
    svg = ElementTree.fromstring(error_bars(groups_of(VIEWS[:1]), 2.0, standalone=True))
    heights = {}
    for bar in svg.iter("{http://www.w3.org/2000/svg}rect"):
        title = bar.find("{http://www.w3.org/2000/svg}title")
        if title is not None and title.text is not None:
            heights[title.text.split(", ")[-1].partition(":")[0]] = float(bar.get("height", "nan"))
    # 100, 2 (the oracle), 1 and .1 e-5, from 1.5 times below the least on a logarithmic axis.
    step = (heights["kbuffer"] - heights["kbuffer-importance"]) / math.log(10.0)
    assert heights["kbuffer-importance"] - heights["kbuffer-optimal"] == pytest.approx(step * math.log(10.0), abs=0.2)
    oracle = heights["Algorithm 1 (offline)"] - heights["kbuffer-importance"]
    assert oracle == pytest.approx(step * math.log(2.0), abs=0.2)
    assert error_bars(groups_of(VIEWS), 7.0) == ""


def test_what_is_written_under_bars_does_not_overlap() -> None:
    wide = view(cell("kbuffer"), scene="minecraft_village_caves", alpha=None)
    other = view(cell("kbuffer"), key="b", scene="two_cylinder_engine", alpha=None)
    svg = ElementTree.fromstring(error_bars(groups_of([wide, other]), 2.0))
    texts = [text for text in svg.iter("{http://www.w3.org/2000/svg}text") if text.text == "authored alpha"]
    first, second = (float(text.get("x", "nan")) for text in texts)
    assert second - first > 6.0 * len("minecraft_villag")


def test_every_bar_of_a_cluster_looks_different() -> None:
    tails = ("density-16", "binned-8", "density", "exact-coverage", "weighted-average")
    cells = [cell(name, tail=tail) for name in ("kbuffer", "kbuffer-optimal") for tail in tails]
    svg = ElementTree.fromstring(error_bars(groups_of([view(*cells)]), 2.0))
    bars = [bar for bar in svg.iter("{http://www.w3.org/2000/svg}rect") if len(bar)]
    assert len(bars) == 11
    assert len({(bar.get("fill"), bar.get("fill-opacity")) for bar in bars}) == 11


def test_every_mark_with_a_number_is_in_the_legend() -> None:
    shown = charts_of(group("", [view(cell("kbuffer"), cell("kbuffer-deep", bundle="x"), cell("moment"))]))
    assert "this bundle" in shown.legend
    assert "moment" not in shown.legend


def test_a_budget_that_holds_every_fragment_is_not_called_exact() -> None:
    """The fixed k-buffer spreads it over all pixels, and still errs."""
    html = page(result().model_copy(update={"views": VIEWS[2:]}), [], None)
    assert "F holds every fragment" in html
    assert "exact" not in html.partition("<tbody>")[2].partition("</tbody>")[0]


def test_the_page_shows_its_charts_without_a_network() -> None:
    html = page(result(), ["time-error.vl.json"], "Two versions.")
    assert html.count("<svg") > 3
    assert not re.search(r'(src|href)="https?://', html)
    assert "@import" not in html
    assert "Two versions." in html
    assert "kbuffer-deep was left out" in html


def test_results_survive_json() -> None:
    text = result().model_dump_json(exclude_defaults=True)
    assert BenchResult.model_validate_json(text) == result()


def test_the_committed_schema_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == schema_text(), "run `python -m services.bench.schema`"
