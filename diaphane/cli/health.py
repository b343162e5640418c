"""`diaphane health`: whether what should run here does; for the health checks of containers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli.server import DEFAULT_URL, UrlOption
from diaphane.cli.state import DEFAULT_STATE, StateOption
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from services.settings import Settings

TIMEOUT_SECONDS = 5.0

RoleOption = Annotated[
    str | None, typer.Option("--role", help="Check a worker of this role on this host. Default: the server at --url.")
]
LiveOption = Annotated[
    bool, typer.Option("--live", help="Check only that it runs, even if the database or the store does not answer.")
]


def health(
    role: RoleOption = None,
    is_live: LiveOption = False,
    url: UrlOption = DEFAULT_URL,
    state: StateOption = DEFAULT_STATE,
) -> None:
    """Tell whether the server, or a worker on this host, is ready for work; exit status 0 if it is."""
    if role is None:
        _ask_server(f"{url.rstrip('/')}/v1/health/{'live' if is_live else 'ready'}")
    else:
        _look_for_worker(role, state, patient=is_live)
    print("ok")


def _ask_server(address: str) -> None:
    from urllib.error import HTTPError, URLError
    from urllib.request import urlopen

    try:
        urlopen(address, timeout=TIMEOUT_SECONDS).close()
    except HTTPError as error:
        raise Problem(
            f"{address} answers {error.code}.",
            "See the server's log for what it is waiting for.",
            ExitCode.CHECK_FAILED,
        ) from None
    except (URLError, OSError, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise Problem(
            f"{address} does not answer: {reason}.",
            "Start `diaphane serve`, or name it with --url.",
            ExitCode.CHECK_FAILED,
        ) from None


def _look_for_worker(role: str, state: Path, *, patient: bool) -> None:
    """Looks for a heartbeat from this host.

    Args:
        role: What the worker does.
        state: State folder.
        patient: Whether a database that does not answer is nothing to hold against a worker.
    """
    from sqlalchemy.exc import DBAPIError, OperationalError

    from services.settings import Settings
    from stages.tasks import ROLES

    if role not in ROLES:
        raise Problem(f"There is no role '{role}'.", f"Choose among {', '.join(ROLES)}.")
    try:
        heard = _is_heard(Settings(state=state), role)
    except OperationalError:
        if patient:
            return
        raise Problem(
            "The database does not answer, or nothing ever ran on it.",
            "Check the server that DIAPHANE_DATABASE names.",
            ExitCode.TRY_AGAIN,
        ) from None
    except DBAPIError:  # it has no tables yet
        heard = False
    if not heard:
        raise Problem(
            f"No worker of the role {role} has reported from this host recently.",
            f"Start `diaphane worker --roles {role}`; if it runs, see its log.",
            ExitCode.CHECK_FAILED,
        )


def _is_heard(settings: Settings, role: str) -> bool:
    import sqlalchemy as sa

    from services.database import Database, tables
    from services.database.clock import clock
    from services.engine.liveness import host

    database, table = Database(settings.database_url), tables.executors
    try:
        age = clock(database) - table.c.last_seen
        fresh = sa.select(table.c.roles).where(table.c.host == host(), age <= settings.ttl)
        with database.read() as connection:
            # As `render:1,label:2`: roles, and how much is done of each at once.
            return any(role in (part.partition(":")[0] for part in row.split(",")) for row in connection.scalars(fresh))
    finally:
        database.close()
