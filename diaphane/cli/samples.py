"""`diaphane samples`: the project's own scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.state import JsonOption


def samples(
    folder: Annotated[Path, typer.Argument(help="Folder for the USD files; created if missing.")],
    deep: Annotated[
        bool, typer.Option("--deep", help="Write the deep scenes instead: 8 to 100 transparent fragments per pixel.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Write small USD scenes of different kinds, to try `diaphane build` on."""
    from renderer.samples import SAMPLES, write_samples
    from renderer.samples.deep import DEEP

    if not as_json:
        output.tell_new_folder(folder.parent)
    paths = write_samples(folder, DEEP if deep else SAMPLES)
    if as_json:
        output.print_json({"scenes": [str(path) for path in paths]})
        return
    for path in paths:
        print(path)
