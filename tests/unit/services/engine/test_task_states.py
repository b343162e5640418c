"""Transitions of tasks, with a claim written by hand."""

from __future__ import annotations

import time
from typing import Any

import pytest
import sqlalchemy as sa
from support.bodies import spec
from support.workers import Fleet

from schemas.problem import ExitCode, Problem
from services.database import tables
from services.engine import states, system
from services.engine.housekeeping import Housekeeping
from services.engine.states import Abandoned, Cancelled, Claim
from services.engine.task_states import Place, Tasks
from stages.tasks import Task

ME = "executor-1"


class Bench:
    """A job that runs, and its transitions."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet, self.database = fleet, fleet.database
        self.tasks = Tasks(fleet.database, fleet.jobs.client, retry_seconds=0.01)
        self.job_id = fleet.jobs.submit(spec("a"), submitted_by="k")[0].id
        self.claim = self.claimed(f"{self.job_id}.1")
        assert states.begin_job(self.database, self.claim, self.job_id, 1) is not None

    def claimed(self, workflow_id: str, executor: str = ME) -> Claim:
        self.set(workflow_id, status="PENDING", executor_id=executor)
        return Claim(workflow_id, executor)

    def set(self, workflow_id: str, **values: Any) -> None:
        table = system.workflows(self.database)
        with self.database.write() as connection:
            connection.execute(table.update().where(table.c.workflow_uuid == workflow_id).values(**values))

    def place(self, *names: str, held: bool = False, stage: Any = "render", **params: Any) -> None:
        asked = [Task(name=name, stage=stage, version="1", params={"n": name, **params}) for name in names]
        self.tasks.place(self.claim, self.job_id, [(task, held) for task in asked])

    def begin(self, position: int, number: int = 0) -> tuple[Claim, Place]:
        claim = self.claimed(self.workflow(position, number))
        place = Place(self.job_id, 1, position)
        assert self.tasks.begin(claim, place) is not None
        return claim, place

    def workflow(self, position: int, number: int = 0) -> str:
        return f"{self.job_id}.1/{position}/{number}"

    def workflows(self) -> dict[str, str]:
        with self.database.read() as connection:
            found = system.statuses(connection, self.database, f"{self.job_id}.1/")
        return {name.partition("/")[2]: status for name, status in found}

    def states(self) -> dict[str, str]:
        return {task.name: task.state for task in self.fleet.jobs.tasks(self.job_id)}


@pytest.fixture
def bench(fleet: Fleet) -> Bench:
    return Bench(fleet)


def test_a_task_whose_process_was_killed_is_the_next_one_again(bench: Bench) -> None:
    bench.place("a", "b", "c")
    claim, place = bench.begin(0)
    bench.tasks.fail(claim, place, Problem("It crashed.", "Repeat it."), 0, final=False, crashed=True)
    bench.set(claim.workflow_id, status="SUCCESS")
    table = system.workflows(bench.database)
    waiting = sa.select(table.c.workflow_uuid).where(table.c.status == "ENQUEUED", table.c.queue_name == "render")
    with bench.database.read() as connection:
        found = list(connection.scalars(waiting.order_by(table.c.priority)))
    assert found == [bench.workflow(0, 1), bench.workflow(1), bench.workflow(2)]
    claim, place = bench.begin(0, 1)
    bench.tasks.fail(claim, place, Problem("It crashed.", "Repeat it."), 1, final=False, crashed=True)
    assert bench.workflows()["0/2"] == "DELAYED"


def test_placing_again_queues_nothing_twice(bench: Bench) -> None:
    bench.place("a", "b")
    bench.place("c", held=True)
    bench.place("a", "b", "d")
    assert bench.workflows() == {"0/0": "ENQUEUED", "1/0": "ENQUEUED", "3/0": "ENQUEUED"}
    assert bench.states() == {"a": "queued", "b": "queued", "c": "skipped", "d": "queued"}


def test_a_task_that_makes_something_else_than_before_is_queued_anew(bench: Bench) -> None:
    bench.place("a")
    claim, place = bench.begin(0)
    bench.tasks.end(claim, place, "done", None)
    bench.set(bench.workflow(0), status="SUCCESS")
    bench.place("a", held=True)
    assert bench.states() == {"a": "done"}
    bench.place("a", alpha=0.5)
    assert bench.states() == {"a": "queued"}
    assert bench.workflows() == {"0/0": "SUCCESS", "0/1": "ENQUEUED"}


def test_an_error_is_tried_three_times_then_quarantined(bench: Bench) -> None:
    bench.place("a")
    problem = Problem("The disk is full.", "Make room.", ExitCode.TRY_AGAIN)
    for number in range(3):
        claim, place = bench.begin(0, number)
        bench.tasks.fail(claim, place, problem, number, final=False)
        bench.set(claim.workflow_id, status="SUCCESS")
    (task,) = bench.fleet.jobs.tasks(bench.job_id)
    assert task.state == "quarantined"
    assert task.problem is not None
    assert (task.problem.detail, task.problem.remedy) == ("The disk is full.", "Make room.")
    assert set(bench.workflows()) == {"0/0", "0/1", "0/2"}


def test_a_task_that_takes_its_executors_with_it_has_one_fresh_round_then_is_quarantined(bench: Bench) -> None:
    bench.place("poison", "good")
    bench.set(bench.workflow(0), status=system.LOST)
    bench.tasks.mend(bench.claim, bench.job_id)
    bench.tasks.mend(bench.claim, bench.job_id)
    assert bench.workflows() == {"0/0": system.LOST, "0/1": "ENQUEUED", "1/0": "ENQUEUED"}
    bench.set(bench.workflow(0, 1), status=system.LOST)
    bench.tasks.mend(bench.claim, bench.job_id)
    assert bench.states() == {"poison": "quarantined", "good": "queued"}
    problem = bench.fleet.jobs.tasks(bench.job_id, state="quarantined")[0].problem
    assert problem is not None
    assert "6 workers" in problem.detail


def test_what_a_worker_writes_after_it_lost_its_claim_is_refused(bench: Bench) -> None:
    bench.place("a")
    claim, place = bench.begin(0)
    bench.claimed(claim.workflow_id, "executor-2")
    for late in (
        lambda: bench.tasks.end(claim, place, "done", None),
        lambda: bench.tasks.report(claim, place, {"progress": 0.5}, []),
        lambda: bench.tasks.fail(claim, place, Problem("x", "y"), 0, final=True),
        lambda: bench.tasks.begin(claim, place),
    ):
        with pytest.raises(Abandoned):
            late()
    assert bench.states() == {"a": "running"}


def test_a_job_that_is_being_cancelled_queues_nothing_more(bench: Bench) -> None:
    bench.place("a", "b")
    claim, place = bench.begin(0)
    bench.fleet.jobs.cancel(bench.job_id)
    assert set(bench.workflows().values()) == {"CANCELLED"}
    with pytest.raises(Cancelled):
        bench.place("c")
    with pytest.raises(Abandoned):
        bench.tasks.fail(claim, place, Problem("x", "y", ExitCode.TRY_AGAIN), 0, final=False)
    assert states.end_job(bench.database, bench.claim, bench.job_id, 1, "succeeded", result={})
    assert bench.fleet.jobs.get(bench.job_id).state == "cancelled"
    assert bench.states() == {"a": "cancelled", "b": "cancelled"}
    assert not states.end_job(bench.database, bench.claim, bench.job_id, 1, "failed")


def test_a_need_that_is_gone_is_queued_once_and_the_task_after_it(bench: Bench) -> None:
    bench.place("a")
    claim, place = bench.begin(0)
    bench.tasks.end(claim, place, "done", None)
    bench.set(claim.workflow_id, status="SUCCESS")
    bench.place("x", "y", stage="label")
    artifact = bench.fleet.jobs.tasks(bench.job_id, stage="render")[0].artifact
    for position in (1, 2):
        claim, place = bench.begin(position)
        bench.tasks.wait_for(claim, place, artifact, 0)
        bench.set(claim.workflow_id, status="SUCCESS")
    assert bench.states() == {"a": "queued", "x": "queued", "y": "queued"}
    assert {name for name, status in bench.workflows().items() if status in system.LIVE} == {"0/1", "1/1", "2/1"}


def test_a_need_that_another_job_made_becomes_a_task_of_this_one(bench: Bench) -> None:
    bench.place("a")
    artifact = bench.fleet.jobs.tasks(bench.job_id)[0].artifact
    other = Bench(bench.fleet)
    other.place("x", stage="label")
    claim, place = other.begin(0)
    other.tasks.wait_for(claim, place, artifact, 0)
    assert other.states() == {f"a {artifact[-8:]}": "queued", "x": "queued"}
    other.set(claim.workflow_id, status="SUCCESS")
    claim, place = other.begin(0, 1)
    other.tasks.wait_for(claim, place, "render/" + "0" * 64, 0)
    assert other.states()["x"] == "quarantined"


def test_what_another_job_makes_now_is_waited_for(bench: Bench) -> None:
    other = Bench(bench.fleet)
    for each in (bench, other):
        each.place("a")
    claim, place = bench.begin(0)
    late = other.claimed(other.workflow(0))
    assert other.tasks.begin(late, Place(other.job_id, 1, 0)) is None
    assert other.states() == {"a": "queued"}
    assert other.workflows()["0/1"] == "DELAYED"
    bench.tasks.end(claim, place, "done", None)
    other.set(other.workflow(0), status="SUCCESS")
    other.begin(0, 1)
    assert other.states() == {"a": "running"}


def test_progress_counts_what_is_done_and_tells_how_long_it_still_takes(bench: Bench) -> None:
    bench.place("a", "b", "c", "d", stage="train")
    for position in range(2):
        claim, place = bench.begin(position)
        if position == 0:
            bench.tasks.end(claim, place, "done", None)
        else:
            bench.tasks.report(claim, place, {"progress": 0.5}, [])
    with bench.database.write() as connection:
        connection.execute(tables.tasks.update().where(tables.tasks.c.name == "a").values(seconds=10.0))
        connection.execute(tables.jobs.update().values(started=time.time() - 15.0))
    job = bench.fleet.jobs.get(bench.job_id)
    (stage,) = job.stages
    assert (stage.total, stage.done, stage.running, stage.queued) == (4, 1, 1, 2)
    assert stage.fraction == 0.375
    assert stage.eta_seconds == 25.0
    assert 0.0 < job.fraction < 0.375
    assert job.eta_seconds is not None
    assert job.eta_seconds > 25.0


def test_events_are_numbered_without_gaps_and_read_from_any_number(bench: Bench) -> None:
    bench.place("a")
    claim, place = bench.begin(0)
    bench.tasks.report(claim, place, {}, [("log", {"text": "1"}), ("log", {"text": "2"})])
    bench.tasks.end(claim, place, "done", None)
    found = bench.fleet.jobs.events(bench.job_id)
    assert [event.number for event in found] == list(range(1, len(found) + 1))
    assert [event.kind for event in found] == ["state", "state", "task", "log", "log", "task"]
    assert bench.fleet.jobs.events(bench.job_id, after=4, limit=1) == [found[4]]


def test_old_workflows_are_removed_but_for_those_of_open_jobs(bench: Bench) -> None:
    bench.place("a")
    other = bench.fleet.jobs.submit(spec("b"), submitted_by="k")[0].id
    bench.fleet.jobs.cancel(other)
    bench.set(bench.workflow(0), status="SUCCESS", completed_at=1)
    bench.set(f"{other}.1", completed_at=1)
    keeper = Housekeeping(bench.fleet.settings, bench.database, bench.fleet.jobs.client, None, conducts=True)  # type: ignore[arg-type]
    assert keeper.prune() == 1
    table = system.workflows(bench.database)
    with bench.database.read() as connection:
        left = set(connection.scalars(sa.select(table.c.workflow_uuid)))
    assert left == {f"{bench.job_id}.1", bench.workflow(0)}


def test_pages_of_tasks_have_each_task_once(bench: Bench) -> None:
    bench.place(*(f"t{number}" for number in range(5)))
    bench.place("x", stage="label")
    found: list[tuple[str, str]] = []
    after: tuple[str, int] | None = None
    while page := bench.fleet.jobs.positioned_tasks(bench.job_id, limit=2, after=after):
        found += [(task.stage, task.name) for _, task in page]
        after = page[-1][1].stage, page[-1][0]
    assert found == [("label", "x"), *(("render", f"t{number}") for number in range(5))]
