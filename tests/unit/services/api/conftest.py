from __future__ import annotations

from pathlib import Path

import pytest
from support.api import Api


@pytest.fixture
def api(tmp_path: Path) -> Api:
    return Api(tmp_path)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Api:
    """For tests that change nothing which another one asks for: an application takes a quarter of a second to make."""
    return Api(tmp_path_factory.mktemp("shared"), rate=1e6, burst=10**6)
