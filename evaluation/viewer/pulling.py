"""Bundles of a server, fetched and verified by the Python client, a distribution of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from schemas.problem import ExitCode, Problem

FETCHED: Final = "bundles"
"""Folder of a state that fetched bundles are kept in."""


def pull(name: str, alias: str, url: str, key: str | None, folder: Path) -> Path:
    """Folder of the bundle that an alias means.

    Args:
        name: Of the bundle.
        alias: Its alias.
        url: Of the server.
        key: API key, or None.
        folder: Where bundles are kept.

    Raises:
        Problem: The client is not installed, or there is no such bundle, or it is not what was signed.
    """
    verifying = verifying_client()
    try:
        return Path(verifying.pull(name, alias, url=url, key=key, folder=folder))
    except verifying.PullError as error:
        raise refused_pull(error) from error


def verifying_client() -> Any:
    """The package of deploy/client/python, a distribution of its own that nothing else here needs."""
    try:
        import diaphane_client
    except ModuleNotFoundError as error:
        raise Problem(
            "A model of a service is fetched by the Python client, which is not installed.",
            "Run `pip install ./deploy/client/python`, or name a folder with --bundle.",
            ExitCode.CHECK_FAILED,
        ) from error
    return diaphane_client


def refused_pull(error: Any) -> Problem:
    """What a `diaphane_client.PullError` means to a user."""
    client = verifying_client()
    codes = {client.Unavailable: ExitCode.TRY_AGAIN, client.Denied: ExitCode.AUTH, client.NotFound: ExitCode.NOT_FOUND}
    return Problem(error.what, error.remedy, codes.get(type(error), ExitCode.CHECK_FAILED))
