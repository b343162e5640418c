"""The figures as a page: one row a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from benchmarks.casting.cases import MODES
from benchmarks.casting.check import Effort, Result
from benchmarks.casting.loader import Comparison
from benchmarks.casting.verdict import REASONS, Tally
from benchmarks.markdown import row
from benchmarks.provenance import said

_TITLES = dict(zip(MODES, ("Every surface at opacity .33", "Opacities as authored"), strict=True))

_LOADER_COLUMNS = (
    "scene", "stages", "loader", "second reader", "of concave faces", "on gprims", "of curves, points", "without area",
    "described", "missing", "extra", "load s",
)  # fmt: skip


def figures(results: Sequence[Result]) -> dict[str, Any]:
    """What JSON holds: each scene's stages added up."""
    scenes: dict[str, list[Result]] = {}
    for result in results:
        scenes.setdefault(result.case.scene, []).append(result)
    return {name: _scene(stages) for name, stages in scenes.items()}


def _scene(stages: list[Result]) -> dict[str, Any]:
    compared = [stage.loader for stage in stages if stage.loader is not None]
    described = [stage.case.triangles for stage in stages if stage.case.triangles is not None]
    rays = {}
    for mode in MODES:
        total = Tally()
        for stage in stages:
            total.add(stage.tallies.get(mode, Tally()))
        rays[mode] = {name: getattr(total, name) for name in Tally.__slots__ if name != "unexplained"}
    names = [item.name for item in fields(Comparison) if item.name != "wrong"]
    return {
        "stages": len(stages),
        "nothing to draw": sum(bool(stage.refused) for stage in stages),
        "load seconds": round(sum(stage.load_seconds for stage in stages), 3),
        "described triangles": sum(described) if described else None,
        "loader": {name: sum(getattr(comparison, name) for comparison in compared) for name in names},
        "rays": rays,
        "problems": [f"{stage.case.path.name}: {line}" for stage in stages for line in stage.problems],
    }


_LOADER = """\
## The loader against a second reader

The second reader (`benchmarks/casting/reading.py`) shares no code with the loader: it walks the stage with the
high-level API of UsdGeom, places every instance by itself, and takes skinned points from `UsdSkel.BakeSkinning`.
Triangles are paired one to one (centre, normal, size) within 4e-6 of the scene's extent; concave faces, which can be
cut in several ways, must be tiled by the loader's triangles between their corners. Gprims count as equal if
every corner of a triangle lies on the implicit surface and the triangles enclose its volume; curves and points if
their triangles lie in the extent that UsdGeom computes. *Described* is the count that came with the scene; it
includes triangles without area, which the loader drops.
"""

_RAYS = """\
## The rasteriser against rays

{views} views of each stage at {width}x{height}, up to {pixels} pixels of each: half anywhere, half where something is
drawn. Through each pixel's centre go two rays: embree's (float32, all hits through trimesh) and an exact one (float64,
every triangle near the pixel). A pixel is *equal* if the renderer has as many fragments and each is at the depth of a
hit; how far depths may differ follows from float32 arithmetic (`benchmarks/casting/coverage.py`), and the greatest
difference found is in the table. The other pixels are explained, each by the first of these that holds:

- **edge**: rounding the corners, to 1/256 pixel above all, decides whether the triangle covers the centre;
- **clip plane**: the same at the near or far plane;
- **texture**: the texels under the fragment are on both sides of nothing, transparent or opaque;
- **depth tie**: an opaque and a transparent surface are within a step of the depth buffer;
- **coincident**: only embree differs: trimesh steps over a surface closer to the last hit than its offset;
- **embree**: only embree differs, by the rounding of its rays.

Explained means: the fragments are a set that these roundings allow, every certain hit among them and none that is no
hit. *Opaque* are pixels whose depth buffer holds the first opaque hit, or nothing where there is none.
"""


def page(found: dict[str, Any], effort: Effort) -> str:
    """Markdown."""
    scenes: dict[str, dict[str, Any]] = found["scenes"]
    problems = [f"- {name}: {line}" for name, scene in scenes.items() for line in scene["problems"]]
    stages = sum(scene["stages"] for scene in scenes.values())
    lines = [
        "# Loader and rasteriser against ray casting",
        "",
        f"*{said(found)}.*",
        "",
        "```",
        found["command"],
        "```",
        "",
        f"{len(scenes)} scenes, {stages} stages. Unexplained: {len(problems)}.",
        "",
        *problems,
        _LOADER,
        row(_LOADER_COLUMNS),
        "|---|" + "---:|" * (len(_LOADER_COLUMNS) - 1),
        *(_loader_row(name, scene) for name, scene in scenes.items()),
        "",
        _RAYS.format(views=effort.views, width=effort.size[0], height=effort.size[1], pixels=effort.pixels),
    ]
    for mode, title in _TITLES.items():
        lines += [f"### {title}", "", *_ray_table(scenes, mode), ""]
    return "\n".join(lines).rstrip() + "\n"


def _loader_row(name: str, scene: dict[str, Any]) -> str:
    counts = scene["loader"]
    cells = [name, scene["stages"], counts["ours"], counts["theirs"]]
    cells += [counts[key] or "" for key in ("cut", "tessellated", "beyond", "degenerate")]
    cells += ["" if scene["described triangles"] is None else scene["described triangles"]]
    cells += [counts["missing"], counts["extra"]]
    return row([*cells, f"{scene['load seconds']:.2f}"])


def _ray_table(scenes: dict[str, dict[str, Any]], mode: str) -> list[str]:
    shown = REASONS[:-1]
    title = ["scene", "pixels", "fragments", "exact rays", "embree", "equal", "equal to embree", *shown]
    rows = [row([*title, "unexplained", "opaque", "depth error"]), "|---|" + "---:|" * (len(title) + 2)]
    for name, scene in scenes.items():
        tally = scene["rays"][mode]
        reasons = Counter(tally["reasons"])
        embree = Counter(tally["reasons_embree"])
        cells = [name, *(tally[key] for key in ("pixels", "fragments", "exact", "embree", "equal", "equal_embree"))]
        cells += [max(reasons[reason], embree[reason]) or "" for reason in shown]
        cells += [reasons["unexplained"], f"{tally['opaque_equal']} / {tally['pixels']}", f"{tally['error']:.1e}"]
        rows.append(row(cells))
    return rows
