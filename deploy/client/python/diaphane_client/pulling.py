"""`pull`: from the name of a bundle to a folder with its verified files."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Collection
from pathlib import Path

from diaphane_client.cache import Cache, Pointer
from diaphane_client.errors import NotFound, Refused, Unavailable
from diaphane_client.manifest import MANIFEST
from diaphane_client.release import Release, check_manifest, parse, verify
from diaphane_client.server import Server

_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")
_SELECTOR = re.compile(r"[a-z0-9](?:[a-z0-9.-]{0,38}[a-z0-9])?")

log = logging.getLogger(__name__)


def pull(
    name: str,
    alias: str = "champion",
    *,
    url: str,
    key: str | None,
    folder: str | os.PathLike[str],
    public_key: str | None = None,
    allow_rollback: bool = False,
    timeout: float = 30.0,
) -> Path:
    """Brings the local copy of a bundle up to date.

    Args:
        name: Name of the bundle.
        alias: Alias, or a version such as 1.2.0.
        url: Where the server is, without `/v1`.
        key: API key with the scope `read`; None: no key.
        folder: Where fetched bundles are kept; created if missing.
        public_key: The ed25519 key that versions must be signed with, raw, base64; None: the one that this server's
            first version had.
        allow_rollback: Whether a version lower than at the last pull is taken.
        timeout: Seconds without a byte after which a connection is given up.

    Returns:
        The folder of the bundle; its files never change.

    Raises:
        Refused: A hash, a signature, a key or a version is not what it must be; what was there stays.
        Unavailable: The server cannot be reached, and there is no bundle of an earlier pull.
        Denied: The server does not accept the key.
        NotFound: There is no such bundle, version or alias.
        OSError: The folder cannot be written.
    """
    bundle, trouble = update(
        name,
        alias,
        url=url,
        key=key,
        folder=folder,
        public_key=public_key,
        allow_rollback=allow_rollback,
        timeout=timeout,
    )
    if trouble:
        log.warning("%s Using '%s' %s of an earlier pull.", trouble.what, name, bundle.name)
    return bundle


def update(
    name: str,
    alias: str,
    *,
    url: str,
    key: str | None,
    folder: str | os.PathLike[str],
    public_key: str | None,
    allow_rollback: bool,
    timeout: float,
) -> tuple[Path, Unavailable | None]:
    """What `pull` does, and why the bundle is that of an earlier pull, if the server could not be asked."""
    cache = Cache(Path(folder), _checked(name, alias))
    server_name = url.rstrip("/")
    with cache.lock():
        known = public_key or cache.known_key(server_name)
        before = cache.pointer(alias, [known]) if known else None
        have = cache.bundle(before.release) if before else None
        try:
            with Server(url, key, timeout) as server:
                answer = server.record(name, alias, before.etag if before and have else "")
                if answer is None and have:
                    return have, None
                content, etag = answer or (b"", "")
                release = parse(content)
                verify(release, name, alias, [known or release.public_key])
                if before and not allow_rollback:
                    _check_order(release, before.release, alias)
                cache.pin_key(server_name, release.public_key)
                bundle = cache.bundle(release) or _fetch(server, cache, release)
        except Unavailable as error:
            if have is None:
                raise
            return have, error
        cache.point(alias, Pointer(release, etag))
        return bundle, None


def cached(
    name: str,
    alias: str = "champion",
    *,
    url: str,
    folder: str | os.PathLike[str],
    public_key: str | None = None,
) -> Path | None:
    """The bundle of the last pull, verified anew, without asking the server.

    Args:
        name: Name of the bundle.
        alias: Alias or version, as for the pull.
        url: Where the server is: its pinned key is the one that is trusted.
        folder: Where fetched bundles are kept.
        public_key: See `pull`.

    Returns:
        The folder of the bundle; None if there is none, or it does not verify.
    """
    cache = Cache(Path(folder), _checked(name, alias))
    known: Collection[str] = [found] if (found := public_key or cache.known_key(url.rstrip("/"))) else []
    pointer = cache.pointer(alias, known)
    return cache.bundle(pointer.release) if pointer else None


def _fetch(server: Server, cache: Cache, release: Release) -> Path:
    if cache.is_taken(release):
        raise Refused(
            f"Another '{release.name}' {release.version} is in the folder, with other files.",
            "Versions never change: give this server a folder of its own, or ask who runs it.",
        )
    # The manifest first: it is small, and tells whether the rest is worth downloading.
    for name, file in sorted(release.files.items(), key=lambda item: item[0] != MANIFEST):
        server.download(file, cache.part(file.sha256))
        if name == MANIFEST:
            check_manifest(cache.part(file.sha256).read_bytes(), release)
    return cache.keep(release)


def _check_order(release: Release, before: Release, alias: str) -> None:
    if release.order < before.order:
        raise Refused(
            f"The server has {release.version} for '{release.name}' {alias}, which was {before.version} before.",
            "If it was rolled back on purpose, pull once with allow_rollback=True.",
        )
    if release.version == before.version and release.digest != before.digest:
        raise Refused(
            f"'{release.name}' {release.version} has other files than it had before.",
            "Versions never change: ask who runs the server.",
        )


def _checked(name: str, alias: str) -> str:
    if not _NAME.fullmatch(name) or not _SELECTOR.fullmatch(alias):
        raise NotFound(
            f"There can be no '{name}' {alias}.",
            "Names are small letters, digits and hyphens; then comes an alias or a version such as 1.2.0.",
        )
    return name
