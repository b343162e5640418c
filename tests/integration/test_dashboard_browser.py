"""The dashboard in a browser: scripts, policy, live parts, keyboard, light and dark, narrow and wide."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy.exc import OperationalError
from support.api import Api
from support.browser import Tab
from support.dashboard import Shown

from services.database import Database, tables

WINDOWS = [(1280, "light"), (360, "dark")]
WINDOW_IDS = ["wide and light", "narrow and dark"]


@pytest.fixture(scope="module", params=WINDOWS, ids=WINDOW_IDS)
def tab(request: pytest.FixtureRequest, chromium: Any, api: Api, url: str, shown: Shown) -> Iterator[Tab]:
    opened = Tab(chromium, url, *request.param)
    opened.sign_in(api.secrets["admin"], "/jobs?state=failed")
    yield opened
    opened.context.close()


@pytest.fixture(params=WINDOWS, ids=WINDOW_IDS)
def empty_tab(request: pytest.FixtureRequest, chromium: Any, empty: Api) -> Iterator[Tab]:
    with empty.served() as address:
        opened = Tab(chromium, address, *request.param)
        opened.sign_in(empty.secrets["admin"])
        yield opened
        opened.context.close()


_OUTLINES = """async () => {
  const fresh = new DOMParser().parseFromString(await (await fetch(location.href)).text(), "text/html");
  const [here, there] = [document, fresh].map((page) =>
    [...page.querySelectorAll("#main *")].map((one) => `${one.nodeName} ${one.id}`));
  return [here.length > 99, here.join() === there.join()];
}"""
"""Whether a page has much in it, and is made of the same elements as one that comes now."""


def _pages(shown: Shown) -> dict[str, str]:
    return {
        "overview": "/",
        "jobs": "/jobs",
        "job-running": f"/jobs/{shown.running}",
        "job-failed": f"/jobs/{shown.failed}",
        "job-built": f"/jobs/{shown.built}",
        "models": "/models",
        "model": "/models/glass",
        "scenes": "/scenes",
        "webhooks": "/webhooks",
        "docs": "/docs",
        "scene": f"/scenes/{shown.scene}",
        "scene-rejected": f"/scenes/{shown.rejected}",
    }


def test_every_page_is_clean(tab: Tab, shown: Shown, tmp_path: Path) -> None:
    """No error, no violation of the policy, nothing from elsewhere, nothing too wide, nothing illegible in any colours.

    `DIAPHANE_SCREENSHOTS` names a folder where pictures of the pages are kept.
    """
    folder = Path(os.environ.get("DIAPHANE_SCREENSHOTS", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    width = tab.page.viewport_size["width"]
    for name, place in (_pages(shown) | {"sign-in": "/sign-in", "nowhere": "/nowhere"}).items():
        tab.page.goto(place, wait_until="load")
        assert tab.audit() == [], place
        tab.page.screenshot(path=folder / f"{name}-{width}.png", full_page=True)
        assert (folder / f"{name}-{width}.png").stat().st_size > 5000
    assert _only_status(tab, 404)


def test_opened_parts_of_the_docs_page_are_clean(tab: Tab) -> None:
    tab.page.goto("/docs", wait_until="load")
    tab.page.locator("#submit_job summary").click()
    tab.page.locator("#schema-JobSpec summary").click()
    tab.page.locator("#submit_job pre").wait_for(state="visible")
    tab.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert tab.audit() == []
    assert tab.faults == []


def test_pages_without_anything_to_show_say_what_to_do(empty_tab: Tab) -> None:
    for place in ("/", "/jobs", "/models", "/scenes"):
        empty_tab.page.goto(place, wait_until="load")
        assert empty_tab.audit() == [], place
        assert "diaphane jobs submit build" in empty_tab.page.locator(".empty").first.inner_text()
    assert empty_tab.faults == []


def test_what_is_not_there_is_a_page_that_leads_on(tab: Tab) -> None:
    for place in ("/nowhere", "/jobs/job_" + "0" * 24, "/models/nothing", "/scenes/scn_" + "0" * 32):
        tab.page.goto(place)
        assert tab.audit() == [], place
        assert "What to do:" in tab.page.locator(".problem").inner_text()
    tab.page.locator("main").get_by_role("link", name="Models").click()
    tab.page.wait_for_url("**/models")
    assert _only_status(tab, 404)


def test_pages_of_a_failing_service_say_so(tab: Tab, shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as broken:
        broken.setattr(Database, "read", _fail)
        for place in _pages(shown).values():
            tab.page.goto(place)
            assert tab.audit() == [], place
            assert "The database cannot be reached." in tab.page.locator(".problem").inner_text()
    tab.page.get_by_role("link", name="Try again").click()
    tab.page.get_by_role("heading", name="Facts").wait_for()
    assert _only_status(tab, 503)


def test_a_live_page_outlives_a_failing_database(
    tab: Tab, api: Api, shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is on the page stays, it is said that it may be old, and what comes next is shown again."""
    tab.page.goto(f"/jobs/{shown.running}")
    with monkeypatch.context() as broken:
        broken.setattr(Database, "read", _fail)
        tab.page.evaluate("htmx.trigger('[data-stream]', 'refresh')")
        tab.page.get_by_role("alert").wait_for()
        assert "the service answered 503" in tab.page.get_by_role("alert").inner_text()
        assert tab.page.get_by_role("heading", name="Stages").is_visible()
    text = f"again at {tab.page.viewport_size['width']}"
    _go_on(api, shown.running, "label", text)
    tab.page.get_by_text(text).wait_for()
    tab.page.get_by_role("alert").wait_for(state="hidden")
    assert _only_status(tab, 503)


