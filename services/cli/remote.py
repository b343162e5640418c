"""A server's REST interface as Python calls: uploads that go on where they stopped, jobs, events, models, keys.

Answers are plain JSON values, as the server gives them: a newer server may say more than this client knows.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shlex
import stat
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import httpx

from schemas.problem import ExitCode, Problem
from services.cli.packing import Package
from services.cli.transport import Backoff, RefusedRequest, Transport

KEY_VARIABLE = "DIAPHANE_KEY"
JSON = dict[str, Any]
Advance = Callable[[int], None]
"""Is told how many bytes more have arrived."""

FINAL_STATES = ("cancelled", "succeeded", "failed")
_HASHES_PER_REQUEST = 4000
_LONGEST_EVENT = 1 << 20
_LONGEST_POLL_SECONDS = 2.0
_READ_BY_OTHERS = stat.S_IRGRP | stat.S_IROTH


class Remote:
    """A server.

    Args:
        transport: How it is reached.
    """

    def __init__(self, transport: Transport) -> None:
        self.transport = transport

    # Files and scenes

    def missing(self, hashes: Sequence[str]) -> set[str]:
        """Those of some hex sha256 whose content the server does not have yet."""
        lacking: set[str] = set()
        for start in range(0, len(hashes), _HASHES_PER_REQUEST):
            asked = list(hashes[start : start + _HASHES_PER_REQUEST])
            lacking |= set(self._json("POST", "/v1/blobs/missing", json={"sha256": asked})["missing"])
        return lacking

    def upload(self, path: Path, sha256: str, advance: Advance = lambda _: None) -> None:
        """Sends a file in parts; goes on with an upload of the same content that was broken off.

        Args:
            path: The file.
            sha256: Hex hash of its content.
            advance: Is told of each part.

        Raises:
            Problem: The server refuses it, or the file changed meanwhile.
        """
        size = path.stat().st_size
        begun = self._json("POST", "/v1/uploads", json={"sha256": sha256, "bytes": size})
        if begun.get("complete"):
            advance(size)
            return
        received, told = int(begun.get("received", 0)), 0
        with path.open("rb") as stream:
            while True:
                advance(received - told)
                told = received
                stream.seek(received)
                part = stream.read(int(begun["part_bytes"]))
                if received + len(part) > size or (not part and received < size):
                    raise Problem(f"{path} changed while it was uploaded.", "Run it again.", ExitCode.TRY_AGAIN)
                state = self._send_part(begun["id"], received, part)
                received = int(state.get("received", received + len(part)))
                if state.get("complete"):
                    advance(size - told)
                    return

    def _send_part(self, upload: str, offset: int, part: bytes) -> JSON:
        path = f"/v1/uploads/{upload}"
        headers = {"Upload-Offset": str(offset), "Content-Type": "application/octet-stream"}
        try:
            return self._json("PATCH", path, content=part, headers=headers)
        except RefusedRequest as refused:
            if refused.status != httpx.codes.CONFLICT:
                raise
        # The part had arrived, and the answer was lost: the upload itself says where it is.
        state = self._json("GET", path)
        if int(state.get("received", offset)) == offset and not state.get("complete"):
            raise Problem("The server refuses the next part of the upload.", "Run it again.", ExitCode.TRY_AGAIN)
        return state

    def upload_scene(self, package: Package, advance: Callable[[str, int], None] = lambda _name, _bytes: None) -> JSON:
        """Uploads what the server lacks of a scene and registers it; the same files are the same scene.

        Args:
            package: The scene.
            advance: Is told the name of a file and how many bytes of it more have arrived.
        """
        hashes = {name: _sha256(path) for name, path in package.files.items()}
        lacking = self.missing(sorted(set(hashes.values())))
        for name, sha256 in hashes.items():
            if sha256 in lacking:
                self.upload(package.files[name], sha256, lambda count, name=name: advance(name, count))  # type: ignore[misc]
                lacking.discard(sha256)
        body = {"name": package.name, "root": package.root, "files": hashes}
        return self._json("POST", "/v1/scenes", json=body)

    def wait_for_scene(
        self, scene_id: str, patience: float = 1800.0, waiting: Callable[[float, JSON], None] = lambda *_: None
    ) -> JSON:
        """The scene once it has been checked: accepted or rejected.

        Args:
            scene_id: Its id.
            patience: Seconds at most.
            waiting: Is told, now and then, for how many seconds the check has been waited for, and of which scene.

        Raises:
            Problem: It takes longer than `patience` seconds.
        """
        start, wait = time.monotonic(), 0.1
        while True:
            scene = self.scene(scene_id)
            if scene["state"] != "checking":
                return scene
            waited = time.monotonic() - start
            waiting(waited, scene)
            if waited > patience:
                raise Problem(
                    f"The scene {scene_id} is still being checked.",
                    "Look at `diaphane workers`: is there one with the role render? Then run it again.",
                    ExitCode.TRY_AGAIN,
                )
            time.sleep(wait)
            wait = min(_LONGEST_POLL_SECONDS, 1.5 * wait)

    def scene(self, scene_id: str) -> JSON:
        """A scene."""
        return self._json("GET", f"/v1/scenes/{_segment(scene_id)}")

    def scenes(self, limit: int | None = None) -> Iterator[JSON]:
        """Scenes, newest first."""
        return self.transport.items("/v1/scenes", limit=limit)

    # Jobs

    def submit(self, spec: Mapping[str, Any], idempotency_key: str | None = None) -> tuple[JSON, bool]:
        """Submits a job.

        Args:
            spec: A `schemas.job.JobSpec` as JSON.
            idempotency_key: The same key with the same spec is the same job; None: a new job.

        Returns:
            The job, and whether it is new.
        """
        headers = {"Idempotency-Key": idempotency_key or uuid.uuid4().hex}
        response = self.transport.request("POST", "/v1/jobs", json=spec, headers=headers)
        return response.json(), response.status_code != httpx.codes.OK

    def job(self, job_id: str) -> JSON:
        """A job."""
        return self._json("GET", f"/v1/jobs/{_segment(job_id)}")

    def jobs(self, limit: int | None = None, **filters: str | None) -> Iterator[JSON]:
        """Jobs, newest first, by state, kind, name."""
        return self.transport.items("/v1/jobs", filters, limit)

    def cancel(self, job_id: str) -> JSON:
        """Asks a job to stop."""
        return self._json("POST", f"/v1/jobs/{_segment(job_id)}/cancel")

    def retry(self, job_id: str) -> JSON:
        """Lets a failed or cancelled job go on."""
        return self._json("POST", f"/v1/jobs/{_segment(job_id)}/retry", repeatable=False)

    def tasks(self, job_id: str, limit: int | None = None, **filters: str | None) -> Iterator[JSON]:
        """Tasks of a job, by stage and state."""
        return self.transport.items(f"/v1/jobs/{_segment(job_id)}/tasks", filters, limit)

    def past_events(self, job_id: str, after: int = 0) -> Iterator[JSON]:
        """What has happened in a job until now, after the event of that number."""
        path = f"/v1/jobs/{_segment(job_id)}/events"
        while items := self._json("GET", path, params={"after": after})["items"]:
            yield from items
            after = items[-1]["number"]

    def events(self, job_id: str, after: int = 0) -> Iterator[JSON]:
        """What happens in a job, until it ends; each event once, however often the connection breaks.

        Args:
            job_id: The job.
            after: Number of the last event that is known already.

        Raises:
            Problem: There is no such job, or the server is away for too long.
        """
        # Where events cannot be streamed, as behind some proxies, they are asked for again and again instead.
        backoff = Backoff(math.inf)
        while True:
            asked = None
            try:
                for event in self._listen(job_id, after):
                    after, backoff = event["number"], Backoff(math.inf)
                    yield event
            except httpx.TransportError:
                pass  # the next request waits for the server to come back, or says that it does not
            except RefusedRequest as refused:
                if refused.code is not ExitCode.TRY_AGAIN:
                    raise
                asked = refused.retry_after
            ended = self.job(job_id)["state"] in FINAL_STATES
            for event in self.past_events(job_id, after):
                after = event["number"]
                yield event
            if ended:
                return
            backoff.pause(asked)

    def _listen(self, job_id: str, after: int) -> Iterator[JSON]:
        headers = {"Accept": "text/event-stream", "Cache-Control": "no-store", "Last-Event-ID": str(after)}
        with self.transport.stream(f"/v1/jobs/{_segment(job_id)}/events", headers=headers) as response:
            yield from server_sent(response.iter_bytes())

    # Data sets, measurements, models

    def dataset(self, dataset_id: str) -> JSON:
        """A data set."""
        return self._json("GET", f"/v1/datasets/{_segment(dataset_id)}")

    def datasets(self, limit: int | None = None) -> Iterator[JSON]:
        """Data sets, newest first."""
        return self.transport.items("/v1/datasets", limit=limit)

    def measurements(self, limit: int | None = None, **filters: str | float | None) -> Iterator[JSON]:
        """Measurements by scene, technique, budget, model, job, since, until."""
        return self.transport.items("/v1/measurements", filters, limit)

    def models(self) -> Iterator[JSON]:
        """All names of the registry."""
        return self.transport.items("/v1/models")

    def versions(self, name: str) -> Iterator[JSON]:
        """The versions of a name."""
        return self.transport.items(f"/v1/models/{_segment(name)}/versions")

    def version(self, name: str, selector: str) -> JSON:
        """A version by number or alias."""
        return self._json("GET", f"/v1/models/{_segment(name)}/versions/{_segment(selector)}")

    def aliases(self, name: str) -> JSON:
        """Aliases of a name and the history of their moves."""
        return self._json("GET", f"/v1/models/{_segment(name)}/aliases")

    def move_alias(self, name: str, alias: str, version: str, reason: str) -> JSON:
        """Points an alias at a version."""
        path = f"/v1/models/{_segment(name)}/aliases/{_segment(alias)}"
        return self._json("PUT", path, json={"version": version, "reason": reason})

    def roll_back(self, name: str, alias: str, reason: str) -> JSON:
        """Points an alias at the version that it meant before."""
        path = f"/v1/models/{_segment(name)}/aliases/{_segment(alias)}/rollback"
        return self._json("POST", path, json={"reason": reason}, repeatable=False)

    # Keys and workers

    def create_key(
        self, name: str, scopes: Sequence[str], expires: str | None, bounds: Mapping[str, int | None]
    ) -> JSON:
        """Makes a key; its secret is in this answer and nowhere else."""
        body = {"name": name, "scopes": list(scopes), "expires": expires, "bounds": dict(bounds)}
        return self._json("POST", "/v1/keys", json=body, repeatable=False)

    def keys(self) -> Iterator[JSON]:
        """All keys, without their secrets."""
        return self.transport.items("/v1/keys")

    def revoke_key(self, key_id: str) -> None:
        """Ends a key."""
        self.transport.request("DELETE", f"/v1/keys/{_segment(key_id)}")

    def workers(self) -> JSON:
        """Queues, and the processes that run work."""
        return self._json("GET", "/v1/workers")

    def _json(self, method: str, path: str, **options: Any) -> JSON:
        answer: JSON = self.transport.request(method, path, **options).json()
        return answer


def read_key(key_file: Path | None) -> str | None:
    """The API key: from a file, else from the environment; None if there is none.

    Raises:
        Problem: The file cannot be read, others of this machine can read it, or what is there cannot be a key.
    """
    source, text, mode = f"The variable {KEY_VARIABLE}", os.environ.get(KEY_VARIABLE, ""), 0
    if key_file is not None:
        source = f"The file {key_file}"
        try:
            mode = key_file.stat().st_mode
            text = key_file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise Problem(f"{source} cannot be read.", "Check the path of the key file.", ExitCode.AUTH) from error
    key = text.strip()
    if not (key.isascii() and key.isprintable()) or " " in key:
        raise Problem(f"{source} does not hold an API key.", "A key is one word: dia_...", ExitCode.AUTH)
    if mode & _READ_BY_OTHERS:
        raise Problem(
            f"{source} can be read by other users of this machine.",
            f"Keep it to yourself: `chmod 600 {shlex.quote(str(key_file))}`.",
            ExitCode.AUTH,
        )
    return key or None


def open_remote(url: str, key: str | None, **patience: float) -> Remote:
    """The server at a URL, asked with a key; None: without."""
    return Remote(Transport(url, key, **patience))


def server_sent(chunks: Iterator[bytes]) -> Iterator[JSON]:
    """Events of a `text/event-stream`: number, kind, and the fields of their data.

    Lines end with LF or CRLF only: a JSON text may hold other characters that Unicode calls line ends.

    Raises:
        httpx.RemoteProtocolError: An event is no JSON object, or longer than any of this service.
    """
    buffer, fields = b"", dict[str, str]()
    for chunk in chunks:
        *lines, buffer = (buffer + chunk).split(b"\n")
        if len(buffer) > _LONGEST_EVENT:
            raise httpx.RemoteProtocolError("an event is too long")
        for line in lines:
            name, _, value = line.removesuffix(b"\r").decode("utf-8", "replace").partition(":")
            if name:
                value = value.removeprefix(" ")
                fields[name] = f"{fields[name]}\n{value}" if name == "data" and name in fields else value
            elif not line.strip():
                if "data" in fields and "id" in fields:
                    yield _event(fields)
                fields = {}


def _event(fields: Mapping[str, str]) -> JSON:
    try:
        data, number = json.loads(fields["data"]), int(fields["id"])
    except ValueError as error:
        raise httpx.RemoteProtocolError("an event cannot be read") from error
    if isinstance(data, dict) and {"kind", "data"} <= set(data):
        return {**data, "number": number}
    return {"number": number, "kind": fields.get("event", "log"), "data": data}


def _segment(text: str) -> str:
    """A part of a path that cannot become several.

    Raises:
        Problem: It is none.
    """
    if not text or text in (".", "..") or not all(c.isascii() and (c.isalnum() or c in "-._") for c in text):
        raise Problem(f"'{text}' is not a name or id.", "Copy it from the output of the list command.")
    return text


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
