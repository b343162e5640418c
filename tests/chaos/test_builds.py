"""Real work, on PostgreSQL and an object store, while processes are killed: the benchmark in small."""

from __future__ import annotations

from pathlib import Path

from support.postgres import Postgres
from support.s3 import S3Server

from benchmarks.chaos.run import Plan, run

PROCESSES = ("api", "jobs,render,label")
QUICK = {"HEARTBEAT": "0.25", "TTL": "3", "POLL": "0.1", "DRAIN_SECONDS": "5"}


def test_labels_are_those_of_undisturbed_work_and_nothing_is_left(
    tmp_path: Path, postgres: Postgres, s3: S3Server
) -> None:
    digests = []
    for name, plan in (("calm", None), ("stormy", Plan(kills=3, away_seconds=0.0))):
        folder = tmp_path / name
        folder.mkdir()
        found = run(folder, postgres, s3, 1, plan, PROCESSES, QUICK, scenes=1, kind="label")
        assert not found.settled.faults, found.settled.faults
        assert found.left == {}
        assert all(kill.seconds is not None for kill in found.kills), found.kills
        assert len(found.kills) == (0 if plan is None else plan.kills)
        digests.append(found.digests)
    assert digests[0] == digests[1]
    assert len(digests[0]) == 1
