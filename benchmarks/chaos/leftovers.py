"""What is left of processes that were killed: nothing may be."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

import sqlalchemy as sa

from services.database import tables
from services.engine import system
from services.engine.rooms import KERNELS
from services.retention import sweep, sweep_cache
from services.settings import Settings
from services.storage import open_storage
from stages.store import Store
from tests.support.cluster import Cluster

LATER_SECONDS = 2 * 24 * 3600.0
"""Retention leaves what is younger than a day: it may still be written."""
_ENDED_SECONDS = 10.0


def leftovers(cluster: Cluster, mark: str, settings: Settings) -> dict[str, list[str]]:
    """What should be gone and is not, by kind; all processes were asked to end.

    Args:
        cluster: Whose processes they were.
        mark: `NAME=VALUE` in the environment of all of them.
        settings: Of the database and store.
    """
    found = {
        "processes": _processes(mark),
        "rooms": [str(room.relative_to(cluster.folder)) for room in cluster.folder.glob("*/work/*") if _is_room(room)],
        "rows": _rows(cluster),
        "files": _files(cluster, settings),
    }
    return {kind: names for kind, names in found.items() if names}


def _processes(mark: str) -> list[str]:
    """Processes that still live a while after they were asked to end, or their parents died."""
    end = time.monotonic() + _ENDED_SECONDS
    while (alive := [path.parent.name for path in Path("/proc").glob("[0-9]*/environ") if _has(path, mark)]) and (
        time.monotonic() < end
    ):
        time.sleep(0.2)
    return alive


def _has(environ: Path, mark: str) -> bool:
    with suppress(OSError):
        return mark.encode() in environ.read_bytes().split(b"\0") and environ.parent.name != str(os.getpid())
    return False


def _is_room(path: Path) -> bool:
    return path.is_dir() and path.name != KERNELS


def _rows(cluster: Cluster) -> list[str]:
    """Rows of processes, claims, tasks and checks that are gone."""
    database = cluster.service.database
    workflows, task, scene = system.workflows(database), tables.tasks, tables.scenes
    queries = {
        "executor": sa.select(tables.executors.c.id),
        "workflow": sa.select(workflows.c.workflow_uuid).where(workflows.c.status.in_(system.LIVE)),
        "task": sa.select(task.c.artifact).where(task.c.state.in_(("queued", "running"))),
        "check": sa.select(scene.c.id).where(scene.c.state == "checking"),
    }
    with database.read() as connection:
        return [f"{kind} {name}" for kind, query in queries.items() for name in connection.scalars(query)]


def _files(cluster: Cluster, settings: Settings) -> list[str]:
    """Temporary files and unfinished objects that retention has not removed once they are old enough."""
    later = time.time() + LATER_SECONDS
    sweep(cluster.service.database, cluster.service.storage, settings, later)
    found = []
    for state in sorted(path for path in cluster.folder.iterdir() if (path / "cache").is_dir()):
        own = settings.model_copy(update={"state": state})
        sweep_cache(open_storage(own), own, later)
        Store(own.cache_folder).clean(later)
        parts = [*state.glob("cache/tmp/*"), *state.glob("cache/sources/.*"), *state.glob("checkpoints/*")]
        found += [str(path.relative_to(cluster.folder)) for path in parts]
    return found
