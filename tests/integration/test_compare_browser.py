"""The page Compare in a browser: keyboard, pointer, address, light and dark, narrow and wide, and without scripts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support.api import Api
from support.browser import Tab
from support.compare import HOSTILE_VIEW, Filled, fill

SIZE = (48, 32)
LOADED = "[...document.querySelectorAll('#stage img.on')].every((image) => image.complete && image.naturalWidth > 0)"


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    return Api(tmp_path_factory.mktemp("compare"), rate=1e6, burst=10**6)


@pytest.fixture(scope="module")
def filled(api: Api) -> Filled:
    return fill(api, SIZE)


def _tab(chromium: Any, api: Api, url: str, width: int, scheme: str, **more: Any) -> Tab:
    opened = Tab(chromium, url, width, scheme, **more)
    opened.page.goto("/sign-in?next=%2Fcompare")
    opened.page.get_by_label("API key").fill(api.secrets["read"])
    opened.page.keyboard.press("Enter")
    opened.page.wait_for_url("**/compare*")
    return opened


def _shows(tab: Tab, x: int, y: int) -> None:
    """Waits until the inspector shows a pixel."""
    tab.page.locator(f'.pixel[data-x="{x}"][data-y="{y}"]').wait_for()


@pytest.fixture(scope="module", params=[(1280, "light"), (360, "dark")], ids=["wide and light", "narrow and dark"])
def tab(request: pytest.FixtureRequest, chromium: Any, api: Api, url: str, filled: Filled) -> Iterator[Tab]:
    opened = _tab(chromium, api, url, *request.param)
    yield opened
    opened.context.close()


def _open(tab: Tab, filled: Filled, more: str = "", view: str = "front") -> Any:
    sides = "a=kbuffer-importance%3A1&b=glass%401.1.0%3A1"
    tab.page.goto(f"/compare?scene={filled.scene}&view={quote(view)}&{sides}{more}", wait_until="load")
    return tab.page.locator("#stage")


def test_every_mode_is_clean(tab: Tab, filled: Filled, tmp_path: Path) -> None:
    """No error, no violation of the policy, nothing too wide, nothing illegible.

    `DIAPHANE_SCREENSHOTS` names a folder where pictures of the pages are kept.
    """
    folder = Path(os.environ.get("DIAPHANE_SCREENSHOTS", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    width = tab.page.viewport_size["width"]
    for mode in ("slider", "blink", "difference", "flip", "k-a", "k-b"):
        _open(tab, filled, f"&mode={mode}&x=20&y=11")
        tab.until(LOADED)
        assert tab.audit() == [], mode
        tab.page.screenshot(path=folder / f"compare-{mode}-{width}.png", full_page=True)
    _open(tab, filled, "&zoom=16&x=40&y=20", HOSTILE_VIEW)
    assert tab.page.evaluate("document.scrollingElement.scrollWidth") <= width
    assert tab.faults == []


def test_the_keyboard_reaches_everything_in_order_and_is_seen(tab: Tab, filled: Filled) -> None:
    for mode in ("slider", "blink", "flip"):
        _open(tab, filled, f"&mode={mode}&x=20&y=11")
        assert tab.walk() == [], mode
    assert tab.faults == []


def test_the_pixel_goes_by_keyboard_and_into_the_address(tab: Tab, filled: Filled) -> None:
    stage = _open(tab, filled)
    stage.focus()
    tab.page.keyboard.press("ArrowRight")  # takes hold of the one in the middle
    _shows(tab, 24, 16)
    tab.page.keyboard.press("ArrowRight")
    tab.page.keyboard.press("Shift+ArrowUp")
    _shows(tab, 25, 6)
    assert (tab.address()["x"], tab.address()["y"]) == ("25", "6")
    tab.until("document.querySelectorAll('#inspector .mark[tabindex=\"0\"]').length === 1")  # the chart is a stop, too
    assert "Pixel 25, 6" in tab.page.get_by_role("status").inner_text()
    tab.page.get_by_label("Pixel x").fill("3")
    tab.page.keyboard.press("Enter")
    _shows(tab, 3, 6)
    tab.page.reload()
    _shows(tab, 3, 6)
    assert tab.page.get_by_label("Pixel x").input_value() == "3"
    stage.focus()
    tab.page.keyboard.press("Escape")
    assert "x" not in tab.address()
    tab.page.go_back()
    _shows(tab, 3, 6)
    assert tab.page.get_by_label("Pixel x").input_value() == "3"
    assert tab.faults == []


def test_the_slider_goes_by_keyboard(tab: Tab, filled: Filled) -> None:
    _open(tab, filled, "&mode=slider")
    clip = "document.getElementById('picture-b').style.clipPath"
    before = tab.page.evaluate(clip)
    tab.page.get_by_label("A to the left of").focus()
    for _ in range(4):
        tab.page.keyboard.press("ArrowLeft")
    assert tab.page.get_by_label("A to the left of").input_value() == "48"
    assert tab.page.evaluate(clip) != before
    tab.page.locator("#stage").focus()
    tab.page.keyboard.press("Space")
    assert tab.page.get_by_label("A to the left of").input_value() == "100"
    assert tab.faults == []


def test_state_survives_a_reload_and_goes_back_and_forth(tab: Tab, filled: Filled) -> None:
    stage = _open(tab, filled)
    tab.page.get_by_label("FLIP", exact=True).check()
    tab.page.get_by_label("Zoom").select_option("8")
    stage.focus()
    tab.page.keyboard.press("+")
    wanted = {"mode": "flip", "zoom": "16", "a": "kbuffer-importance:1", "b": "glass@1.1.0:1", "view": "front"}
    for again in (False, True):
        if again:
            tab.page.reload()
        assert wanted.items() <= tab.address().items()
        assert tab.page.get_by_label("FLIP", exact=True).is_checked()
        assert tab.page.locator(".sheet").bounding_box()["width"] == 16 * SIZE[0]
        tab.until(LOADED)
    tab.page.go_back()
    tab.page.go_back()
    tab.until("document.getElementById('zoom').value === 'fit'")
    tab.page.go_back()
    tab.until("document.querySelector('[name=mode]:checked').value === 'slider'")
    tab.page.go_forward()
    tab.until("document.querySelector('[name=mode]:checked').value === 'flip'")
    assert tab.faults == []


def test_another_side_is_another_page_and_what_was_in_focus_stays_so(tab: Tab, filled: Filled) -> None:
    _open(tab, filled, "&mode=difference&x=5&y=6")
    tab.page.get_by_label("Differences").select_option("64")
    shown = tab.page.locator("#picture-map").get_attribute("src")
    assert tab.page.get_by_role("link", name="difference as PNG").get_attribute("href") == shown
    tab.page.get_by_label("A", exact=True).focus()
    tab.page.get_by_label("A", exact=True).select_option("exact")
    tab.page.wait_for_url("**a=exact*")
    _shows(tab, 5, 6)
    assert tab.page.evaluate("document.activeElement.id") == "a"
    assert tab.address()["mode"] == "difference"
    tab.page.get_by_label("View").select_option(HOSTILE_VIEW)
    tab.page.wait_for_url("**view=%3Cb*")
    _shows(tab, 5, 6)
    assert tab.address()["view"] == HOSTILE_VIEW
    assert "near" not in tab.address()
    tab.page.go_back()
    tab.page.wait_for_url("**view=front*")
    assert tab.page.get_by_label("View").input_value() == "front"
    assert tab.faults == []


def test_the_pointer_inspects_holds_and_pans(tab: Tab, filled: Filled) -> None:
    stage = _open(tab, filled, "&zoom=fit")
    box = tab.page.locator(".sheet").bounding_box()
    place = (box["x"] + box["width"] * 10.5 / SIZE[0], box["y"] + box["height"] * 4.5 / SIZE[1])
    tab.page.mouse.move(*place)
    _shows(tab, 10, 4)
    assert "x" not in tab.address()
    tab.page.mouse.click(*place)
    _shows(tab, 10, 4)
    tab.page.wait_for_url("**x=10&y=4*")
    tab.page.get_by_label("Zoom").select_option("16")
    tab.page.evaluate("document.getElementById('stage').scrollTo(200, 0)")
    frame = stage.bounding_box()
    tab.page.mouse.move(frame["x"] + 40, frame["y"] + 150)
    tab.page.mouse.down()
    tab.page.mouse.move(frame["x"] + 120, frame["y"] + 150, steps=4)
    tab.page.mouse.up()
    if tab.page.viewport_size["width"] < 16 * SIZE[0]:
        assert tab.page.evaluate("document.getElementById('stage').scrollLeft") == 120
    assert tab.address()["x"] == "10", "a drag is no click"
    assert tab.faults == []


def test_blinking_waits_where_less_motion_is_asked_for(chromium: Any, api: Api, url: str, filled: Filled) -> None:
    for motion, pressed in (("reduce", "false"), ("no-preference", "true")):
        tab = _tab(chromium, api, url, 1280, "light", reduced_motion=motion)
        _open(tab, filled, "&mode=blink")
        assert tab.page.locator("#play").get_attribute("aria-pressed") == pressed
        if motion == "reduce":
            tab.page.wait_for_timeout(1500)
            assert tab.page.locator("#shown").inner_text() == "A is shown"
            tab.page.locator("#stage").focus()
            tab.page.keyboard.press("Space")
            assert tab.page.locator("#picture-b.on").count() == 1
        tab.page.get_by_text("B is shown").wait_for()
        assert tab.faults == []
        tab.context.close()


def test_a_service_that_is_away_is_said(tab: Tab, filled: Filled) -> None:
    stage = _open(tab, filled, "&x=5&y=6")
    tab.page.route("**/compare/pixel?*", lambda route: route.abort())
    stage.focus()
    tab.page.keyboard.press("ArrowDown")
    tab.page.get_by_role("alert").wait_for()
    assert "cannot be reached" in tab.page.get_by_role("alert").inner_text()
    tab.page.unroute("**/compare/pixel?*")
    tab.page.keyboard.press("ArrowDown")
    _shows(tab, 5, 8)
    assert not tab.page.get_by_role("alert").is_visible()
    tab.faults.clear()  # the browser says it, too


def test_a_picture_that_failed_is_asked_for_again(tab: Tab, filled: Filled) -> None:
    tab.page.route("**/compare/picture.png?*", lambda route: route.fulfill(status=503))
    _open(tab, filled, "&x=5&y=6")
    alert = tab.page.get_by_role("alert")
    alert.wait_for()
    tab.page.locator("#stage").focus()
    tab.page.keyboard.press("ArrowDown")
    _shows(tab, 5, 7)
    assert "A picture could not be loaded" in alert.inner_text(), "a pixel that was read says nothing about pictures"
    tab.page.unroute("**/compare/picture.png?*")
    tab.page.get_by_role("button", name="Show", exact=True).click()
    tab.until(LOADED)
    assert not alert.is_visible()
    tab.faults.clear()  # the browser says it, too


def test_the_slider_is_within_the_picture_and_in_the_address(tab: Tab, filled: Filled) -> None:
    stage = _open(tab, filled, "&zoom=1&split=25")
    middle = "document.querySelector('.divider').getBoundingClientRect()"
    left = tab.page.evaluate(f"{middle}.left + {middle}.width / 2") - tab.page.locator(".sheet").bounding_box()["x"]
    assert left == pytest.approx(0.25 * SIZE[0], abs=1.5)
    stage.focus()
    tab.page.keyboard.press("Space")
    tab.page.wait_for_url("**split=100*")
    tab.page.reload()
    assert tab.page.get_by_label("A to the left of").input_value() == "100"
    assert tab.faults == []


def test_without_scripts_the_button_does_it(chromium: Any, api: Api, url: str, filled: Filled) -> None:
    tab = _tab(chromium, api, url, 1280, "light", java_script_enabled=False)
    _open(tab, filled)
    assert tab.page.locator("#stage img").count() == 2
    tab.page.get_by_label("k of B", exact=True).check()
    tab.page.get_by_label("Pixel x").fill("7")
    tab.page.get_by_label("y", exact=True).fill("9")
    tab.page.get_by_role("button", name="Show", exact=True).click()
    _shows(tab, 7, 9)
    assert tab.page.locator("#picture-map").get_attribute("alt") == "k of B"
    tab.context.close()
