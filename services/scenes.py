"""Scenes: files by hash, checked before any job may use them.

A scene's id comes from its content, so that the same files are one scene however often they are sent. The check runs on
a worker (`services.intake`), in a child process with limits: this module opens no file.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Mapping
from pathlib import PurePosixPath
from typing import Any, Protocol

import sqlalchemy as sa

from schemas.canonical import canonical_json
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.service import FileRef, ProblemDocument, SceneRecord, SceneState
from services.clock import iso
from services.database import Database
from services.database.tables import scenes as table
from services.problems import Refusal
from services.storage import Blobs
from services.webhooks import outbox

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz", ".glb")
"""Of a file that can be opened as a scene."""

QUOTA_CHECKS = 64
"""Scenes of one key that may wait for their checks."""
RETRY_SECONDS = 10
"""When to come again with a scene beyond them."""

_PATIENCE_SECONDS = 5.0
_PATH_LENGTH = 512
_NAMED_MISSING = 100
_IDS_PER_QUERY = 500


class Checks(Protocol):
    """Where checks are asked for: `services.engine.jobs.Jobs`."""

    def check_next(self, scene_id: str) -> None:
        """Has workers check what the key that sent a scene has waiting, in turn; asking again changes nothing."""


class Scenes:
    """The scenes of a service.

    Args:
        database: Their records.
        blobs: Their files.
        jobs: Checks them.
    """

    def __init__(self, database: Database, blobs: Blobs, jobs: Checks) -> None:
        self._database, self._blobs, self._jobs = database, blobs, jobs

    def create(self, name: str, root: str, files: Mapping[str, str], by: str) -> tuple[SceneRecord, bool]:
        """Registers a scene whose files were uploaded, and has it checked.

        Args:
            name: What its owner calls it.
            root: The file that is opened.
            files: Relative path -> hex sha256.
            by: Id of the key.

        Returns:
            The record, and whether the scene is new.

        Raises:
            Problem: A path is not fit for a file, there are too many files or bytes, or the root is none of them.
            Refusal: Files were not uploaded, or too many scenes of the key wait for their checks.
        """
        _check_paths(root, files)
        references = self._references(files)
        digest = _digest(root, files)
        scene_id = f"scn_{digest[:32]}"
        row = {
            "id": scene_id,
            "digest": digest,
            "name": name,
            "root": root,
            "files": {path: reference.model_dump() for path, reference in references.items()},
            "bytes": sum(reference.bytes for reference in references.values()),
            "state": "checking",
            "created": time.time(),
            "created_by": by,
        }

        def insert(connection: sa.Connection) -> bool:
            if connection.scalar(sa.select(table.c.id).where(table.c.id == scene_id)) is not None:
                return False
            _check_quota(connection, by)
            connection.execute(table.insert().values(**row))
            return True

        try:
            new = self._database.retry(insert, _PATIENCE_SECONDS)
        except sa.exc.IntegrityError:
            new = False  # the same scene came at the same time
        record = self.get(scene_id)
        if record.state == "checking":  # also when it is not new: whoever inserted it may have died before it asked
            self._jobs.check_next(scene_id)
        return record, new

    def get(self, scene_id: str) -> SceneRecord:
        """A scene.

        Raises:
            Problem: There is none of that id.
        """
        found = self.many([scene_id])
        if scene_id not in found:
            raise Problem(f"There is no scene {scene_id}.", "List the scenes.", ExitCode.NOT_FOUND)
        return found[scene_id]

    def list(
        self, *, state: SceneState | None = None, limit: int = 50, after: tuple[float, str] | None = None
    ) -> list[SceneRecord]:
        """Scenes, newest first.

        Args:
            state: Only those in this state.
            limit: How many at most.
            after: Only those that come after the one with this time (seconds since 1970) and id.
        """
        query = sa.select(table).order_by(table.c.created.desc(), table.c.id.desc()).limit(limit)
        if state is not None:
            query = query.where(table.c.state == state)
        if after is not None:
            place = sa.tuple_(table.c.created, table.c.id)
            query = query.where(place < sa.tuple_(sa.literal(after[0]), sa.literal(after[1])))
        with self._database.read() as connection:
            return [_record(row) for row in connection.execute(query).mappings()]

    def many(self, ids: Iterable[str]) -> dict[str, SceneRecord]:
        """The scenes of these ids that exist, by id."""
        wanted = sorted(set(ids))
        found: dict[str, SceneRecord] = {}
        with self._database.read() as connection:
            for start in range(0, len(wanted), _IDS_PER_QUERY):
                query = sa.select(table).where(table.c.id.in_(wanted[start : start + _IDS_PER_QUERY]))
                found |= {row["id"]: _record(row) for row in connection.execute(query).mappings()}
        return found

    def resolve_check(
        self, scene_id: str, facts: Mapping[str, Any] | None, problem: ProblemDocument | None = None
    ) -> None:
        """Writes down what the check of a scene found; only the first result counts.

        Args:
            scene_id: The scene.
            facts: What was found in it, if it is accepted.
            problem: Why it is rejected.
        """
        values: dict[str, Any] = {"state": "rejected" if problem else "accepted"}
        values["facts"] = None if facts is None else dict(facts)
        values["problem"] = None if problem is None else problem.model_dump(mode="json")
        open_check = sa.and_(table.c.id == scene_id, table.c.state == "checking")
        change = table.update().where(open_check).values(**values)

        def update(connection: sa.Connection) -> None:
            changed = connection.execute(change.returning(table.c.id, table.c.name, table.c.created_by)).first()
            if changed is not None and problem is not None:
                outbox.scene_rejected(connection, changed, problem)

        self._database.retry(update)

    def _references(self, files: Mapping[str, str]) -> dict[str, FileRef]:
        sizes = {sha256: self._blobs.size(sha256) for sha256 in sorted(set(files.values()))}
        missing = [sha256 for sha256, size in sizes.items() if size is None]
        if missing:
            raise Refusal(
                "blobs-missing",
                f"{len(missing)} of {len(sizes)} files of the scene were not uploaded.",
                more={"missing": missing[:_NAMED_MISSING]},
            )
        references = {path: FileRef(sha256=sha256, bytes=sizes[sha256] or 0) for path, sha256 in files.items()}
        if sum(reference.bytes for reference in references.values()) > LIMITS.upload_bytes:
            raise Problem(
                f"The files of the scene are more than {LIMITS.upload_bytes} bytes.",
                "Make the scene smaller.",
                ExitCode.LIMIT,
            )
        return references


def _check_quota(connection: sa.Connection, by: str) -> None:
    """Bounds what waits of one key."""
    waiting = sa.select(sa.func.count()).where(table.c.created_by == by, table.c.state == "checking")
    if int(connection.scalar(waiting) or 0) >= QUOTA_CHECKS:
        raise Refusal(
            "too-many-requests",
            f"{QUOTA_CHECKS} scenes of this key wait for their checks.",
            "Wait until some are checked.",
            headers={"Retry-After": str(RETRY_SECONDS)},
        )


def _digest(root: str, files: Mapping[str, str]) -> str:
    return hashlib.sha256(canonical_json([root, sorted(files.items())]).encode()).hexdigest()


def _check_paths(root: str, files: Mapping[str, str]) -> None:
    if len(files) > LIMITS.scene_files:
        raise Problem(
            f"A scene has at most {LIMITS.scene_files} files.", "Pack the scene into a usdz file.", ExitCode.LIMIT
        )
    for path in files:
        if not _is_plain(path):
            raise Problem(
                "A file of the scene has a name that is not a plain relative path.",
                "Name files relative to the scene's folder, with '/', without '..', ':' and control characters.",
            )
    if root not in files or not root.lower().endswith(SUFFIXES):
        raise Problem(
            "The root of the scene is not one of its files, or not of a known type.",
            f"Name the root file: {', '.join(SUFFIXES)}.",
        )
    folded = {path.casefold() for path in files}
    parents = {parent.as_posix().casefold() for path in files for parent in PurePosixPath(path).parents}
    if len(folded) != len(files) or folded & parents:
        raise Problem(
            "Two files of the scene have names that some file systems cannot tell apart.",
            "Give them names that differ in more than case.",
        )


def _is_plain(path: str) -> bool:
    """Whether a name means the same below any folder, on any file system."""
    segments = path.split("/")
    return (
        len(path.encode()) <= _PATH_LENGTH
        and path.isprintable()
        and not set(path) & set('\\:*?"<>|')
        and all(segment.strip(" .") and len(segment.encode()) <= 255 for segment in segments)
    )


def _record(row: Any) -> SceneRecord:
    return SceneRecord(
        id=row["id"],
        digest=row["digest"],
        name=row["name"],
        root=row["root"],
        files={path: FileRef.model_validate(reference) for path, reference in row["files"].items()},
        bytes=row["bytes"],
        state=row["state"],
        problem=None if row["problem"] is None else ProblemDocument.model_validate(row["problem"]),
        facts=row["facts"],
        created=iso(row["created"]),
    )
