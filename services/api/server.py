"""The HTTP server: uvicorn, with the service's settings.

Files are sent in pieces of 1 MiB: over the loopback interface that is as fast as nginx with `sendfile`, because the
transport hands them to the kernel without a copy of its own.
"""

from __future__ import annotations

import asyncio
import ipaddress
import math
import socket
from collections.abc import Sequence

import uvicorn
from fastapi import FastAPI

from services.api.application import create_app
from services.api.feeds import Feeds
from services.api.observe import LOOPBACK
from services.api.protocol import BoundedProtocol, room_for_connections
from services.service import Service

DRAIN_SECONDS = 5.0
"""How long requests under way may take once a server without settings is told to stop."""


class Server(uvicorn.Server):
    """Ends the event streams when it is told to stop: they would never end by themselves.

    Args:
        config: Of uvicorn.
        feeds: The event streams.
    """

    def __init__(self, config: uvicorn.Config, feeds: Feeds) -> None:
        super().__init__(config)
        self._feeds = feeds

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stops listening, ends the event streams, and waits for the requests under way."""
        self._feeds.close()
        # Whoever is in the listener's queue by now is accepted in the first round, and would be refused by its end.
        for _ in range(2):
            await asyncio.sleep(0)
        await super().shutdown(sockets)


def is_loopback(host: str) -> bool:
    """Whether an address is reached from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def make_server(service: Service, host: str, port: int, hosts: Sequence[str] = ()) -> Server:
    """A server; `run()` serves until a signal comes, `started` tells when it listens.

    Args:
        service: What it answers from.
        host: Address that it listens on.
        port: Port; 0: a free one.
        hosts: Names that it answers for beside those of the loopback interface; `*`: any. Empty: on a loopback
            address no others, on any other address all, because there a name cannot be guessed.
    """
    names = (*LOOPBACK, *hosts) if hosts or is_loopback(host) else ("*",)
    settings = service.settings
    return server_of(create_app(service, hosts=names), host, port, settings.trusted_proxies, settings.drain_seconds)


def server_of(
    app: FastAPI, host: str, port: int, proxies: Sequence[str] = (), drain_seconds: float = DRAIN_SECONDS
) -> Server:
    """A server of an application; see `make_server`.

    Args:
        app: The application.
        host: Address that it listens on.
        port: Port; 0: a free one.
        proxies: Addresses and networks of proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` are believed.
        drain_seconds: How long requests under way may take once it is told to stop.
    """
    BoundedProtocol.most_connections = room_for_connections()
    config = uvicorn.Config(
        app,
        host=host,
        port=port,
        http=BoundedProtocol,
        ws="none",
        # What others say of who asks is believed of the proxies alone that an operator named.
        proxy_headers=bool(proxies),
        forwarded_allow_ips=list(proxies),
        access_log=False,  # the application writes its own
        log_config=None,
        server_header=False,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=math.ceil(drain_seconds),
    )
    return Server(config, app.state.feeds)
