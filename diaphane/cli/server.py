"""Options of the commands that talk to a server."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from diaphane.client import Client

DEFAULT_URL = "http://127.0.0.1:8035"
URL_VARIABLE = "DIAPHANE_URL"

UrlOption = Annotated[str, typer.Option("--url", envvar=URL_VARIABLE, help="Address of the server.")]
# The key itself is no option: the command line of a process can be read by everybody on the machine.
KeyFileOption = Annotated[
    Path | None,
    typer.Option(
        "--key-file",
        envvar="DIAPHANE_KEY_FILE",
        help="Read the API key from this file, which others must not read. Default: DIAPHANE_KEY.",
    ),
]
LimitOption = Annotated[int, typer.Option("--limit", min=1, help="Show at most this many, newest first.")]


def connect(url: str, key_file: Path | None) -> Client:
    """The server at a URL, with the key of the file or the environment.

    Args:
        url: Of the server.
        key_file: As of `find_key`.

    Raises:
        Problem: The URL or the key is not understood.
    """
    # Imported late: `diaphane --help` does not need a HTTP client.
    from diaphane.client import Client

    return Client(url, find_key(url, key_file))


def find_key(url: str, key_file: Path | None) -> str | None:
    """The API key of a server: of a file that is named, else of the environment, else of the user's configuration.

    Args:
        url: Of the server.
        key_file: The file; None: none is named.

    Returns:
        The key; None: there is none.

    Raises:
        Problem: The key is not understood, or must not be sent to this server.
    """
    from diaphane.cli import config
    from diaphane.client.keys import KEY_VARIABLE, read_key

    if key_file is None and not os.environ.get(KEY_VARIABLE, "").strip():
        key_file = config.current().key_file(url, DEFAULT_URL)
    key = read_key(key_file)
    if key is not None:
        config.current().check_key(url)
    return key
