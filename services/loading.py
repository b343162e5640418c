"""What a process that stays loads at its start."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Looks for no garbage in the context, and never again at what was made in it.

    Imports make objects by the hundred thousand, and all of them stay: to look through them again and again takes a
    sixth of the start of a worker.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
