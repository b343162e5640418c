"""`/clients` and `/examples` of the service: packages to install, and pages that show what they do."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from support.api import Api
from support.browser import Tab
from support.dashboard import Visitor

from services.dashboard import clients, examples
from services.dashboard.page import POLICY

_KEEP = """(() => {
    const before = globalThis.GPUAdapter?.prototype.requestDevice;
    if (before) GPUAdapter.prototype.requestDevice = async function (...all) {
        return (globalThis.device = await before.apply(this, all));
    };
})()"""
_DRAWN = "!document.getElementById('status').textContent && !!document.querySelector('#stage canvas')"


def test_packages_are_open_and_listed(empty: Api) -> None:
    nobody = Visitor(empty, None)
    listed = json.loads(nobody.get("/clients/index.json").content)["packages"]
    assert [one["name"] for one in listed] == ["@diaphane/core", "@diaphane/three"]
    page = nobody.get("/clients/")
    assert page.content == nobody.get("/clients").content
    for one in listed:
        address = f"/clients/{one['file']}"
        assert f"http://localhost{address}" in page.text  # of the command
        answer = nobody.get(address)
        assert answer.headers["content-type"] == "application/gzip"
        assert len(answer.content) == one["bytes"]
    for name in ("none.tgz", "..%2findex.json", "%2e%2e"):
        assert nobody.get(f"/clients/{name}").status_code in (404, 422)
    assert sum(len(content) for content, _ in clients.BUILT.files.values()) < 200_000


def test_examples_are_open_and_strict_and_lead_to_each_other(empty: Api) -> None:
    nobody = Visitor(empty, None)
    index = nobody.get("/examples/")
    places = set(re.findall(r'href="(/examples/[a-z]+\.html)"', index.text))
    assert len(places) == 5
    for place in (*places, "/examples"):
        page = nobody.get(place)
        assert page.status_code == 200
        assert page.headers["content-security-policy"] == POLICY
        assert "<script>" not in page.text
        assert "style=" not in page.text
        for local in re.findall(r'(?:href|src)="(/(?:examples|clients)[^"]*)"', page.text):
            assert nobody.get(local).status_code == 200, local
    assert sum(len(content) for content, _ in examples.BUILT.files.values()) < 1_500_000


@pytest.fixture(scope="module")
def tab(webgpu: Any, empty: Api) -> Iterator[Tab]:
    """As narrow as a telephone, so that little is drawn."""
    with empty.served() as url:
        opened = Tab(webgpu, url, 320, "light")
        opened.page.add_init_script(_KEEP)
        yield opened
        opened.context.close()


def test_an_example_draws_a_file_and_explains_a_lost_device(tab: Tab) -> None:
    tab.page.goto("/examples/bottles.html")
    tab.until(_DRAWN)
    assert tab.audit() == []
    tab.page.evaluate("device.destroy()")
    tab.page.get_by_role("alert").get_by_text("device was lost").wait_for()
    tab.page.get_by_role("button", name="Draw again").click()
    tab.until(_DRAWN)
    assert tab.page.get_by_role("alert").is_hidden()
    assert tab.faults == []


def test_an_example_takes_keys_and_fetches_a_bundle_when_it_is_wanted(tab: Tab) -> None:
    asked: list[str] = []
    tab.page.on("request", lambda sent: asked.append(sent.url))
    tab.page.goto("/examples/split.html")
    tab.until(_DRAWN)
    assert not [url for url in asked if url.endswith(".wgsl")]
    tab.page.get_by_label("Technique").select_option("kbuffer-deep")
    tab.page.get_by_label("Budget").fill("1")
    tab.page.wait_for_timeout(100)
    tab.until(_DRAWN)
    assert [url for url in asked if url.endswith(".wgsl")]
    tab.page.locator("#stage").press("]")
    tab.page.locator("#stage").press("ArrowLeft")
    tab.until(_DRAWN)
    assert tab.page.get_by_label("Split").input_value() == "52"
    assert tab.faults == []
