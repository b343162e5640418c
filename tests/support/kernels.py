"""What numba compiles is compiled once a machine: compiling everything takes two minutes of processor time."""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

from numba.core.caching import UserProvidedCacheLocator
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("renderer", "labeller", "trainer")


def compile_in_turns() -> None:
    """Lets one process at a time compile a function: the others wait for it, and load what it has kept."""
    compiled: Callable[[Dispatcher, Any], Any] = Dispatcher.compile

    @wraps(compiled)
    def compile_in_turn(dispatcher: Dispatcher, signature: Any) -> Any:
        # Other threads of this process wait for numba's own lock, and so never hold a file's while they do.
        with global_compiler_lock, _turn(dispatcher):
            return compiled(dispatcher, signature)

    Dispatcher.compile = compile_in_turn


_held: set[Path] = set()
"""Turns of this process: a function may be met again while what it calls is compiled."""


@contextmanager
def _turn(dispatcher: Dispatcher) -> Iterator[None]:
    folder = dispatcher.stats.cache_path
    lock = Path(folder or "") / f"{dispatcher.py_func.__qualname__}.lock"
    if folder is None or lock in _held:
        yield
        return
    lock.parent.mkdir(parents=True, exist_ok=True)
    with lock.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        _held.add(lock)
        try:
            yield
        finally:
            _held.discard(lock)


def warm(folders: Iterable[Path]) -> None:
    """Copies what lies beside the sources to where processes keep it elsewhere; what does not is compiled when needed.

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
