"""A queue for each role and two for checks of uploads, and who is served first.

Order within a queue is by class first (high, normal, low) and by start-time fair queueing within a class (Goyal, Vin
and Cheng, 1996, with equal weights and tasks of equal cost): a job's first task gets the virtual time at which the
queue is now, or that after the job's last one, and every further task one more. So jobs of one class take turns,
however many tasks each has queued and whoever came first.

Checks are queued one after the other for each key (`services.engine.checks`), so keys take turns. One that takes longer
than its turn while others wait goes on in a queue and a slot for such ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import sqlalchemy as sa

from schemas.job import Priority
from services.database import Database
from services.engine import system
from services.settings import Settings
from stages.tasks import ROLES, Role

if TYPE_CHECKING:
    from dbos import DBOSClient

CHECKS: Final = "check"
"""Queue of checks: of the workers for the role `render`, who have USD."""
LONG_CHECKS: Final = "check-long"
"""Queue of checks that took longer than a turn."""
QUEUES: Final = (*ROLES, CHECKS, LONG_CHECKS)

LONG_SLOTS = 1
"""Long checks that a worker runs at once, beside the others."""

JOB_SLOTS = 32
"""Jobs that one process conducts at once; each is a thread that waits."""

CLASS_WIDTH = 1 << 29
CLASSES: dict[Priority, int] = {"high": 1, "normal": 1 + CLASS_WIDTH, "low": 1 + 2 * CLASS_WIDTH}
"""First priority number of each class; the smaller, the earlier."""


def slots(settings: Settings, roles: tuple[Role, ...]) -> dict[str, int]:
    """How many workflows of each queue a process with these roles runs at once."""
    children: dict[Role, int] = {
        "jobs": JOB_SLOTS,
        "render": settings.slots_render,
        "label": settings.slots_label,
        "train": settings.slots_train,
    }
    found: dict[str, int] = {role: children[role] for role in ROLES if role in roles}
    return {**found, CHECKS: settings.slots_check, LONG_CHECKS: LONG_SLOTS} if "render" in roles else found


def register(client: DBOSClient, settings: Settings) -> None:
    """Makes the queues known to all processes.

    A process claims nothing before it has said how much it can do (`steering.steer`).
    """
    for queue in QUEUES:
        client.register_queue(queue, worker_concurrency=0, polling_interval_sec=settings.poll)


def job_priority(priority: Priority) -> int:
    """Of a job itself: jobs of a class begin in the order in which they came."""
    return CLASSES[priority]


def next_priority(
    connection: sa.Connection, database: Database, queue: str, priority: Priority, job_prefix: str
) -> int:
    """Priority number of the next task of a job.

    Args:
        connection: The caller's transaction.
        database: The same database.
        queue: Of the task's role.
        priority: Class of the job.
        job_prefix: That the ids of all the job's tasks begin with.
    """
    table, first = system.workflows(database), CLASSES[priority]
    inside = [table.c.queue_name == queue, table.c.priority >= first, table.c.priority < first + CLASS_WIDTH]
    served = sa.select(sa.func.max(table.c.priority)).where(*inside, table.c.status == "PENDING")
    waiting = sa.select(sa.func.min(table.c.priority)).where(*inside, table.c.status == "ENQUEUED")
    last = sa.select(sa.func.max(table.c.priority)).where(
        *inside, table.c.status.in_(system.LIVE), system.under(table, job_prefix, database)
    )
    now = connection.scalar(served)
    now = connection.scalar(waiting) if now is None else now
    own = connection.scalar(last)
    number = max(first if now is None else int(now), first if own is None else int(own) + 1)
    return min(number, first + CLASS_WIDTH - 1)
