"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_STATE = Path(".diaphane")
STATE_VARIABLE = "DIAPHANE_STATE"

StateOption = Annotated[
    Path, typer.Option("--state", envvar=STATE_VARIABLE, help="Folder of artifacts, registry and reports.")
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout; errors as one JSON object on stderr.")
]
