"""What jobs found out: measurements of pictures, and data sets of label shards, recorded once and queried."""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Mapping, Sequence
from typing import Any

import sqlalchemy as sa
from pydantic import BaseModel, ConfigDict
from sqlalchemy.dialects import postgresql, sqlite

from schemas.canonical import canonical_json
from schemas.measurement import Measurement
from schemas.problem import ExitCode, Problem
from schemas.service import DatasetRecord, MeasurementRecord, ShardRef
from services.clock import iso
from services.database import Database
from services.database.tables import datasets, measurements

_DIGEST = re.compile(r"[0-9a-f]{64}")


class MeasurementFilter(BaseModel):
    """Which measurements are asked for; None: all.

    Attributes:
        scene: Label of the scene, or hex digest of its content.
        technique: Name of the technique.
        budget: Budget as a multiple of width * height.
        model: `name@version` of the bundle, or `name` for all its versions.
        job: Id of the job.
        since: Seconds since 1970, this or later.
        until: Seconds since 1970, before this.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene: str | None = None
    technique: str | None = None
    budget: float | None = None
    model: str | None = None
    job: str | None = None
    since: float | None = None
    until: float | None = None


class Measured:
    """Measurements and data sets of a service."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def record(
        self,
        artifact: str,
        found: Sequence[Measurement],
        scene_digests: Mapping[str, str],
        model: str | None,
        job_id: str | None,
    ) -> None:
        """Records the measurements of an artifact; recording them again changes nothing.

        Args:
            artifact: `stage/key` that they were measured in.
            found: In the artifact's order.
            scene_digests: Label of every scene -> hex digest of its content.
            model: `name@version`, where they are a bundle's pictures.
            job_id: Job that they were first measured for.
        """
        now = time.time()
        rows = [
            {
                "artifact": artifact,
                "position": position,
                "job_id": job_id,
                "model": model,
                "scene": one.scene,
                "scene_digest": scene_digests[one.scene],
                "view": one.view,
                "technique": one.technique,
                "budget_factor": one.budget_factor,
                "created": now,
                "data": one.model_dump(mode="json"),
            }
            for position, one in enumerate(found)
        ]
        if rows:
            self._database.retry(lambda connection: _insert_missing(connection, measurements, rows))

    def query(self, wanted: MeasurementFilter, limit: int = 50, after: int | None = None) -> list[MeasurementRecord]:
        """Measurements, newest first.

        Args:
            wanted: Which.
            limit: How many at most.
            after: Only those that come after the one with this id.
        """
        query = sa.select(measurements).where(*_conditions(wanted)).order_by(measurements.c.id.desc()).limit(limit)
        if after is not None:
            query = query.where(measurements.c.id < after)
        with self._database.read() as connection:
            return [_measurement(row) for row in connection.execute(query).mappings()]

    def record_dataset(
        self, settings: Mapping[str, Any], shards: Sequence[ShardRef], job_id: str | None
    ) -> DatasetRecord:
        """Records a data set under the id of its content; the same content again is the same data set.

        Args:
            settings: What its labels were made with.
            shards: In a fixed order.
            job_id: Job that made it first.
        """
        content = {"settings": dict(settings), "shards": [shard.model_dump(mode="json") for shard in shards]}
        dataset_id = f"dst_{hashlib.sha256(canonical_json(content).encode()).hexdigest()[:32]}"
        row = {"id": dataset_id, "job_id": job_id, "created": time.time(), **content}
        self._database.retry(lambda connection: _insert_missing(connection, datasets, [row]))
        return self.dataset(dataset_id)

    def datasets(self, limit: int = 50, after: tuple[float, str] | None = None) -> list[DatasetRecord]:
        """Data sets, newest first.

        Args:
            limit: How many at most.
            after: Only those that come after the one with this time (seconds since 1970) and id.
        """
        place = sa.tuple_(datasets.c.created, datasets.c.id)
        query = sa.select(datasets).order_by(datasets.c.created.desc(), datasets.c.id.desc()).limit(limit)
        if after is not None:
            query = query.where(place < sa.tuple_(sa.literal(after[0]), sa.literal(after[1])))
        with self._database.read() as connection:
            return [_dataset(row) for row in connection.execute(query).mappings()]

    def dataset(self, dataset_id: str) -> DatasetRecord:
        """A data set.

        Raises:
            Problem: There is none of that id.
        """
        with self._database.read() as connection:
            row = connection.execute(sa.select(datasets).where(datasets.c.id == dataset_id)).mappings().first()
        if row is None:
            raise Problem(f"There is no data set {dataset_id}.", "List the data sets.", ExitCode.NOT_FOUND)
        return _dataset(row)


def _insert_missing(connection: sa.Connection, table: sa.Table, rows: Sequence[Mapping[str, Any]]) -> None:
    """Inserts rows of which those that are there already stay as they are."""
    insert = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
    connection.execute(insert(table).on_conflict_do_nothing(), [dict(row) for row in rows])


def _conditions(wanted: MeasurementFilter) -> list[sa.ColumnElement[bool]]:
    columns = measurements.c
    found: list[sa.ColumnElement[bool]] = []
    if wanted.scene is not None:
        # One or the other, so that an index serves: what looks like a digest is one.
        found.append((columns.scene_digest if _DIGEST.fullmatch(wanted.scene) else columns.scene) == wanted.scene)
    if wanted.technique is not None:
        found.append(columns.technique == wanted.technique)
    if wanted.budget is not None:
        found.append(columns.budget_factor == wanted.budget)
    if wanted.model is not None:
        versions = columns.model.startswith(f"{wanted.model}@", autoescape=True)
        found.append(columns.model == wanted.model if "@" in wanted.model else versions)
    if wanted.job is not None:
        found.append(columns.job_id == wanted.job)
    if wanted.since is not None:
        found.append(columns.created >= wanted.since)
    if wanted.until is not None:
        found.append(columns.created < wanted.until)
    return found


def _measurement(row: Any) -> MeasurementRecord:
    return MeasurementRecord(
        id=row["id"],
        created=iso(row["created"]),
        job_id=row["job_id"],
        model=row["model"],
        scene_digest=row["scene_digest"],
        measurement=Measurement.model_validate(row["data"]),
    )


def _dataset(row: Any) -> DatasetRecord:
    return DatasetRecord(
        id=row["id"],
        job_id=row["job_id"],
        created=iso(row["created"]),
        settings=row["settings"],
        shards=tuple(ShardRef.model_validate(shard) for shard in row["shards"]),
    )
