"""Options of the commands that talk to a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from services.cli.remote import Remote

DEFAULT_URL = "http://127.0.0.1:8035"
URL_VARIABLE = "DIAPHANE_URL"

UrlOption = Annotated[str, typer.Option("--url", envvar=URL_VARIABLE, help="Address of the server.")]
# The key itself is no option: the command line of a process can be read by everybody on the machine.
KeyFileOption = Annotated[
    Path | None,
    typer.Option(
        "--key-file", envvar="DIAPHANE_KEY_FILE", help="Read the API key from this file. Default: DIAPHANE_KEY."
    ),
]
LimitOption = Annotated[int, typer.Option("--limit", min=1, help="Show at most this many, newest first.")]


def connect(url: str, key_file: Path | None) -> Remote:
    """The server at a URL, with the key of the file or the environment.

    Raises:
        Problem: The URL or the key is not understood.
    """
    # Imported late: `diaphane --help` does not need a HTTP client.
    from services.cli.remote import open_remote

    return open_remote(url, key_file)
