"""`diaphane build`: the main job."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.scene_options import LicenceOption
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from evaluation.wording import counted

if TYPE_CHECKING:
    from diaphane.local.options import BuildOptions
    from diaphane.local.result import BuildResult


def build(
    scenes: Annotated[list[Path], typer.Argument(help="USD files: .usd, .usda, .usdc, .usdz.")],
    name: Annotated[str, typer.Option("--name", help="Name of the bundle in the registry.")],
    holdout: Annotated[
        list[Path] | None,
        typer.Option(
            "--holdout",
            help="Evaluate on this scene and never train on it, by path or stem; repeatable. Default: a quarter.",
        ),
    ] = None,
    licence: LicenceOption = None,
    views: Annotated[
        Path | None,
        typer.Option("--views", help="Read the views of the scenes from this JSON file. Default: the stages' cameras."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--from", help="Start from this pretrained bundle: a folder, or NAME@ALIAS of the registry. Default: none."
        ),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option(
            "--replay",
            help="Train again on this data set of --from, so that it is not forgotten. Default: that of its name.",
        ),
    ] = None,
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
    **given: Any,
) -> None:
    """Render, label, train, evaluate, publish and report. Builds are resumable: rerun the command to continue."""
    from diaphane.local.options import BuildOptions, asked, parse_licences
    from evaluation.progress import make_progress
    from schemas import flags
    from schemas.options import Options

    options = BuildOptions(
        scenes=tuple(scenes),
        name=name,
        options=asked(Options, flags.given(Options, given)),
        holdout=tuple(holdout or ()),
        licences={Path(scene): said for scene, said in parse_licences(licence or (), [*map(str, scenes)]).items()},
        views=views,
        start=start,
        replay=replay,
        state=state,
    )
    # The pipeline loads torch and numba: only once the options are known to be good.
    from diaphane.local.build import build as run

    result = run(options, make_progress(sys.stderr, silent=as_json))
    if as_json:
        output.print_json(result.model_dump(mode="json"))
    else:
        _show(options, result)


def _show(options: BuildOptions, result: BuildResult) -> None:
    from rich import box
    from rich.table import Table

    from diaphane.local.result import HEADINGS

    console = output.out()
    if rows := result.table():
        # As narrow as that, no number is cut off in 80 columns.
        title = f"Held out: {', '.join(result.held_out)}"
        table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for i, heading in enumerate(HEADINGS):
            table.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
        for row in rows:
            table.add_row(*row)
        console.print(table)
    console.print(result.verdict, markup=False)
    if result.skipped:
        skipped = ", ".join(counted(count, what) for what, count in result.skipped.items())
        console.print(f"Skipped: {skipped}.", markup=False)
    if not result.worked:
        console.print("Nothing had to be done: every artifact was there already.", markup=False)
    console.print(f"{result.registry.reference}: {result.registry.reason}", markup=False)
    console.print(result.licences, markup=False)
    console.print(f"Bundle: {result.registry.folder}", markup=False)
    console.print(f"Data set: {result.dataset}", markup=False)
    console.print(f"Report: {result.report}", markup=False)
    console.print(f"[dim]{result.seconds:.1f} s, seed {options.options.seed}[/]")
