"""`diaphane worker`: a process that does tasks of some roles, of which there may be many."""

from __future__ import annotations

import os
import signal
import threading
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli.state import DEFAULT_STATE, STATE_VARIABLE, StateOption
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    from services.engine.runtime import Runtime
    from stages.tasks import Role

EXIT_SECONDS = 20.0


def worker(
    roles: Annotated[str, typer.Option("--roles", help="Roles of the worker, of jobs,render,label,train.")],
    state: StateOption = DEFAULT_STATE,
) -> None:
    """Do the tasks of a service. Database and store are set by DIAPHANE_DATABASE and DIAPHANE_STORE."""
    from services.installed import require

    wanted = parse_roles(roles)
    require(*wanted)
    os.environ[STATE_VARIABLE] = str(state)
    from services.loading import uncollected

    with uncollected():
        from services import logs
        from services.engine.runtime import Runtime
        from services.settings import Settings

    logs.set_up()
    runtime = Runtime(Settings(), wanted)
    stop = threading.Event()
    stop_on_signal(stop.set)
    runtime.start()
    print(f"worker {runtime.executor} takes work: {', '.join(wanted)}", flush=True)
    stop.wait()
    shut_down(runtime)


def parse_roles(text: str) -> tuple[Role, ...]:
    """The roles of a comma-separated list.

    Raises:
        Problem: One is unknown, or there is none.
    """
    from stages.tasks import ROLES

    names = [name.strip() for name in text.split(",") if name.strip()]
    unknown = sorted(set(names) - set(ROLES))
    if unknown or not names:
        what = f"'{unknown[0]}' is not a role." if unknown else "No role is named."
        raise Problem(what, f"Name some of {', '.join(ROLES)} with --roles.", ExitCode.USAGE)
    return tuple(role for role in ROLES if role in names)


def stop_on_signal(stop: Callable[[], None]) -> None:
    """Calls `stop` at the first SIGTERM or SIGINT; the second one ends the process at once."""
    seen = threading.Event()

    def handle(number: int, _frame: FrameType | None) -> None:
        if seen.is_set():
            os._exit(128 + number)  # its children die with it, its work is taken over by others
        seen.set()
        stop()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handle)


def shut_down(runtime: Runtime) -> None:
    """Stops the runtime; a thread that waits for a dead database does not keep the process alive."""
    timer = threading.Timer(runtime.settings.drain_seconds + EXIT_SECONDS, os._exit, (0,))
    timer.daemon = True
    timer.start()
    runtime.stop()
