"""Fixtures that many tests share."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest
from hypothesis import settings

from renderer.context import gl_context

# Failing examples are printed as code, so the same examples everywhere cost nothing; a shared machine has no deadline.
settings.register_profile("diaphane", deadline=None, max_examples=50, derandomize=True, database=None)
settings.load_profile("diaphane")


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--golden` writes the golden pictures anew."""
    parser.addoption("--golden", action="store_true", help="write the golden pictures anew")


@pytest.fixture(scope="session")
def gl() -> moderngl.Context:
    """The one context of the test process."""
    return gl_context()


@pytest.fixture
def ctx(gl: moderngl.Context) -> Iterator[moderngl.Context]:
    """The context; a GL error left behind fails the test that made it."""
    _ = gl.error
    yield gl
    assert gl.error == "GL_NO_ERROR"
