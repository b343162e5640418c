"""Clients: readers of blobs and measurements, those that submit jobs, those that listen to events.

Every answer is checked: status, length, the hash of a part of the blobs, filter and order of measurements, numbers of
events.
"""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Sequence
from contextlib import aclosing
from dataclasses import dataclass
from datetime import datetime
from typing import Any
from urllib.parse import urlencode

from benchmarks.load.figures import Tally
from benchmarks.load.http import Answer, ClientError, Connection
from benchmarks.load.seed import BUDGETS, LARGE, NAMES, SCENES, SMALL, TECHNIQUES, Seed

FAULTS = (ClientError, OSError, TimeoutError, ValueError, KeyError, IndexError)
FINAL = ("succeeded", "failed", "cancelled")
PAGES = 3
"""Of a query of measurements that are read at most."""
REPEAT_EVERY = 20
"""Every so many submissions are sent a second time."""
RECONNECT_AFTER = 25
"""Events, after which every fifth listener connects anew."""


@dataclass(frozen=True)
class Mix:
    """How many readers of each kind, and how they read.

    Attributes:
        small: Of blobs of 64 KiB.
        large: Of blobs of 8 MiB.
        measurements: Of measurements, and now and then of versions and jobs.
        think: Mean seconds between an answer and the next request of a reader, exponentially distributed; 0: none.
        hash_every: Every so many blobs are hashed.
    """

    small: int = 50
    large: int = 10
    measurements: int = 40
    think: float = 1.0
    hash_every: int = 8


async def read_all(port: int, seed: Seed, mix: Mix, seconds: float) -> Tally:
    """Runs all readers for some seconds."""
    tally, end = Tally(), time.perf_counter() + seconds
    kinds = [*["small"] * mix.small, *["large"] * mix.large, *["measurements"] * mix.measurements]

    async def reader(number: int, kind: str) -> None:
        draw = random.Random(number)
        async with Connection(port, seed.key) as connection:
            while time.perf_counter() < end:
                await asyncio.sleep(draw.expovariate(1.0 / mix.think) if mix.think else 0.0)
                if kind == "measurements":
                    await _read_records(connection, draw, tally)
                else:
                    await _read_blob(connection, kind, seed, draw, tally, mix.hash_every)

    await asyncio.gather(*(reader(number, kind) for number, kind in enumerate(kinds)))
    return tally


async def submit_all(
    port: int, seed: Seed, specs: Sequence[dict[str, Any]], per_second: float, tally: Tally, clients: int = 4
) -> list[str]:
    """Submits jobs, some of them twice; ids of those that were accepted.

    Args:
        port: Of the service.
        seed: What it holds.
        specs: The jobs.
        per_second: How many a second are sent.
        tally: What happened.
        clients: How many at once.
    """
    found: list[str] = []
    begun, waiting = time.perf_counter(), iter(list(enumerate(specs)))

    async def client() -> None:
        async with Connection(port, seed.key) as connection:
            for number, spec in waiting:
                await asyncio.sleep(max(0.0, begun + number / per_second - time.perf_counter()))
                first = await _submit(connection, spec, f"load-{begun}-{number}", 202, "submit job", tally)
                if first is not None:
                    found.append(first)
                if number % REPEAT_EVERY == 0:
                    again = await _submit(connection, spec, f"load-{begun}-{number}", 200, "submit job again", tally)
                    if first != again:
                        tally.wrong("submit job again", "another job")

    await asyncio.gather(*(client() for _ in range(clients)))
    return found


async def listen_all(port: int, key: str, jobs: Sequence[str], tally: Tally, end: float) -> int:
    """Listens to jobs, one listener for each entry, until they have ended; how many streams ended well.

    Args:
        port: Of the service.
        key: API key.
        jobs: A job may be listed more than once.
        tally: What happened; the seconds of `event` are from its writing to its arrival.
        end: On the clock of `time.perf_counter`: streams that have not ended by then are errors.
    """

    async def listener(number: int, job_id: str) -> bool:
        try:
            async with asyncio.timeout(max(0.0, end - time.perf_counter())):
                return await _listen(port, key, job_id, number % 5 == 0, tally)
        except FAULTS as error:
            tally.wrong("event", f"{type(error).__name__}: {error}")
            return False

    ended = await asyncio.gather(*(listener(number, job_id) for number, job_id in enumerate(jobs)))
    return sum(ended)


async def pages(connection: Connection, path: str) -> list[dict[str, Any]]:
    """All items of a list.

    Raises:
        ClientError: A page is refused.
    """
    found: list[dict[str, Any]] = []
    following: str | None = path
    while following:
        answer = await connection.request("GET", following)
        if answer.status != 200:
            raise ClientError(f"{following} answered {answer.status}")
        found += answer.json()["items"]
        following = answer.next
    return found


