"""The folder of fetched bundles.

    known-keys.json                 server -> public key that it is trusted with
    <name>/versions/<version>/      a bundle; complete and verified, or not there
    <name>/aliases/<alias>.json     which version an alias meant at the last pull: record, signature, ETag
    <name>/parts/<sha256>           downloads under way, which go on after a cut

What is read from here is verified anew: hashes and signature.
"""

from __future__ import annotations

import json
import shutil
import uuid
from collections.abc import Collection
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from diaphane_client.errors import PullError
from diaphane_client.files import file_sha256, locked, sync_folder, write_whole
from diaphane_client.release import Release, parse, verify

KNOWN_KEYS = "known-keys.json"


@dataclass(frozen=True)
class Pointer:
    """What an alias meant at the last pull, and the ETag of the server's answer."""

    release: Release
    etag: str


class Cache:
    """Fetched bundles of one name.

    Args:
        folder: Folder of all bundles.
        name: Name of the bundle.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._keys = folder / KNOWN_KEYS
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

    def known_key(self, server: str) -> str | None:
        """The public key that a server is trusted with, base64; None before the first pull."""
        key = self._known_keys().get(server)
        return key if isinstance(key, str) else None

    def pin_key(self, server: str, public_key: str) -> None:
        """Trusts a server with a public key from now on."""
        with locked(self._keys.with_name(f".{KNOWN_KEYS}.lock")):
            keys = self._known_keys()
            if keys.get(server) != public_key:
                write_whole(self._keys, json.dumps({**keys, server: public_key}, indent=2, sort_keys=True).encode())

    def pointer(self, alias: str, trusted: Collection[str]) -> Pointer | None:
        """What an alias meant at the last pull; None if there was none, or it is not signed with a trusted key."""
        try:
            content = json.loads((self._folder / "aliases" / f"{alias}.json").read_bytes())
            release = parse(json.dumps(content["release"]).encode())
            verify(release, self._name, alias, trusted)
            return Pointer(release, str(content["etag"]))
        except (OSError, ValueError, KeyError, TypeError, PullError):
            return None

    def point(self, alias: str, pointer: Pointer) -> None:
        """Writes down what an alias means."""
        content = {"release": pointer.release.as_json(), "etag": pointer.etag}
        write_whole(self._folder / "aliases" / f"{alias}.json", json.dumps(content, indent=2).encode())

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

    def is_taken(self, release: Release) -> bool:
        """Whether an alias means a whole bundle of the same version with other files, such as another server's."""
        trusted = [key for key in self._known_keys().values() if isinstance(key, str)]
        found = (self.pointer(path.stem, trusted) for path in (self._folder / "aliases").glob("*.json"))
        return any(
            pointer.release.version == release.version
            and pointer.release.digest != release.digest
            and self.bundle(pointer.release)
            for pointer in found
            if pointer
        )

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

    def _known_keys(self) -> dict[str, object]:
        try:
            keys = json.loads(self._keys.read_bytes())
        except FileNotFoundError:
            return {}
        except ValueError as error:
            raise PullError(
                f"The trusted keys in {self._keys} cannot be read.",
                "Restore that file; if you remove it, the next pull trusts the key that the server then has.",
            ) from error
        return keys if isinstance(keys, dict) else {}
