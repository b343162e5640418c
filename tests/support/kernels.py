"""What numba compiled for this process before, for processes that keep it elsewhere: compiling takes half a minute."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from numba.core.caching import UserProvidedCacheLocator

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("renderer", "labeller", "trainer")


def warm(folders: Iterable[Path]) -> None:
    """Copies what lies beside the sources; what does not is compiled when it is needed.

    Args:
        folders: As in `NUMBA_CACHE_DIR`.
    """
    for folder in folders:
        for package in PACKAGES:
            for cache in (ROOT / package).rglob("__pycache__"):
                source = str(cache.parent / "__init__.py")
                own = folder / UserProvidedCacheLocator.get_suitable_cache_subpath(source)  # type: ignore[no-untyped-call]
                for found in cache.glob("*.nb[ic]"):
                    own.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(found, own / found.name)
