"""Fixtures of the dashboard's tests: services with something of everything and with nothing."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.api import Api
from support.dashboard import Shown, fill


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    """A service that `shown` fills."""
    return Api(tmp_path_factory.mktemp("full"), rate=1e6, burst=10**6, ttl=1e6)


@pytest.fixture(scope="module")
def shown(api: Api, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """What is in it."""
    return fill(api, tmp_path_factory.mktemp("bundles"))


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Api:
    """A service without anything but keys."""
    return Api(tmp_path_factory.mktemp("empty"), rate=1e6, burst=10**6)


@pytest.fixture(scope="module")
def url(api: Api) -> Iterator[str]:
    """Where `api` is served."""
    with api.served() as address:
        yield address
