"""ed25519 signatures over what the registry states: published versions, what aliases mean, which key follows which.

What is signed is a statement: canonical JSON that says what it is by its `format`.

- `diaphane-release/1`: a version's name, number, digest, time and files by hash. A client that trusts the key thereby
  knows every byte of the version, whoever served it.
- `diaphane-pointer/1`: what a name and an alias mean now. It expires, so that nobody can serve it for ever; `serial`
  rises with each move of the alias, so that nobody can serve the meaning of before a move after it.
- `diaphane-handover/1`: the key that follows this one.
"""

from __future__ import annotations

import base64
import binascii
import os
import uuid
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from schemas.canonical import canonical_json
from schemas.problem import Problem
from schemas.service import FileRef
from services.settings import Settings
from stages.store import sync

RELEASE_FORMAT = "diaphane-release/1"
POINTER_FORMAT = "diaphane-pointer/1"
HANDOVER_FORMAT = "diaphane-handover/1"
KEY_FILE = "signing.key"
NEXT_KEY_FILE = "signing.key.next"
"""Beside the key file: the key that is about to replace it."""
_SEED_BYTES = 32


def statement(name: str, version: str, digest: str, created: str, files: Mapping[str, FileRef]) -> str:
    """The text that is signed for a version.

    Args:
        name: Name of the bundle.
        version: Semantic version.
        digest: Digest of the bundle.
        created: UTC, ISO 8601.
        files: Name -> size and hash.
    """
    listed = {file: {"sha256": reference.sha256, "bytes": reference.bytes} for file, reference in files.items()}
    content = {"name": name, "version": version, "digest": digest, "created": created, "files": listed}
    return canonical_json({"format": RELEASE_FORMAT, **content})


def pointer_statement(
    name: str, selector: str, version: str, digest: str, *, serial: int, issued: int, expires: int
) -> str:
    """The text that is signed for what an alias means.

    Args:
        name: Name of the bundle.
        selector: Alias, or the version itself.
        version: What it means.
        digest: Digest of that version.
        serial: Number of the alias's last move; 0 for a version.
        issued: Seconds since 1970.
        expires: Seconds since 1970.
    """
    content: dict[str, Any] = {"name": name, "selector": selector, "version": version, "digest": digest}
    return canonical_json({"format": POINTER_FORMAT, **content, "serial": serial, "issued": issued, "expires": expires})


def handover_statement(old: str, new: str, issued: int) -> str:
    """The text that a key signs for the one that follows it.

    Args:
        old: Public key that signs, base64.
        new: Public key that follows, base64.
        issued: Seconds since 1970.
    """
    return canonical_json({"format": HANDOVER_FORMAT, "from": old, "to": new, "issued": issued})


class SigningKey:
    """A private key.

    Args:
        seed: Its 32 bytes.
    """

    def __init__(self, seed: bytes) -> None:
        self._key = Ed25519PrivateKey.from_private_bytes(seed)

    @cached_property
    def public_key(self) -> str:
        """The raw public key, base64."""
        return base64.b64encode(self._key.public_key().public_bytes_raw()).decode()

    def sign(self, text: str) -> str:
        """Signature over the text's UTF-8 bytes, base64."""
        return base64.b64encode(self._key.sign(text.encode())).decode()


class Signer:
    """Where the key to sign with is found.

    Args:
        seed: Gives the 32 bytes of the private key; called at every use.
    """

    def __init__(self, seed: Callable[[], bytes]) -> None:
        self._seed = seed

    @classmethod
    def open(cls, settings: Settings) -> Self:
        """The key of the settings, or else that of the state folder, which is made at the first use.

        Processes on several machines that publish must share a key: they take it from the settings.

        Raises:
            Problem: The key of the settings is not 32 bytes in base64.
        """
        if settings.signing_key:
            seed = decoded_seed(settings.signing_key, "DIAPHANE_SIGNING_KEY")
            return cls(lambda: seed)
        return cls(lambda: _kept(settings.state / KEY_FILE))

    @property
    def key(self) -> SigningKey:
        """The key as it is now: the file may have been replaced by that of a rotation.

        Raises:
            Problem: The key file is damaged.
            OSError: The key file can be neither read nor made.
        """
        return SigningKey(self._seed())


def verify(public_key: str, text: str, signature: str) -> bool:
    """Whether a signature over the text's UTF-8 bytes is that of a public key; both base64."""
    try:
        key = Ed25519PublicKey.from_public_bytes(base64.b64decode(public_key, validate=True))
        key.verify(base64.b64decode(signature, validate=True), text.encode())
    except (InvalidSignature, ValueError):  # binascii.Error is a ValueError
        return False
    return True


def decoded_seed(text: str, where: str) -> bytes:
    """The 32 bytes of a private key.

    Args:
        text: base64.
        where: Where it comes from, for people.

    Raises:
        Problem: It is not one.
    """
    try:
        seed = base64.b64decode(text.strip(), validate=True)
    except (binascii.Error, ValueError):
        seed = b""
    if len(seed) != _SEED_BYTES:
        raise Problem(
            f"{where} holds no signing key.",
            "It is 32 random bytes in base64, as `openssl rand -base64 32` prints them.",
        )
    return seed


def read_seed(path: Path) -> bytes:
    """The 32 bytes of a private key in a file.

    Raises:
        Problem: It holds no key.
        OSError: It cannot be read.
    """
    return decoded_seed(path.read_text(encoding="ascii", errors="replace"), str(path))


def make_key_file(path: Path, seed: bytes | None = None) -> None:
    """Writes a key, readable by its owner only; of two processes the first one's stays.

    Args:
        path: The file.
        seed: 32 bytes; None: random ones.

    Raises:
        OSError: It cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(base64.b64encode(seed or os.urandom(_SEED_BYTES)) + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        os.link(temporary, path)
        sync(path.parent)
    except FileExistsError:
        pass
    finally:
        temporary.unlink()


def _kept(path: Path) -> bytes:
    if not path.is_file():
        make_key_file(path)
    return read_seed(path)