def test_a_live_page_without_its_stream_goes_along_and_says_when_it_cannot(
    chromium: Any, api: Api, url: str, shown: Shown
) -> None:
    tab = Tab(chromium, url, 1280, "light")
    tab.sign_in(api.secrets["read"])
    tab.page.add_init_script("const wait = setTimeout; window.setTimeout = (what, ms) => wait(what, ms / 20);")
    tab.page.route("**/events?*", lambda route: route.fulfill(status=503))
    tab.page.goto(f"/jobs/{shown.running}")
    _go_on(api, shown.running, "label", "without a stream")
    tab.page.get_by_text("without a stream").wait_for()
    alert, page = tab.page.get_by_role("alert"), f"**/jobs/{shown.running}"
    assert not alert.is_visible()
    tab.page.route(page, lambda route: route.abort())
    alert.wait_for()
    assert "cannot be reached" in alert.inner_text()
    tab.page.unroute(page)
    alert.wait_for(state="hidden")
    tab.context.close()


def test_a_part_that_comes_anew_keeps_what_is_the_same(tab: Tab, api: Api, shown: Shown) -> None:
    """The focus, what is selected, and how far a table is scrolled; no row is lost or there twice."""
    tab.page.goto("/")
    is_narrow = tab.page.viewport_size["width"] < 1000
    tab.page.evaluate(
        f"() => {{ window.link = document.querySelector('#now a[href=\"/jobs/{shown.running}\"]');"
        " [window.jobs, window.workers] = document.querySelectorAll('#now .scroll');"
        " getSelection().selectAllChildren(link); jobs.scrollLeft = 40; }"
    )
    kept = "[getSelection().toString(), link.pathname, link.isConnected, jobs.isConnected, jobs.scrollLeft]"
    as_it_was = tab.page.evaluate(kept)
    assert as_it_was[1:] == [f"/jobs/{shown.running}", True, True, 40 if is_narrow else 0]
    tab.until(f"workers.tabIndex === {0 if is_narrow else -1}")  # what scrolls, and has no link in it, is a stop
    other = api.job(name="came-later")
    came = tab.page.locator("#now tr").get_by_text("build came-later")
    for focused in ("link", "workers"):
        tab.page.evaluate(f"document.activeElement.blur(), {focused}.focus()")
        before = tab.page.evaluate("window.before = document.activeElement, before.nodeName")
        assert before == ("A" if focused == "link" else "DIV" if is_narrow else "BODY")
        for state, seen in (("running", "visible"), ("cancelled", "detached")):
            api.move(other, state)
            tab.page.evaluate("htmx.trigger('[data-stream]', 'refresh')")
            came.wait_for(state=seen)
            assert tab.page.evaluate("new Promise(requestAnimationFrame).then(() => document.activeElement === before)")
            assert tab.page.evaluate(kept) == as_it_was
            assert tab.page.evaluate("workers.getAttribute('role')") == ("region" if is_narrow else None)
            assert tab.page.evaluate(_OUTLINES) == [True, True]
    with api.service.database.write() as connection:
        connection.execute(tables.jobs.delete().where(tables.jobs.c.id == other))
    assert tab.faults == []


