"""Signed records of bundles, for clients to pull."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from schemas.service import FileRef
from services.registry import Signer
from services.registry.names import bundle_files, digest_of
from services.registry.signing import statement
from support.bundles import make_bundle
from support.release_server import ReleaseServer

SIGNER = Signer(lambda: b"s" * 32)
STRANGER = Signer(lambda: b"x" * 32)

Record = dict[str, Any]


def record_of(version: str, files: dict[str, FileRef], signer: Signer = SIGNER, name: str = "glass") -> Record:
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


def publish(
    server: ReleaseServer, tmp_path: Path, version: str, *, signer: Signer = SIGNER, alias: str = "champion"
) -> Record:
    """Serves a bundle under a version and an alias."""
    bundle = make_bundle(tmp_path / f"published-{version}-{len(server.blobs)}", f"{version} " + "w" * 5000)
    files = bundle_files(bundle)
    server.blobs |= {files[name].sha256: (bundle / name).read_bytes() for name in files}
    record = record_of(version, files, signer)
    serve(server, record, alias)
    return record


def serve(server: ReleaseServer, record: Record, alias: str = "champion") -> None:
    """Serves a record under its version and an alias."""
    for selector in (alias, record["version"]):
        server.records[f"glass/versions/{selector}"] = json.dumps(record).encode()
