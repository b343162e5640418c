"""What is asked of the server: what an alias means, a version's record, and files by hash.

Downloads of files go on where they were cut.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import httpx

from diaphane_client.connection import BadKey, BadUrl, connect
from diaphane_client.errors import Denied, NotFound, PullError, Refused, Unavailable
from diaphane_client.files import file_sha256
from diaphane_client.manifest import FileRef
from diaphane_client.pointer import MAX_POINTER_BYTES
from diaphane_client.release import MAX_RECORD_BYTES

ATTEMPTS = 6
"""How often in a row a download may stop before the server is taken for unavailable."""
FIRST_WAIT = 0.1
"""Seconds before a stopped download goes on; doubled each time."""


class Server:
    """A Diaphane server.

    Args:
        url: Where it is, without `/v1`.
        key: API key with the scope `read`; None: no key.
        timeout: Seconds without a byte after which a connection is given up.

    Raises:
        NotFound: The URL is not one.
        Denied: The key is not one.
    """

    def __init__(self, url: str, key: str | None, timeout: float) -> None:
        try:
            self._http = connect(url, key, timeout, {"Accept-Encoding": "identity"})
        except BadUrl as error:
            raise NotFound(error.what, error.remedy) from error
        except BadKey as error:
            raise Denied(str(error), "A key is one word: dia_...") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._http.close()

    def pointer(self, name: str, selector: str) -> bytes:
        """The statement of what an alias or a version means now; no cache on the way is to answer for the server.

        Raises:
            PullError: There is no such alias or version, or the server cannot or will not tell.
        """
        return self._small(f"/v1/models/{name}/pointers/{selector}", f"'{name}' {selector}", MAX_POINTER_BYTES)

    def record(self, name: str, version: str) -> bytes:
        """The record of a version.

        Raises:
            PullError: There is no such version, or the server cannot or will not tell.
        """
        return self._small(f"/v1/models/{name}/versions/{version}", f"'{name}' {version}", MAX_RECORD_BYTES)

    def download(self, file: FileRef, part: Path) -> None:
        """Downloads a file by its hash.

        Args:
            file: Size and hash.
            part: Where to; what is there from an earlier attempt is not downloaded again.

        Raises:
            Refused: The server's bytes do not have that hash.
            PullError: The server cannot be reached, or does not have the file.
            OSError: The disk cannot be written.
        """
        resumed = part.exists() and part.stat().st_size > 0
        self._complete(file, part)
        if file_sha256(part) == file.sha256:
            return
        part.unlink()
        if resumed:  # what was there before may be what is wrong
            self._complete(file, part)
            if file_sha256(part) == file.sha256:
                return
            part.unlink()
        raise Refused(
            f"The server's bytes for {file.sha256} do not have that hash.",
            "Try again; if it stays so, the server or the way to it is damaged or tampered with.",
        )

    def _small(self, path: str, what: str, limit: int) -> bytes:
        with _reported(), self._http.stream("GET", path, headers={"Cache-Control": "no-cache"}) as answer:
            _check_status(answer, what)
            content = b""
            for chunk in answer.iter_raw():
                content += chunk
                if len(content) > limit:
                    raise Refused(f"The server's answer about {what} is too long.", "Check the URL.")
            return content

    def _complete(self, file: FileRef, part: Path) -> None:
        """Appends to a part until it has its size; attempts that add nothing are counted."""
        part.touch()
        failures = 0
        while (start := part.stat().st_size) != file.bytes:
            if start > file.bytes:
                part.unlink()
                part.touch()
                start = 0
            try:
                self._append(file, part, start)
                stopped: PullError = Unavailable("The server ended a download early.", "Try again.")
            except Unavailable as error:
                stopped = error
            if part.stat().st_size > start:
                failures = 0
                continue
            failures += 1
            if failures >= ATTEMPTS:
                raise stopped
            time.sleep(FIRST_WAIT * 2.0 ** (failures - 1))

    def _append(self, file: FileRef, part: Path, start: int) -> None:
        headers = {"Range": f"bytes={start}-"} if start else {}
        with _reported(), self._http.stream("GET", f"/v1/blobs/sha256/{file.sha256}", headers=headers) as answer:
            _check_status(answer, f"the file {file.sha256}")
            goes_on = answer.headers.get("Content-Range", "").startswith(f"bytes {start}-")
            if start and answer.status_code == httpx.codes.PARTIAL_CONTENT and not goes_on:
                raise Refused("The server sent another part of a file than was asked for.", "Try again.")
            if answer.status_code == httpx.codes.OK:
                start = 0  # the server knows no ranges
            with part.open("r+b") as stream:
                stream.truncate(start)
                stream.seek(start)
                for chunk in answer.iter_raw():
                    start += len(chunk)
                    if start > file.bytes:
                        raise Refused("The server sent more of a file than it has.", "Try again.")
                    stream.write(chunk)


@contextmanager
def _reported() -> Iterator[None]:
    try:
        yield
    except httpx.HTTPError as error:
        raise Unavailable(
            f"The server cannot be reached ({type(error).__name__}).", "Check the URL and the network, and try again."
        ) from error


def _check_status(answer: httpx.Response, what: str) -> None:
    status = answer.status_code
    if status in (httpx.codes.OK, httpx.codes.PARTIAL_CONTENT):
        return
    if status in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
        raise Denied(f"The server does not let this key read {what}.", "Give a key with the scope `read`.")
    if status == httpx.codes.NOT_FOUND:
        raise NotFound(f"The server does not have {what}.", "Look at `diaphane models list` for what it has.")
    if status == httpx.codes.TOO_MANY_REQUESTS or status >= httpx.codes.INTERNAL_SERVER_ERROR:
        raise Unavailable(f"The server cannot answer now (status {status}).", "Try again later.")
    raise Refused(f"The server answered with status {status} when asked for {what}.", "Check the URL.")
