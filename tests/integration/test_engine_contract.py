"""What the engine relies on inside DBOS beyond its documented interface; on both databases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from dbos import DBOS, DBOSConfig, DBOSPortableJSONSerializer
from psycopg.errors import DiskFull, LockNotAvailable, SerializationFailure
from sqlalchemy.exc import DBAPIError

from schemas.problem import Problem
from services.database import Database, open_database, tables
from services.database.clock import clock
from services.engine import flow, queues, steering, system
from services.engine.claims import Claims
from services.engine.jobs import Jobs
from services.engine.liveness import Liveness, host
from services.settings import Settings

ID = "job_x.1/0/0"


class Engine:
    """An executor that listens to no queue."""

    def __init__(self, folder: Path, url: str) -> None:
        self.settings = Settings(state=folder, database=url, poll=0.05)
        self.database = open_database(url)
        self.jobs = Jobs(self.settings, self.database)
        self.liveness = Liveness(self.settings, self.database, Claims(), {"jobs": 1})
        self.liveness.beat()
        config = DBOSConfig(
            name=system.APPLICATION,
            system_database_url=system.engine_url(url),
            application_version=system.VERSION,
            executor_id=self.liveness.executor,
            serializer=DBOSPortableJSONSerializer(),
            run_migrations=False,
        )
        DBOS(config=config)
        DBOS.listen_queues([])
        DBOS.launch()

    def enqueue(self, workflow_id: str = ID, queue: str = "render", priority: int = 1) -> None:
        with self.database.write() as connection:
            arguments = ("job_x", 1, 0, 0)
            system.enqueue(self.jobs.client, connection, "task", workflow_id, queue, *arguments, priority=priority)

    def set(self, workflow_id: str = ID, **values: Any) -> None:
        table = system.workflows(self.database)
        with self.database.write() as connection:
            connection.execute(table.update().where(table.c.workflow_uuid == workflow_id).values(**values))

    def row(self, workflow_id: str = ID) -> dict[str, Any]:
        table = system.workflows(self.database)
        with self.database.read() as connection:
            found = connection.execute(sa.select(table).where(table.c.workflow_uuid == workflow_id)).mappings().one()
        return dict(found)

    def claimed_by(self, executor: str, workflow_id: str = ID) -> None:
        self.set(workflow_id, status="PENDING", executor_id=executor, owner_xid="x", recovery_attempts=1)


@pytest.fixture
def engine(tmp_path: Path, database_url: str) -> Iterator[Engine]:
    found = Engine(tmp_path, database_url)
    yield found
    DBOS.destroy(workflow_completion_timeout_sec=0)
    found.jobs.close()
    found.database.close()


def _insert_executor(database: Database, name: str, *, where: str, pid: int, started: str, age: float) -> None:
    values = {"id": name, "host": where, "pid": pid, "started": started, "roles": "render:1"}
    with database.write() as connection:
        connection.execute(tables.executors.insert().values(**values, last_seen=clock(database) - age))


def test_the_workflows_of_a_dead_executor_are_queued_again_and_the_attempt_counts(engine: Engine) -> None:
    engine.enqueue()
    engine.claimed_by("dead")
    assert engine.liveness.reap(patient=False) == ["dead"]
    row = engine.row()
    assert (row["status"], row["queue_name"], row["owner_xid"]) == ("ENQUEUED", "render", None)
    assert row["recovery_attempts"] == 1


def test_only_the_dead_lose_their_work(engine: Engine) -> None:
    engine.enqueue()
    _insert_executor(engine.database, "silent", where="elsewhere", pid=1, started="1", age=60.0)
    _insert_executor(engine.database, "alive", where="elsewhere", pid=1, started="1", age=0.0)
    for owner, patient, dead in (
        ("alive", True, []),
        ("silent", False, []),
        ("silent", True, ["silent"]),
        (engine.liveness.executor, True, []),
    ):
        engine.claimed_by(owner)
        assert engine.liveness.reap(patient=patient) == dead
        assert engine.row()["status"] == ("ENQUEUED" if dead else "PENDING")


def test_a_dead_process_of_the_same_host_is_seen_without_patience(engine: Engine) -> None:
    engine.enqueue()
    _insert_executor(engine.database, "gone", where=host(), pid=2**22 + 1, started="1", age=0.0)
    engine.claimed_by("gone")
    assert engine.liveness.reap(patient=False) == ["gone"]


def test_rows_of_processes_that_have_ended_go_once_nothing_is_claimed_by_them(engine: Engine) -> None:
    engine.enqueue()
    _insert_executor(engine.database, "gone", where=host(), pid=2**22 + 1, started="1", age=0.0)
    _insert_executor(engine.database, "owner", where=host(), pid=2**22 + 1, started="1", age=0.0)
    _insert_executor(engine.database, "elsewhere", where="elsewhere", pid=2**22 + 1, started="1", age=0.0)
    engine.claimed_by("owner")
    engine.liveness._forget()
    with engine.database.read() as connection:
        left = set(connection.scalars(sa.select(tables.executors.c.id)))
    assert left == {"owner", "elsewhere", engine.liveness.executor}


def test_waits_for_the_database_are_short_and_contention_is_looked_at_again_soon(engine: Engine) -> None:
    from dbos import _sys_db
    from dbos._dbos import _get_dbos_instance

    steering.steer(engine.database, {})
    slept: list[float] = []
    assert _sys_db.time.time() > 0.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steering.time, "sleep", slept.append)
        _sys_db.time.sleep(90.0)
        _sys_db.time.sleep(0.5)
    assert slept == [steering.LONGEST_WAIT_SECONDS, 0.5]
    database = _get_dbos_instance()._sys_db
    assert database.is_lock_conflict(DBAPIError("", None, SerializationFailure()))
    assert database.is_lock_conflict(DBAPIError("", None, LockNotAvailable()))
    assert not database.is_lock_conflict(DBAPIError("", None, DiskFull()))


def test_recovering_the_dead_again_leaves_what_somebody_else_has_claimed(engine: Engine) -> None:
    engine.enqueue()
    engine.claimed_by("somebody")
    with engine.database.write() as connection:
        assert system.recover(connection, engine.database, ["dead"]) == 0
    assert engine.row()["executor_id"] == "somebody"
    assert engine.row()["status"] == "PENDING"


def test_recovering_the_dead_leaves_what_was_cancelled_since(engine: Engine) -> None:
    engine.enqueue()
    engine.claimed_by("dead")
    DBOS.cancel_workflow(ID)
    with engine.database.write() as connection:
        assert system.recover(connection, engine.database, ["dead"]) == 0
    assert engine.row()["status"] == "CANCELLED"


def test_what_dbos_offers_publicly_would_take_work_from_the_living_and_forget_attempts(engine: Engine) -> None:
    """Why the engine queues again by a statement of its own; it can go when this fails."""
    engine.enqueue()
    engine.claimed_by("somebody")
    DBOS.resume_workflows([ID], queue_name="render")
    row = engine.row()
    assert (row["status"], row["recovery_attempts"]) == ("ENQUEUED", 0)
    DBOS.cancel_workflow(ID)
    DBOS.resume_workflows([ID], queue_name="render")
    assert engine.row()["status"] == "ENQUEUED"


def test_our_recovery_is_that_of_dbos(engine: Engine) -> None:
    for workflow_id in ("a/0", "b/0"):
        engine.enqueue(workflow_id)
        engine.claimed_by(f"dead {workflow_id}", workflow_id)
    DBOS._recover_pending_workflows(["dead a/0"])
    with engine.database.write() as connection:
        assert system.recover(connection, engine.database, ["dead b/0", "dead too"]) == 1
    theirs, ours = engine.row("a/0"), engine.row("b/0")
    assert abs(theirs.pop("updated_at") - ours.pop("updated_at")) < 60_000
    for name in ("workflow_uuid", "created_at", "executor_id"):
        theirs.pop(name), ours.pop(name)
    assert ours == theirs


def test_a_dbos_that_cannot_be_steered_is_said_before_work_is_taken(engine: Engine) -> None:
    from dbos._dbos import _get_dbos_instance

    inner = _get_dbos_instance()._sys_db
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(inner, "dequeue_scopes", None)
        with pytest.raises(Problem, match=r"lacks what the engine needs: dequeue_scopes\."):
            steering.steer(engine.database, {"render": 1})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steering, "CONCURRENCY", "_of_another_version")
        with pytest.raises(Problem, match=r"lacks what the engine needs: _of_another_version\."):
            steering.steer(engine.database, {"render": 1})
    assert "get_queue" not in vars(inner), "nothing is half replaced"


def test_enqueueing_an_id_again_changes_nothing(engine: Engine) -> None:
    engine.enqueue(priority=5)
    engine.claimed_by("somebody")
    engine.enqueue(priority=9)
    row = engine.row()
    assert (row["status"], row["executor_id"], row["priority"]) == ("PENDING", "somebody", 5)


def test_an_enqueue_is_part_of_the_transaction(engine: Engine) -> None:
    def enqueue_and_fail() -> None:
        with engine.database.write() as connection:
            system.enqueue(engine.jobs.client, connection, "task", ID, "render", "j", 1, 0, 0, priority=1)
            raise KeyError

    with pytest.raises(KeyError):
        enqueue_and_fail()
    with engine.database.read() as connection:
        assert system.status(connection, engine.database, ID) is None


def test_our_cancelling_is_that_of_dbos(engine: Engine) -> None:
    for workflow_id in ("a/0", "b/0"):
        engine.enqueue(workflow_id)
        engine.claimed_by("somebody", workflow_id)
    DBOS.cancel_workflow("a/0")
    table = system.workflows(engine.database)
    with engine.database.write() as connection:
        assert system.cancel(connection, engine.database, system.under(table, "b/", engine.database)) == 1
    theirs, ours = engine.row("a/0"), engine.row("b/0")
    for name in ("updated_at", "completed_at"):
        assert abs(theirs.pop(name) - ours.pop(name)) < 60_000
    for name in ("workflow_uuid", "created_at"):
        theirs.pop(name), ours.pop(name)
    assert ours == theirs


def test_what_is_given_back_does_not_count_as_an_attempt(engine: Engine) -> None:
    engine.enqueue()
    engine.claimed_by("me")
    with engine.database.write() as connection:
        assert system.hand_back(connection, engine.database, "other") == 0
        assert system.hand_back(connection, engine.database, "me", [ID]) == 1
    row = engine.row()
    assert (row["status"], row["recovery_attempts"], row["owner_xid"]) == ("ENQUEUED", 0, None)


def test_a_claim_stays_within_the_process_s_own_slots(engine: Engine) -> None:
    from dbos._dbos import _get_dbos_instance

    system_database = _get_dbos_instance()._sys_db
    registered = system_database.get_queue("render")
    assert registered is not None
    assert registered._worker_concurrency == 0
    slots = {"render": 2}
    steering.steer(engine.database, slots)
    for number in range(3):
        engine.enqueue(f"t/{number}", priority=3 - number)
    queue = system_database.get_queue("render")
    assert queue is not None
    claimed, _ = system_database.start_queued_workflows(queue, "me", system.VERSION, None, 0, owner_xid="x")
    assert claimed == ["t/2", "t/1"], "by priority, as many as there are slots"
    slots.clear()
    assert system_database.get_queue("render")._worker_concurrency == 0  # type: ignore[union-attr]


def test_a_queue_is_claimed_from_only_while_something_waits_in_it(engine: Engine) -> None:
    from dbos._dbos import _get_dbos_instance

    system_database = _get_dbos_instance()._sys_db
    assert system_database.dequeue_scopes("render") == [None]
    steering.steer(engine.database, {"render": 1})
    assert system_database.dequeue_scopes("render") == []
    engine.enqueue()
    assert system_database.dequeue_scopes("render") == [None]
    assert system_database.dequeue_scopes("label") == []
    engine.claimed_by("somebody")
    assert system_database.dequeue_scopes("render") == []


def test_whether_something_waits_is_read_from_an_index(tmp_path: Path) -> None:
    database = open_database(f"sqlite:///{tmp_path / 'queues.sqlite'}")
    system.migrate(database)
    asked = system.waiting(database).params(queue="render")
    statement = str(asked.compile(database.engine, compile_kwargs={"literal_binds": True}))
    with database.read() as connection:
        plan = str(connection.exec_driver_sql(f"explain query plan {statement}").all())
    database.close()
    assert "USING COVERING INDEX" in plan, "half a million waiting rows must not slow it down"


def test_prefixes_match_whole_parts_only(engine: Engine) -> None:
    for workflow_id in ("job_a.1/0/0", "job_a.1/10/0", "job_a.10/0/0", "jobXa.1/0/0"):
        engine.enqueue(workflow_id)
    with engine.database.read() as connection:
        found = system.statuses(connection, engine.database, "job_a.1/")
        assert [name for name, _ in found] == ["job_a.1/0/0", "job_a.1/10/0"]
        assert system.live(connection, engine.database, "job_a.1/1") == 1


def test_workflow_names_and_limits_are_what_the_engine_says() -> None:
    for function, lost in ((flow.task, 2), (flow.check, 2), (flow.job, flow.JOB_EXECUTORS)):
        assert function.dbos_func_decorator_info.max_recovery_attempts == lost  # type: ignore[attr-defined]
    assert queues.CLASSES["low"] + queues.CLASS_WIDTH < 2**31
