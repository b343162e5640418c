"""`diaphane bench`: every technique on views of scene files: time of each pass, bytes, errors."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.scene_options import CameraOption, ComplexityOption, GlassOption, RefineOption, VariantOption
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from diaphane.cli.technique_options import (
    BudgetsOption,
    InferenceOption,
    NodesOption,
    SteepnessOption,
    StochasticSamplesOption,
    VkbOption,
)
from schemas.glass import DEFAULT_GLASS
from schemas.tail import DEFAULT_TAIL, TAIL_HELP


def bench(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="SCENE...", help="Scenes: .usd, .usda, .usdc, .usdz, .glb, .gltf, .obj, .ply, .stl."),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Folder of the results: JSON lines, JSON, Vega-Lite plots, an HTML page."),
    ],
    techniques: Annotated[str, typer.Option("--techniques", "-t", help="Names with commas between, or all.")] = "all",
    budgets: BudgetsOption = None,
    alpha: Annotated[
        str | None,
        typer.Option(
            "--alpha", help="Opacities that every surface gets, and authored: .15,.33,authored. Default: authored."
        ),
    ] = None,
    glass: GlassOption = DEFAULT_GLASS,
    picture_size: Annotated[
        str, typer.Option("--size", help="WIDTHxHEIGHT in pixels; several with commas between.")
    ] = "1430x960",
    tails: Annotated[
        str | None,
        typer.Option(
            "--tails",
            help=f"Of bounded techniques, with commas between; kbuffer-deep has its bundle's. {TAIL_HELP} "
            f"Default: {DEFAULT_TAIL}.",
        ),
    ] = None,
    g: SteepnessOption = None,
    bundle: Annotated[
        str | None,
        typer.Option("--bundle", help="For kbuffer-deep and -temporal: a folder, or NAME@ALIAS of the registry."),
    ] = None,
    inference: InferenceOption = "glsl",
    vkb: VkbOption = "",
    nodes: NodesOption = None,
    stochastic_samples: StochasticSamplesOption = None,
    camera: CameraOption = None,
    views: Annotated[
        Path | None, typer.Option("--views", help="JSON file with views; all that it has of a scene are measured.")
    ] = None,
    most_views: Annotated[
        int | None, typer.Option("--most-views", help="Most views of a scene, spread over those of --views.")
    ] = None,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    variant: VariantOption = None,
    equal_memory: Annotated[
        bool,
        typer.Option(
            "--equal-memory/--equal-fragments", help="Also at the total bytes that the fixed k-buffer takes, or not."
        ),
    ] = True,
    path: Annotated[
        int, typer.Option("--path", metavar="FRAMES", help="Frames of a camera path for flicker; 0: none.")
    ] = 0,
    repeats: Annotated[int, typer.Option("--repeats", help="Timed frames of each cell, after a warm-up.")] = 3,
    limit: Annotated[
        float, typer.Option("--limit", help="Seconds for the repeats of one cell; slower ones are timed once.")
    ] = 10.0,
    account: Annotated[
        bool,
        typer.Option(
            "--account/--no-account", help="Count the work of a frame of each cell: passes, fragments, bytes, atomics."
        ),
    ] = True,
    resume: Annotated[
        bool, typer.Option("--resume/--fresh", help="Keep what was measured into --out already, or measure all anew.")
    ] = True,
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
    **given: Any,
) -> None:
    """Measure every technique: time of each pass, bytes, errors, scores at equal fragments and memory, work counted."""
    from evaluation.bench.groups import group, groups_of
    from evaluation.bench.options import BenchOptions, parse_alphas, parse_budgets, parse_sizes, parse_tails
    from evaluation.choices import parse_glass
    from evaluation.progress import make_progress
    from evaluation.render_options import parse_needs, parse_refine, parse_techniques, said_left_out
    from schemas import flags
    from schemas.work import Device

    options = BenchOptions(
        scenes=tuple(files),
        techniques=parse_techniques([techniques], bundle is not None),
        out=out,
        budgets=None if budgets is None else parse_budgets(budgets),
        alphas=parse_alphas(alpha),
        glass=parse_glass(glass),
        sizes=parse_sizes(picture_size),
        tails=() if tails is None else parse_tails(tails),
        g=g,
        bundle=bundle,
        needs=parse_needs(vkb, inference, nodes, stochastic_samples),
        camera=camera,
        views=views,
        most_views=most_views,
        variants=tuple(variant or ()),
        refine=parse_refine(complexity, refine),
        equal_memory=equal_memory,
        path=path,
        repeats=repeats,
        account=account,
        device=flags.checked(Device, flags.given(Device, given)),
        limit=limit,
        resume=resume,
    )
    from diaphane.bundles import bundle_folder
    from diaphane.cli.advise import show_sentences
    from diaphane.cli.bench_table import show
    from evaluation.advice.gathered import of_bench
    from evaluation.bench.files import write_files
    from evaluation.bench.run import bench as run
    from evaluation.bench.run import check_same_code, no_views

    if not as_json:
        output.tell_new_folder(out.parent)
    progress = make_progress(sys.stderr, silent=as_json)
    with bundle_folder(bundle, state) as folder:
        result = run(options, folder, shlex.join(["diaphane", *sys.argv[1:]]), progress)
    if not result.views:
        raise no_views(result)
    write_files(out, result)
    if as_json:
        output.print_json(result.model_dump(mode="json", exclude_defaults=True))
        return
    groups = groups_of(result.views)
    for each in [*groups, *([group("All of them", result.views)] if len(groups) > 1 else [])]:
        show(each, result.device)
    for each in groups:
        show_sentences(of_bench(each.title, each.views))
    if note := check_same_code(result):
        progress.note(note)
    if note := said_left_out([techniques], bundle is not None):
        progress.note(note)
    print(out / "index.html")
