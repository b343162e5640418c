"""`diaphane keys`: who may use a server, and what it signs with."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.lines import print_columns
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, connect
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from evaluation.wording import counted
from schemas.problem import Problem

if TYPE_CHECKING:
    from services.keys import Keys

app = typer.Typer(
    help="API keys: create, list, revoke (needs an admin key, or --local); the signing key: rotate.",
    no_args_is_help=True,
)

LocalOption = Annotated[
    bool,
    typer.Option("--local", help="Use the database of the state folder, or DIAPHANE_DATABASE, instead of a server."),
]
SCOPES = ("read", "submit", "publish", "admin")
_DAY_SECONDS = 86400.0


@app.command()
def create(
    name: Annotated[str, typer.Argument(help="Who or what the key is for.")],
    scope: Annotated[list[str], typer.Option("--scope", help="read, submit, publish or admin; repeatable.")],
    days: Annotated[float | None, typer.Option("--days", help="Days until it expires. Default: never.")] = None,
    job_pixels: Annotated[
        int | None, typer.Option("--job-pixels", min=1, help="Pixels of all views of a job. Default: the service's.")
    ] = None,
    job_steps: Annotated[
        int | None, typer.Option("--job-steps", min=1, help="Optimiser steps of a job. Default: the service's.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Jobs that have not ended. Default: the service's.")
    ] = None,
    is_local: LocalOption = False,
    state: StateOption = DEFAULT_STATE,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a key. It is printed once, on stdout, and cannot be shown again."""
    unknown = sorted(set(scope) - set(SCOPES))
    if unknown:
        raise Problem(f"There is no scope '{unknown[0]}'.", f"Choose among {', '.join(SCOPES)}: --scope read.")
    if days is not None and not 0.0 < days <= 36500.0:
        raise Problem(
            f"--days {days:g} is not above 0 and at most 36500.",
            "Give above 0 and at most 36500 days, or leave out --days: the key then never expires.",
        )
    expires = None if days is None else time.time() + days * _DAY_SECONDS
    bounds = {"job_pixels": job_pixels, "job_steps": job_steps, "jobs": jobs}
    if is_local:
        from schemas.service import JobBounds

        with _local(state) as keys:
            record, secret = keys.create(name, scope, expires, JobBounds(**bounds))  # type: ignore[arg-type]  # checked
        made: dict[str, Any] = {"key": record.model_dump(mode="json"), "secret": secret}
    else:
        moment = None if expires is None else datetime.fromtimestamp(expires, UTC).isoformat(timespec="seconds")
        made = connect(url, key_file).keys.create(name, scope, moment, bounds)
    if as_json:
        output.print_json(made)
        return
    print(made["secret"])
    output.err().print("Keep it: it is shown this once. Clients read it from DIAPHANE_KEY.", markup=False)


@app.command("list")
def list_(
    is_local: LocalOption = False,
    state: StateOption = DEFAULT_STATE,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """All keys, without their secrets."""
    if is_local:
        with _local(state) as keys:
            found = [key.model_dump(mode="json") for key in keys.list()]
    else:
        found = list(connect(url, key_file).keys.list())
    if as_json:
        output.print_json({"keys": found})
        return
    rows = [(k["id"], k["name"], ",".join(k["scopes"]), _state(k), k["created"], k["last_used"]) for k in found]
    print_columns(("id", "name", "scopes", "state", "created", "last used"), rows)


@app.command()
def revoke(
    key_id: Annotated[str, typer.Argument(metavar="ID", help="Id of the key: key_...")],
    is_local: LocalOption = False,
    state: StateOption = DEFAULT_STATE,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
) -> None:
    """End a key at once."""
    if is_local:
        with _local(state) as keys:
            keys.revoke(key_id)
    else:
        connect(url, key_file).keys.revoke(key_id)
    print(f"{key_id} is revoked.")


@app.command("rotate-signing")
def rotate_signing(
    new_key: Annotated[
        Path | None,
        typer.Option(
            "--new-key",
            help="Read the new key from this file, 32 random bytes in base64; -: stdin. Default: generate one.",
        ),
    ] = None,
    is_lost: Annotated[
        bool,
        typer.Option("--lost", help="The old key is lost: sign with the current one, which every client must be told."),
    ] = False,
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
) -> None:
    """Hand over to a new signing key, in the database of the state folder, or DIAPHANE_DATABASE."""
    # Imported late: `diaphane --help` needs no database.
    from services.database import open_database
    from services.registry import handovers
    from services.registry.signing import decoded_seed, read_seed
    from services.settings import Settings

    if is_lost and new_key is not None:
        raise Problem(
            "--lost uses the current key, so it cannot be combined with --new-key.",
            "Put the new key in its place, then repeat.",
        )
    seed = None
    if str(new_key) == "-":
        seed = decoded_seed(sys.stdin.read(), "Standard input")
    elif new_key is not None:
        if not new_key.is_file():
            raise Problem(f"There is no file {new_key}.", "Create it: `openssl rand -base64 32 > new.key`.")
        seed = read_seed(new_key)
    settings = Settings(state=state)
    database = open_database(settings.database_url)
    try:
        done = handovers.replace_lost(database, settings) if is_lost else handovers.rotate(database, settings, seed)
    finally:
        database.close()
    if as_json:
        output.print_json({"public_key": done.public_key, "signed": done.signed, "left": list(done.left)})
        return
    print(done.public_key)
    say = output.err()
    say.print(f"The registry's public key; it signs {counted(done.signed, 'versions')}.", markup=False)
    for reference in done.left:
        say.print(f"warning: {reference} had no right signature, and was left as it is.", markup=False)
    if settings.signing_key and not is_lost:
        say.print("Start every process that signs with the new key as DIAPHANE_SIGNING_KEY.", markup=False)


@contextmanager
def _local(state: Path) -> Iterator[Keys]:
    # Imported late: `diaphane --help` needs no database.
    from services.database import open_database
    from services.keys import Keys
    from services.settings import Settings

    database = open_database(Settings(state=state).database_url)
    try:
        yield Keys(database)
    finally:
        database.close()


def _state(key: dict[str, Any]) -> str:
    if key["revoked"]:
        return "revoked"
    expires = key["expires"]
    if expires and datetime.fromisoformat(expires) <= datetime.now(UTC):
        return "expired"
    return f"until {expires[:10]}" if expires else "valid"
