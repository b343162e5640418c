"""The API is killed while it answers; clients repeat what they asked, and miss nothing."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
from support.chaos.arena import Arena
from support.chaos.settled import require
from support.cluster import API
from support.workers import until


@pytest.mark.parametrize(
    ("point", "seed"), [pytest.param("submit:begin", 10, marks=pytest.mark.mainly("sqlite")), ("submit:end", 13)]
)
def test_a_submission_that_is_cut_off_is_repeated_and_is_one_job(arena: Arena, point: str, seed: int) -> None:
    spec = arena.spec(f"cut-{point.partition(':')[2]}", seed)
    with arena.gates(point), ThreadPoolExecutor() as threads:
        answer = threads.submit(arena.post, spec, f"once-{point}")
        arena.reached(point)
        arena.kill(arena.of(API), restart=False)
        with pytest.raises(httpx.TransportError):
            answer.result(10.0)
    arena.start(API)
    again = arena.post(spec, f"once-{point}")
    assert again.status_code == (200 if point == "submit:end" else 202), again.text
    jobs = arena.service.jobs.list(name=spec["name"])
    assert [job.id for job in jobs] == [again.json()["id"]]
    arena.wait(jobs[0].id)
    require(arena, [jobs[0].id], in_vain=0)


def test_identical_submissions_at_the_same_moment_are_one_job(arena: Arena) -> None:
    spec = arena.spec("together", seed=11)
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda _: arena.post(spec, "together"), range(8)))
    assert sorted(answer.status_code for answer in answers) == [200] * 7 + [202]
    (job_id,) = {answer.json()["id"] for answer in answers}
    arena.wait(job_id)
    require(arena, [job_id], in_vain=0)


@pytest.mark.mainly("postgresql")
def test_a_listener_whose_server_is_killed_goes_on_where_it_was(arena: Arena) -> None:
    with arena.gates("label:begin"):
        job_id = arena.submit("heard", seed=12)
        heard: list[str] = []
        listener = threading.Thread(target=_listen, args=(arena, job_id, heard, 0))
        listener.start()
        arena.reached("label:begin")
        until(lambda: heard)
        arena.kill(arena.of(API))
        listener.join(10.0)
        assert not listener.is_alive()
        arena.ready(arena.of(API))
    _listen(arena, job_id, heard, int(heard[-1]))
    arena.wait(job_id)
    assert heard == [str(event.number) for event in arena.service.jobs.events(job_id)]
    require(arena, [job_id], in_vain=0)


def _listen(arena: Arena, job_id: str, heard: list[str], after: int) -> None:
    """Collects the ids of events until the stream ends or breaks."""
    headers: dict[str, Any] = {"Accept": "text/event-stream", "Last-Event-ID": str(after)}
    try:
        with arena.client() as client, client.stream("GET", f"/v1/jobs/{job_id}/events", headers=headers) as answer:
            assert answer.status_code == 200
            for line in answer.iter_lines():
                if line.startswith("id:"):
                    heard.append(line.partition(":")[2].strip())
    except httpx.TransportError:
        return
