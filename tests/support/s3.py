"""A throw-away S3 server of a test's own, in the test process, on a free port of the loopback interface."""

from __future__ import annotations

import os
import urllib.request
import uuid
from collections.abc import Iterator
from contextlib import contextmanager

from moto.server import ThreadedMotoServer

ENVIRONMENT = {
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_REGION": "us-east-1",
}


class S3Server:
    """An S3 server whose content is lost with it."""

    def __init__(self) -> None:
        self._server, self._port = _started(0)
        self.endpoint = f"http://127.0.0.1:{self._port}"

    @property
    def environment(self) -> dict[str, str]:
        """Variables with which a process finds the server."""
        return {**ENVIRONMENT, "AWS_ENDPOINT_URL": self.endpoint}

    def new_bucket(self) -> str:
        """Name of an empty bucket."""
        name = f"t{uuid.uuid4().hex[:12]}"
        urllib.request.urlopen(urllib.request.Request(f"{self.endpoint}/{name}", method="PUT")).close()
        return name

    def stop(self) -> None:
        """Ends it; `start` brings it back at the same address, with what it held: that is in this process."""
        self._server.stop()

    def start(self) -> None:
        """After `stop`."""
        self._server, self._port = _started(self._port)


def _started(port: int) -> tuple[ThreadedMotoServer, int]:
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    server.start()
    return server, server.get_host_and_port()[1]


@contextmanager
def environment(variables: dict[str, str]) -> Iterator[None]:
    """The process's environment with some variables set, and put back afterwards."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.__setitem__(name, value)
