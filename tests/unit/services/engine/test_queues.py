"""Order of tasks in a queue."""

from __future__ import annotations

from support.workers import Fleet

from schemas.job import Priority
from services.engine import queues, system
from services.settings import Settings


def _queue(fleet: Fleet, job: str, count: int, priority: Priority = "normal") -> None:
    with fleet.database.write() as connection:
        first = queues.next_priority(connection, fleet.database, "render", priority, f"{job}.1/")
        for number in range(count):
            name = f"{job}.1/{first + number}/0"
            system.enqueue(fleet.jobs.client, connection, "task", name, "render", priority=first + number)


def _serve(fleet: Fleet, count: int) -> str:
    """What DBOS would serve next, by its order."""
    table = system.workflows(fleet.database)
    served = ""
    for _ in range(count):
        with fleet.database.write() as connection:
            waiting = table.select().where(table.c.status == "ENQUEUED")
            row = connection.execute(waiting.order_by(table.c.priority, table.c.created_at).limit(1)).one()
            connection.execute(table.update().where(table.c.status == "PENDING").values(status="SUCCESS"))
            this = table.c.workflow_uuid == row.workflow_uuid
            connection.execute(table.update().where(this).values(status="PENDING"))
        served += row.workflow_uuid[0]
    return served


def test_a_job_that_comes_later_takes_turns_with_one_that_has_begun(fleet: Fleet) -> None:
    _queue(fleet, "a", 8)
    assert _serve(fleet, 3) == "aaa"
    _queue(fleet, "b", 4)
    assert sorted(_serve(fleet, 2)) == ["a", "b"]
    assert _serve(fleet, 6).count("b") == 3


def test_a_job_that_queues_more_does_not_get_more(fleet: Fleet) -> None:
    _queue(fleet, "a", 4)
    _queue(fleet, "b", 2)
    _queue(fleet, "a", 4)
    assert _serve(fleet, 4).count("b") == 2


def test_classes_are_served_one_after_the_other(fleet: Fleet) -> None:
    _queue(fleet, "l", 2, "low")
    _queue(fleet, "n", 2)
    _queue(fleet, "h", 2, "high")
    assert _serve(fleet, 6) == "hhnnll"


def test_an_empty_queue_begins_again(fleet: Fleet) -> None:
    _queue(fleet, "a", 3)
    _serve(fleet, 3)
    table = system.workflows(fleet.database)
    with fleet.database.write() as connection:
        connection.execute(table.update().values(status="SUCCESS"))
        first = queues.next_priority(connection, fleet.database, "render", "normal", "b.1/")
    assert first == queues.CLASSES["normal"]


def test_a_process_has_the_slots_of_its_roles() -> None:
    settings = Settings(slots_render=3, slots_label=2)
    assert queues.slots(settings, ("label", "jobs")) == {"jobs": queues.JOB_SLOTS, "label": 2}
    assert queues.slots(settings, ("render",)) == {"render": 3, "check": 2, "check-long": 1}
