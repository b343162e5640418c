"""Processes that are killed in the middle of every stage and at every boundary between them."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.chaos.arena import Arena
from support.chaos.probe import POINTS
from support.chaos.settled import require
from support.postgres import Postgres

SELECTION = {
    "sqlite": (
        *("scene:begin", "map:render:begin", "render:kept", "label:end", "train:kept"),
        *("evaluate:begin", "publish:middle", "map:report:begin"),
    ),
    "postgresql": (
        *("scene:kept", "render:begin", "map:label:end", "train:begin"),
        *("export:kept", "publish:end", "step:publish:end", "report:begin"),
    ),
}


def test_whoever_is_killed_and_wherever_the_job_goes_on_and_publishes_once(
    arena: Arena, kind: str, request: pytest.FixtureRequest
) -> None:
    points = POINTS if request.config.getoption("--all-points", False) else SELECTION[kind]
    # A champion that the job begins with, and that its own version takes the place of.
    arena.wait(arena.submit("kills", seed=0))
    before = arena.allowance
    with arena.gates(*points):
        job_id = arena.submit("kills", seed=1, start_from="champion")
        for point in points:
            arena.kill(arena.owner(arena.reached(point)))
            arena.open(point)
        (job,) = arena.wait(job_id)
    assert (job.state, job.attempt) == ("succeeded", 1), job.problem
    require(arena, [job_id], arena.allowance - before)
    assert job.result is not None
    assert job.result["champion"], "it is better than the one before, whoever asked again"


def test_what_was_not_pushed_to_the_object_store_is_made_again(tmp_path: Path, postgres: Postgres, s3_url: str) -> None:
    # At `kept` the artifact lies on the worker's own disk only, and the worker's successor has another one.
    points = ("render:kept", "train:begin", "publish:middle")
    with Arena(tmp_path, postgres.new_database(), s3_url) as arena:
        arena.start("jobs", "render,label", "train")
        with arena.gates(*points):
            job_id = arena.submit("far", seed=1)
            for point in points:
                arena.kill(arena.owner(arena.reached(point)))
                arena.open(point)
            (job,) = arena.wait(job_id)
        assert (job.state, job.attempt) == ("succeeded", 1), job.problem
        require(arena, [job_id], arena.allowance)
