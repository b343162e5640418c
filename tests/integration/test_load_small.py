"""A small load on a real `diaphane serve`: every answer is right while many clients ask at once. Nothing is timed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.load.phases import Plan, run_queued
from benchmarks.load.seed import seed
from benchmarks.load.service import Service
from benchmarks.load.traffic import Mix
from services.settings import Settings

READ = ("blob 64 KiB", "blob 8 MiB", "blob, not modified", "blob, range of 4 KiB", "measurements")
PLAN = Plan(
    seconds=1.5,
    jobs=50,
    per_second=50.0,
    listeners=5,
    followed=3,
    events_per_second=10.0,
    mix=Mix(small=5, large=1, measurements=4, think=0.05, hash_every=1),
)


def test_jobs_readers_and_listeners_at_the_same_time_meet_no_error(tmp_path: Path, database_url: str) -> None:
    state = tmp_path / "state"
    held = seed(Settings(state=state, database=database_url), tmp_path, measurements=400, versions=4, blobs=8, large=1)
    environment = {"DIAPHANE_DATABASE": database_url, "DIAPHANE_RATE": "100000", "DIAPHANE_BURST": "100000"}
    with Service(state, "none", environment) as service:
        service.wait_ready()
        settings = Settings(state=state, database=database_url)
        tally, counts = run_queued(service.port, held, PLAN, settings, ThreadPoolExecutor(3))
        found = tally.figures(PLAN.seconds)
        assert found["error_kinds"] == {}
        assert service.unexpected() == []
    assert counts == {"jobs_submitted": 50, "jobs_queued_in_all": 50, "streams_ended_well": 5}
    assert found["operations"]["submit job again"]["count"] == 3
    assert set(READ) <= set(found["operations"])
    assert found["operations"]["event"]["count"] >= PLAN.listeners
