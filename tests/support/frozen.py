"""A service in which nothing is of chance: no time passes, and ids follow each other."""

from __future__ import annotations

import base64
import itertools
import secrets
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from support.api import Api

NOW = 1_780_000_000.0
"""28 May 2026, 20:26:40 UTC."""
SIGNING_KEY = base64.b64encode(bytes(32)).decode()


@contextmanager
def frozen(folder: Path) -> Iterator[Api]:
    """A service at the moment `NOW`, for as long as the context lasts.

    Args:
        folder: Of its state.
    """
    numbers = itertools.count(1)
    with (
        patch.object(time, "time", lambda: NOW),
        patch.object(uuid, "uuid4", lambda: uuid.UUID(int=next(numbers) << 96)),
        patch.object(secrets, "token_hex", lambda size: f"{next(numbers):0{2 * size}x}"),
    ):
        yield Api(folder, rate=1e6, burst=10**6, ttl=1e12, signing_key=SIGNING_KEY)
