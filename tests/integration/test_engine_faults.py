"""Worker processes that are killed, stopped and lied to; nothing is lost, nothing is done twice that was done."""

from __future__ import annotations

import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.postgres import Postgres
from support.workers import Fleet, alive, until

from services.engine import system

ALL = ("jobs", "render", "label", "train")


@pytest.fixture
def fleet(tmp_path: Path, database_url: str) -> Iterator[Fleet]:
    with Fleet(tmp_path, database_url) as found:
        yield found


@pytest.fixture
def sqlite_fleet(tmp_path: Path) -> Iterator[Fleet]:
    with Fleet(tmp_path, f"sqlite:///{tmp_path / 'test.sqlite'}") as found:
        yield found


def _tasks(stage: str, count: int, **params: Any) -> dict[str, Any]:
    return {"stage": stage, "tasks": [{"name": f"{stage}{index}", **params} for index in range(count)]}


def _publish(fleet: Fleet) -> dict[str, Any]:
    return {"step": "publish", "file": str(fleet.folder / "published")}


def _states(fleet: Fleet, job_id: str) -> dict[str, str]:
    return {task.name: task.state for task in fleet.jobs.tasks(job_id)}


def _within(seconds: float) -> Callable[[], float]:
    begun = time.monotonic()
    return lambda: seconds - (time.monotonic() - begun)


def test_a_killed_worker_s_task_is_done_by_another_and_a_killed_conductor_s_job_goes_on(fleet: Fleet) -> None:
    conductor, first, second = fleet.worker("jobs"), fleet.worker("render"), fleet.worker("render", "label")
    for worker in (conductor, first, second):
        worker.ready()
    plan = (_tasks("render", 4, sleep=0.8), _publish(fleet), _tasks("label", 2, sleep=0.8))
    job_id = fleet.submit("a", *plan)
    until(lambda: len(fleet.trace()) >= 2)
    lost = [entry for entry in fleet.trace() if entry[3] == first.pid]
    first.kill()
    until(lambda: not alive(lost[-1][2]), 2.0)
    until(lambda: fleet.begun("label0"))
    conductor.kill()
    fleet.worker("jobs").ready()
    job = fleet.wait(job_id)
    assert (job.state, job.attempt) == ("succeeded", 1)
    begun = Counter(entry[1] for entry in fleet.trace())
    assert {name for name, count in begun.items() if count > 1} == {lost[-1][1]}, "only what was lost is done again"
    assert (fleet.folder / "published").read_text().split() == ["publish", job_id]
    numbers = [event.number for event in fleet.jobs.events(job_id)]
    assert numbers == list(range(1, len(numbers) + 1))
    again = fleet.wait(fleet.submit("a", *plan))
    assert set(_states(fleet, again.id).values()) == {"skipped"}
    assert sum(again.skipped.values()) == 6


def test_a_cancelled_job_s_processes_end_at_once_and_a_retry_finds_what_was_made(fleet: Fleet) -> None:
    fleet.worker(*ALL).ready()
    job_id = fleet.submit("a", _tasks("render", 2), _tasks("label", 2, sleep=1.5))
    until(lambda: fleet.begun("label0"))
    child = next(entry[2] for entry in fleet.trace() if entry[1] == "label0")
    assert fleet.jobs.cancel(job_id).state == "cancelling"
    until(lambda: not alive(child), 2.0)
    assert fleet.wait(job_id).state == "cancelled"
    assert _states(fleet, job_id) == {
        **{f"render{index}": "done" for index in range(2)},
        **{f"label{index}": "cancelled" for index in range(2)},
    }
    assert fleet.jobs.retry(job_id).attempt == 2
    job = fleet.wait(job_id)
    assert job.state == "succeeded"
    assert _states(fleet, job_id) == {
        **{f"render{index}": "skipped" for index in range(2)},
        **{f"label{index}": "done" for index in range(2)},
    }
    assert fleet.begun("render0") == 1
    states = [event.data["state"] for event in fleet.jobs.events(job_id) if event.kind == "state"]
    assert states == ["queued", "running", "cancelling", "cancelled", "queued", "running", "succeeded"]


