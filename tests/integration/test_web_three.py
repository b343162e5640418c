"""@diaphane/three in a browser: its pictures beside fragments of three.js, peeled and composited in float64."""

from __future__ import annotations

import functools
import http.server
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.browser import CHROMIUM, WEBGPU, Tab, browser
from support.web import run


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the test's own output is enough."""


@pytest.fixture(scope="module")
def page(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """The package's page of tests, in a browser with WebGPU."""
    pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    built = tmp_path_factory.mktemp("three")
    done = run(
        installed, "npx", "vite", "build", "-c", "packages/three/tests/page/vite.config.ts", "--outDir", str(built)
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=built)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with browser(tmp_path_factory.mktemp("browser"), WEBGPU) as started:
            opened = Tab(started, f"http://127.0.0.1:{server.server_port}", 1000, "light")
            opened.page.goto("/")
            if not opened.page.evaluate("!!navigator.gpu && navigator.gpu.requestAdapter().then(Boolean)"):
                pytest.skip("this chromium has no WebGPU adapter")
            opened.until("!!globalThis.three")
            yield opened
        server.shutdown()


_COMPARE = """async ([names, budgets]) => {
    const renderer = await three.start(false);
    const found = {};
    for (const name of names) {
        const right = await three.peel(renderer, three.SCENES[name]());
        const agreements = [];
        for (const budget of budgets) {
            const picture = await three.linear(renderer, three.SCENES[name](), budget);
            agreements.push(three.agreement(right.picture, picture));
        }
        found[name] = { most: Math.max(...right.counts), agreements };
    }
    return found;
}"""


def test_pictures_are_those_of_sorted_fragments(page: Tab) -> None:
    """With eight slots exactly where there are no more fragments; with bins alone, nearly."""
    found = page.page.evaluate(_COMPARE, [["panes", "primitives", "skinned"], [0, 8]])
    for name, scene in found.items():
        binned, kept = scene["agreements"]
        assert 1 < scene["most"] <= 8, name
        assert kept["within"] >= 0.999, (name, kept)
        assert binned["within"] >= 0.9, (name, binned)
        assert kept["rmse"] < binned["rmse"] < 2.0, name
    assert page.faults == []


def test_neither_order_nor_size_nor_budget_leaves_anything(page: Tab) -> None:
    apart, (before, during, again, after) = page.page.evaluate(
        """async () => {
            const renderer = await three.start(false);
            const apart = [];
            for (const budget of [0, 2]) {
                const one = await three.linear(renderer, three.SCENES.primitives(), budget);
                const two = await three.linear(renderer, three.reversed(three.SCENES.primitives()), budget);
                apart.push(three.agreement(one, two).most);
            }
            return [apart, await three.life(renderer)];
        }"""
    )
    assert max(apart) <= 1.0  # of 255: sums of half floats depend on their order in the last bits
    assert all(more > less for more, less in zip(during, before, strict=True))
    assert again == during
    assert after == before
    assert page.faults == []
