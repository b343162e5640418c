"""Fixtures of the dashboard's tests, and of the browser client's: services, and sources with their packages."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from support.api import Api
from support.browser import CHROMIUM, WEBGPU, WEBGPU_AND_WEBGL, browser
from support.dashboard import Shown, fill
from support.web import install


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


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the browser client's sources with their locked packages."""
    root = tmp_path_factory.mktemp("web")
    yield install(root)
    shutil.rmtree(root)


@pytest.fixture(scope="module")
def webgpu(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser with WebGPU."""
    with _capable(tmp_path_factory.mktemp("browser"), WEBGPU) as started:
        yield started


@pytest.fixture(scope="module")
def webgl(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser with WebGPU and WebGL 2, for pictures that are not shown."""
    with _capable(tmp_path_factory.mktemp("browser"), WEBGPU_AND_WEBGL) as started:
        yield started


@contextmanager
def _capable(folder: Path, flags: Sequence[str]) -> Iterator[Any]:
    pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with browser(folder, flags) as started:
        page = started.new_page()
        page.goto("chrome://version")
        if not page.evaluate("!!navigator.gpu && navigator.gpu.requestAdapter().then(Boolean)"):
            pytest.skip("this chromium has no WebGPU adapter")
        page.close()
        yield started
