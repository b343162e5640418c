"""`diaphane storm`: OpenUSD's Storm as it is installed: compared with its own exact picture, and patched."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.state import JsonOption
from schemas.problem import Problem

app = typer.Typer(
    help="OpenUSD's Storm, where it is installed (`make peers`): compare, patch.",
    no_args_is_help=True,
)

PYTHON = Path(".venv-peers/bin/python")


@app.command()
def compare(
    scenes: Annotated[list[Path], typer.Argument(metavar="SCENE...", help="Scene files.")],
    python: Annotated[Path, typer.Option("--python", help="Interpreter that has OpenUSD with Storm.")] = PYTHON,
    size: Annotated[str, typer.Option("--size", help="Width x height.")] = "480x320",
    alpha: Annotated[
        float | None, typer.Option("--alpha", min=0.0, max=0.99, help="Opacity of every surface. Default: as authored.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FOLDER", help="Write contact sheets and storm.json there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Render scenes in Storm as installed, with the nearest 8 and a tail, and exactly; print the errors."""
    from evaluation.storm.compare import Compared, table
    from evaluation.storm.compare import compare as compared
    from evaluation.storm.engine import Engine
    from schemas.flags import parse_size

    engine, wanted = Engine.of(python), parse_size(size)
    found: list[Compared] = []
    for one in compared(engine, scenes, wanted, alpha, out):
        found.append(one)
        output.err().print(f"{one.scene} ...", markup=False)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        told = json.dumps([one.json() for one in found], indent=1)
        (out / "storm.json").write_text(told + "\n", encoding="utf-8")
    if as_json:
        output.print_json({"scenes": [one.json() for one in found]})
    else:
        print(table(found), end="")


@app.command()
def patch(
    folder: Annotated[Path, typer.Argument(help="OpenUSD's folder of plug-ins, such as lib/usd.")],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would change.")] = False,
    apply: Annotated[bool, typer.Option("--apply", help="Change the file, and keep it as it was beside it.")] = False,
    revert: Annotated[bool, typer.Option("--revert", help="Put the file back as it was.")] = False,
) -> None:
    """Let an installed Storm keep the nearest 8 fragments and a tail instead of the last 8 that were drawn."""
    from evaluation.storm.patch import Target

    if dry_run + apply + revert != 1:
        raise Problem("One of --dry-run, --apply and --revert is needed.", "Begin with --dry-run.")
    target = Target.of(folder)
    if dry_run:
        print(target.difference(), end="")
    elif apply:
        target.apply()
        print(f"{target.file} is patched; as it was: {target.backup.name}")
    else:
        target.revert()
        print(f"{target.file} is as it was.")
