"""The dashboard in a browser: scripts, policy, live parts, keyboard, light and dark, narrow and wide."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.api import Api
from support.dashboard import Shown, fill

from services.database import tables

playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

SECONDS = 60_000
"""Of patience with a busy machine, ms."""

AUDIT = Path(__file__).with_name("dashboard_audit.js").read_text(encoding="utf-8").rstrip("\n;")
"""A function that returns what is wrong with a page for those who cannot see it, or not well."""


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    return Api(tmp_path_factory.mktemp("service"), rate=1e6, burst=10**6, ttl=1e6)


@pytest.fixture(scope="module")
def shown(api: Api, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    return fill(api, tmp_path_factory.mktemp("bundles"))


@pytest.fixture(scope="module")
def url(api: Api) -> Iterator[str]:
    with api.served() as address:
        yield address


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as tools:
        flags = ["--no-sandbox", "--disable-gpu"]
        started = tools.chromium.launch(executable_path=CHROMIUM, args=flags, timeout=SECONDS)
        yield started
        started.close()


class Tab:
    """A signed-in tab that remembers what went wrong in it."""

    def __init__(self, browser: Any, url: str, secret: str, width: int, scheme: str) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, base_url=url)
        self.page = self.context.new_page()
        self.page.set_default_timeout(SECONDS)
        self.faults: list[str] = []
        self.page.on(
            "console", lambda said: self.faults.append(said.text) if said.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", lambda sent: None if sent.url.startswith(url) else self.faults.append(sent.url))
        self.page.goto("/jobs?state=failed")
        self.page.get_by_label("API key").fill(secret)
        self.page.keyboard.press("Enter")
        self.page.wait_for_url("**/jobs?state=failed")


@pytest.fixture(scope="module", params=[(1280, "light"), (360, "dark")], ids=["wide and light", "narrow and dark"])
def tab(request: pytest.FixtureRequest, browser: Any, api: Api, url: str, shown: Shown) -> Iterator[Tab]:
    opened = Tab(browser, url, api.secrets["admin"], *request.param)
    yield opened
    opened.context.close()


def test_every_page_is_clean(tab: Tab, shown: Shown, tmp_path: Path) -> None:
    """No error, no violation of the policy, nothing from elsewhere, nothing too wide, nothing illegible.

    `DIAPHANE_SCREENSHOTS` names a folder where pictures of the pages are kept.
    """
    folder = Path(os.environ.get("DIAPHANE_SCREENSHOTS", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    width = tab.page.viewport_size["width"]
    places = {
        "overview": "/",
        "jobs": "/jobs",
        "job-running": f"/jobs/{shown.running}",
        "job-failed": f"/jobs/{shown.failed}",
        "models": "/models",
        "model": "/models/glass",
        "scenes": "/scenes",
        "scene": f"/scenes/{shown.scene}",
        "sign-in": "/sign-in",
    }
    for name, place in places.items():
        tab.page.goto(place, wait_until="load")
        assert tab.page.evaluate(AUDIT) == [], place
        assert tab.page.evaluate("document.scrollingElement.scrollWidth") <= width, place
        tab.page.screenshot(path=folder / f"{name}-{width}.png", full_page=True)
        assert (folder / f"{name}-{width}.png").stat().st_size > 5000
    assert tab.faults == []


def test_a_running_job_is_shown_as_it_goes(tab: Tab, api: Api, shown: Shown) -> None:
    tab.page.goto(f"/jobs/{shown.running}")
    assert tab.page.get_by_role("status").inner_text() == ""
    loads: list[str] = []
    tab.page.on("framenavigated", lambda frame: loads.append(frame.url))
    text = f"news at {tab.page.viewport_size['width']}"
    later = threading.Timer(0.5, _go_on, [api, shown.running, "export", text])
    later.start()
    tab.page.get_by_text(text).wait_for()
    later.join()
    assert tab.page.get_by_role("status").inner_text() == "The job is running, stage export"
    assert loads == []
    assert tab.faults == []


def test_the_overview_goes_along(tab: Tab, api: Api, shown: Shown) -> None:
    _go_on(api, shown.running, "label", "back")
    tab.page.goto("/")
    loads: list[str] = []
    tab.page.on("framenavigated", lambda frame: loads.append(frame.url))
    _go_on(api, shown.running, "evaluate", "on")
    tab.page.locator("#now").get_by_text("evaluate").wait_for()
    assert loads == []
    _go_on(api, shown.running, "label", "back again")
    assert tab.faults == []


def _go_on(api: Api, job_id: str, stage: str, text: str) -> None:
    with api.service.database.write() as connection:
        connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(stage=stage))
    api.log(job_id, text)


def test_filters_change_the_list_and_the_address(tab: Tab, shown: Shown) -> None:
    tab.page.goto("/jobs")
    tab.page.get_by_label("State").select_option("failed")
    tab.page.wait_for_url("**/jobs?state=failed*")
    assert tab.page.locator("#list tbody tr").count() == 1
    assert tab.faults == []


def test_values_of_charts_can_be_read_with_the_pointer_and_the_keyboard(tab: Tab) -> None:
    tab.page.goto("/models/glass")
    tip = tab.page.locator(".tip")
    assert not tip.is_visible()
    mark = tab.page.locator("svg.chart .mark").first
    mark.hover(force=True)
    assert "e-5" in tip.inner_text()
    tab.page.keyboard.press("Escape")
    assert not tip.is_visible()
    tab.page.locator("svg.chart .mark").nth(1).focus()
    assert "e-5" in tip.inner_text()
    box = tip.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= tab.page.viewport_size["width"]
    assert tab.faults == []


def test_the_keyboard_reaches_the_content_first(tab: Tab) -> None:
    tab.page.goto("/models")
    tab.page.keyboard.press("Tab")
    assert tab.page.evaluate("document.activeElement.className") == "skip"
    tab.page.keyboard.press("Enter")
    assert tab.page.evaluate("document.activeElement.id") == "main"
    tab.page.keyboard.press("Tab")
    assert tab.page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"


def test_a_service_that_is_away_is_said_and_the_page_stays(tab: Tab, shown: Shown) -> None:
    tab.page.goto("/jobs")
    tab.page.route("**/jobs?*", lambda route: route.abort())
    tab.page.get_by_label("State").select_option("failed")
    tab.page.get_by_role("alert").wait_for()
    assert "cannot be reached" in tab.page.get_by_role("alert").inner_text()
    assert tab.page.locator("#list tbody tr").count() == 3
    tab.page.unroute("**/jobs?*")
    tab.faults.clear()  # the browser says it, too
