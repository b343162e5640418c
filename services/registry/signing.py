"""ed25519 signatures over published versions.

What is signed is a statement: canonical JSON with the version's name, number, digest, time and files by hash. A client
that trusts the public key thereby knows every byte of the version, whoever served it.
"""

from __future__ import annotations

import base64
import binascii
import os
import uuid
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Self

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from schemas.problem import Problem
from schemas.service import FileRef
from services.settings import Settings
from services.store import canonical_json, sync

STATEMENT_FORMAT = "diaphane-release/1"
KEY_FILE = "signing.key"
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
    return canonical_json({"format": STATEMENT_FORMAT, **content})


class Signer:
    """Signs with one key.

    Args:
        seed: Gives the 32 bytes of the private key; called at the first use.
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
            seed = _decode(settings.signing_key, "DIAPHANE_SIGNING_KEY")
            return cls(lambda: seed)
        return cls(lambda: _kept(settings.state / KEY_FILE))

    @property
    def public_key(self) -> str:
        """The raw public key, base64.

        Raises:
            Problem: The key file is damaged.
            OSError: The key file can be neither read nor made.
        """
        return base64.b64encode(self._key.public_key().public_bytes_raw()).decode()

    def sign(self, text: str) -> str:
        """Signature over the text's UTF-8 bytes, base64.

        Raises:
            Problem: The key file is damaged.
            OSError: The key file can be neither read nor made.
        """
        return base64.b64encode(self._key.sign(text.encode())).decode()

    @cached_property
    def _key(self) -> Ed25519PrivateKey:
        return Ed25519PrivateKey.from_private_bytes(self._seed())


def verify(public_key: str, text: str, signature: str) -> bool:
    """Whether a signature over the text's UTF-8 bytes is that of a public key; both base64."""
    try:
        key = Ed25519PublicKey.from_public_bytes(base64.b64decode(public_key, validate=True))
        key.verify(base64.b64decode(signature, validate=True), text.encode())
    except (InvalidSignature, ValueError):  # binascii.Error is a ValueError
        return False
    return True


def _decode(text: str, where: str) -> bytes:
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


def _kept(path: Path) -> bytes:
    if not path.is_file():
        _make(path)
    return _decode(path.read_text(encoding="ascii", errors="replace"), str(path))


def _make(path: Path) -> None:
    """Writes a new key, readable by its owner only; of two processes the first one's stays."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(base64.b64encode(os.urandom(_SEED_BYTES)) + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        os.link(temporary, path)
        sync(path.parent)
    except FileExistsError:
        pass
    finally:
        temporary.unlink()
