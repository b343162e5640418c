"""Signed records of bundles and statements of what aliases mean, for clients to pull."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from schemas.bundle_files import bundle_files, digest_of
from schemas.service import FileRef
from services.registry.pointers import LIFETIME_SECONDS
from services.registry.signing import SigningKey, handover_statement, pointer_statement, statement
from support.bundles import make_bundle
from support.release_server import ReleaseServer

SIGNER = SigningKey(b"s" * 32)
STRANGER = SigningKey(b"x" * 32)

Record = dict[str, Any]

_moves = itertools.count(1)


def record_of(version: str, files: dict[str, FileRef], signer: SigningKey = SIGNER, name: str = "glass") -> Record:
    """The record of a version, as the service has it."""
    text = statement(name, version, digest_of(files), "2026-01-01T00:00:00Z", files)
    return {
        "name": name,
        "version": version,
        "digest": digest_of(files),
        "files": {file: reference.model_dump() for file, reference in files.items()},
        "statement": text,
        "signature": signer.sign(text),
        "public_key": signer.public_key,
        "score": 0.5,
        "aliases": ["champion"],
    }


def handover(old: SigningKey, new: SigningKey) -> Record:
    """A key names the one that follows it."""
    text = handover_statement(old.public_key, new.public_key, int(time.time()))
    return {"statement": text, "signature": old.sign(text)}


def pointer_to(
    record: Record,
    selector: str = "champion",
    *,
    serial: int | None = None,
    issued: float | None = None,
    lifetime: int = LIFETIME_SECONDS,
    signer: SigningKey = SIGNER,
    handovers: Sequence[Record] = (),
    **said: Any,
) -> Record:
    """What the service states of an alias: by default that it moved to a version just now.

    Args:
        record: Of the version.
        selector: Alias or version.
        serial: Of the move; None: the next one.
        issued: When; None: now.
        lifetime: Seconds.
        signer: Its key.
        handovers: That lead to the key.
        said: Members of the statement that are other than they should be.
    """
    at = int(time.time() if issued is None else issued)
    values: Record = {"name": record["name"], "selector": selector, "version": record["version"]}
    values |= {"digest": record["digest"], "serial": next(_moves) if serial is None else serial}
    text = pointer_statement(**{**values, "issued": at, "expires": at + lifetime, **said})
    return {
        "statement": text,
        "signature": signer.sign(text),
        "public_key": signer.public_key,
        "handovers": list(handovers),
    }


def publish(server: ReleaseServer, tmp_path: Path, version: str, *, alias: str = "champion", **options: Any) -> Record:
    """Serves a bundle under a version and an alias; see `pointer_to` for the options."""
    bundle = make_bundle(tmp_path / f"published-{version}-{len(server.blobs)}", f"{version} " + "w" * 5000)
    files = bundle_files(bundle)
    server.blobs |= {files[name].sha256: (bundle / name).read_bytes() for name in files}
    record = record_of(version, files, options.get("signer", SIGNER))
    serve(server, record, alias, **options)
    return record


def serve(server: ReleaseServer, record: Record, alias: str = "champion", **options: Any) -> None:
    """Serves a record under its version, and moves an alias to it."""
    server.records[f"glass/versions/{record['version']}"] = json.dumps(record).encode()
    state(server, pointer_to(record, record["version"], **{**options, "serial": 0}), record["version"])
    state(server, pointer_to(record, alias, **options), alias)


def state(server: ReleaseServer, pointer: Record, selector: str = "champion") -> None:
    """Serves a statement as the answer to what a selector means."""
    server.records[f"glass/pointers/{selector}"] = json.dumps(pointer).encode()
