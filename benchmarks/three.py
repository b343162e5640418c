"""The pass for three.js beside three.js's own: passes, bytes per pixel, time and error of every way, on six scenes.

python -m benchmarks.three --out benchmarks/results/three.json --page benchmarks/THREE.md
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.markdown import table
from benchmarks.outputs import add_outputs, write_figures, write_page
from tests.support.browser import MILLISECONDS, WEBGPU_AND_WEBGL, browser
from tests.support.web import ROOT, WEB, three_page

SIZE = (256, 192)
SCENES: Mapping[str, str] = {
    "primitives": "knots and boxes that pass through each other and something opaque, one double-sided",
    "instanced": "40 spheres of one mesh, in fog",
    "textured": "cut-out textures, and vertex colours with opacities",
    "skinned": "two bent tubes of glTF, with bones",
    "sheets": "64 faint sheets",
    "panes": "four panes, each in front of the next",
}
BUNDLE = ROOT / "benchmarks/bundle"

_ACCOUNT = """async ([name, size, network]) => {
    const [gpu, gl] = (globalThis.renderers ??= [await three.start(false), await three.start(true)]);
    gpu.setSize(...size);
    const right = await three.peel(gpu, await three.SCENES[name]());
    const bundle = three.bundleOf(...network);
    const measured = async (renderer, names) =>
        three.account(renderer, await three.SCENES[name](), bundle, right.picture, ...size, names);
    const ways = await measured(gpu);
    const { binned } = await measured(gl, ["binned"]);
    const counts = right.counts.filter((each) => each > 0);
    const mean = counts.reduce((one, two) => one + two, 0) / counts.length;
    return { ways, webgl: binned, most: Math.max(...right.counts), mean };
}"""
_TIMED = """async ([name, size, rounds, network]) => three.timed(
    renderers[0], await three.SCENES[name](), three.bundleOf(...network), ...size, rounds)"""


def main() -> None:
    """Measures, and writes the page."""
    arguments = _parse()
    if not (WEB / "node_modules").is_dir():
        raise SystemExit("The page needs its packages: run `npm ci` in deploy/client/web.")
    found: dict[str, Any] = {**provenance.head("benchmarks.three"), "rounds": arguments.rounds}
    with provenance.load_around(found), tempfile.TemporaryDirectory(prefix="diaphane-three-") as name:
        folder = Path(name)
        with three_page(WEB, folder / "page") as url, browser(folder, WEBGPU_AND_WEBGL) as started:
            found["browser"] = f"Chromium {started.version} on SwiftShader"
            found["scenes"] = _measured(started, url, arguments.rounds)
    write_figures(arguments.out, found)
    text = page(found)
    write_page(arguments.page, text)
    print(text)


def _measured(started: Any, url: str, rounds: int) -> dict[str, Any]:
    network = [
        json.loads((BUNDLE / "manifest.json").read_text(encoding="utf-8"))["tail"]["name"],
        (BUNDLE / "predict.wgsl").read_text(encoding="utf-8"),
    ]
    opened = started.new_page()
    opened.set_default_timeout(MILLISECONDS)
    opened.goto(url)
    opened.wait_for_function("!!globalThis.three")
    found = {}
    for name in SCENES:
        found[name] = opened.evaluate(_ACCOUNT, [name, SIZE, network])
        times: dict[str, list[float]] = opened.evaluate(_TIMED, [name, SIZE, rounds, network])
        for way, taken in times.items():
            found[name]["ways"][way]["ms"] = statistics.median(taken)
        print(name, flush=True)
    return found


def page(found: Mapping[str, Any]) -> str:
    """The page of a result."""
    load = found["load_average"]
    return _PAGE.format(
        about=f"{found['browser']}; {provenance.said(found)}",
        load=provenance.said_load(load["before"][0], load["after"][0]),
        errors="\n".join(_scene(name, SCENES[name], one) for name, one in found["scenes"].items()),
        size="x".join(map(str, SIZE)),
        rounds=found["rounds"],
        summary=_summary(list(found["scenes"].values())),
    )


def _summary(scenes: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for way in scenes[0]["ways"]:
        each = [one["ways"][way] for one in scenes]
        passes = sorted({one["passes"] for one in each})
        sizes = [one["bytes"] for one in each]
        rows.append(
            [
                way,
                "-".join(str(count) for count in dict.fromkeys((passes[0], passes[-1]))),
                f"{min(sizes):.0f}",
                f"{statistics.mean(one['rmse'] for one in each):.2f}",
                f"{100 * min(one['within'] for one in each):.2f}",
                f"{statistics.geometric_mean(one['ms'] for one in each):.0f}",
            ]
        )
    head = ("way", "passes", "bytes per pixel", "RMSE, mean", "least within 2, %", "ms, geometric mean")
    return table(head, rows)


def _scene(name: str, what: str, one: Mapping[str, Any]) -> str:
    rows = [
        [way, f"{row['rmse']:.3f}", f"{100 * row['within']:.2f}", f"{row['most']:.0f}", f"{row['ms']:.0f}"]
        for way, row in one["ways"].items()
    ]
    gl = one["webgl"]
    rows.append(["binned, WebGL 2", f"{gl['rmse']:.3f}", f"{100 * gl['within']:.2f}", f"{gl['most']:.0f}", "-"])
    depth = f"{one['mean']:.1f} fragments per covered pixel, {one['most']} at most"
    tabled = table(("way", "RMSE", "within 2, %", "largest", "ms"), rows)
    return f"### {name}\n\n{what[0].upper()}{what[1:]}: {depth}.\n\n{tabled}"


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.three")
    parser.add_argument("--rounds", type=int, default=7, help="frames of each way that are timed, in turns (default 7)")
    add_outputs(parser)
    return parser.parse_args()


_PAGE = """# The pass for three.js beside three.js's own

*{about}; {load}.*

```
cd deploy/client/web && npm ci && cd -
python -m benchmarks.three --out benchmarks/results/three.json --page benchmarks/THREE.md
```

`diaphanePass` of [@diaphane/three](../deploy/client/web/packages/three/README.md) without a budget (`binned`), with a
fixed k of 2 and 8, and with half a slot and two slots per pixel that the committed bundle's network shares out; beside
three.js's own sorted transparency (`pass`) and its weighted-blended `OITPassNode`. The shading is three.js's in all.

- The right picture is peeled from the same materials, layer by layer, and composited in float64. Errors are those of
  8-bit sRGB values at {size} pixels: their root mean square, the pixels of which no channel is more than 2 of 255
  apart, and the largest.
- Passes are those of rendering and computing that a frame begins, the opaque objects' among them. Bytes per pixel are
  what the device's textures and buffers grow by with the picture, its own colour and depth among them.
- Times are medians of {rounds} frames, in turns, in software on a machine with other work: good for an order of
  magnitude, and no forecast of a graphics card.
- The bundle was trained on none of these scenes.

## All scenes

{summary}
## Each scene

{errors}"""


if __name__ == "__main__":
    main()
