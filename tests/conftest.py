"""Fixtures that many tests share."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moderngl
import pytest
from hypothesis import settings
from support.browser import CHROMIUM, browser
from support.kernels import compile_in_turns
from support.postgres import Postgres
from support.s3 import S3Server, environment

from evaluation.stress.threads import one_thread
from renderer.context import gl_context
from services.settings import Settings
from services.storage import Storage, open_storage

Machine = Callable[[str], Storage]
"""Opens one storage as a machine of the given name does."""

# A shell's background job begins with interrupts ignored, and the programs that tests start and interrupt would, too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Whoever runs the tests may have a configuration of their own, which they do not read.
os.environ["XDG_CONFIG_HOME"] = str(Path(tempfile.gettempdir()) / "diaphane-no-configuration")

# Failing examples are printed as code, so the same examples everywhere cost nothing; a shared machine has no deadline.
settings.register_profile("diaphane", deadline=None, max_examples=50, derandomize=True, database=None)
settings.load_profile("diaphane")

compile_in_turns()


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--golden` writes the golden pictures anew; `--examples` asks the API longer than a run of all tests may."""
    parser.addoption("--golden", action="store_true", help="write the golden pictures anew")
    parser.addoption("--examples", type=int, default=4, help="requests that schemathesis makes of an operation")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the tests that need a program which `make setup` does not install: `make check` leaves them out."""
    for item in items:
        wanted = set(getattr(item, "fixturenames", ()))
        given = getattr(item, "callspec", None)
        if wanted & {"chromium", "postgres"} or (
            given is not None and any(isinstance(one, str) and one == "postgresql" for one in given.params.values())
        ):
            item.add_marker(pytest.mark.installed)


@pytest.fixture(scope="module")
def single_thread() -> Iterator[None]:
    """For thousands of tiny calls: threads of compiled code would only wait for each other."""
    with one_thread():
        yield


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


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    """The test session's PostgreSQL server.

    Its data are not in pytest's own folder: every other session of pytest that begins closes that to all users but
    root, and a server that cannot read its data ends.
    """
    with tempfile.TemporaryDirectory(prefix="postgres-") as folder:
        server = Postgres(Path(folder) / "server")
        yield server
        server.stop("immediate")


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of a database without rows: every test that asks for it runs on both kinds."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'test.sqlite'}"
    server: Postgres = request.getfixturevalue("postgres")
    return server.new_database()


@pytest.fixture(scope="session")
def s3() -> Iterator[S3Server]:
    """The test session's S3 server; processes that the tests start find it in their environment."""
    server = S3Server()
    with environment(server.environment):
        yield server
    server.stop()


@pytest.fixture
def s3_url(s3: S3Server) -> str:
    """Store URL of an empty bucket."""
    return f"s3://{s3.new_bucket()}/some/prefix"


@pytest.fixture(params=["folder", "s3"])
def machine(request: pytest.FixtureRequest, tmp_path: Path) -> Machine:
    """Opens one storage as a machine of the given name does: every test that asks for it runs on both kinds."""
    shared = str(tmp_path / "store") if request.param == "folder" else request.getfixturevalue("s3_url")
    return lambda name: open_storage(Settings(state=tmp_path / name, store=shared))


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A headless browser."""
    pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with browser(tmp_path_factory.mktemp("browser")) as started:
        yield started
