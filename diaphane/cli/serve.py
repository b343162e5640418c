"""`diaphane serve`: the whole service in one process: API, registry, dashboard, and workers of every role."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli.server import URL_VARIABLE
from diaphane.cli.state import DEFAULT_STATE, STATE_VARIABLE, StateOption
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from services.api.server import Server
    from services.service import Service
    from stages.tasks import Role

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8035
FIRST_KEY = "first"
EXIT_SECONDS = 5.0
"""Of a server, beyond what its requests may take."""


def serve(
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = DEFAULT_HOST,
    port: Annotated[int, typer.Option("--port", help="Port; 0: a free one.", min=0, max=65535)] = DEFAULT_PORT,
    roles: Annotated[
        str | None,
        typer.Option(
            "--roles",
            help="What it does itself, of jobs,render,label,train; 'none': the API only. Default: what is installed.",
        ),
    ] = None,
    state: StateOption = DEFAULT_STATE,
) -> None:
    """Serve the API, and do the work. Stop with Ctrl-C: what is under way continues at the next start."""
    from diaphane.cli.worker import shut_down, stop_on_signal

    wanted = _roles(roles)
    os.environ[STATE_VARIABLE] = str(state)
    from services.loading import uncollected

    with uncollected():
        from services import logs
        from services.api.server import make_server
        from services.engine.runtime import Runtime
        from services.service import open_service
        from services.settings import Settings

    logs.set_up()
    settings = Settings()
    check_port(host, port)  # before a key is made that is shown only once
    service = open_service(settings)
    show_first_key(service, host)
    runtime = Runtime(settings, wanted) if wanted else None  # with a store of its own, which waits longer
    stop = threading.Event()
    stop_on_signal(stop.set)
    names = [name.strip() for name in settings.hosts.split(",") if name.strip()]
    listener = _Listener(make_server(service, host, port, names), host, port, settings.drain_seconds)
    with ExitStack() as stack:
        stack.callback(listener.stop)
        listener.start()
        listener.wait_ready()  # before any work is claimed: it may be that it cannot listen
        if runtime is not None:
            runtime.start()
            stack.callback(shut_down, runtime)
            stack.callback(listener.stop)  # no more requests before the work ends
        announce(host, listener.port)
        if roles is None:
            _announce_missing(wanted)
        while not stop.wait(0.5) and listener.is_alive():
            pass
    if not stop.is_set():
        raise Problem("The HTTP server ended by itself.", "Look into the log, and start it again.", ExitCode.TRY_AGAIN)


def _roles(text: str | None) -> tuple[Role, ...]:
    """What a server does itself.

    Raises:
        Problem: A role is unknown, or needs a package that is not installed.
    """
    from diaphane.cli.worker import parse_roles
    from services.installed import installed_roles, require

    if text is None:
        return installed_roles()
    wanted = () if text.strip() == "none" else parse_roles(text)
    require(*wanted)
    return wanted


def _announce_missing(roles: Sequence[Role]) -> None:
    """Prints what this server leaves to other workers: jobs that need it wait for one."""
    from services.installed import WORK, missing
    from stages.tasks import ROLES

    for role in ROLES:
        if role not in roles:
            lacking = " and ".join(missing(role))
            print(f"{WORK[role]} waits for a worker of the role {role}: {lacking} not installed here", flush=True)


class _Listener(threading.Thread):
    """The HTTP server, in a thread: signals belong to the main one."""

    def __init__(self, server: Server, host: str, port: int, drain_seconds: float) -> None:
        super().__init__(daemon=True, name="http")
        self._server = server
        self._where, self._drain_seconds = (host, port), drain_seconds

    @property
    def port(self) -> int:
        """That it listens on."""
        return int(self._server.servers[0].sockets[0].getsockname()[1])

    def run(self) -> None:
        with suppress(SystemExit):  # uvicorn's way to say that it cannot listen
            self._server.run()

    def wait_ready(self) -> None:
        """Waits until it listens.

        Raises:
            Problem: It cannot.
        """
        while not self._server.started:
            if not self.is_alive():
                raise _not_listening(*self._where, "another program has taken it")
            time.sleep(0.02)

    def stop(self) -> None:
        """Ends it, after the requests under way."""
        self._server.should_exit = True
        if self.is_alive():
            self.join(self._drain_seconds + EXIT_SECONDS)


def check_port(host: str, port: int) -> None:
    """Makes sure that a server can listen.

    Args:
        host: Address to listen on.
        port: The port; 0: a free one.

    Raises:
        Problem: It cannot.
    """
    try:
        for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            with socket.socket(family, kind, protocol) as tried:
                tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                tried.bind(address)
    except OSError as error:
        raise _not_listening(host, port, (error.strerror or str(error)).lower()) from error


def _not_listening(host: str, port: int, cause: str) -> Problem:
    return Problem(
        f"Diaphane cannot listen on port {port} of {host}: {cause}.",
        "Stop what listens there, or choose another one: --port 0 takes a free port.",
        ExitCode.CONFLICT,
    )


def show_first_key(service: Service, host: str) -> None:
    """Makes the first key of a new service and prints it; it is never shown again.

    Raises:
        Problem: There is no key, and others than this machine could reach the service.
    """
    from services.api.server import is_loopback

    if service.keys.any():
        return
    if not is_loopback(host):
        raise Problem(
            f"The service has no API key yet, and {host} can be reached from elsewhere.",
            "Make one on this machine: diaphane keys create NAME --scope admin --local.",
            ExitCode.AUTH,
        )
    _, secret = service.keys.create(FIRST_KEY, ("admin",))
    print(f"First API key (admin), shown only now:\n  {secret}\nUse it: export DIAPHANE_KEY={secret}", flush=True)


def announce(host: str, port: int) -> None:
    """Prints where the service and its pages are, and how commands find it."""
    shown = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    url = f"http://{shown}:{port}"
    lines = (
        f"Diaphane serves http://{f'[{host}]' if ':' in host else host}:{port}",
        f"Dashboard: {url}/",
        f"API: {url}/v1, described by {url}/v1/openapi.json",
        f"For the commands: export {URL_VARIABLE}={url}",
    )
    print("\n".join(lines), file=sys.stdout, flush=True)
