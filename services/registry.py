"""Published bundles: immutable versions, movable aliases with their history.

    root/<name>/versions/<n>/     the bundle's files and publication.json; never changed once there
    root/<name>/aliases.json      which version an alias means, and every move it made

Rules:
- a bundle is published once: the same bytes again give the version they already have;
- versions are 1.0.0, 1.1.0, 1.2.0, ... in order of publication;
- publishing moves no alias; `promote` does, and keeps who, when and why; `consider` promotes what is better;
- publishers exclude each other by a file lock, readers need none.
"""

from __future__ import annotations

import fcntl
import getpass
import hashlib
import math
import re
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from schemas.problem import ExitCode, Problem
from services.store import canonical_json, file_sha256, sync, sync_tree, write_durably

CHAMPION = "champion"
PUBLICATION = "publication.json"
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")
_VERSION = re.compile(r"\d{1,6}\.\d{1,6}\.\d{1,6}")


class Publication(BaseModel):
    """A published version.

    Attributes:
        name: Name of the bundle.
        version: Semantic version.
        digest: Hex sha256 over the names and contents of the bundle's files.
        score: Geometric mean over held-out views and budgets of the bundle's squared error over VKB's; lower is better;
            None where nothing could be compared.
        evaluation: What the score was measured on.
        created: UTC, ISO 8601.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    digest: str
    score: float | None
    evaluation: dict[str, Any]
    created: str


class Move(BaseModel):
    """One move of an alias: from which version to which, when, by whom and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    alias: str
    before: str | None
    after: str
    when: str
    who: str
    why: str


class Aliases(BaseModel):
    """Where the aliases of a name point, and how they got there."""

    model_config = ConfigDict(extra="forbid")

    aliases: dict[str, str] = {}
    history: list[Move] = []


def check_name(name: str) -> str:
    """The name itself, if it can be a bundle's.

    Raises:
        Problem: It is not 1 to 63 small letters, digits and inner hyphens.
    """
    if not _NAME.fullmatch(name):
        raise Problem(
            f"'{name}' cannot be the name of a bundle.",
            "Use 1 to 63 small letters, digits and hyphens, with no hyphen at either end: --name glass.",
        )
    return name


def bundle_digest(folder: Path) -> str:
    """Hex sha256 over the sorted names and contents of a bundle's files."""
    files = {
        path.relative_to(folder).as_posix(): file_sha256(path)
        for path in folder.rglob("*")
        if path.is_file() and path.name not in ("meta.json", PUBLICATION)
    }
    return hashlib.sha256(canonical_json(files).encode()).hexdigest()