async def _listen(port: int, key: str, job_id: str, leaves: bool, tally: Tally) -> bool:
    last, kind, state, cut = 0, "", "", True
    while cut:
        cut, since, begun = False, time.time(), last
        async with Connection(port, key) as connection:
            stream = connection.events(f"/v1/jobs/{job_id}/events", {"Last-Event-ID": str(last)})
            async with aclosing(stream) as events:  # type: ignore[type-var]
                async for number, record in events:
                    if number != last + 1:
                        raise ClientError(f"event {number} came after {last}")
                    last, kind, state = number, record["kind"], record["data"].get("state", "")
                    written = datetime.fromisoformat(record["at"]).timestamp()
                    if written >= since:
                        tally.took("event", time.time() - written)
                    if leaves and number - begun >= RECONNECT_AFTER:
                        cut = True
                        break
    if kind != "state" or state not in FINAL:
        raise ClientError(f"the events ended with {kind} {state}")
    return True


async def _submit(
    connection: Connection, spec: dict[str, Any], name: str, status: int, operation: str, tally: Tally
) -> str | None:
    try:
        answer = await connection.request("POST", "/v1/jobs", headers={"Idempotency-Key": name}, document=spec)
        if answer.status != status:
            tally.wrong(operation, answer.status)
            return None
        tally.took(operation, answer.seconds)
        return str(answer.json()["id"])
    except FAULTS as error:
        tally.wrong(operation, f"{type(error).__name__}: {error}")
        return None


async def _read_blob(
    connection: Connection, kind: str, seed: Seed, draw: random.Random, tally: Tally, hash_every: int
) -> None:
    size, name = (SMALL, "blob 64 KiB") if kind == "small" else (LARGE, "blob 8 MiB")
    sha256 = draw.choice(seed.small if kind == "small" else seed.large)
    chance = draw.random()
    headers, expected, length = {}, 200, size
    if chance < 0.1:
        name, headers, expected, length = "blob, not modified", {"If-None-Match": f'"{sha256}"'}, 304, 0
    elif chance < 0.2:
        first = draw.randrange(size - 4096)
        headers = {"Range": f"bytes={first}-{first + 4095}"}
        name, expected, length = "blob, range of 4 KiB", 206, 4096
    whole = expected == 200 and draw.randrange(hash_every) == 0
    try:
        answer = await connection.request(
            "GET", f"/v1/blobs/sha256/{sha256}", headers=headers, digest=whole, keep=False
        )
    except FAULTS as error:
        tally.wrong(name, f"{type(error).__name__}: {error}")
        return
    wrong = _blob_fault(answer, expected, length, sha256)
    if wrong:
        tally.wrong(name, wrong)
    else:
        tally.took(name, answer.seconds, answer.bytes)


def _blob_fault(answer: Answer, status: int, length: int, sha256: str) -> str:
    if answer.status != status:
        return str(answer.status)
    if answer.bytes != length:
        return f"{answer.bytes} bytes"
    return "other bytes" if answer.sha256 not in (None, sha256) else ""


async def _read_records(connection: Connection, draw: random.Random, tally: Tally) -> None:
    """One query of measurements with its pages, or a page of versions or jobs."""
    chance = draw.random()
    name, path, wanted = "measurements", "", {}
    if chance < 0.05:
        name, path = "versions", f"/v1/models/{draw.choice(NAMES)}/versions?limit=50"
    elif chance < 0.10:
        name, path = "jobs", "/v1/jobs?limit=50"
    else:
        wanted = _filter(draw)
        path = f"/v1/measurements?{urlencode({**wanted, 'limit': draw.choice((20, 50, 200))})}"
    following: str | None = path
    last = 2**53
    for page in range(PAGES):
        label = f"{name}, next page" if page else name
        try:
            assert following is not None
            answer = await connection.request("GET", following)
            if answer.status != 200:
                tally.wrong(label, answer.status)
                return
            if name == "measurements":
                last = _check_measurements(answer.json()["items"], wanted, last)
        except FAULTS as error:
            tally.wrong(label, f"{type(error).__name__}: {error}")
            return
        tally.took(label, answer.seconds, answer.bytes)
        following = answer.next
        if following is None or name != "measurements":
            return


def _filter(draw: random.Random) -> dict[str, Any]:
    choices = {
        "scene": draw.choice(SCENES),
        "technique": draw.choice(TECHNIQUES),
        "budget": draw.choice(BUDGETS),
        "model": draw.choice(NAMES),
    }
    return {name: choices[name] for name in draw.sample(list(choices), draw.randrange(3))}


def _check_measurements(items: list[dict[str, Any]], wanted: dict[str, Any], last: int) -> int:
    """The last id of a page that is as it should be.

    Raises:
        ClientError: It is not.
    """
    for item in items:
        if item["id"] >= last:
            raise ClientError("measurements are not newest first")
        last, found = item["id"], item["measurement"]
        values = {"scene": found["scene"], "technique": found["technique"], "budget": found["budget_factor"]}
        values["model"] = (item["model"] or "").partition("@")[0]
        if any(values[name] != value for name, value in wanted.items()):
            raise ClientError("a measurement is none of those that were asked for")
    return last
