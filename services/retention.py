"""Retention: what is no longer used is removed, by age and by size.

Never removed:
- what a published version refers to: its files, the artifacts it was made from, the scenes of the job that made it;
- what the tasks of unfinished jobs make or read;
- artifacts used within the hour, blobs used within the day: someone may be about to refer to them.

Beyond that, jobs go `keep_days` after their end with their tasks and events, and so do deliveries of webhooks; scenes
and data sets when no job that is still listed names them; artifacts and blobs when nothing was read of them for
`keep_days`, and earlier, the least recently used first, while all together are more than `keep_bytes`. What is removed
and needed again is made again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from schemas.job import FINAL_STATES
from services.database import Database
from services.database.tables import datasets, deliveries, events, jobs, scenes, tasks, uploads, versions
from services.settings import Settings
from services.storage import Blobs, Storage
from stages.store import Store

DAY = 86400.0
ARTIFACT_GRACE = 3600.0
"""Seconds after its last use before which no artifact is removed."""
BLOB_GRACE = DAY
"""The same for blobs: the files of a scene are uploaded one by one, and referred to when all are there."""
CACHE_GRACE = DAY
"""The same for local copies: a task may be reading them."""
UPLOAD_GRACE = DAY
"""Seconds after its last part before which no upload is given up."""


@dataclass(frozen=True)
class SweepResult:
    """What a sweep removed: numbers, and the bytes of artifacts and blobs."""

    jobs: int = 0
    scenes: int = 0
    datasets: int = 0
    uploads: int = 0
    artifacts: int = 0
    blobs: int = 0
    bytes: int = 0


@dataclass(frozen=True)
class References:
    """What must stay: artifacts as `stage/key`, blobs by sha256."""

    artifacts: frozenset[str]
    blobs: frozenset[str]


@dataclass(frozen=True)
class _Item:
    """Something that could be removed."""

    name: str
    remove: Callable[[str], None]
    bytes: int
    last_used: float
    grace: float


def sweep(database: Database, storage: Storage, settings: Settings, now: float) -> SweepResult:
    """Removes what is no longer used. Any number of processes may do so at the same time.

    Args:
        database: The service's.
        storage: The service's.
        settings: `keep_days` and `keep_bytes`.
        now: Seconds since 1970 UTC.

    Raises:
        Problem: The object store cannot be reached.
    """
    # Listed before the references are read: what comes to be referred to meanwhile is seen to be.
    artifacts, blobs = list(storage.store.artifacts()), list(storage.blobs.all())
    expired = (0, 0, 0)
    if settings.keep_days > 0.0:
        cutoff = now - settings.keep_days * DAY
        recent = {sha256 for sha256, _, last_used in blobs if last_used >= cutoff}
        expired = database.retry(lambda connection: _expire_rows(connection, cutoff, recent))
    given_up = _expire_uploads(database, storage.blobs, now)
    kept = references(database)
    items = [
        _Item(found.artifact, storage.store.remove, found.bytes, found.last_used, ARTIFACT_GRACE)
        for found in artifacts
        if found.artifact not in kept.artifacts
    ]
    items += [
        _Item(sha256, storage.blobs.remove, size, last_used, BLOB_GRACE)
        for sha256, size, last_used in blobs
        if sha256 not in kept.blobs
    ]
    total = sum(artifact.bytes for artifact in artifacts) + sum(size for _, size, _ in blobs)
    removed = _remove(items, total, settings, now)
    gone = {item.name for item in removed}
    broken = database.retry(lambda connection: _remove_broken_datasets(connection, gone)) if gone else 0
    storage.store.clean(now)
    sweep_cache(storage, settings, now)
    return SweepResult(
        jobs=expired[0],
        scenes=expired[1],
        datasets=expired[2] + broken,
        uploads=given_up,
        artifacts=sum("/" in item.name for item in removed),
        blobs=sum("/" not in item.name for item in removed),
        bytes=sum(item.bytes for item in removed),
    )


def sweep_cache(storage: Storage, settings: Settings, now: float) -> None:
    """Removes local copies of what lies in an object store, by the same age and size, and checkpoints done with.

    Every process with a cache does it for its own.

    Args:
        storage: The service's; if it is a folder, there are checkpoints alone.
        settings: `keep_days` and `keep_bytes`.
        now: Seconds since 1970 UTC.
    """
    items = [
        _Item(copy.artifact, storage.store.drop, copy.bytes, copy.last_used, CACHE_GRACE)
        for copy in storage.store.cached()
    ]
    items += [
        _Item(sha256, storage.blobs.drop, size, last_used, CACHE_GRACE)
        for sha256, size, last_used in storage.blobs.cached()
    ]
    _remove(items, sum(item.bytes for item in items), settings, now)
    _sweep_checkpoints(storage.store)


def _sweep_checkpoints(store: Store) -> None:
    """Removes the checkpoints of trainings whose worker was killed, and which another one has finished."""
    for folder in store.checkpoints.glob("[0-9a-f]" * 64):
        if folder.is_dir() and store.holds(f"train/{folder.name}"):
            shutil.rmtree(folder, ignore_errors=True)


def references(database: Database) -> References:
    """What versions and unfinished jobs refer to, and the files of all scenes."""
    artifacts: set[str] = set()
    blobs: set[str] = set()
    with database.read() as connection:
        for version in connection.execute(sa.select(versions.c.artifacts, versions.c.files)):
            artifacts.update(version.artifacts)
            blobs.update(file["sha256"] for file in version.files.values())
        for files in connection.scalars(sa.select(scenes.c.files)):
            blobs.update(file["sha256"] for file in files.values())
        unfinished = jobs.c.state.not_in(FINAL_STATES)
        ours = sa.select(tasks.c.artifact, tasks.c.task).join(jobs, jobs.c.id == tasks.c.job_id).where(unfinished)
        for task in connection.execute(ours):
            artifacts.update((task.artifact, *task.task.get("needs", ())))
            for source in (task.task.get("scene"), task.task.get("bundle")):
                blobs.update((source or {}).get("files", {}).values())
        specs = connection.scalars(sa.select(jobs.c.spec).where(unfinished)).all()
        learnt = {spec.get("dataset") for spec in specs} - {None}
        for shards in connection.scalars(sa.select(datasets.c.shards).where(datasets.c.id.in_(learnt))):
            artifacts.update(shard["artifact"] for shard in shards)
    return References(frozenset(artifacts), frozenset(blobs))


def _remove(items: Iterable[_Item], total: int, settings: Settings, now: float) -> list[_Item]:
    """Removes the least recently used first: what is too old, and what is too much of `total` bytes."""
    removed = []
    for item in sorted(items, key=lambda item: item.last_used):
        age = now - item.last_used
        if age <= item.grace:
            continue
        too_old = 0.0 < settings.keep_days * DAY < age
        too_much = 0 < settings.keep_bytes < total
        if too_old or too_much:
            item.remove(item.name)
            removed.append(item)
            total -= item.bytes
    return removed


def _expire_rows(connection: sa.Connection, cutoff: float, recent: set[str]) -> tuple[int, int, int]:
    """Removes rows of jobs, scenes and data sets that were last used before `cutoff`; how many of each."""
    ended = sa.func.coalesce(jobs.c.finished, jobs.c.created)
    over = jobs.c.state.in_(FINAL_STATES) & (ended < cutoff)
    publishers = sa.select(versions.c.job_id).where(versions.c.job_id.is_not(None))
    for details in (events, tasks):  # a job that published a version stays: it names the version's scenes
        connection.execute(details.delete().where(details.c.job_id.in_(sa.select(jobs.c.id).where(over))))
    gone_jobs = connection.execute(jobs.delete().where(over & jobs.c.id.not_in(publishers))).rowcount
    connection.execute(deliveries.delete().where(deliveries.c.finished < cutoff))
    specs = connection.scalars(sa.select(jobs.c.spec)).all()
    used_scenes = {use["scene"] for spec in specs for use in spec.get("scenes", ())}
    old_scenes = connection.execute(sa.select(scenes.c.id, scenes.c.files).where(scenes.c.created < cutoff)).all()
    gone_scenes = [
        row.id
        for row in old_scenes
        if row.id not in used_scenes and not any(file["sha256"] in recent for file in row.files.values())
    ]
    used_datasets = {spec.get("dataset") for spec in specs} - {None}
    makers = sa.select(jobs.c.id)
    old_datasets = sa.select(datasets.c.id).where(datasets.c.created < cutoff)
    orphans = old_datasets.where(sa.or_(datasets.c.job_id.is_(None), datasets.c.job_id.not_in(makers)))
    gone_datasets = [row for row in connection.scalars(orphans) if row not in used_datasets]
    _delete(connection, scenes, gone_scenes)
    _delete(connection, datasets, gone_datasets)
    return gone_jobs, len(gone_scenes), len(gone_datasets)


def _expire_uploads(database: Database, blobs: Blobs, now: float) -> int:
    """Gives up uploads that got no part for a day, and forgets finished ones; how many."""
    last_parts = dict(blobs.uploads())
    with database.read() as connection:
        created = {row.id: row.created for row in connection.execute(sa.select(uploads.c.id, uploads.c.created))}
    stale = [
        upload_id
        for upload_id in {*created, *last_parts}
        if now - max(created.get(upload_id, 0.0), last_parts.get(upload_id, 0.0)) > UPLOAD_GRACE
    ]
    for upload_id in stale:
        blobs.discard(upload_id)
    database.retry(lambda connection: _delete(connection, uploads, stale))
    return len(stale)


def _remove_broken_datasets(connection: sa.Connection, gone: set[str]) -> int:
    """Removes data sets with a shard that was removed, so that none is offered that cannot be learnt from."""
    rows = connection.execute(sa.select(datasets.c.id, datasets.c.shards)).all()
    broken = [row.id for row in rows if any(shard["artifact"] in gone for shard in row.shards)]
    _delete(connection, datasets, broken)
    return len(broken)


def _delete(connection: sa.Connection, table: sa.Table, ids: list[Any]) -> None:
    for start in range(0, len(ids), 500):
        connection.execute(table.delete().where(table.c.id.in_(ids[start : start + 500])))
