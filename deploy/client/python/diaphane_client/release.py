"""A published version as the server describes it, believed only as far as its signature goes.

Rules:
- it is the version that the pointer names, with that digest, and signed with the same key;
- the statement is the exact text that is signed; what the record says beside it must be the same;
- the digest follows from the names and hashes of the files;
- names of files are plain and versions are numbers, so that none leads out of its folder.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from diaphane_client.errors import Refused
from diaphane_client.manifest import MANIFEST, FileRef, parse_files, parse_manifest
from diaphane_client.pointer import Pointer, version_order
from diaphane_client.signatures import is_signed

STATEMENT_FORMAT: Final = "diaphane-release/1"
MAX_RECORD_BYTES: Final = 1 << 20

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

    def as_json(self) -> dict[str, Any]:
        """What `parse` reads back."""
        files = {name: {"sha256": file.sha256, "bytes": file.bytes} for name, file in self.files.items()}
        return {**self.__dict__, "files": files}


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
        if MANIFEST not in release.files or not version_order(release.version):
            raise ValueError("there is no manifest, or no version")
        return release
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise Refused(
            "The server's answer is not the record of a version.", "Check the URL; it is that of a Diaphane server."
        ) from error


def verify(release: Release, pointer: Pointer) -> None:
    """Checks that a release is what a pointer names, and that its signature holds.

    Args:
        release: As the server describes it.
        pointer: Is believed.

    Raises:
        Refused: It is not.
    """
    name = pointer.name
    if (release.name, release.version, release.digest) != (name, pointer.version, pointer.digest):
        raise Refused(
            f"The server sent '{release.name}' {release.version}, and states that '{name}' {pointer.selector} is "
            f"{pointer.version} with other files.",
            _SERVED_WRONG,
        )
    if release.public_key != pointer.public_key:
        raise Refused(
            f"'{name}' {release.version} is signed with the key {release.public_key}, and the statement that names it "
            f"with {pointer.public_key}.",
            "If the server's key was changed a moment ago, try again; else ask who runs it.",
        )
    if not is_signed(release.public_key, release.statement, release.signature):
        raise Refused(f"The signature of '{name}' {release.version} is wrong.", _SERVED_WRONG)
    described = {path: {"sha256": file.sha256, "bytes": file.bytes} for path, file in release.files.items()}
    signed: dict[str, object] = {"format": STATEMENT_FORMAT, "name": name, "version": release.version}
    signed |= {"digest": release.digest, "files": described}
    statement = _parsed(release.statement)
    if not isinstance(statement, dict) or any(statement.get(field) != value for field, value in signed.items()):
        raise Refused(f"The record of '{name}' does not say what its signature is for.", _SERVED_WRONG)
    if release.digest != digest_of(release):
        raise Refused(f"The record of '{name}' contradicts itself.", _SERVED_WRONG)


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


def digest_of(release: Release) -> str:
    """Hex sha256 over the names and hashes of a release's files."""
    hashes = {name: file.sha256 for name, file in release.files.items()}
    return hashlib.sha256(json.dumps(hashes, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _parsed(statement: str) -> object:
    try:
        return json.loads(statement)
    except (ValueError, RecursionError):
        return None
