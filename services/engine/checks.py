"""Checks of scenes that nobody does any more."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import sqlalchemy as sa

from schemas.problem import ExitCode, Problem
from services.database import Database, tables
from services.engine import system
from services.problems import document_of

if TYPE_CHECKING:
    from services.engine.jobs import Jobs

PAUSE_SECONDS = 5.0
TRIES = 3
MOST = 100


def see_to_adrift(database: Database, jobs: Jobs) -> None:
    """Queues checks again whose workflow failed or never came, and rejects a scene that took its checkers with it."""
    table = tables.scenes
    waiting = sa.select(table.c.id).where(table.c.state == "checking", table.c.created < time.time() - PAUSE_SECONDS)
    with database.read() as connection:
        ids = list(connection.scalars(waiting.limit(MOST)))
        found = {scene_id: system.statuses(connection, database, f"{scene_id}/") for scene_id in ids}
    for scene_id, workflows in found.items():
        if any(status in system.LIVE for _, status in workflows):
            continue
        if len(workflows) < TRIES:
            jobs.check_scene(scene_id)
            continue
        problem = Problem(
            f"The scene could not be checked within {TRIES} tries.",
            "It probably exhausts the machine's memory: upload a simpler one.",
            ExitCode.LIMIT,
        )
        values = {"state": "rejected", "problem": document_of(problem).model_dump(mode="json")}
        with database.write() as connection:
            here = [table.c.id == scene_id, table.c.state == "checking"]
            connection.execute(table.update().where(*here).values(**values))