def test_a_link_from_elsewhere_finds_who_is_signed_in(chromium: Any, api: Api, url: str, shown: Shown) -> None:
    tab = Tab(chromium, url, 1280, "light")
    tab.sign_in(api.secrets["read"])
    link = f'<a href="{url}/jobs/{shown.built}">look at this</a>'
    tab.page.route("http://chat.example/", lambda route: route.fulfill(content_type="text/html", body=link))
    tab.page.goto("http://chat.example/")
    tab.page.get_by_text("look at this").click()
    tab.page.get_by_role("heading", name="build glass").wait_for()
    tab.context.close()


def _fail(_: object) -> None:
    raise OperationalError("select 1", {}, Exception("gone"))


def _only_status(tab: Tab, status: int) -> bool:
    """Whether all that the console said is that an answer had this status; forgets it."""
    said = [fault for fault in tab.faults if f"the server responded with a status of {status}" not in fault]
    said = [fault for fault in said if not fault.startswith(f"Response Status Error Code {status}")]  # htmx
    tab.faults.clear()
    return said == []


def test_a_running_job_is_shown_as_it_goes(tab: Tab, api: Api, shown: Shown) -> None:
    _go_on(api, shown.running, "label", "before")
    tab.page.goto(f"/jobs/{shown.running}")
    assert tab.page.get_by_role("status").inner_text() == ""
    loads: list[str] = []
    tab.page.on("framenavigated", lambda frame: loads.append(frame.url))
    text = f"news at {tab.page.viewport_size['width']}"
    tab.page.evaluate("getSelection().selectAllChildren(document.querySelector('#log-lines tbody tr'))")
    selected = tab.page.evaluate("getSelection().toString()")
    later = threading.Timer(0.5, _go_on, [api, shown.running, "export", text])
    later.start()
    tab.page.get_by_text(text).wait_for()
    later.join()
    assert tab.page.get_by_role("status").inner_text() == "The job is running, stage export"
    assert tab.page.evaluate("getSelection().toString()") == selected != ""
    assert tab.page.evaluate(_OUTLINES) == [True, True]
    assert loads == []
    assert tab.faults == []


def test_the_overview_goes_along(tab: Tab, api: Api, shown: Shown) -> None:
    _go_on(api, shown.running, "label", "back")
    tab.page.goto("/")
    loads: list[str] = []
    tab.page.on("framenavigated", lambda frame: loads.append(frame.url))
    _name(api, shown.built, "glass-too")
    _go_on(api, shown.running, "evaluate", "on")
    tab.page.locator("#now").get_by_text("evaluate").wait_for()
    tab.page.locator("#ended-now").get_by_text("build glass-too").wait_for()
    assert loads == []
    _name(api, shown.built, "glass")
    _go_on(api, shown.running, "label", "back again")
    assert tab.faults == []


