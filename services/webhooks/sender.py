"""One attempt to deliver: one POST, to an address that was checked, within bounds of time and bytes.

The connection goes to the address itself, so that nothing resolves the name a second time; TLS still verifies the name.
Redirects are answers like others that are no success; proxies of the environment are not asked. Of the answer only the
status is kept: a body would let an administrator of the service read what the service can reach.
"""

from __future__ import annotations

import http.client
import io
import socket
import ssl
import time
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from services.webhooks.addresses import Network, Refused, Target, parse, resolve

SECONDS: Final = 10.0
"""Of an attempt, from the first connection to the end of the answer; resolving the name comes before."""
ANSWER_BYTES: Final = 64 << 10
"""Of an answer, head and body; what is beyond is not read."""

_GONE: Final = 410


@dataclass(frozen=True)
class Outcome:
    """What became of an attempt.

    Attributes:
        status: HTTP status; None: there was no answer.
        problem: Why it failed; None: it was delivered.
        is_final: Whether the receiver wants no further attempt.
    """

    status: int | None
    problem: str | None = None
    is_final: bool = False


def send(
    url: str, headers: Mapping[str, str], body: bytes, allowed: Sequence[Network] = (), seconds: float = SECONDS
) -> Outcome:
    """Tries to deliver a message.

    Args:
        url: Of the webhook.
        headers: Beside those of every request.
        body: JSON.
        allowed: Networks that may be reached beside the public ones.
        seconds: Time for it.
    """
    target = parse(url)
    try:
        addresses = resolve(target, allowed)
        end = time.monotonic() + seconds
        with closing(_connected(target, addresses, end)) as connection:
            status = _status(connection, target, headers, body, end)
    except Refused as refused:
        return Outcome(None, str(refused))
    except ssl.SSLCertVerificationError:
        return Outcome(None, "The certificate of the receiver is not valid for its name.")
    except TimeoutError:
        return Outcome(None, f"The receiver did not answer within {seconds:g} seconds.")
    except (OSError, http.client.HTTPException):
        return Outcome(None, "The connection to the receiver failed, or what it answered is not HTTP.")
    return _judged(status)


def _judged(status: int) -> Outcome:
    if 200 <= status < 300:
        return Outcome(status)
    if 300 <= status < 400:
        return Outcome(status, f"The receiver answered {status}; redirects are not followed.")
    if status == _GONE:
        return Outcome(status, f"The receiver answered {status}: it wants no more of this.", is_final=True)
    return Outcome(status, f"The receiver answered {status}.")


def _connected(target: Target, addresses: Sequence[str], end: float) -> socket.socket:
    """A connection to the first address that answers, with TLS if the target has it."""
    for number, address in enumerate(addresses, start=1):
        try:
            plain = socket.create_connection((address, target.port), _left(end))
            break
        except OSError:
            if number == len(addresses):
                raise
    if target.scheme == "http":
        return plain
    try:
        plain.settimeout(_left(end))
        return _tls().wrap_socket(plain, server_hostname=target.host)
    except BaseException:
        plain.close()
        raise


def _status(connection: socket.socket, target: Target, headers: Mapping[str, str], body: bytes, end: float) -> int:
    """Sends the request and reads the answer, as far as it is read."""
    client = http.client.HTTPConnection(target.host, target.port)
    client.sock = _Bounded(connection, end)  # all that the client uses of a socket
    fixed = {"Host": target.named, "Content-Type": "application/json", "User-Agent": "Diaphane", "Connection": "close"}
    client.request("POST", target.place, body, {**fixed, **headers})
    answer = client.getresponse()
    # A receiver whose answer is not taken may believe that it failed; what comes of it changes nothing here.
    with suppress(OSError, http.client.HTTPException):
        answer.read()
    return answer.status


class _Bounded:
    """A socket for `http.client` that ends at a time, and after a number of bytes.

    Args:
        connection: The socket.
        end: When, by the monotonic clock.
    """

    def __init__(self, connection: socket.socket, end: float) -> None:
        self._connection, self._end = connection, end

    def sendall(self, data: bytes) -> None:
        """Sends all of it."""
        self._connection.settimeout(_left(self._end))
        self._connection.sendall(data)

    def makefile(self, _mode: str) -> io.BufferedReader:
        """What is received, as a file."""
        return io.BufferedReader(_Received(self._connection, self._end))

    def close(self) -> None:
        """Nothing: whoever connected closes."""


class _Received(io.RawIOBase):
    def __init__(self, connection: socket.socket, end: float) -> None:
        self._connection, self._end, self._budget = connection, end, ANSWER_BYTES

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Bytes as they come; the end of the file once there were enough."""
        if self._budget == 0:
            return 0
        self._connection.settimeout(_left(self._end))
        count = self._connection.recv_into(buffer, min(len(buffer), self._budget))
        self._budget -= count
        return count


def _left(end: float) -> float:
    left = end - time.monotonic()
    if left <= 0.0:
        raise TimeoutError
    return left


@cache
def _tls() -> ssl.SSLContext:
    return ssl.create_default_context()
