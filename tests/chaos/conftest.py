"""Services of real processes, one for each kind of database, that the tests of this folder share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.chaos.arena import Arena
from support.cluster import API
from support.postgres import Postgres

PROCESSES = (API, "jobs", "jobs", "render", "render", "label", "train")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of this folder."""
    parser.addoption("--all-points", action="store_true", help="kill at every point, not at a selection")


def pytest_configure(config: pytest.Config) -> None:
    """Markers of this folder."""
    config.addinivalue_line("markers", "only(kind): cannot run on the other kind of database")
    config.addinivalue_line("markers", "mainly(kind): on the other kind of database only with --all-points")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out what the markers leave out."""
    everything = config.getoption("--all-points", False)

    def is_wanted(item: pytest.Item) -> bool:
        kind = getattr(item, "callspec", None) and item.callspec.params.get("kind")  # type: ignore[attr-defined]
        only, mainly = item.get_closest_marker("only"), item.get_closest_marker("mainly")
        if kind is None or (only is None and mainly is None):
            return True
        return kind in only.args if only is not None else bool(everything) or kind in mainly.args

    left_out = [item for item in items if not is_wanted(item)]
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=left_out)


@pytest.fixture(scope="package", params=["sqlite", "postgresql"])
def kind(request: pytest.FixtureRequest) -> str:
    """Which database."""
    return str(request.param)


@pytest.fixture(scope="package")
def shared(kind: str, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Arena]:
    """A service that all tests on a kind of database share: starting one takes seconds."""
    folder = tmp_path_factory.mktemp(kind)
    url = f"sqlite:///{folder / 'chaos.sqlite'}"
    if kind == "postgresql":
        server: Postgres = request.getfixturevalue("postgres")
        url = server.new_database()
    with Arena(folder, url, small=True) as found:
        yield found


@pytest.fixture
def arena(shared: Arena) -> Arena:
    """The service with these processes, whatever the test before did to it."""
    shared.tidy(*PROCESSES)
    return shared
