"""`diaphane render`: pictures of scene files by any technique."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import print_columns, size
from diaphane.cli.scene_options import (
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
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from diaphane.cli.technique_options import (
    BudgetOption,
    InferenceOption,
    NodesOption,
    SteepnessOption,
    StochasticSamplesOption,
    TailOption,
    VkbOption,
)
from evaluation.wording import counted
from schemas.glass import DEFAULT_GLASS

if TYPE_CHECKING:
    from evaluation.ranking import Rank
    from evaluation.rendering import Picture


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
    stochastic_samples: StochasticSamplesOption = None,
    samples: Annotated[
        int,
        typer.Option(
            "--samples", help="Antialias by the mean, in linear light, of so many frames: 1, 2, 4, 8, 16, 32 or 64."
        ),
    ] = 1,
    aov: Annotated[
        list[str] | None,
        typer.Option("--aov", help="Layers of the .exr beside the colours, of depth,n,k,alpha; repeatable."),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option(
            "--compare", help="Compare with the exact picture: MSE, PSNR, FLIP; several are ranked, on a contact sheet."
        ),
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
    from evaluation.choices import parse_tail
    from evaluation.progress import make_progress
    from evaluation.render_options import (
        RenderOptions,
        loading,
        parse_aovs,
        parse_background,
        parse_needs,
        parse_techniques,
        parse_times,
        said_left_out,
    )
    from schemas.flags import parse_size

    options = RenderOptions(
        scenes=tuple(files),
        techniques=parse_techniques(techniques or (), bundle is not None),
        needs=parse_needs(vkb, inference, nodes, stochastic_samples),
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
        samples=samples,
        aovs=parse_aovs(aov or ()),
        output=target,
        is_full=is_full,
        compare=compare,
    )
    if target is not None and not as_json:
        output.tell_new_folder(target.parent)
    from diaphane.bundles import bundle_folder
    from evaluation.rendering import render as run

    pictures, progress = [], make_progress(sys.stderr, silent=as_json)
    with bundle_folder(bundle, state) as folder:
        for picture in run(options, folder, progress):
            pictures.append(picture)
            if not as_json:
                _show(picture)
    if note := said_left_out(techniques or (), bundle is not None):
        progress.note(note)
    from evaluation.ranking import ranked

    ranks = ranked(pictures) if compare and len(options.techniques) > 1 else []
    if as_json:
        output.print_json(
            {"pictures": [picture.json() for picture in pictures], "ranking": [rank.json() for rank in ranks]}
        )
    elif ranks:
        _show_ranks(ranks)
        for sheet in dict.fromkeys(picture.sheet for picture in pictures if picture.sheet is not None):
            print(f"Contact sheet: {sheet}")


def _show(picture: Picture) -> None:
    frame = "default time" if picture.frame is None else f"frame {picture.frame:g}"
    print(f"{picture.file}  {picture.technique} ({picture.family})  {picture.width}x{picture.height}")
    print(f"  view {picture.view} ({picture.view_how}), {frame}")
    if picture.problem is not None or picture.passes is None or picture.k is None:
        print(f"  left out: {picture.problem}")
        if picture.total_bytes is not None:
            print(f"  it would need {_memory(picture)}")
        return
    drawn = picture.width * picture.height * picture.samples
    least, most = picture.k
    kept = f", {picture.captured:,} kept apart, k {least}..{most}"
    fragments = counted(picture.fragments or 0, "fragments")
    print(f"  {fragments}, {(picture.fragments or 0) / drawn:.2f} per pixel{kept if most else ''}")
    if picture.family == "bounded":
        print(f"  budget {counted(picture.budget, 'fragments')}, {picture.tail} tail")
    samples = f" for {picture.samples} samples per pixel" if picture.samples > 1 else ""
    passes = ", ".join(f"{name} {ms:.1f}" for name, ms in picture.passes.items())
    print(f"  {picture.milliseconds:.1f} ms{samples}: {passes}")
    print(f"  memory: {_memory(picture)}")
    if picture.skips:
        print(f"  skipped: {', '.join(counted(count, what) for what, count in picture.skips.items())}")
    if picture.mse is not None:
        psnr = "no error" if picture.psnr is None else f"PSNR {picture.psnr:.2f} dB"
        print(f"  against exact: MSE {1e5 * picture.mse:.4g} x1e-5, {psnr}, FLIP {picture.flip:.4g}")


def _memory(picture: Picture) -> str:
    from evaluation.summary import said_unfit

    pool = f"pool {size(picture.pool_bytes or 0)}"
    if not picture.fits:
        pool += f" (it {said_unfit()})"
    beside = f"{counted(picture.pixel_bytes or 0, 'bytes')} per pixel beside it"
    return f"{pool}, {beside}, {size(picture.total_bytes or 0)} at most"


def _show_ranks(ranks: Sequence[Rank]) -> None:
    from evaluation.looks import title
    from evaluation.summary import number

    asked = ranks[0].asked
    over = f", means over {counted(asked, 'pictures')}" if asked > 1 else ""
    print(f"\nRanked by error against the exact picture, then by time{over}")
    print_columns(
        ("rank", "technique", "family", "MSE e-5", "PSNR dB", "FLIP", "ms", "memory"),
        [
            [
                place,
                title(rank.technique),
                rank.family,
                None if rank.mse is None else number(1e5 * rank.mse),
                None if rank.psnr is None else f"{rank.psnr:.2f}",
                None if rank.flip is None else number(rank.flip),
                "left out" if rank.milliseconds is None else f"{rank.milliseconds:.1f}",
                None if rank.total_bytes is None else size(rank.total_bytes),
            ]
            for place, rank in enumerate(ranks, 1)
        ],
    )
    for rank in ranks:
        if 0 < rank.rendered < asked:
            print(f"{rank.technique}: {rank.rendered} of {counted(asked, 'pictures')}; the others were left out")
