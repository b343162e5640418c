"""A queue for each role, and who is served first.

Order within a queue is by class first (high, normal, low) and by start-time fair queueing within a class (Goyal, Vin
and Cheng, 1996, with equal weights and tasks of equal cost): a job's first task gets the virtual time at which the
queue is now, or that after the job's last one, and every further task one more. So jobs of one class take turns,
however many tasks each has queued and whoever came first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import sqlalchemy as sa

from schemas.job import Priority
from services.database import Database
from services.engine import system
from services.settings import Settings
from services.tasks import ROLES, Role

if TYPE_CHECKING:
    from dbos import DBOSClient

JOB_SLOTS = 32
"""Jobs that one process conducts at once; each is a thread that waits."""

CLASS_WIDTH = 1 << 29
CLASSES: dict[Priority, int] = {"high": 1, "normal": 1 + CLASS_WIDTH, "low": 1 + 2 * CLASS_WIDTH}
"""First priority number of each class; the smaller, the earlier."""


def slots(settings: Settings, roles: tuple[Role, ...]) -> dict[Role, int]:
    """How many workflows of each role a process runs at once."""
    children: dict[Role, int] = {
        "jobs": JOB_SLOTS,
        "render": settings.slots_render,
        "label": settings.slots_label,
        "train": settings.slots_train,
    }
    return {role: children[role] for role in ROLES if role in roles}


def register(client: DBOSClient, settings: Settings) -> None:
    """Makes the queues known to all processes.

    A process claims nothing before it has said how much it can do (`system.limit_slots`).
    """
    for role in ROLES:
        client.register_queue(role, worker_concurrency=0, polling_interval_sec=settings.poll)


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
