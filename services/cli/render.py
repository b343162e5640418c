"""`diaphane render`: pictures of scene files by any technique."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.glass import DEFAULT_GLASS
from services.cli import output
from services.cli.lines import size
from services.cli.scene_options import (
    WHITE,
    AlphaOption,
    BackgroundOption,
    CameraOption,
    ComplexityOption,
    GlassOption,
    RefineOption,
    SizeOption,
    VariantOption,
    WidthOption,
)
from services.cli.state import DEFAULT_STATE, JsonOption, StateOption
from services.cli.technique_options import (
    BudgetOption,
    InferenceOption,
    NodesOption,
    SamplesOption,
    SteepnessOption,
    TailOption,
    VkbOption,
)

if TYPE_CHECKING:
    from services.rendering import Picture


def render(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Scenes: .usd, .usda, .usdc, .usdz, .glb, .gltf, .obj, .ply, .stl."),
    ],
    target: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Picture, .png or .exr; #### is the frame. Default: named after the scene."
        ),
    ] = None,
    techniques: Annotated[
        list[str] | None,
        typer.Option("--technique", "-t", help="Name of a technique, or all; repeatable. Default: sbuffer, exact."),
    ] = None,
    budget: BudgetOption = 2.0,
    tail: TailOption = None,
    g: SteepnessOption = None,
    bundle: Annotated[
        str | None,
        typer.Option("--bundle", help="For kbuffer-deep and -temporal: a folder, or NAME@ALIAS of the registry."),
    ] = None,
    inference: InferenceOption = "glsl",
    vkb: VkbOption = "",
    nodes: NodesOption = None,
    samples: SamplesOption = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Compare with the exact picture: MSE, PSNR, FLIP.")
    ] = False,
    camera: CameraOption = None,
    views: Annotated[
        Path | None, typer.Option("--views", help="JSON file with views; all that it has of a scene are rendered.")
    ] = None,
    image_width: WidthOption = 960,
    picture_size: SizeOption = None,
    frames: Annotated[
        str | None,
        typer.Option("--frames", "-f", "--time", help="Time codes: 1, 101:105, 105:101, 101:109x2; with commas."),
    ] = None,
    default_time: Annotated[
        bool, typer.Option("--defaultTime", "-d", help="At the default time, not at the start of the stage.")
    ] = False,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = DEFAULT_GLASS,
    variant: VariantOption = None,
    background: BackgroundOption = WHITE,
    is_full: Annotated[bool, typer.Option("--float", help="32-bit channels in .exr, not half floats.")] = False,
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
) -> None:
    """Render pictures by any technique within a budget, and say what each cost."""
    from services.flags import parse_size
    from services.options import parse_tail
    from services.progress import make_progress
    from services.render_options import (
        RenderOptions,
        loading,
        parse_background,
        parse_needs,
        parse_techniques,
        parse_times,
        said_left_out,
    )

    options = RenderOptions(
        scenes=tuple(files),
        techniques=parse_techniques(techniques or (), bundle is not None),
        needs=parse_needs(vkb, inference, nodes, samples),
        budget=budget,
        tail=None if tail is None else parse_tail(tail),
        g=g,
        bundle=bundle,
        camera=camera,
        views=views,
        image_width=image_width,
        size=None if picture_size is None else parse_size(picture_size),
        frames=parse_times(frames, default_time),
        load=loading(alpha, glass, variant, complexity, refine),
        background=parse_background(background),
        output=target,
        is_full=is_full,
        compare=compare,
        state=state,
    )
    from services.rendering import render as run

    pictures, progress = [], make_progress(sys.stderr, silent=as_json)
    for picture in run(options, progress):
        pictures.append(picture)
        if not as_json:
            _show(picture)
    if note := said_left_out(techniques or (), bundle is not None):
        progress.note(note)
    if as_json:
        output.print_json({"pictures": [picture.json() for picture in pictures]})


def _show(picture: Picture) -> None:
    frame = "default time" if picture.frame is None else f"frame {picture.frame:g}"
    print(f"{picture.file}  {picture.technique} ({picture.family})  {picture.width}x{picture.height}")
    print(f"  view {picture.view} ({picture.view_how}), {frame}")
    if picture.problem is not None or picture.passes is None or picture.k is None:
        print(f"  left out: {picture.problem}")
        if picture.total_bytes is not None:
            print(f"  it would need {_memory(picture)}")
        return
    pixels = picture.width * picture.height
    least, most = picture.k
    kept = f", {picture.captured:,} kept apart, k {least}..{most}"
    print(f"  {picture.fragments:,} fragments, {(picture.fragments or 0) / pixels:.2f} a pixel{kept if most else ''}")
    if picture.family == "bounded":
        print(f"  budget {picture.budget:,} fragments, {picture.tail} tail")
    total = sum(picture.passes.values())
    print(f"  {total:.1f} ms: {', '.join(f'{name} {ms:.1f}' for name, ms in picture.passes.items())}")
    print(f"  memory: {_memory(picture)}")
    if picture.skips:
        print(f"  skipped: {', '.join(f'{count:,} {what}' for what, count in picture.skips.items())}")
    if picture.mse is not None:
        psnr = "no error" if picture.psnr is None else f"PSNR {picture.psnr:.2f} dB"
        print(f"  against exact: MSE {1e5 * picture.mse:.4g} x1e-5, {psnr}, FLIP {picture.flip:.4g}")


def _memory(picture: Picture) -> str:
    from services.summary import said_unfit

    pool = f"pool {size(picture.pool_bytes or 0)}"
    if not picture.fits:
        pool += f" (it {said_unfit()})"
    return f"{pool}, {picture.pixel_bytes} bytes a pixel beside it, {size(picture.total_bytes or 0)} at most"
