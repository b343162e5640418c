"""The long run: hundreds of kills at random while jobs keep coming. Only with --kills N; figures go to --results."""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support.chaos.arena import API, HEARTBEAT_SECONDS, TTL_SECONDS, Arena
from support.chaos.settled import Settled, look
from support.chaos.storm import JOBS_AT_ONCE, Storm, Thrower, counts, recovery
from support.postgres import Postgres

from services.versions import library_versions, machine

SLEEP_SECONDS = 0.15
PROCESSES = (API, "jobs", "jobs", "render", "render", "label", "label", "train")


def test_nothing_is_lost_and_nothing_published_twice_whatever_is_killed_and_when(
    kind: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    kills, results = request.config.getoption("--kills", 0), request.config.getoption("--results", None)
    if not kills:
        pytest.skip("the long run needs --kills N")
    seed = request.config.getoption("--kill-seed")
    server: Postgres | None = None if kind == "sqlite" else request.getfixturevalue("postgres")
    url = f"sqlite:///{tmp_path / 'chaos.sqlite'}" if server is None else server.new_database()
    with Arena(tmp_path, url, sleep=SLEEP_SECONDS) as arena:
        arena.start(*PROCESSES)
        begun = time.monotonic()
        storm = Thrower(arena, seed, server).run(kills, request.config.getoption("--most-seconds"))
        seconds = time.monotonic() - begun
        found = look(arena, storm.submitted)
        figures = _figures(kind, seed, seconds, storm, found, arena)
        if results is not None:
            results.mkdir(parents=True, exist_ok=True)
            (results / f"chaos-{kind}-{seed}.json").write_text(json.dumps(figures, indent=2) + "\n")
        assert not found.faults, found.faults
        assert found.published == len(storm.submitted)
        assert found.bodies <= found.artifacts + arena.allowance
        assert figures["not_recovered"] == 0


def _figures(kind: str, seed: int, seconds: float, storm: Storm, found: Settled, arena: Arena) -> dict[str, Any]:
    finite = [kill for kill in storm.kills if kill.seconds != float("inf")]
    return {
        "database": kind,
        "store": "shared folder",
        "command": shlex.join(["pytest", *sys.argv[1:]]),
        "machine": machine(),
        "libraries": {name: library_versions().get(name) for name in ("python", "diaphane")},
        "settings": {
            "seed": seed,
            "heartbeat_seconds": HEARTBEAT_SECONDS,
            "ttl_seconds": TTL_SECONDS,
            "body_seconds": SLEEP_SECONDS,
            "jobs_at_once": JOBS_AT_ONCE,
            "processes": list(PROCESSES),
        },
        "seconds": round(seconds, 1),
        "kills": {"total": len(storm.kills), **counts(storm.kills)},
        "hit_at_work": sum(kill.doing != "idle" for kill in storm.kills),
        "points": sorted({point for kill in storm.kills for point in kill.doing.split() if ":" in point}),
        "jobs": {"submitted": len(storm.submitted), "succeeded": found.jobs - len(found.lost), "lost": len(found.lost)},
        "requests_repeated": storm.repeated,
        "bundles": {"published": found.published, "published_twice": len(found.twice)},
        "artifacts": {"distinct": found.artifacts, "damaged": len(found.damaged)},
        "tasks": {"left_pending": len(found.pending), "quarantined": len(found.quarantined)},
        "bodies": {"run": found.bodies, "in_vain": found.bodies - found.artifacts, "could_be_hit": arena.allowance},
        "faults": found.faults,
        "not_recovered": len(storm.kills) - len(finite),
        "recovery_seconds": recovery(finite),
    }