def test_a_task_that_fails_is_tried_again_or_quarantined_with_the_reason_and_the_job_goes_on(
    sqlite_fleet: Fleet,
) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL).ready()
    faults = [
        {"name": "good"},
        {"name": "unlucky", "fault": "raise", "times": 2},
        {"name": "broken", "fault": "raise"},
        {"name": "empty", "fault": "problem"},
        {"name": "crash", "fault": "crash"},
        {"name": "talk", "fault": "talk"},
    ]
    job_id = fleet.submit("a", {"stage": "render", "tasks": faults}, {"stage": "label", "tasks": [{"name": "next"}]})
    job = fleet.wait(job_id)
    assert job.state == "succeeded"
    assert job.result is not None
    assert set(job.result["made"]["render"]) == {"good", "unlucky", "talk"}
    reasons = {task.name: task.problem for task in fleet.jobs.tasks(job_id, state="quarantined")}
    assert {name: fleet.begun(name) for name in reasons} == {"broken": 3, "empty": 1, "crash": 3}
    details = {name: problem.detail for name, problem in reasons.items() if problem is not None}
    assert "ValueError: bad luck" in details["broken"]
    assert details["empty"] == "The view is empty."
    assert "SIGSEGV" in details["crash"]
    texts = [event.data for event in fleet.jobs.events(job_id) if event.kind == "log"]
    lines = [line for data in texts if data["name"] == "talk" for line in data["text"].splitlines()]
    assert lines[0] == "line 0"
    assert len(lines) == 2000
    assert any("bad luck" in data["text"] for data in texts if data["name"] == "broken")


def test_a_need_that_is_gone_is_made_again(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL).ready()
    label = {"stage": "label", "tasks": [{"name": "label", "fault": "lose-need", "times": 1}]}
    job = fleet.wait(fleet.submit("a", _tasks("render", 1), label))
    assert job.state == "succeeded"
    assert (fleet.begun("render0"), fleet.begun("label")) == (2, 2)


