"""@diaphane/three in a browser: its pictures beside fragments of three.js, peeled and composited in float64."""

from __future__ import annotations

import functools
import http.server
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.browser import Tab
from support.web import ROOT, run

BUNDLE = ROOT / "benchmarks/bundle"


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the test's own output is enough."""


@pytest.fixture(scope="module")
def page(webgpu: Any, installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """The package's page of tests, in a browser with WebGPU."""
    built = tmp_path_factory.mktemp("three")
    done = run(
        installed, "npx", "vite", "build", "-c", "packages/three/tests/page/vite.config.ts", "--outDir", str(built)
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=built)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        opened = Tab(webgpu, f"http://127.0.0.1:{server.server_port}", 1000, "light")
        opened.page.goto("/")
        opened.until("!!globalThis.three")
        yield opened
        server.shutdown()


@pytest.fixture(scope="module")
def network() -> list[str]:
    """Tail and WGSL of the committed bundle."""
    tail = json.loads((BUNDLE / "manifest.json").read_text(encoding="utf-8"))["tail"]["name"]
    return [tail, (BUNDLE / "predict.wgsl").read_text(encoding="utf-8")]


_COMPARE = """async ([names, network]) => {
    const renderer = await three.start(false);
    const bundle = three.bundleOf(...network);
    const wanted = { binned: {}, two: { budget: 2 }, kept: { budget: 8 }, deep: { budget: 0.5, bundle },
        whole: { budget: 8, bundle } };
    const found = {};
    for (const name of names) {
        const right = await three.peel(renderer, three.SCENES[name]());
        found[name] = { most: Math.max(...right.counts) };
        for (const [key, options] of Object.entries(wanted)) {
            const { picture, budget, used } = await three.drawnBy(renderer, three.SCENES[name](), options);
            found[name][key] = { ...three.agreement(right.picture, picture), budget, used };
        }
    }
    return found;
}"""


def test_pictures_are_those_of_sorted_fragments(page: Tab, network: list[str]) -> None:
    """With slots for all fragments exactly; with bins alone, nearly; a network does best with few slots."""
    found = page.page.evaluate(_COMPARE, [["panes", "primitives", "skinned"], network])
    for name, scene in found.items():
        assert 1 < scene["most"] <= 8, name
        for kept in (scene["kept"], scene["whole"]):
            assert kept["within"] >= 0.999, (name, kept)
            assert kept["rmse"] < scene["binned"]["rmse"] < 2.0, name
        assert scene["binned"]["within"] >= 0.9, (name, scene)
        for deep in (scene["deep"], scene["whole"]):
            assert 0 < deep["used"] <= deep["budget"], (name, deep)
        assert scene["deep"]["rmse"] < scene["binned"]["rmse"], (name, scene)
    knots = found["primitives"]
    assert knots["deep"]["used"] == knots["deep"]["budget"]  # F, half a slot a pixel, is fewer than there are fragments
    assert knots["deep"]["rmse"] < knots["two"]["rmse"]  # which has four times the slots
    assert page.faults == []


def test_the_order_of_objects_makes_no_difference(page: Tab, network: list[str]) -> None:
    apart = page.page.evaluate(
        """async (network) => {
            const renderer = await three.start(false);
            const apart = [];
            for (const options of [{}, { budget: 2 }, { budget: 0.5, bundle: three.bundleOf(...network) }]) {
                const one = await three.linear(renderer, three.SCENES.primitives(), options);
                const two = await three.linear(renderer, three.reversed(three.SCENES.primitives()), options);
                apart.push(three.agreement(one, two).most);
            }
            return apart;
        }""",
        network,
    )
    assert max(apart) <= 1.0  # of 255: sums of half floats depend on their order in the last bits
    assert page.faults == []


def test_budgets_and_techniques_change_without_compiling_and_nothing_stays(page: Tab, network: list[str]) -> None:
    """Of a scene whose objects do not change, so that three.js has no other cause to renew what it draws them with."""
    first, second = page.page.evaluate(
        """async (network) => {
            const renderer = await three.start(false);
            const bundle = three.bundleOf(...network);
            const deep = { budget: 0.5, bundle, technique: 'kbuffer-deep' };
            const turns = [{}, { budget: 2 }, deep, {}, { budget: 5 }, { ...deep, budget: 1 }, { budget: 2 }, {}];
            const sample = three.SCENES.panes();
            return [await three.life(renderer, sample, turns), await three.life(renderer, sample, turns)];
        }""",
        network,
    )
    for _, binned, two, deep, *later, disposed in (first, second):
        assert {each["pipelines"] for each in later} == {deep["pipelines"]}
        assert binned["bytes"] < two["bytes"] < deep["bytes"]
        assert later[0]["textures"] == binned["textures"]
        assert disposed["bytes"] < binned["bytes"]
    counted = ("buffers", "textures", "bytes")
    assert [second[-1][name] for name in counted] == [first[-1][name] for name in counted]
    assert page.faults == []


def test_a_pass_goes_on_when_the_device_was_lost(page: Tab, network: list[str]) -> None:
    apart = page.page.evaluate(
        """async (network) => {
            const options = { budget: 0.5, bundle: three.bundleOf(...network) };
            return three.lost(await three.start(false), three.SCENES.panes(), options);
        }""",
        network,
    )
    assert apart["most"] == 0.0
    assert [fault for fault in page.faults if "Device Lost" not in fault and "device lost" not in fault.lower()] == []
    page.faults.clear()
