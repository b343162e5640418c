"""JSON values over a socket between a worker and its child process."""

from __future__ import annotations

import json
import select
import socket
import struct
from typing import Any, Self

MOST_BYTES = 64 << 20
"""A message beyond this ends the channel: its sender is out of control."""


class Channel:
    """One end. Messages are JSON objects with their length in front, 4 bytes, big-endian."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._buffer = bytearray()

    @classmethod
    def from_descriptor(cls, descriptor: int) -> Self:
        """The end that a process inherited."""
        return cls(socket.socket(fileno=descriptor))

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    def send(self, message: dict[str, Any]) -> None:
        """Sends a message.

        Raises:
            OSError: The other end is gone.
        """
        content = json.dumps(message).encode()
        self._socket.sendall(struct.pack(">I", len(content)) + content)

    def receive(self, seconds: float | None = None) -> dict[str, Any] | None:
        """The next message; None when the other end is closed.

        Args:
            seconds: How long to wait; None: for ever.

        Raises:
            TimeoutError: Nothing came in time.
        """
        while True:
            message = self._take()
            if message is not None:
                return message
            if seconds is not None and not select.select([self._socket], [], [], seconds)[0]:
                raise TimeoutError
            try:
                content = self._socket.recv(1 << 16)
            except ConnectionError:
                return None
            if not content:
                return None
            self._buffer += content

    def close(self) -> None:
        """Closes this end."""
        self._socket.close()

    def _take(self) -> dict[str, Any] | None:
        if len(self._buffer) < 4:
            return None
        (size,) = struct.unpack_from(">I", self._buffer)
        if size > MOST_BYTES:
            raise ConnectionError(f"a message of {size} bytes")
        if len(self._buffer) < 4 + size:
            return None
        content = bytes(self._buffer[4 : 4 + size])
        del self._buffer[: 4 + size]
        value = json.loads(content)
        if not isinstance(value, dict):
            raise ConnectionError("a message that is not an object")
        return value
