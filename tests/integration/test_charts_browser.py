"""Charts in a browser: drawn by the scripts that a page carries, under a policy against `eval`, and told by value."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.browser import Tab
from support.charts import CHARTS, POINTS

from evaluation.report.page import TEMPLATES
from evaluation.report.vega import figure, scripts


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("charts")
    css = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    (folder / "page.html").write_text(
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Charts</title>'
        f'<link rel="icon" href="data:,"><meta http-equiv="Content-Security-Policy" content="{policy}; img-src data:">'
        f'<meta name="viewport" content="width=device-width"><style>{css}</style></head>'
        f"<body><main>{''.join(figure(spec) for spec in CHARTS.values())}</main>{scripts()}</body></html>"
    )
    return folder / "page.html"


@pytest.fixture(params=[(1280, "light"), (390, "dark")], ids=["wide and light", "narrow and dark"])
def tab(request: pytest.FixtureRequest, chromium: Any, page: Path) -> Iterator[Tab]:
    opened = Tab(chromium, "file://", *request.param)
    opened.page.goto(page.as_uri())
    opened.page.wait_for_selector(".chart:last-of-type .mark")
    yield opened
    opened.context.close()


def test_a_browser_draws_the_charts_and_tells_values(tab: Tab) -> None:
    tab.until(f"document.querySelectorAll('.chart .drawn svg .mark[tabindex=\"0\"]').length === {len(CHARTS)}")
    for i, spec in enumerate(CHARTS.values()):
        said = {row["said"] for row in spec["data"]["values"]}
        marks = tab.page.locator(".chart").nth(i).locator(".mark")
        told = {mark.get_attribute("aria-label") for mark in marks.all()}
        assert told
        assert told <= said
    assert len(tab.page.locator(".chart").first.locator(".mark").all()) == len(POINTS)
    mark, tip = tab.page.locator(".chart .mark").first, tab.page.locator(".tip")
    assert not tip.is_visible()
    mark.hover(force=True)
    tab.until("!document.querySelector('.tip').hidden")
    assert tip.inner_text() == mark.get_attribute("aria-label")
    tab.page.keyboard.press("Escape")
    assert not tip.is_visible()
    wide = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    assert tab.page.evaluate(wide)
    assert tab.faults == []


def test_the_legend_picks_a_series(tab: Tab) -> None:
    marks = tab.page.locator(".chart").first.locator(".mark")
    before = [mark.get_attribute("opacity") for mark in marks.all()]
    tab.page.locator(".chart").first.locator(".role-legend-label text").first.click(force=True)
    faded = "document.querySelector('.chart .mark[opacity=\"0.12\"]') !== null"
    tab.until(faded)
    after = [mark.get_attribute("opacity") for mark in marks.all()]
    assert set(before) <= {"1", None}
    assert after.count("0.12") == 1


def test_a_legend_is_whole_after_the_window_has_changed(tab: Tab) -> None:
    whole = """[...document.querySelectorAll('.chart')].every((one) => {
        const end = one.querySelector('svg').getBoundingClientRect().bottom;
        return [...one.querySelectorAll('.role-legend-label')].every((at) => at.getBoundingClientRect().bottom <= end);
    })"""
    tab.until(whole)
    width = tab.page.viewport_size["width"]
    tab.page.set_viewport_size({"width": width, "height": 500})
    tab.page.wait_for_timeout(500)
    tab.until(whole)
