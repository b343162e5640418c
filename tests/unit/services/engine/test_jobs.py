"""Jobs from outside, without a process that does them."""

from __future__ import annotations

import pytest
import sqlalchemy as sa
from support.bodies import spec
from support.workers import Fleet

from schemas.job import JobSpec
from schemas.problem import ExitCode, Problem
from services.database import tables
from services.engine import checks, states, system


def _workflow(fleet: Fleet, workflow_id: str) -> str | None:
    with fleet.database.read() as connection:
        return system.status(connection, fleet.database, workflow_id)


def test_a_job_and_its_workflow_come_together(fleet: Fleet) -> None:
    job, new = fleet.jobs.submit(spec("a", "low"), submitted_by="key_1", request_id="req_1")
    assert new
    assert (job.state, job.attempt, job.priority, job.request_id) == ("queued", 1, "low", "req_1")
    assert (job.fraction, job.eta_seconds, job.stages) == (0.0, None, ())
    assert _workflow(fleet, f"{job.id}.1") == "ENQUEUED"
    assert fleet.jobs.get(job.id) == job
    assert [event.data for event in fleet.jobs.events(job.id)] == [{"state": "queued", "attempt": 1}]


def test_a_failed_submission_leaves_neither(fleet: Fleet, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise KeyError

    monkeypatch.setattr(system, "enqueue", fail)
    with pytest.raises(KeyError):
        fleet.jobs.submit(spec("a"), submitted_by="key_1")
    assert fleet.jobs.list() == []


def test_a_key_names_one_request_of_its_owner(fleet: Fleet) -> None:
    first, _ = fleet.jobs.submit(spec("a"), submitted_by="key_1", idempotency_key="k")
    assert fleet.jobs.submit(spec("a"), submitted_by="key_1", idempotency_key="k") == (first, False)
    with pytest.raises(Problem, match="another job") as problem:
        fleet.jobs.submit(spec("b"), submitted_by="key_1", idempotency_key="k")
    assert problem.value.code is ExitCode.CONFLICT
    assert fleet.jobs.submit(spec("b"), submitted_by="key_2", idempotency_key="k")[1]
    assert fleet.jobs.submit(spec("a"), submitted_by="key_1")[1]


class LaterSpec(JobSpec):
    """As jobs are asked for once there is another option."""

    spare: int = 3


def test_a_request_from_before_a_field_was_added_is_still_the_same(fleet: Fleet) -> None:
    first, _ = fleet.jobs.submit(spec("a"), submitted_by="key_1", idempotency_key="k")
    later = LaterSpec.model_validate(spec("a").model_dump())
    found = fleet.jobs.repeated(later, submitted_by="key_1", idempotency_key="k")
    assert found is not None
    assert (found.id, found.spec) == (first.id, spec("a"))
    assert fleet.jobs.repeated(later, submitted_by="key_2", idempotency_key="k") is None
    for change in ({"spare": 4}, {"patience": 1}):
        with pytest.raises(Problem, match="another job"):
            fleet.jobs.repeated(later.model_copy(update=change), submitted_by="key_1", idempotency_key="k")


def test_pages_of_jobs_have_each_job_once_newest_first(fleet: Fleet) -> None:
    ids = [fleet.jobs.submit(spec("a" if number % 2 else "b"), submitted_by="k")[0].id for number in range(5)]
    with fleet.database.write() as connection:  # two of the same moment
        connection.execute(tables.jobs.update().where(tables.jobs.c.id.in_(ids[:2])).values(created=1.0))
    found: list[str] = []
    after: tuple[float, str] | None = None
    while True:
        page = fleet.jobs.list(limit=2, after=after)
        if not page:
            break
        found += [job.id for job in page]
        with fleet.database.read() as connection:
            created = connection.scalar(sa.select(tables.jobs.c.created).where(tables.jobs.c.id == found[-1]))
        assert created is not None
        after = created, found[-1]
    assert found == [*reversed(ids[2:]), *sorted(ids[:2], reverse=True)]
    assert {job.id for job in fleet.jobs.list(name="a")} == {ids[1], ids[3]}
    assert fleet.jobs.list(state="running") == []
    assert len(fleet.jobs.list(kind="train")) == 5


def test_a_list_of_jobs_costs_the_same_queries_however_long_it_is(fleet: Fleet) -> None:
    counted: list[str] = []
    sa.event.listen(fleet.database.engine, "before_cursor_execute", lambda *args: counted.append(args[2]))
    for _ in range(2):
        fleet.jobs.submit(spec("a"), submitted_by="k")
    counted.clear()
    fleet.jobs.list()
    few = len(counted)
    for _ in range(10):
        fleet.jobs.submit(spec("a"), submitted_by="k")
    counted.clear()
    assert len(fleet.jobs.list()) == 12
    assert len(counted) == few


def test_a_queued_job_is_cancelled_at_once_and_may_be_retried(fleet: Fleet) -> None:
    job, _ = fleet.jobs.submit(spec("a"), submitted_by="k")
    with pytest.raises(Problem, match="is queued") as problem:
        fleet.jobs.retry(job.id)
    assert problem.value.code is ExitCode.CONFLICT
    cancelled = fleet.jobs.cancel(job.id)
    assert cancelled.state == "cancelled"
    assert cancelled.finished is not None
    assert _workflow(fleet, f"{job.id}.1") == "CANCELLED"
    assert fleet.jobs.cancel(job.id) == cancelled
    again = fleet.jobs.retry(job.id)
    assert (again.state, again.attempt, again.finished) == ("queued", 2, None)
    assert _workflow(fleet, f"{job.id}.2") == "ENQUEUED"


def test_a_job_whose_workflow_is_gone_does_not_stay_for_ever(fleet: Fleet) -> None:
    kept = fleet.jobs.submit(spec("a"), submitted_by="k")[0].id
    lost = fleet.jobs.submit(spec("a"), submitted_by="k")[0].id
    table = system.workflows(fleet.database)
    with fleet.database.write() as connection:
        connection.execute(table.update().where(table.c.workflow_uuid == f"{lost}.1").values(status=system.LOST))
    assert states.end_adrift(fleet.database) == [lost]
    job = fleet.jobs.get(lost)
    assert job.state == "failed"
    assert job.problem is not None
    assert "lost again and again" in job.problem.detail
    assert fleet.jobs.get(kept).state == "queued"


def test_unknown_jobs_are_not_found(fleet: Fleet) -> None:
    for call in (fleet.jobs.get, fleet.jobs.cancel, fleet.jobs.retry, fleet.jobs.tasks, fleet.jobs.events):
        with pytest.raises(Problem) as problem:
            call("job_none")  # type: ignore[operator]
        assert problem.value.code is ExitCode.NOT_FOUND


def _sent(fleet: Fleet, key: str, *ids: str) -> None:
    for number, scene_id in enumerate(ids):
        row = {"id": scene_id, "digest": scene_id, "name": "a", "root": "a.usda", "files": {}, "bytes": 0}
        row |= {"state": "checking", "created": float(number), "created_by": key}
        with fleet.database.write() as connection:
            connection.execute(tables.scenes.insert().values(**row))
        fleet.jobs.check_next(scene_id)


def _queued_checks(fleet: Fleet) -> list[str]:
    table = system.workflows(fleet.database)
    found = table.select().where(table.c.queue_name == "check", table.c.status.in_(system.LIVE))
    with fleet.database.read() as connection:
        rows = connection.execute(found.order_by(table.c.created_at))
        return [row.workflow_uuid.removeprefix("check/") for row in rows]


def _check_ended(fleet: Fleet, scene_id: str, status: str, state: str) -> None:
    table = system.workflows(fleet.database)
    with fleet.database.write() as connection:
        mine = table.c.workflow_uuid.like(f"%/{scene_id}/%")
        connection.execute(tables.scenes.update().where(tables.scenes.c.id == scene_id).values(state=state))
        connection.execute(table.update().where(mine).values(status=status))
    fleet.jobs.check_next(scene_id)


def test_a_check_is_queued_once_at_a_time_and_again_when_it_failed(fleet: Fleet) -> None:
    _sent(fleet, "key_a", "scn_1")
    fleet.jobs.check_next("scn_1")
    assert _queued_checks(fleet) == ["key_a/scn_1/0"]
    assert [(queue.role, queue.queued) for queue in fleet.jobs.queues()][1:] == [
        *(("render", 0), ("label", 0), ("train", 0)),
        ("check", 1),
    ]
    _check_ended(fleet, "scn_1", "ERROR", "checking")
    assert _queued_checks(fleet) == ["key_a/scn_1/1"]


def test_a_key_with_many_uploads_has_one_in_the_queue_and_another_key_is_next(fleet: Fleet) -> None:
    _sent(fleet, "key_a", *(f"scn_{number}" for number in range(8)))
    _sent(fleet, "key_b", "scn_b0", "scn_b1")
    assert _queued_checks(fleet) == ["key_a/scn_0/0", "key_b/scn_b0/0"]
    _check_ended(fleet, "scn_0", "SUCCESS", "accepted")
    assert _queued_checks(fleet) == ["key_b/scn_b0/0", "key_a/scn_1/0"]
    assert fleet.jobs.queues()[-1].queued == 9


def test_the_next_check_is_queued_while_the_workflow_of_the_last_one_still_ends(fleet: Fleet) -> None:
    _sent(fleet, "key_a", "scn_0", "scn_1")
    _check_ended(fleet, "scn_0", "PENDING", "rejected")
    assert _queued_checks(fleet) == ["key_a/scn_0/0", "key_a/scn_1/0"]


def test_a_check_whose_turn_is_over_is_queued_once_among_the_long_ones_and_stays_its_key_s_one(fleet: Fleet) -> None:
    _sent(fleet, "key_a", "scn_0", "scn_1")
    fleet.jobs.check_longer("check/key_a/scn_0/0")
    fleet.jobs.check_longer("check/key_a/scn_0/0")
    table = system.workflows(fleet.database)
    ended = table.update().where(table.c.workflow_uuid == "check/key_a/scn_0/0").values(status="SUCCESS")
    with fleet.database.write() as connection:
        connection.execute(ended)
    fleet.jobs.check_next("scn_0")
    with fleet.database.read() as connection:
        rows = connection.execute(sa.select(table.c.workflow_uuid, table.c.queue_name, table.c.status)).all()
    assert sorted(map(tuple, rows)) == [
        ("check/key_a/scn_0/0", "check", "SUCCESS"),
        ("check/key_a/scn_0/1", "check-long", "ENQUEUED"),
    ]


def test_a_check_s_turn_ends_when_others_wait_and_not_before(fleet: Fleet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "LOOK_SECONDS", 0.0)
    patient, over = checks.Turn(fleet.database, 600.0), checks.Turn(fleet.database, 0.0)
    for _ in range(3):
        over.tick()
    _sent(fleet, "key_a", "scn_0")
    over.tick()
    for _ in range(3):
        patient.tick()
    with pytest.raises(checks.TurnOver):
        over.tick()


def test_a_scene_that_takes_its_checkers_with_it_is_rejected_and_the_next_one_is_checked(fleet: Fleet) -> None:
    _sent(fleet, "key_a", "scn_0", "scn_1")
    for _ in range(checks.TRIES):
        _check_ended(fleet, "scn_0", system.LOST, "checking")
    checks.see_to_adrift(fleet.database, fleet.jobs)
    with fleet.database.read() as connection:
        rows = connection.execute(sa.select(tables.scenes.c.id, tables.scenes.c.state)).all()
    assert {row.id: row.state for row in rows} == {"scn_0": "rejected", "scn_1": "checking"}
    assert _queued_checks(fleet) == ["key_a/scn_1/0"]
