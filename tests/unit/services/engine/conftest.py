from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.workers import Fleet


@pytest.fixture
def fleet(tmp_path: Path, database_url: str) -> Iterator[Fleet]:
    """A service without workers."""
    with Fleet(tmp_path, database_url) as found:
        yield found
