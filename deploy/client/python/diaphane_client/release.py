"""A published version as the server describes it, believed only as far as its signature goes.

Rules:
- the statement is the exact text that is signed; what the record says beside it must be the same;
- the digest follows from the names and hashes of the files;
- names of files are plain and versions are numbers, so that none leads out of its folder.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from diaphane_client.ed25519 import is_signed
from diaphane_client.errors import Refused
from diaphane_client.manifest import MANIFEST, FileRef, parse_files, parse_manifest

STATEMENT_FORMAT: Final = "diaphane-release/1"
MAX_RECORD_BYTES: Final = 1 << 20

_VERSION = re.compile(r"\.".join(3 * [r"(0|[1-9][0-9]{0,5})"]))

_SERVED_WRONG = "Ask who runs the server: it may be misconfigured, or somebody may have tampered with it."


@dataclass(frozen=True)
class Release:
    """A published version.

    Attributes:
        name: Name of the bundle.
        version: Semantic version.
        digest: Hex sha256 over the names and hashes of the files.
        files: Name -> size and hash.
        statement: The text that is signed.
        signature: ed25519 over the statement's UTF-8 bytes, base64.
        public_key: Raw ed25519 public key, base64.
    """

    name: str
    version: str
    digest: str
    files: Mapping[str, FileRef]
    statement: str
    signature: str
    public_key: str

    @property
    def order(self) -> tuple[int, ...]:
        """The version as numbers, to compare."""
        return version_order(self.version)

    def as_json(self) -> dict[str, Any]:
        """What `parse` reads back."""
        files = {name: {"sha256": file.sha256, "bytes": file.bytes} for name, file in self.files.items()}
        return {**self.__dict__, "files": files}


def version_order(version: str) -> tuple[int, ...]:
    """A semantic version as numbers; empty if it is none."""
    found = _VERSION.fullmatch(version)
    return tuple(map(int, found.groups())) if found else ()


def parse(content: bytes) -> Release:
    """Reads a version's record. Nothing in it is believed before `verify`.

    Raises:
        Refused: It is not a record.
    """
    try:
        record = json.loads(content)
        texts = {name: record[name] for name in ("name", "version", "digest", "statement", "signature", "public_key")}
        if not all(isinstance(text, str) for text in texts.values()):
            raise TypeError("a text is not one")
        release = Release(**texts, files=parse_files(record["files"]))
        if MANIFEST not in release.files or not release.order:
            raise ValueError("there is no manifest, or no version")
        return release
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise Refused(
            "The server's answer is not the record of a version.", "Check the URL; it is that of a Diaphane server."
        ) from error


def verify(release: Release, name: str, selector: str, trusted: Collection[str]) -> None:
    """Checks that a release is what was asked for, and signed with a trusted key.

    Args:
        release: As the server describes it.
        name: Name that was asked for.
        selector: Version or alias that was asked for.
        trusted: Public keys, base64.

    Raises:
        Refused: It is not.
    """
    if release.public_key not in trusted:
        raise Refused(
            f"'{name}' is signed with the key {release.public_key}, which is not the one that is trusted here.",
            "If the server's key was changed on purpose, give the new one as public_key once, or take the server from "
            "known-keys.json in the folder of bundles.",
        )
    if not _is_signed(release):
        raise Refused(f"The signature of '{name}' {release.version} is wrong.", _SERVED_WRONG)
    statement = json.loads(release.statement)
    described = {path: {"sha256": file.sha256, "bytes": file.bytes} for path, file in release.files.items()}
    signed: dict[str, object] = {"format": STATEMENT_FORMAT, "name": name, "version": release.version}
    signed |= {"digest": release.digest, "files": described}
    if not isinstance(statement, dict) or any(statement.get(field) != value for field, value in signed.items()):
        raise Refused(f"The record of '{name}' does not say what its signature is for.", _SERVED_WRONG)
    if release.name != name or release.digest != _digest(release.files):
        raise Refused(f"The record of '{name}' contradicts itself.", _SERVED_WRONG)
    if version_order(selector) and release.version != selector:
        raise Refused(f"The server has {release.version} for '{name}' {selector}.", _SERVED_WRONG)


def check_manifest(content: bytes, release: Release) -> None:
    """Checks that a bundle's manifest is valid and lists the files that the release has.

    Raises:
        Refused: It does not.
    """
    try:
        listed = parse_manifest(content).files
    except ValueError as error:
        raise Refused(
            f"The manifest of '{release.name}' {release.version} is not one that this client understands: {error}.",
            "Update diaphane-client; if that does not help, publish the bundle again.",
        ) from error
    if {**listed, MANIFEST: release.files[MANIFEST]} != dict(release.files):
        raise Refused(
            f"The manifest of '{release.name}' {release.version} does not list the files that it is published with.",
            "Publish the bundle again.",
        )


def _digest(files: Mapping[str, FileRef]) -> str:
    hashes = {name: file.sha256 for name, file in files.items()}
    return hashlib.sha256(json.dumps(hashes, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _is_signed(release: Release) -> bool:
    try:
        key, signature = (base64.b64decode(text, validate=True) for text in (release.public_key, release.signature))
        json.loads(release.statement)
        return is_signed(key, release.statement.encode(), signature)
    except (ValueError, RecursionError):
        return False
