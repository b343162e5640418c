"""The registry: published bundles in a database and a store of blobs.

Rules:
- a bundle is published once: the same files again give the version they already have, whoever publishes them, when and
  however often; the files come first, then one row;
- versions are 1.0.0, 1.1.0, 1.2.0, ... in order of publication, signed; a row never changes, but for its signature
  when the key does, and is never removed;
- publishing moves no alias; `promote` and `rollback` do, and keep who, when and why; `consider` promotes what is
  better on the same held-out views and whose exported forms agree, and names the rest `candidate`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from schemas.bundle import MANIFEST, Manifest, load_manifest
from schemas.bundle_files import bundle_files, check_name, digest_of
from schemas.problem import ExitCode, Problem
from schemas.service import ModelRecord, MoveRecord, PointerRecord, VersionRecord
from services.database import Database
from services.database.tables import aliases, versions
from services.registry import handovers, pointers
from services.registry.aliases import history, local_user, lock_name, move, previous
from services.registry.checkout import check_out
from services.registry.records import CANDIDATE, CHAMPION, Aliases, Move, Publication
from services.registry.rows import files_of, publication_of, signed_columns
from services.registry.signing import Signer
from services.settings import Settings
from services.storage import Blobs

_ALIAS_LENGTH = 40
_OF_VKB = 1.0
"""Score of an allocation that is as good as VKB."""


class Registry:
    """Published bundles.

    Args:
        database: Versions and aliases.
        blobs: The bundles' files.
        signer: Signs what is published here.
        folder: Local checkouts of published bundles; created when the first is made.
    """

    def __init__(self, database: Database, blobs: Blobs, signer: Signer, folder: Path) -> None:
        self._database = database
        self._blobs = blobs
        self._signer = signer
        self._checkouts = folder
        self._manifests: dict[str, Manifest] = {}

    def names(self) -> list[str]:
        """Names that have at least one version, sorted."""
        with self._database.read() as connection:
            return list(connection.scalars(sa.select(versions.c.name).distinct().order_by(versions.c.name)))

    def versions(self, name: str) -> list[Publication]:
        """All versions of a name, oldest first; none if the name is unknown."""
        query = sa.select(versions).where(versions.c.name == check_name(name)).order_by(versions.c.ordinal)
        with self._database.read() as connection:
            return [publication_of(row) for row in connection.execute(query)]

    def aliases(self, name: str) -> Aliases:
        """Aliases of a name and their history."""
        query = sa.select(aliases.c.alias, aliases.c.version).where(aliases.c.name == check_name(name))
        with self._database.read() as connection:
            present = {row.alias: row.version for row in connection.execute(query)}
        past = [Move(when=record.at, **record.model_dump(exclude={"at"})) for record in self.moves(name)]
        return Aliases(aliases=present, history=past)

    def champion(self, name: str) -> Publication | None:
        """The version that the alias `champion` means, if there is one yet."""
        return self._aliased(check_name(name), CHAMPION)

    def resolve(self, reference: str) -> Publication:
        """The version that `name`, `name@alias` or `name@1.2.0` means; a bare name means its champion.

        Raises:
            Problem: There is no such name, version or alias.
        """
        name, _, selector = reference.partition("@")
        selector = selector or CHAMPION
        found = self._aliased(check_name(name), selector) or self._version(name, selector)
        if found is None:
            raise self._unknown(name, selector)
        return found

    def pointer(self, name: str, selector: str) -> PointerRecord:
        """What an alias or a version means now, signed until it expires.

        Raises:
            Problem: There is no such name, version or alias, or this process has another signing key than the registry.
        """
        found = pointers.pointer(self._database, self._signer.key, check_name(name), selector)
        if found is None:
            raise self._unknown(name, selector)
        return found

    def folder(self, publication: Publication) -> Path:
        """A local folder with a version's files, verified, and written again if they were damaged.

        Raises:
            MissingBlob: A file is no longer in the store.
            OSError: The folder cannot be written.
        """
        files = files_of(self._row(publication))
        return check_out(self._checkouts / publication.name / publication.version, publication, files, self._blobs)

    def publish(
        self,
        name: str,
        bundle: Path,
        score: float | None,
        evaluation: Mapping[str, Any],
        *,
        artifacts: Sequence[str] = (),
        job_id: str | None = None,
    ) -> Publication:
        """Makes a bundle a new version, or finds the version that these very files already have.

        Args:
            name: Name to publish under.
            bundle: Folder with manifest.json and the files it lists; anything else in it is left out.
            score: See `Publication.score`.
            evaluation: See `Publication.evaluation`; JSON values.
            artifacts: What it was made from, as `stage/key`: retention keeps that.
            job_id: Job that publishes it.

        Raises:
            Problem: The name is not allowed, or the folder is not a valid bundle.
            OSError: The store cannot be written.
        """
        check_name(name)
        load_manifest(bundle)
        files = bundle_files(bundle)
        if any(self._blobs.put_file(bundle / file) != reference for file, reference in files.items()):
            raise Problem(f"{bundle} changed while it was published.", "Run it again.", ExitCode.TRY_AGAIN)
        digest = digest_of(files)
        known = sa.select(versions).where((versions.c.name == name) & (versions.c.digest == digest))

        def body(connection: sa.Connection) -> Publication:
            lock_name(connection, name)
            row = connection.execute(known).one_or_none()
            if row is None:
                handovers.share_key(connection)
                key = self._signer.key
                handovers.require_key(connection, key)
                values = signed_columns(connection, key, name, digest, files)
                values |= {"score": score, "evaluation": dict(evaluation)}
                values |= {"artifacts": list(artifacts), "job_id": job_id}
                connection.execute(versions.insert().values(values))
                row = connection.execute(known).one()
            return publication_of(row)

        return self._database.retry(body)

    def promote(self, name: str, version: str, reason: str, alias: str = CHAMPION, who: str | None = None) -> None:
        """Points an alias at a version and records the move; does nothing if it points there already.

        Args:
            name: Name of the bundle.
            version: A version of it, or another alias.
            reason: Why.
            alias: The alias to move.
            who: Id of the key that asked for it; None: the user of this process.

        Raises:
            Problem: There is no such version, or the alias is not a name.
        """
        version = self.resolve(f"{name}@{version}").version
        change = _change(check_name(alias), None, version, reason, who)
        move(self._database, name, change)

    def rollback(self, name: str, reason: str, alias: str = CHAMPION, who: str | None = None) -> Publication:
        """Points an alias at the version that it meant before, and records the move.

        Raises:
            Problem: There is no version to go back to (CONFLICT), the name has no such alias (NOT_FOUND), or another
                process moved it meanwhile (CONFLICT).
        """
        now = self.resolve(f"{name}@{check_name(alias)}").version
        before = previous(self.moves(name), alias)
        if before is None:
            raise Problem(
                f"The alias '{alias}' of '{name}' has no version before {now} to go back to.",
                f"`diaphane models promote {name} VERSION --reason TEXT` points it at a version of your choice.",
                ExitCode.CONFLICT,
            )
        move(self._database, name, _change(alias, now, before, reason, who), only_from_before=True)
        return self.resolve(f"{name}@{before}")

    def consider(
        self,
        publication: Publication,
        score: float | None,
        rival: float | None,
        *,
        who: str | None = None,
        promote: bool = True,
    ) -> tuple[bool, str]:
        """Makes a version the champion if it is the first and no worse than VKB, or better than the champion.

        Whatever its score, a version is promoted only if torch, ONNX and GLSL agree within the tolerance of its parity
        report. What is not promoted becomes the `candidate`.

        Args:
            publication: The candidate.
            score: Its score on some views.
            rival: The champion's score on the same views; None if there is no other champion, or it was not measured.
            who: See `promote`.
            promote: Whether it may become the champion.

        Returns:
            Whether the version is the champion now, and the reason in one sentence.
        """
        name, champion = publication.name, self.champion(publication.name)
        if champion is not None and champion.version == publication.version:
            return True, "It is the champion already."
        verdict, reason = _compare(score, champion, rival)
        if not self._parity_holds(publication):
            verdict, reason = False, "Its exported forms do not agree within the tolerance of its parity report."
        if verdict and not promote:
            verdict, reason = False, f"{reason} It stays a candidate, as was asked."
        if verdict:
            before = champion.version if champion else None
            try:
                change = _change(CHAMPION, before, publication.version, reason, who)
                move(self._database, name, change, only_from_before=True)
            except Problem as problem:
                verdict, reason = False, f"{problem.title} It was not compared with that one."
        if not verdict:
            move(self._database, name, _change(CANDIDATE, None, publication.version, reason, who))
        return verdict, reason

    def record(self, publication: Publication) -> VersionRecord:
        """Everything about a version, as the API answers it.

        Raises:
            MissingBlob: Its manifest is no longer in the store.
        """
        return self.records(publication.name, [publication])[0]

    def records(self, name: str, publications: Sequence[Publication]) -> list[VersionRecord]:
        """Everything about some versions of a name, in two queries however many they are.

        Raises:
            MissingBlob: The manifest of one is no longer in the store.
        """
        wanted = [publication.version for publication in publications]
        chosen = sa.select(versions).where((versions.c.name == name) & versions.c.version.in_(wanted))
        meant = sa.select(aliases).where((aliases.c.name == name) & aliases.c.version.in_(wanted))
        with self._database.read() as connection:
            rows = {row.version: row for row in connection.execute(chosen)}
            marks = connection.execute(meant.order_by(aliases.c.alias)).all()
        return [
            self._record(
                publication,
                rows[publication.version],
                tuple(mark.alias for mark in marks if mark.version == publication.version),
            )
            for publication in publications
        ]

    def models(self) -> list[ModelRecord]:
        """All names, sorted, with their latest version and their aliases."""
        with self._database.read() as connection:
            rows = connection.execute(sa.select(versions.c.name, versions.c.version).order_by(versions.c.ordinal)).all()
            marks = connection.execute(sa.select(aliases)).all()
        published: dict[str, list[str]] = {}
        for row in rows:
            published.setdefault(row.name, []).append(row.version)
        return [
            ModelRecord(
                name=name,
                latest=numbers[-1],
                aliases={mark.alias: mark.version for mark in marks if mark.name == name},
                versions=len(numbers),
            )
            for name, numbers in sorted(published.items())
        ]

    def made_from(self, publication: Publication) -> tuple[str, ...]:
        """The artifacts that a version was made from, as `stage/key`; none if it was published as mere files."""
        return tuple(self._row(publication).artifacts)

    def manifest(self, publication: Publication) -> Manifest:
        """The manifest of a version.

        Raises:
            MissingBlob: It is no longer in the store.
        """
        return self._manifest(self._row(publication))

    def moves(self, name: str) -> list[MoveRecord]:
        """Every move of every alias of a name, oldest first."""
        return history(self._database, check_name(name))

    def public_keys(self) -> list[str]:
        """The public key that versions and aliases are signed with, base64, then those that came before it.

        Raises:
            Problem: The key file is damaged.
            OSError: The key file can be neither read nor made.
        """
        with self._database.read() as connection:
            present = handovers.public_key(connection) or self._signer.key.public_key
            return [present, *handovers.retired_keys(connection)]

    def _unknown(self, name: str, selector: str) -> Problem:
        if not self.versions(name):
            title, remedy = f"There is no bundle '{name}' in the registry.", "See `diaphane models list`."
        else:
            title = f"'{name}' has no version or alias '{selector[:_ALIAS_LENGTH]}'."
            remedy = f"See `diaphane models show {name}` for what it has."
        return Problem(title, remedy, ExitCode.NOT_FOUND)

    def _version(self, name: str, version: str) -> Publication | None:
        query = sa.select(versions).where((versions.c.name == name) & (versions.c.version == version))
        with self._database.read() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else publication_of(row)

    def _aliased(self, name: str, alias: str) -> Publication | None:
        meant = (versions.c.name == aliases.c.name) & (versions.c.version == aliases.c.version)
        asked = (aliases.c.name == name) & (aliases.c.alias == alias)
        with self._database.read() as connection:
            row = connection.execute(sa.select(versions).join(aliases, meant).where(asked)).one_or_none()
        return None if row is None else publication_of(row)

    def _row(self, publication: Publication) -> Any:
        mine = (versions.c.name == publication.name) & (versions.c.version == publication.version)
        with self._database.read() as connection:
            return connection.execute(sa.select(versions).where(mine)).one()

    def _record(self, publication: Publication, row: Any, meaning: tuple[str, ...]) -> VersionRecord:
        manifest = self._manifest(row)
        return VersionRecord(
            **publication.model_dump(),
            parity=manifest.parity.model_dump(mode="json"),
            provenance=manifest.provenance.model_dump(mode="json"),
            files=files_of(row),
            statement=row.statement,
            signature=row.signature,
            public_key=row.public_key,
            aliases=meaning,
            job_id=row.job_id,
        )

    def _manifest(self, row: Any) -> Manifest:
        if row.digest not in self._manifests:
            content = b"".join(self._blobs.read(files_of(row)[MANIFEST].sha256))
            self._manifests[row.digest] = Manifest.model_validate_json(content)
        return self._manifests[row.digest]

    def _parity_holds(self, publication: Publication) -> bool:
        parity = self._manifest(self._row(publication)).parity
        return parity.worst <= parity.tolerance


def open_registry(database: Database, blobs: Blobs, settings: Settings) -> Registry:
    """The registry of a service.

    Raises:
        Problem: The signing key of the settings is not one.
    """
    return Registry(database, blobs, Signer.open(settings), settings.state / "registry")


def _change(alias: str, before: str | None, after: str, why: str, who: str | None) -> MoveRecord:
    return MoveRecord(alias=alias, before=before, after=after, at="", who=who or local_user(), why=why)


def _compare(score: float | None, champion: Publication | None, rival: float | None) -> tuple[bool, str]:
    if score is None or not math.isfinite(score):
        return False, "It has no score: no held-out view could be compared."
    if champion is None:
        if score > _OF_VKB:
            return False, (
                f"Score {score:.4g}: it is the first version with a score, but worse than VKB. More scenes or steps "
                "may help; `diaphane models promote` makes it the champion by hand."
            )
        return True, "It is the first version with a score."
    if rival is None or not math.isfinite(rival):
        return False, (
            f"The champion {champion.version} was trained on a scene of these views, or could not be measured on them: "
            "it stays; `diaphane models promote` moves it by hand."
        )
    verdict = "better than" if score < rival else "not better than"
    return score < rival, f"Score {score:.4g}, {verdict} {rival:.4g} of the champion {champion.version} on these views."
