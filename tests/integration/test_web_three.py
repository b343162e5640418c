"""@diaphane/three in a browser: its pictures beside fragments of three.js, peeled and composited in float64."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.browser import Tab
from support.web import ROOT, three_page

BUNDLE = ROOT / "benchmarks/bundle"


@pytest.fixture(scope="module")
def page(webgl: Any, installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """The package's page of tests, in a browser with WebGPU."""
    with three_page(installed, tmp_path_factory.mktemp("three")) as url:
        opened = Tab(webgl, url, 1000, "light")
        opened.page.goto("/")
        opened.until("!!globalThis.three")
        yield opened
        opened.context.close()


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
        const right = await three.peel(renderer, await three.SCENES[name]());
        found[name] = { most: Math.max(...right.counts) };
        for (const [key, options] of Object.entries(wanted)) {
            if (key === 'two' && name !== 'primitives') continue;
            const { picture, budget, used } = await three.drawnBy(renderer, await three.SCENES[name](), options);
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
    assert knots["binned"]["within"] >= 0.97  # fragments that something opaque hides have no part in it
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


def test_webgl_2_draws_depth_bins_as_webgpu_does(page: Tab) -> None:
    """And says once that a budget needs WebGPU."""
    found = page.page.evaluate(
        """async () => {
            const [gpu, gl] = [await three.start(false), await three.start(true)];
            const pictures = [];
            for (const [renderer, budget] of [[gpu, 0], [gl, 0], [gl, 4]])
                pictures.push(await three.linear(renderer, three.SCENES.primitives(), { budget }));
            return [three.agreement(pictures[0], pictures[1]), three.agreement(pictures[1], pictures[2])];
        }"""
    )
    assert found[0]["within"] >= 0.998, found  # silhouettes: another rasteriser
    assert found[1]["most"] == 0.0
    assert page.faults == ["A budget needs WebGPU, and this is WebGL 2. Depth bins alone are used."]
    page.faults.clear()


def test_depth_buffers_may_be_reversed_or_logarithmic(page: Tab) -> None:
    """Of a scene in which something opaque hides fragments."""
    found = page.page.evaluate(
        """async () => {
            const pictures = [];
            const kinds = ['reversedDepthBuffer', 'logarithmicDepthBuffer'];
            for (const more of [{}, ...kinds.map((kind) => ({ [kind]: true }))]) {
                const renderer = await three.start(false, more);
                pictures.push(await three.linear(renderer, three.SCENES.primitives(), { budget: 2 }));
                for (const kind of kinds) if (renderer[kind] !== (kind in more)) throw new Error(kind);
            }
            return pictures.slice(1).map((each) => three.agreement(pictures[0], each));
        }"""
    )
    for each in found:
        assert each["within"] >= 0.999, found
    assert page.faults == []
