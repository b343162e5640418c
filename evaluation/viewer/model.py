"""The bundle that is shown: a folder, one of the local registry, or one of a service, followed while it is shown."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.viewer.pulling import FETCHED, refused_pull, verifying_client

_EVERY = 5.0
"""Seconds between two questions for the alias; one about the same version costs a small answer."""


@dataclass(frozen=True, slots=True)
class Service:
    """Where a model is fetched from.

    Attributes:
        reference: NAME@ALIAS.
        url: The server.
        key: API key; None: none.
        state: Folder of the state, in which fetched bundles are kept.
        follow: Whether later versions of the alias are fetched, too.
        public_key: The server's signing key, base64; None: the one that was seen first.
    """

    reference: str
    url: str
    key: str | None
    state: Path
    follow: bool
    public_key: str | None = None


@dataclass(frozen=True, slots=True)
class Source:
    """The bundle, and those that come after it.

    Attributes:
        folder: Of the bundle; None: none was asked for.
        name: As it is shown.
        later: Folders of newer versions, from the thread that asks for them.
    """

    folder: Path | None
    name: str
    later: queue.SimpleQueue[Path]

    def newest(self) -> Path | None:
        """The last one that has come since this was asked last; None: no other one."""
        found = None
        while not self.later.empty():
            found = self.later.get()
        return found


def fetched_name(name: str, folder: Path) -> str:
    """NAME@VERSION of a fetched bundle, whose folder is named after its version."""
    return f"{name.partition('@')[0]}@{folder.name}"


@contextmanager
def local_source(folder: Path | None, name: str) -> Iterator[Source]:
    """A bundle of this machine.

    Args:
        folder: Of the bundle; None: none.
        name: As it is shown.
    """
    yield Source(folder, name, queue.SimpleQueue())


@contextmanager
def remote_source(service: Service) -> Iterator[Source]:
    """A bundle of a service, fetched and verified by the Python client.

    Raises:
        Problem: The client is not installed, or there is no such bundle, or it is not what was signed.
    """
    client = verifying_client()
    name, _, alias = service.reference.partition("@")
    asked: dict[str, Any] = {"url": service.url, "key": service.key, "folder": service.state / FETCHED}
    asked["public_key"] = service.public_key
    stop, later = threading.Event(), queue.SimpleQueue[Path]()
    bundles = client.watch(name, alias or "champion", every=_EVERY, stop=stop, **asked)
    try:
        first = next(bundles)
    except client.PullError as error:
        raise refused_pull(error) from error

    def listen() -> None:
        for folder in bundles:
            later.put(folder)

    if service.follow:
        threading.Thread(target=listen, name="watch", daemon=True).start()
    try:
        yield Source(first, fetched_name(name, first), later)
    finally:
        stop.set()
