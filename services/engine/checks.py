"""Checks of uploaded scenes: in a queue and slots of their own, so that no upload holds up a task, and fair by key.

The waiting scenes of a key are its own queue, in the order in which they came. At most `checks_per_key` of them are
among the workflows at once; the next one follows when one is done. So keys take turns, however many uploads each has
waiting, and a key whose uploads take all the time that they may holds that many slots and no more.

Several keys could hold all slots that way. So a check has a turn (`check_turn`): one that takes longer while others
wait is ended, and begins again in a queue and a slot for long ones. Where nobody waits it simply goes on.

A check's workflows have the ids check/KEY/SCENE/NUMBER.
"""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING

import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from schemas.problem import ExitCode, Problem
from services.database import Database, tables
from services.engine import queues, system
from services.problems import document_of
from services.webhooks import outbox

if TYPE_CHECKING:
    from dbos import DBOSClient

    from services.engine.jobs import Jobs

PAUSE_SECONDS = 5.0
TRIES = 3
MOST = 100
LOOK_SECONDS = 0.5
"""Between two looks at whether others wait, when a turn is over."""


class TurnOver(Exception):
    """A check has had its turn, and others wait."""


class Turn:
    """The time of a check while others wait.

    Args:
        database: That the checks are queued in.
        seconds: How long it is.
    """

    def __init__(self, database: Database, seconds: float) -> None:
        self._database, self._next, self._waited = database, time.monotonic() + seconds, False

    def tick(self) -> None:
        """Ends the check if its turn is over and others wait.

        They are seen twice: what a free slot takes at the next poll does not wait.

        Raises:
            TurnOver: It ends.
        """
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + LOOK_SECONDS
        waits = False
        with suppress(DBAPIError), self._database.read() as connection:
            waits = connection.execute(system.waiting(self._database), {"queue": queues.CHECKS}).first() is not None
        if waits and self._waited:
            raise TurnOver
        self._waited = waits


def prefix_of(key: str, scene_id: str = "") -> str:
    """What the ids of workflows begin with, of all checks of a key or of those of one scene."""
    return f"check/{key}/{scene_id}/" if scene_id else f"check/{key}/"


def queue_next(connection: sa.Connection, database: Database, client: DBOSClient, key: str, at_once: int) -> None:
    """Queues the next checks of a key; doing it again changes nothing while they wait or run.

    Args:
        connection: The caller's transaction.
        database: The same database.
        client: Queues workflows in it.
        key: Id of the key that sent the scenes.
        at_once: How many checks of a key wait in the queue, or run, at once.
    """
    table = tables.scenes
    waiting = sa.select(table.c.id).where(table.c.created_by == key, table.c.state == "checking")
    # The rows are held: of two processes that do this at once, the second sees what the first has queued.
    ids = list(connection.scalars(waiting.order_by(table.c.created, table.c.id).limit(MOST).with_for_update()))
    queued = {name.split("/")[2] for name in system.live_ids(connection, database, prefix_of(key))}
    free = at_once - len(queued & set(ids))
    for scene_id in ids:
        if free <= 0:
            return
        prefix = prefix_of(key, scene_id)
        tried = len(system.statuses(connection, database, prefix))
        if scene_id not in queued and tried < TRIES:
            name, free = f"{prefix}{tried}", free - 1
            system.enqueue(client, connection, "check", name, queues.CHECKS, scene_id, False, priority=1)


def queue_long(connection: sa.Connection, database: Database, client: DBOSClient, ended: str) -> None:
    """Queues a check again, among those that take longer than a turn; doing it again changes nothing.

    Args:
        connection: The caller's transaction.
        database: The same database.
        client: Queues workflows in it.
        ended: Id of the workflow whose turn is over, and that still runs.
    """
    _, key, scene_id, _ = ended.split("/")
    prefix = prefix_of(key, scene_id)
    if set(system.live_ids(connection, database, prefix)) - {ended}:
        return
    name = f"{prefix}{len(system.statuses(connection, database, prefix))}"
    system.enqueue(client, connection, "check", name, queues.LONG_CHECKS, scene_id, True, priority=1)


def see_to_adrift(database: Database, jobs: Jobs) -> None:
    """Queues checks again whose workflow failed or never came, and rejects a scene that took its checkers with it."""
    table = tables.scenes
    waiting = sa.select(table.c.id, table.c.created_by).where(
        table.c.state == "checking", table.c.created < time.time() - PAUSE_SECONDS
    )
    with database.read() as connection:
        rows = connection.execute(waiting.order_by(table.c.created).limit(MOST)).all()
        first = sa.select(sa.func.min(table.c.id)).where(table.c.state == "checking").group_by(table.c.created_by)
        of_keys = list(connection.scalars(first))
        found = {row.id: system.statuses(connection, database, prefix_of(row.created_by, row.id)) for row in rows}
    for scene_id, workflows in found.items():
        if len(workflows) >= TRIES and not any(status in system.LIVE for _, status in workflows):
            _give_up(database, scene_id)
    for scene_id in of_keys:
        jobs.check_next(scene_id)


def _give_up(database: Database, scene_id: str) -> None:
    problem = Problem(
        f"The scene could not be checked within {TRIES} tries.",
        "It probably exhausts the machine's memory: upload a simpler one.",
        ExitCode.LIMIT,
    )
    document, table = document_of(problem), tables.scenes
    here = [table.c.id == scene_id, table.c.state == "checking"]
    change = table.update().where(*here).values(state="rejected", problem=document.model_dump(mode="json"))
    with database.write() as connection:
        changed = connection.execute(change.returning(table.c.id, table.c.name, table.c.created_by)).first()
        if changed is not None:
            outbox.scene_rejected(connection, changed, document)
