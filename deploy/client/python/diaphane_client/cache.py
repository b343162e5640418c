"""The folder of fetched bundles.

    trust.json                      what was seen of servers and bundles: keys, what aliases meant, versions
    <name>/versions/<version>/      a bundle; complete and verified, or not there
    <name>/aliases/<alias>.json     record of the bundle that an alias meant at the last pull
    <name>/parts/<sha256>           downloads under way, which go on after a cut

What is read from here is verified anew: against the hashes, and against what was seen. `trust.json` has no second copy.
Where it is missing or damaged although there are bundles, nothing is fetched: what was seen before would not count.
"""

from __future__ import annotations

import json
import shutil
import uuid
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from diaphane_client.errors import PullError, Refused
from diaphane_client.files import file_sha256, locked, sync_folder, write_whole
from diaphane_client.release import Release, digest_of, parse
from diaphane_client.trust import Trust, forget
from diaphane_client.trust_file import dump_trust, parse_trust

TRUST = "trust.json"


class Cache:
    """Fetched bundles of one name.

    Args:
        folder: Folder of all bundles.
        name: Name of the bundle.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._trust = folder / TRUST
        self._folder = folder / name
        self._name = name

    def lock(self) -> AbstractContextManager[None]:
        """Keeps other processes from pulling the same name."""
        return locked(self._folder / ".lock")

    def part(self, sha256: str) -> Path:
        """Where a download under way lies."""
        path = self._folder / "parts" / sha256
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def trust(self) -> Trust:
        """What was seen so far.

        Raises:
            Refused: It is damaged, or does not know of bundles that are there.
        """
        found = self._read_trust()
        if self._name not in found.names and (self._folder / "versions").exists():
            raise Refused(
                f"There are bundles of '{self._name}' here, but {self._trust} does not know them.",
                f"Restore that file; or call diaphane_client.forget('{self._name}', folder=...), and give the server's "
                "public_key at the next pull.",
            )
        return found

    def learn(self, step: Callable[[Trust], Trust]) -> Trust:
        """Replaces what was seen by what follows from it; no other process does so meanwhile.

        Args:
            step: From what was seen to what is kept.

        Returns:
            What is kept.

        Raises:
            Refused: As `trust`, and what `step` raises.
            OSError: It cannot be written.
        """
        with self._trust_lock():
            return self._write_trust(step, self.trust())

    def forget(self) -> None:
        """Makes the name as if it had never been seen.

        Raises:
            Refused: What was seen of others is damaged.
            OSError: It cannot be written.
        """
        with self._trust_lock():
            self._write_trust(lambda known: forget(known, self._name), self._read_trust())

    def pulled(self, alias: str, trust: Trust) -> Release | None:
        """The record of the bundle that an alias meant at the last pull; None if it is not one that was seen."""
        try:
            release = parse((self._folder / "aliases" / f"{alias}.json").read_bytes())
        except (OSError, PullError):
            return None
        seen = trust.names.get(self._name)
        is_known = seen is not None and seen.versions.get(release.version) == release.digest == digest_of(release)
        return release if is_known else None

    def point(self, alias: str, release: Release) -> None:
        """Writes down which bundle an alias means."""
        write_whole(self._folder / "aliases" / f"{alias}.json", json.dumps(release.as_json(), indent=2).encode())

    def bundle(self, release: Release) -> Path | None:
        """The folder of a release whose files are all there and have their hashes."""
        folder = self._bundle_folder(release)
        try:
            if {path.name for path in folder.iterdir()} != set(release.files):
                return None
            intact = all(file_sha256(folder / name) == file.sha256 for name, file in release.files.items())
        except OSError:
            return None
        return folder if intact else None

    def keep(self, release: Release) -> Path:
        """Makes a bundle of complete, verified parts, in one step; replaces one that is damaged.

        Raises:
            OSError: The folder cannot be written.
        """
        target = self._bundle_folder(release)
        temporary = self._folder / "parts" / f"bundle-{uuid.uuid4().hex}"
        temporary.mkdir()
        try:
            for name, file in release.files.items():
                write_whole(temporary / name, self.part(file.sha256).read_bytes())
            sync_folder(temporary)
            target.parent.mkdir(exist_ok=True)
            if target.exists():
                target.rename(self._folder / "parts" / f"bundle-{uuid.uuid4().hex}")
            temporary.rename(target)
            sync_folder(target.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        shutil.rmtree(self._folder / "parts", ignore_errors=True)
        return target

    def _bundle_folder(self, release: Release) -> Path:
        return self._folder / "versions" / release.version

    def _trust_lock(self) -> AbstractContextManager[None]:
        return locked(self._trust.with_name(f".{TRUST}.lock"))

    def _read_trust(self) -> Trust:
        try:
            return parse_trust(self._trust.read_bytes())
        except FileNotFoundError:
            return Trust()
        except ValueError as error:
            raise Refused(
                f"What was seen of servers and bundles, {self._trust}, cannot be read.",
                "Restore that file, or begin with an empty folder of bundles.",
            ) from error

    def _write_trust(self, step: Callable[[Trust], Trust], before: Trust) -> Trust:
        after = step(before)
        if after is not before:
            write_whole(self._trust, dump_trust(after).encode())
            sync_folder(self._trust.parent)
        return after
