"""`pull`: from the name of a bundle to a folder with its verified files."""

from __future__ import annotations

import logging
import os
import re
import time
from pathlib import Path

from diaphane_client.cache import Cache
from diaphane_client.errors import NotFound, Unavailable
from diaphane_client.manifest import MANIFEST
from diaphane_client.pointer import Pointer, parse_pointer
from diaphane_client.release import Release, check_manifest, parse, verify
from diaphane_client.server import Server
from diaphane_client.trust import Question, Trust, advance, is_vouched, moment

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
    timeout: float = 30.0,
) -> Path:
    """Brings the local copy of a bundle up to date.

    Args:
        name: Name of the bundle.
        alias: Alias, or a version such as 1.2.0.
        url: Where the server is, without `/v1`.
        key: API key with the scope `read`; None: no key.
        folder: Where fetched bundles are kept; created if missing.
        public_key: The ed25519 key of the server, raw, base64, or one that handed over to it; None: the one that was
            seen first.
        timeout: Seconds without a byte after which a connection is given up.

    Returns:
        The folder of the bundle; its files never change.

    Raises:
        Refused: A hash, a signature, a key, a time or a version is not what it must be; what was there stays.
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
    timeout: float,
) -> tuple[Path, Unavailable | None]:
    """What `pull` does, and why the bundle is that of an earlier pull, if the server could not be asked."""
    cache = Cache(Path(folder), _checked(name, alias))
    asked = Question(url.rstrip("/"), name, alias, public_key)
    with cache.lock():
        trust = cache.trust()
        before = cache.pulled(alias, trust) if is_vouched(trust, asked) else None
        have = cache.bundle(before) if before else None
        try:
            with Server(url, key, timeout) as server:
                pointer = parse_pointer(server.pointer(name, alias))
                # Before anything is downloaded: what is begun and not ended counts as seen.
                cache.learn(lambda known: advance(known, asked, pointer, time.time()))
                if have and before and (before.version, before.digest) == (pointer.version, pointer.digest):
                    return have, None
                release, bundle = _bundle(server, cache, pointer)
        except Unavailable as error:
            if have is None:
                raise
            return have, Unavailable(f"{error.what} {_confirmed(trust, asked)}", error.remedy)
        cache.point(alias, release)
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

    Raises:
        Refused: What was seen is damaged, or does not know of bundles that are there.
    """
    cache = Cache(Path(folder), _checked(name, alias))
    trust = cache.trust()
    if not is_vouched(trust, Question(url.rstrip("/"), name, alias, public_key)):
        return None
    release = cache.pulled(alias, trust)
    return cache.bundle(release) if release else None


def forget(name: str, *, folder: str | os.PathLike[str]) -> None:
    """Makes a name as if it had never been seen: the next pull takes what the server's key signs, older or not.

    Keys of servers stay, and files as long as no other version comes under their number. For a server that lost its
    history, or a folder that lost `trust.json`.

    Args:
        name: Name of the bundle.
        folder: Where fetched bundles are kept.

    Raises:
        Refused: What was seen of others is damaged.
        OSError: The folder cannot be written.
    """
    Cache(Path(folder), _checked(name)).forget()


def _bundle(server: Server, cache: Cache, pointer: Pointer) -> tuple[Release, Path]:
    release = parse(server.record(pointer.name, pointer.version))
    verify(release, pointer)
    if found := cache.bundle(release):
        return release, found
    # The manifest first: it is small, and tells whether the rest is worth downloading.
    for name, file in sorted(release.files.items(), key=lambda item: item[0] != MANIFEST):
        server.download(file, cache.part(file.sha256))
        if name == MANIFEST:
            check_manifest(cache.part(file.sha256).read_bytes(), release)
    return release, cache.keep(release)


def _confirmed(trust: Trust, asked: Question) -> str:
    seen = trust.names.get(asked.name)
    mark = seen.marks.get(asked.selector) if seen else None
    return f"What '{asked.name}' {asked.selector} means was confirmed at {moment(mark.issued)}." if mark else ""


def _checked(name: str, alias: str = "champion") -> str:
    if not _NAME.fullmatch(name) or not _SELECTOR.fullmatch(alias):
        raise NotFound(
            f"There can be no '{name}' {alias}.",
            "Names are small letters, digits and hyphens; then comes an alias or a version such as 1.2.0.",
        )
    return name
