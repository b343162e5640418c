from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where processes that are shut in keep what they compile: compiling takes longer than all uploads together."""
    return tmp_path_factory.mktemp("numba")
