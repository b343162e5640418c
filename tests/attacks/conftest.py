from __future__ import annotations

from pathlib import Path

import pytest
from support.kernels import warm


@pytest.fixture(scope="session")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where processes that are shut in keep what they compile: compiling takes longer than all uploads together."""
    folder = tmp_path_factory.mktemp("numba")
    warm([folder])
    return folder