def test_jobs_of_a_class_take_turns_and_a_higher_class_overtakes(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    jobs = [fleet.submit(name, _named(name, 12)) for name in ("a", "b")]
    fleet.worker("jobs").ready()
    until(lambda: fleet.jobs.queues()[1].queued == 24)
    fleet.worker("render").ready()
    until(lambda: len(fleet.trace()) > 8)
    urgent = fleet.submit("c", _named("c", 2), priority="high")
    assert all(fleet.wait(job_id).state == "succeeded" for job_id in (*jobs, urgent))
    order = "".join(entry[1][0] for entry in fleet.trace())
    normal = order.replace("c", "")
    for length in range(1, 25):
        assert abs(normal[:length].count("a") - normal[:length].count("b")) <= 2, order
    assert order.rindex("c") < len(order) - 4, order


def _named(name: str, count: int) -> dict[str, Any]:
    return {"stage": "render", "tasks": [{"name": f"{name}{index}", "sleep": 0.1} for index in range(count)]}


def test_a_worker_that_is_told_to_stop_finishes_its_task_and_hands_its_job_over(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    worker = fleet.worker(*ALL).ready()
    job_id = fleet.submit("a", _tasks("render", 3, sleep=1.0))
    until(lambda: fleet.begun("render0"))
    assert worker.stop() == 0
    assert _states(fleet, job_id) == {"render0": "done", "render1": "queued", "render2": "queued"}
    assert fleet.jobs.executors() == []
    fleet.worker(*ALL).ready()
    assert fleet.wait(job_id).state == "succeeded"
    assert len(fleet.trace()) == 3


def test_a_stopped_worker_is_taken_for_dead_and_what_it_does_afterwards_is_refused(
    tmp_path: Path, postgres: Postgres
) -> None:
    # Not on SQLite: a process that is stopped in the middle of a write keeps the database locked.
    with Fleet(tmp_path, postgres.new_database(), TTL="1.5") as fleet:
        fleet.worker("jobs").ready()
        zombie = fleet.worker("render").ready()
        job_id = fleet.submit("a", _tasks("render", 1, sleep=3.0), _publish(fleet))
        until(lambda: fleet.begun("render0"))
        child = fleet.trace()[0][2]
        zombie.signal(signal.SIGSTOP)
        fleet.worker("render").ready()
        until(lambda: fleet.begun("render0") == 2)
        zombie.signal(signal.SIGCONT)
        until(lambda: not alive(child), 3.0)
        assert fleet.wait(job_id).state == "succeeded"
        (task,) = fleet.jobs.tasks(job_id)
        assert task.executor is not None
        assert f"-{fleet.workers[2].pid}-" in task.executor


def test_a_restart_of_postgresql_repeats_nothing(tmp_path: Path, postgres: Postgres) -> None:
    with Fleet(tmp_path, postgres.new_database(), TTL="5") as fleet:
        for worker in (fleet.worker("jobs"), fleet.worker("render")):
            worker.ready()
        job_id = fleet.submit("a", _tasks("render", 6, sleep=0.5), _publish(fleet))
        until(lambda: len(fleet.trace()) >= 3)
        postgres.stop("immediate")
        time.sleep(1.0)
        postgres.start()
        assert fleet.wait(job_id, 60.0).state == "succeeded"
        assert Counter(entry[1] for entry in fleet.trace()) == Counter(f"render{index}" for index in range(6))
        assert (fleet.folder / "published").read_text().split() == ["publish", job_id]


def test_identical_submissions_at_the_same_moment_are_one_job(fleet: Fleet) -> None:
    from support.bodies import spec

    found: list[tuple[str, bool]] = []
    barrier = threading.Barrier(6)

    def submit() -> None:
        barrier.wait()
        job, new = fleet.jobs.submit(spec("a"), submitted_by="key_test", idempotency_key="once")
        found.append((job.id, new))

    threads = [threading.Thread(target=submit) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({job_id for job_id, _ in found}) == 1
    assert sum(new for _, new in found) == 1
    assert len(fleet.jobs.list()) == 1


def test_uploads_that_take_all_their_time_hold_up_neither_another_key_s_nor_a_task(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL, CHECK_SECONDS="600").ready()
    slow = [fleet.send("key_a", f"slow {number}") for number in range(3)]
    until(lambda: fleet.jobs.queues()[-1].running == 1)
    good = fleet.send("key_b", "good")
    until(lambda: fleet.checked(good) == "accepted")
    assert fleet.wait(fleet.submit("a", _tasks("render", 1))).state == "succeeded"
    assert [fleet.checked(scene_id) for scene_id in slow] == ["checking"] * 3
    assert (fleet.jobs.queues()[-1].running, fleet.jobs.queues()[-1].queued) == (1, 2)


def test_uploads_of_three_keys_that_take_all_their_time_make_room_for_a_fourth_key_s(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL, CHECK_SECONDS="6", CHECK_TURN="1").ready()
    slow = [fleet.send(f"key_{name}", f"slow {name}") for name in "abc"]
    until(lambda: fleet.jobs.queues()[-1].running >= 2)
    good = fleet.send("key_d", "good")
    until(lambda: fleet.checked(good) == "accepted")
    assert [fleet.checked(scene_id) for scene_id in slow] == ["checking"] * 3
    until(lambda: [fleet.checked(scene_id) for scene_id in slow] == ["rejected"] * 3, 40.0)
    assert fleet.jobs.queues()[-1].queued == fleet.jobs.queues()[-1].running == 0


def test_a_check_goes_on_beyond_its_turn_where_nobody_waits(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL, CHECK_SECONDS="3", CHECK_TURN="0.2").ready()
    slow = [fleet.send(f"key_{name}", f"slow {name}") for name in "ab"]
    until(lambda: [fleet.checked(scene_id) for scene_id in slow] == ["rejected"] * 2)
    with fleet.database.read() as connection:
        ids = system.statuses(connection, fleet.database, "check/")
    assert {name.rpartition("/")[2] for name, _ in ids} == {"0"}, "each was begun once"


def test_a_check_that_is_taken_over_at_the_end_of_its_turn_shares_no_room_with_its_longer_one(
    sqlite_fleet: Fleet,
) -> None:
    fleet = sqlite_fleet
    scene_id = fleet.send("key_a", "slow a")
    fleet.jobs.check_longer(f"check/key_a/{scene_id}/0")
    fleet.worker(*ALL, CHECK_SECONDS="3").ready()
    rooms = fleet.folder / "work"
    until(lambda: len(list(rooms.glob("*/check-*/sources/*/a.usda"))) == 2)
    until(lambda: fleet.checked(scene_id) == "rejected")
    until(lambda: not list(rooms.glob("*/check-*")))


def test_a_key_s_uploads_are_checked_one_after_the_other_by_the_clock(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    fleet.worker(*ALL, CHECK_SECONDS="2").ready()
    sent = [fleet.send("key_a", text) for text in ("slow", "bad", "crash", "good")]
    until(lambda: fleet.checked(sent[-1]) == "accepted")
    assert [fleet.checked(scene_id) for scene_id in sent] == ["rejected", "rejected", "rejected", "accepted"]


def test_the_rooms_of_a_killed_worker_are_removed_by_whoever_comes_next(sqlite_fleet: Fleet) -> None:
    fleet = sqlite_fleet
    work = fleet.folder / "work"
    first = fleet.worker(*ALL).ready()
    fleet.submit("a", _tasks("render", 1, sleep=30.0))
    until(lambda: fleet.begun("render0"))
    rooms = [folder for folder in work.iterdir() if list(folder.glob("render-*/made"))]
    first.kill()
    assert len(rooms) == 1
    assert rooms[0].exists()
    second = fleet.worker(*ALL).ready()
    assert not rooms[0].exists()
    assert len([folder for folder in work.iterdir() if list(folder.glob(".lock"))]) == 1
    assert second.stop() == 0
    assert [folder.name for folder in work.iterdir() if folder.is_dir()] == ["kernels"]
