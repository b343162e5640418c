"""The verdicts as a page: one row a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from benchmarks.judging.agreement import ALPHA, COLOUR, DEPTH, Count
from benchmarks.judging.judge import CAMERAS, HEIGHT, KINDS, Verdict
from benchmarks.judging.reasons import PICTURES, REASONS
from benchmarks.markdown import table
from benchmarks.provenance import said

_HEAD = """\
Storm, the renderer that comes with OpenUSD, opens every stage by itself and is asked for the same pictures as our
renderer: {height} rows, from the view that frames the scene, a listed view where there is one, and up to {cameras} of
the stage's cameras, read by Storm. It is the wheel bpy's, in a process of its own, with three texts of its shaders
replaced in a copy for that process: no light (a surface shows diffuse and emissive colour), and all transparent
fragments sorted. Pixels are seen at their centres, and textures without anisotropic filtering. Here, normals of zero
take the light away. Glass is read as `plain`, which is how UsdPreviewSurface has it without refraction.

- **silhouette**, **depth**: materials are left out of both pictures, so every surface counts. Silhouettes are pixels
  where anything is; depths agree within {depth:g} of the scene's diagonal.
- **camera**, **refined**: both of these, through the stage's cameras; and with every subdivision mesh refined once.
- **opaque depth**: of what the materials leave opaque, which shows what is drawn as transparent, and cut-outs.
- **opacity**: 1 - the product of (1 - a); Storm's is the difference of its pictures over black and over white. They
  agree within {alpha:.0f}/255.
- **colour**: sRGB over black; they agree within {colour:.0f}/255.

A cell is the share of pixels that agree, of those that either picture covers; in brackets, how many pixels differ and
are not explained. A pixel is explained if its value lies between those of the other picture's neighbouring pixels (the
edges of triangles and of texels), or if its surface has no colour: USD names none for that case, and each renderer has
a grey of its own.
"""


def figures(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """What JSON holds: each scene's stages added up."""
    scenes: dict[str, dict[str, Any]] = {}
    for verdict in verdicts:
        scene = scenes.setdefault(verdict.case.scene, {"stages": 0, "full": 0, "refused": [], "differs": {}})
        scene["stages"] += 1
        scene["full"] += verdict.full
        if verdict.refused:
            scene["refused"].append(
                f"{verdict.case.path.name}: {verdict.refused.replace(f'{verdict.case.path.parent}/', '')}"
            )
        wrong = {kind: count.unexplained for kind, count in verdict.counts.items() if count.unexplained}
        if wrong:
            scene["differs"][verdict.case.path.name] = wrong
        for kind in KINDS:
            total = Count(**scene.get(kind, {}))
            total.add(verdict.counts[kind])
            scene[kind] = asdict(total)
    return scenes


def page(found: dict[str, Any]) -> str:
    """Markdown."""
    scenes: dict[str, dict[str, Any]] = found["scenes"]
    head = _HEAD.format(height=HEIGHT, cameras=CAMERAS, depth=DEPTH, alpha=255 * ALPHA, colour=255 * COLOUR)
    rows = [[name, scene["stages"], *(_cell(Count(**scene[kind])) for kind in KINDS)] for name, scene in scenes.items()]
    return "\n".join(
        [
            "# The loader against Storm",
            "",
            f"*{said(found)}; OpenUSD {found['storm']}.*",
            "",
            "```",
            "make peers",
            found["command"],
            "```",
            "",
            head,
            table(["scene", "stages", *KINDS], rows),
            "## What differs, and why",
            "",
            *(f"- {line}" for line in REASONS),
            "",
            "By stage, pixels that differ and are not explained:",
            "",
            *_differences(scenes),
            "",
            "Not compared:",
            "",
            *_left_out(scenes),
            "",
            "## Pictures of differences",
            "",
            "Above: as loaded here, in Storm, what is not explained. Below: both depths, difference of opacity.",
            "",
            *(
                line
                for name, text in PICTURES.items()
                for line in (f"{text}:", "", f"![{text}](results/loader/{name}.png)", "")
            ),
        ]
    )


def _cell(count: Count) -> str:
    if not count.pixels:
        return ""
    share = 100.0 * (count.equal + count.unset) / count.pixels
    # 100 says that all agree, so it isn't rounded up to.
    shown = "100" if count.equal + count.unset == count.pixels else f"{min(share, 99.99):.2f}"
    return f"{shown} % ({count.unexplained})" if count.unexplained else f"{shown} %"


def _differences(scenes: dict[str, dict[str, Any]]) -> list[str]:
    return [
        f"- {name}, {stage}: {', '.join(f'{kind} {pixels}' for kind, pixels in wrong.items())}"
        for name, scene in scenes.items()
        for stage, wrong in scene["differs"].items()
    ]


def _left_out(scenes: dict[str, dict[str, Any]]) -> list[str]:
    lines = []
    for name, scene in scenes.items():
        if scene["full"]:
            lines.append(f"- {name}: looks of {scene['full']} pictures, whose fragments do not fit into Storm's pool")
        nothing = [line for line in scene["refused"] if "has no geometry" in line or "cannot be read" in line]
        if nothing:
            lines.append(f"- {name}: {len(nothing)} stages that are empty or no USD")
        lines += [f"- {name}, {line.split(':')[0]}: Storm fails" for line in scene["refused"] if line not in nothing]
    return lines