def _name(api: Api, job_id: str, name: str) -> None:
    with api.service.database.write() as connection:
        connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(name=name))


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
    tab.until("document.querySelectorAll('.chart[data-theme]').length === document.querySelectorAll('.chart').length")
    tip = tab.page.locator(".tip")
    assert not tip.is_visible()
    mark = tab.page.locator(".chart .mark").first
    mark.hover(force=True)
    assert "e-5" in tip.inner_text()
    tab.page.keyboard.press("Escape")
    assert not tip.is_visible()
    marks = tab.page.locator(".chart").first.locator(".mark")
    marks.first.focus()
    for key, place in (("ArrowRight", 1), ("End", marks.count() - 1), ("ArrowDown", marks.count() - 1), ("Home", 0)):
        tab.page.keyboard.press(key)
        assert tip.inner_text() == marks.nth(place).get_attribute("aria-label")
    assert "e-5" in tip.inner_text()
    assert tab.page.locator('.chart .mark[tabindex="0"]').count() == tab.page.locator(".chart").count()
    box = tip.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= tab.page.viewport_size["width"]
    assert tab.faults == []


def test_the_keyboard_reaches_the_content_first(tab: Tab) -> None:
    tab.page.goto("/models")
    tab.page.keyboard.press("Tab")
    assert tab.page.evaluate("document.activeElement.className") == "skip"
    assert tab.page.locator(".skip").bounding_box()["x"] >= 0
    tab.page.keyboard.press("Enter")
    assert tab.page.evaluate("document.activeElement.id") == "main"
    tab.page.keyboard.press("Tab")
    assert tab.page.evaluate("document.getElementById('main').contains(document.activeElement)")


def test_the_keyboard_reaches_everything_in_order_and_is_seen(tab: Tab, shown: Shown) -> None:
    for place in (_pages(shown) | {"sign-in": "/sign-in", "nowhere": "/nowhere"}).values():
        tab.page.goto(place, wait_until="load")
        assert tab.walk() == [], place
    assert _only_status(tab, 404)


def test_faults_are_found(tab: Tab) -> None:
    """What the audit and the walk are there for, made on purpose."""
    for place, change, fault in (
        ("/jobs", "main.querySelector('select').style.borderColor = 'transparent'", "the border of"),
        ("/models/glass", "main.querySelector('.chart svg text').style.fill = 'transparent'", "the text"),
        ("/models/glass", "main.querySelector('.chart svg .mark').style.fill = 'transparent'", "a mark"),
        ("/jobs", "main.querySelector('h1').outerHTML = '<h3>x</h3>'", "a level of headings is left out"),
        ("/jobs", "main.querySelector('a').style.transitionDuration = '1s'", "moves"),
        ("/jobs", "main.append(document.createElement('a'))", "no name"),
        ("/jobs", "main.firstElementChild.style.cssText = 'overflow: auto; height: 9px; clip-path: none'", "scrolled"),
    ):
        tab.page.goto(place, wait_until="load")
        assert tab.audit() == []
        tab.page.evaluate(f"() => {{ const main = document.getElementById('main'); {change}; }}")
        if fault == "scrolled":
            tab.page.evaluate(
                "() => { document.getElementById('main').firstElementChild.textContent = 'x '.repeat(99); }"
            )
        assert any(fault in one for one in tab.audit()), fault
    for change, fault in (("tabIndex = 5", "stop"), ("style.outline = 'none'", "the focus is not to be seen")):
        tab.page.goto("/jobs", wait_until="load")
        tab.page.evaluate(f"() => {{ document.querySelector('main a').{change}; }}")
        assert any(one.startswith(fault) for one in tab.walk()), fault
    tab.page.goto("/models/glass", wait_until="load")
    tab.page.evaluate(
        "() => { document.querySelector('main .scroll').innerHTML = '<pre>' + 'x'.repeat(999) + '</pre>'; }"
    )
    tab.until("document.querySelector('main .scroll pre').tabIndex === 0")  # what comes later is a stop, too
    assert tab.audit() == []
    assert tab.faults == []


def test_a_service_that_is_away_is_said_and_the_page_stays(tab: Tab, shown: Shown) -> None:
    tab.page.goto("/jobs")
    tab.page.route("**/jobs?*", lambda route: route.abort())
    tab.page.get_by_label("State").select_option("failed")
    tab.page.get_by_role("alert").wait_for()
    assert "cannot be reached" in tab.page.get_by_role("alert").inner_text()
    assert tab.page.locator("#list tbody tr").count() == 3
    tab.page.unroute("**/jobs?*")
    tab.faults.clear()  # the browser says it, too
