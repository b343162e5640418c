"""Disks that are full, artifacts that are torn, processes that sleep, databases that restart, owners who cancel."""

from __future__ import annotations

import os
import signal
import time

import pytest
from support.chaos.arena import TTL_SECONDS, Arena, pause
from support.chaos.bodies import DATA
from support.chaos.probe import STAGES
from support.chaos.settled import require
from support.postgres import Postgres
from support.workers import alive, until

from stages.desk import BUNDLE
from stages.tasks import FACTS


@pytest.mark.mainly("sqlite")
def test_a_full_disk_delays_a_task_and_fails_a_publication_that_a_retry_repeats(arena: Arena) -> None:
    with arena.gates("render:begin", "publish:begin"):
        job_id = arena.submit("disk", seed=3)
        arena.reached("render:begin")
        arena.disk.fill()
        arena.open("render:begin")
        until(lambda: "No space left" in _told(arena, job_id))
        arena.disk.free()
        arena.reached("publish:begin")
        if arena.disk.is_real:
            arena.disk.fill()
            arena.open("publish:begin")
            (job,) = arena.wait(job_id)
            assert job.state == "failed"
            assert job.problem is not None
            assert "No space left" in job.problem.detail
            assert arena.service.registry.versions("disk") == []
            arena.disk.free()
            arena.service.jobs.retry(job_id)
        arena.open("publish:begin")
        (job,) = arena.wait(job_id)
    assert job.state == "succeeded", job.problem
    require(arena, [job_id], in_vain=2 * 3)


@pytest.mark.mainly("postgresql")
def test_a_torn_artifact_is_made_again(arena: Arena) -> None:
    torn = {
        "map:render:end": ("render", DATA),
        "map:label:end": ("label", FACTS),
        "map:export:end": ("export", f"{BUNDLE}/weights.safetensors"),
        "publish:begin": ("evaluate", DATA),
    }
    with arena.gates(*torn):
        job_id = arena.submit("torn", seed=4)
        for point, (stage, name) in torn.items():
            arena.reached(point)
            _tear(arena, job_id, stage, name)
            arena.open(point)
        (job,) = arena.wait(job_id)
    assert job.state == "succeeded", job.problem
    found = require(arena, [job_id], in_vain=len(torn))
    assert found.bodies == found.artifacts + len(torn)


@pytest.mark.mainly("postgresql")
def test_a_bundle_that_is_torn_just_before_it_is_published_is_made_again(arena: Arena) -> None:
    with arena.gates("map:evaluate:end"):
        job_id = arena.submit("torn-bundle", seed=5)
        arena.reached("map:evaluate:end")
        _tear(arena, job_id, "export", f"{BUNDLE}/weights.safetensors")
        arena.open("map:evaluate:end")
        (job,) = arena.wait(job_id)
    assert job.state == "succeeded", job.problem
    require(arena, [job_id], in_vain=1)


@pytest.mark.mainly("postgresql")
def test_what_was_stopped_for_longer_than_the_ttl_is_taken_over_and_its_late_work_refused(
    arena: Arena, kind: str
) -> None:
    locked = arena.folder / "chaos.sqlite" if kind == "sqlite" else None
    with arena.gates("publish:begin", "label:begin"):
        arena.start("label", wait=False)
        first, second = arena.submit("stopped", seed=6), arena.submit("stopped", seed=7)
        line = arena.reached("label:begin")
        worker = arena.owner(line)
        os.kill(line["pid"], signal.SIGSTOP)
        pause(worker, locked)
        arena.open("label:begin")
        conductor = arena.owner(arena.reached("publish:begin"))
        pause(conductor, locked)
        arena.open("publish:begin")
        stopped = time.monotonic()
        jobs = arena.wait(first, second)
        assert time.monotonic() - stopped < 10 * TTL_SECONDS
        for member in (worker, conductor):
            member.resume()
        if alive(line["pid"]):
            os.kill(line["pid"], signal.SIGCONT)
    assert {job.state for job in jobs} == {"succeeded"}, [job.problem for job in jobs]
    time.sleep(1.0)
    require(arena, [first, second], in_vain=2)
    assert worker.is_running()
    assert conductor.is_running()


@pytest.mark.mainly("sqlite")
def test_a_cancelled_job_ends_at_every_stage_and_a_retry_goes_on(arena: Arena) -> None:
    stages = [*STAGES[:-1], "publish", STAGES[-1]]
    points = [f"{stage}:begin" for stage in stages]
    with arena.gates(*points):
        job_id = arena.submit("cancelled", seed=8)
        for point in points:
            line = arena.reached(point)
            arena.service.jobs.cancel(job_id)
            if "artifact" in line:
                # Two workers of a role may both have a task there.
                until(lambda at=point: not any(map(alive, _children_at(arena, at))), 5.0)
            arena.open(point)
            (job,) = arena.wait(job_id)
            assert job.state == "cancelled"
            before = _artifacts(arena)
            assert not [task for task in arena.service.jobs.tasks(job_id) if task.state in ("queued", "running")]
            time.sleep(0.3)
            assert _artifacts(arena) == before, "nothing is written for a job that was cancelled"
            arena.service.jobs.retry(job_id)
        (job,) = arena.wait(job_id)
    assert (job.state, job.attempt) == ("succeeded", 1 + len(points)), job.problem
    # A stage's second task may run in the second worker of its role.
    require(arena, [job_id], in_vain=2 * len(points))


@pytest.mark.only("postgresql")
def test_a_restart_of_postgresql_loses_and_repeats_nothing(arena: Arena, postgres: Postgres) -> None:
    points = ("evaluate:begin", "publish:middle")
    with arena.gates(*points):
        job_id = arena.submit("restart", seed=9)
        for point in points:
            arena.reached(point)
            postgres.stop("immediate")
            arena.open(point)
            time.sleep(0.5)
            postgres.start()
        (job,) = arena.wait(job_id)
    assert (job.state, job.attempt) == ("succeeded", 1), job.problem
    require(arena, [job_id], in_vain=len(points))
    assert arena.client().get("/v1/health/ready").status_code == 200


def _told(arena: Arena, job_id: str) -> str:
    return str([event.data for event in arena.service.jobs.events(job_id)])


def _tear(arena: Arena, job_id: str, stage: str, name: str) -> None:
    """Cuts a file of the job's last artifact of a stage in half."""
    task = arena.service.jobs.tasks(job_id, stage=stage)[-1]
    path = arena.service.storage.store.fetch(task.artifact) / name
    os.truncate(path, path.stat().st_size // 2)


def _children_at(arena: Arena, point: str) -> set[int]:
    """Processes of tasks that came to a point since the gates were shut."""
    return {line["pid"] for line in arena.trace()[arena.mark :] if line["point"] == point and "artifact" in line}


def _artifacts(arena: Arena) -> set[str]:
    return {found.artifact for found in arena.service.storage.store.artifacts()}
