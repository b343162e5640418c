"""`diaphane scene`: scene files on this machine."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns
from diaphane.cli.scene_options import (
    AlphaOption,
    ComplexityOption,
    GlassOption,
    RefineOption,
    SceneArgument,
    TimeOption,
    VariantOption,
)
from diaphane.cli.state import JsonOption
from evaluation.wording import counted
from schemas.glass import DEFAULT_GLASS

if TYPE_CHECKING:
    from renderer.scene_report import SceneReport

app = typer.Typer(
    help="Scene files on this machine: inspect, convert. (`diaphane scenes` is about those on a server.)",
    no_args_is_help=True,
)


@app.command()
def inspect(
    file: SceneArgument,
    variant: VariantOption = None,
    time: TimeOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = DEFAULT_GLASS,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    as_json: JsonOption = False,
) -> None:
    """Tell what is in a scene: prims, triangles, materials, what is transparent and why, cameras, units, warnings."""
    from dataclasses import replace

    from evaluation.local_scenes import as_usd
    from evaluation.render_options import loading
    from renderer.inspection import inspect_scene

    load = loading(alpha, glass, variant, complexity, refine, time)
    with as_usd(file) as usd:
        report = replace(inspect_scene(usd, load), file=str(file))
    if as_json:
        output.print_json(report.json())
    else:
        _show(report)
    if report.problem is not None:
        raise report.problem


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="A .obj, .gltf, .glb, .ply or .stl file.")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="A .usda, .usdc, .usd or .usdz file.")],
    up: Annotated[
        str | None, typer.Option("--up", help="Up axis of IN: Y or Z. Default: Y of .obj, Z of .ply and .stl.")
    ] = None,
    metres_per_unit: Annotated[
        float, typer.Option("--metersPerUnit", help="Metres per unit of IN; glTF's is always a metre.")
    ] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Convert OBJ, glTF, PLY and STL to USD: geometry, places, names, colours, opacity and textures."""
    from renderer.convert_meshes import convert_meshes

    if not as_json:
        output.tell_new_folder(target.parent)
    converted = convert_meshes(source, target, None if up is None else up.upper(), metres_per_unit)
    if as_json:
        output.print_json({**asdict(converted), "file": str(target)})
        return
    for warning in converted.warnings:
        output.err().print(f"warning: {warning}", markup=False)
    print(
        f"{target}: {counted(converted.triangles, 'triangles')}, {counted(converted.meshes, 'meshes')} in "
        f"{counted(converted.instances, 'places')}, "
        f"{counted(converted.materials, 'materials')}, {counted(converted.textures, 'textures')}, {converted.up} up, "
        f"{converted.metres_per_unit:g} m per unit"
    )


def _show(report: SceneReport) -> None:
    codes = report.time_codes
    ranged = "no time range" if codes is None else f"time codes {codes[0]:g} to {codes[1]:g}, {codes[2]:g} a second"
    print(f"{report.file}: {report.up_axis} up, {report.metres_per_unit:g} m per unit, {ranged}")
    print(f"{'Animated' if report.animated else 'Nothing but cameras is animated'}.")
    _show_drawn(report)
    _show_prims(report)
    _show_materials(report)
    _show_rest(report)


def _show_drawn(report: SceneReport) -> None:
    total = sum(report.triangles.values())
    kinds = ", ".join(f"{count:,} {kind}" for kind, count in report.triangles.items()) or "none"
    meshes = f"{counted(report.meshes, 'meshes')} in {counted(report.instances, 'places')}"
    print(f"{meshes}, {counted(total, 'triangles')}: {kinds}")
    if report.bounds is not None:
        low, high = (" ".join(f"{x:g}" for x in corner) for corner in report.bounds)
        print(f"Bounds, metres: {low} to {high}")


def _show_prims(report: SceneReport) -> None:
    print()
    rows = []
    for name, count in report.prims.items():
        why = "; ".join(f"{number} {reason}" for reason, number in count.reasons.items())
        rows.append((name, count.total, count.drawn, why))
    print_columns(("prims", "number", "drawn", "not drawn"), rows)
    purposes = ", ".join(f"{number} {purpose}" for purpose, number in sorted(report.purposes.items()))
    print(f"Purposes of geometry: {purposes or 'none'}")


def _show_materials(report: SceneReport) -> None:
    print()
    unused = sum(fact.kind == "unused" for fact in report.materials.values())
    rows = [
        (path, fact.kind, f"{fact.triangles:,}", fact.prims, "yes" if fact.textured else None, fact.why)
        for path, fact in sorted(report.materials.items(), key=lambda entry: (_KINDS.index(entry[1].kind), entry[0]))
        if fact.kind != "unused"
    ]
    print_columns(("material", "kind", "triangles", "prims", "textured", "why"), rows)
    if unused:
        print(f"Bound to nothing that is drawn: {counted(unused, 'more materials')}.")
    for name in report.textures:
        print(f"texture {plain(name)}")


_KINDS = ("transparent", "cut-out", "opaque", "unused")


def _show_rest(report: SceneReport) -> None:
    print()
    for camera in report.cameras:
        lens = f"height {camera.height:g} m" if camera.fov is None else f"fov {camera.fov:.4g}°"
        print(f"camera {plain(camera.path)}: {camera.projection}, {lens}, aspect {camera.aspect:.4g}")
    if not report.cameras:
        print("No cameras.")
    for variant in report.variants:
        others = f" and {variant.prims - 1} more" if variant.prims > 1 else ""
        choices = ", ".join(f"[{c}]" if c == variant.selected else c for c in variant.choices)
        print(f"variants {plain(variant.name)} of {plain(variant.path)}{others}: {plain(choices)}")
    for name in report.missing:
        print(f"missing {plain(name)}")
    for warning in report.warnings:
        print(f"warning: {plain(warning)}")
    if not report.warnings:
        print("No warnings.")