class Registry:
    """Published bundles under one folder.

    Args:
        root: Folder; created at the first publication.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    def names(self) -> list[str]:
        """Names that have at least one version, sorted."""
        return sorted(path.parent.name for path in self.root.glob("*/versions") if any(path.iterdir()))

    def versions(self, name: str) -> list[Publication]:
        """All versions of a name, oldest first; none if the name is unknown."""
        folders = [path for path in self._versions(name).glob("*") if _VERSION.fullmatch(path.name)]
        return [_publication(folder) for folder in sorted(folders, key=lambda path: _order(path.name))]

    def aliases(self, name: str) -> Aliases:
        """Aliases of a name and their history."""
        path = self.root / check_name(name) / "aliases.json"
        if not path.is_file():
            return Aliases()
        try:
            return Aliases.model_validate_json(path.read_bytes())
        except ValueError as error:
            raise Problem(
                f"The aliases in {path} cannot be read.",
                f"Remove that file; `diaphane models promote {name} VERSION --reason TEXT` then names a champion.",
                ExitCode.CONFLICT,
            ) from error

    def champion(self, name: str) -> Publication | None:
        """The version that the alias `champion` means, if there is one yet."""
        version = self.aliases(name).aliases.get(CHAMPION)
        return next((publication for publication in self.versions(name) if publication.version == version), None)

    def resolve(self, reference: str) -> Publication:
        """The version that `name`, `name@alias` or `name@1.2.0` means; a bare name means its champion.

        Raises:
            Problem: There is no such name, version or alias.
        """
        name, _, selector = reference.partition("@")
        known = {publication.version: publication for publication in self.versions(name)}
        if not known:
            raise Problem(
                f"There is no bundle '{name}' in {self.root}.", "See `diaphane models list`.", ExitCode.NOT_FOUND
            )
        version = self.aliases(name).aliases.get(selector or CHAMPION, selector)
        if version not in known:
            raise Problem(
                f"'{name}' has no version or alias '{selector or CHAMPION}'.",
                f"See `diaphane models show {name}` for what it has.",
                ExitCode.NOT_FOUND,
            )
        return known[version]

    def folder(self, publication: Publication) -> Path:
        """Where a version's files lie."""
        return self._versions(publication.name) / publication.version

    def publish(self, name: str, bundle: Path, score: float | None, evaluation: Mapping[str, Any]) -> Publication:
        """Copies a bundle in as a new version, or finds the version that these very files already have.

        Args:
            name: Name to publish under.
            bundle: Folder with manifest.json and the files it lists.
            score: See `Publication.score`.
            evaluation: See `Publication.evaluation`; JSON values.

        Raises:
            Problem: The name is not allowed, or the folder holds no manifest.
        """
        if not (bundle / "manifest.json").is_file():
            raise Problem(f"{bundle} is not a bundle: it has no manifest.json.", "Export it again.", ExitCode.NOT_FOUND)
        digest = bundle_digest(bundle)
        with self._locked(name):
            published = self.versions(name)
            for publication in published:
                if publication.digest == digest:
                    self._repair(bundle, publication)
                    return publication
            publication = Publication(
                name=name,
                version=_next_version(published),
                digest=digest,
                score=score,
                evaluation=dict(evaluation),
                created=_now(),
            )
            self._copy_in(bundle, publication)
        return publication

    def promote(self, name: str, version: str, reason: str, alias: str = CHAMPION) -> None:
        """Points an alias at a version and records the move; does nothing if it points there already.

        Raises:
            Problem: There is no such version.
        """
        version = self.resolve(f"{name}@{version}").version
        with self._locked(name):
            state = self.aliases(name)
            before = state.aliases.get(alias)
            if before == version:
                return
            state.aliases[alias] = version
            state.history.append(
                Move(
                    alias=alias,
                    before=before,
                    after=version,
                    when=_now(),
                    who=getpass.getuser(),
                    why=reason,
                )
            )
            write_durably(self.root / name / "aliases.json", state.model_dump_json(indent=2))

    def consider(self, publication: Publication, score: float | None, rival: float | None) -> tuple[bool, str]:
        """Makes a version the champion if it is the first, or better than the champion on the same views.

        Args:
            publication: The candidate.
            score: Its score on some views.
            rival: The champion's score on the same views; None if there is no other champion, or it was not measured.

        Returns:
            Whether the version is the champion now, and the reason in one sentence.
        """
        champion = self.champion(publication.name)
        if champion is not None and champion.version == publication.version:
            return True, "It is the champion already."
        verdict, reason = _compare(score, champion, rival)
        if verdict:
            self.promote(publication.name, publication.version, reason)
        return verdict, reason

    def _versions(self, name: str) -> Path:
        return self.root / check_name(name) / "versions"

    def _copy_in(self, bundle: Path, publication: Publication) -> None:
        target = self.folder(publication)
        temporary = target.parent.parent / f".publishing-{uuid.uuid4().hex}"
        try:
            shutil.copytree(bundle, temporary, ignore=shutil.ignore_patterns("meta.json"))
            if bundle_digest(temporary) != publication.digest:
                raise Problem(f"{bundle} changed while it was published.", "Run it again.", ExitCode.TRY_AGAIN)
            (temporary / PUBLICATION).write_text(publication.model_dump_json(indent=2), encoding="utf-8")
            sync_tree(temporary)
            temporary.rename(target)
            sync(target.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)

    def _repair(self, bundle: Path, publication: Publication) -> None:
        """Writes a version's files again if they are no longer those that were published."""
        folder = self.folder(publication)
        if bundle_digest(folder) != publication.digest:
            folder.rename(folder.parent.parent / f".damaged-{publication.version}-{uuid.uuid4().hex}")
            self._copy_in(bundle, publication)

    @contextmanager
    def _locked(self, name: str) -> Iterator[None]:
        self._versions(name).mkdir(parents=True, exist_ok=True)
        with (self.root / name / ".lock").open("w") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            yield


def _publication(folder: Path) -> Publication:
    try:
        return Publication.model_validate_json((folder / PUBLICATION).read_bytes())
    except (OSError, ValueError) as error:
        raise Problem(
            f"The published version in {folder} cannot be read ({error.__class__.__name__}).",
            "Remove that folder and publish again.",
            ExitCode.NOT_FOUND,
        ) from error


def _compare(score: float | None, champion: Publication | None, rival: float | None) -> tuple[bool, str]:
    if score is None or not math.isfinite(score):
        return False, "It has no score: no held-out view could be compared."
    if champion is None:
        return True, "It is the first version with a score."
    if rival is None or not math.isfinite(rival):
        return False, (
            f"The champion {champion.version} was trained on a scene of these views, or could not be measured on them: "
            "it stays; `diaphane models promote` moves it by hand."
        )
    verdict = "better than" if score < rival else "not better than"
    return score < rival, f"Score {score:.4g}, {verdict} {rival:.4g} of the champion {champion.version} on these views."


def _next_version(published: list[Publication]) -> str:
    if not published:
        return "1.0.0"
    major, minor, _ = _order(published[-1].version)
    return f"{major}.{minor + 1}.0"


def _order(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
