"""Two servers behind nginx as it is deployed: they and all workers are restarted one after the other under load."""

from __future__ import annotations

import itertools
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from support.chaos.arena import Arena
from support.chaos.settled import require
from support.cluster import API, ROLES, Cluster
from support.nginx import nginx
from support.workers import until

READS = ("/v1/jobs?limit=5", "/v1/workers", "/v1/scenes?limit=1")
READERS = 2
SUBMIT_SECONDS = 0.2
JOBS = 4
"""That are submitted again and again, as clients do that miss an answer."""


@dataclass
class Load:
    """What clients saw.

    Attributes:
        done: Requests that were answered as they should.
        failed: Method, path and what came instead, of the others.
        jobs: Ids of jobs that were accepted.
    """

    done: int = 0
    failed: list[tuple[str, str, str]] = field(default_factory=list)
    jobs: set[str] = field(default_factory=set)


@pytest.mark.only("postgresql")
@pytest.mark.skipif(shutil.which("nginx") is None, reason="nginx is not installed: apt-get install nginx-light")
def test_a_rolling_restart_fails_no_request_and_a_kill_only_what_was_under_way(arena: Arena, tmp_path: Path) -> None:
    (second,) = arena.start(API)
    servers = [arena.of(API), second]
    try:
        with nginx(tmp_path, [member.slot.port for member in servers]) as url:
            with _load(arena, url) as load:
                until(lambda: len(load.jobs) == JOBS)
                for server in servers:
                    arena.restart(server)
                arena.restart(*(arena.of(role) for role in ROLES))
                seen = load.done
                until(lambda: load.done > seen + 20)
            assert load.failed == []
            arena.wait(*load.jobs)
            require(arena, sorted(load.jobs), in_vain=len(ROLES) - 1)
            with _load(arena, url) as load:
                until(lambda: load.done > 5)
                Cluster.kill(arena, next(member for member in arena.members if member.slot == second.slot))
                seen = load.done
                until(lambda: load.done > seen + 20)
            assert [method for method, _, _ in load.failed] in ([], ["POST"]), "what may have changed something"
            arena.wait(*load.jobs)
    finally:
        arena.kill(next(member for member in arena.members if member.slot == second.slot), restart=False)


@contextmanager
def _load(arena: Arena, url: str) -> Iterator[Load]:
    """Clients that ask and submit without a pause longer than a moment."""
    load, end = Load(), threading.Event()

    def send(client: httpx.Client, method: str, path: str, **options: object) -> httpx.Response | None:
        try:
            answer = client.request(method, path, **options)  # type: ignore[arg-type]
        except httpx.TransportError as error:
            load.failed.append((method, path, repr(error)))
            return None
        if answer.is_success:
            load.done += 1
            return answer
        load.failed.append((method, path, f"{answer.status_code} {answer.text}"))
        return None

    def read() -> None:
        with arena.client(url) as client:
            while not end.wait(0.01):
                for path in READS:
                    send(client, "GET", path)

    def submit() -> None:
        first = 100_000 + len(arena.trace())  # no two jobs of the shared service are alike
        with arena.client(url) as client:
            for number in itertools.cycle(range(first, first + JOBS)):
                headers = {"Idempotency-Key": f"rolling-{number}"}
                answer = send(client, "POST", "/v1/jobs", json=arena.spec("rolling", number), headers=headers)
                if answer is not None:
                    load.jobs.add(str(answer.json()["id"]))
                if end.wait(SUBMIT_SECONDS):
                    return

    threads = [threading.Thread(target=target) for target in (*[read] * READERS, submit)]
    for thread in threads:
        thread.start()
    try:
        yield load
    finally:
        end.set()
        for thread in threads:
            thread.join()
