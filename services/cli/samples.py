"""`diaphane samples`: the project's own small scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from services.cli import output
from services.cli.state import JsonOption


def samples(
    folder: Annotated[Path, typer.Argument(help="Where the USD files go; created if missing.")],
    as_json: JsonOption = False,
) -> None:
    """Write small USD scenes of different kinds, to try `diaphane build` on."""
    from renderer.samples import write_samples

    paths = write_samples(folder)
    if as_json:
        output.print_json({"scenes": [str(path) for path in paths]})
        return
    for path in paths:
        print(path)
