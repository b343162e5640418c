"""The browser client's sources: what is committed is what they make, and their own tests pass."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from renderer.samples.glb import HOME, SAMPLES
from services.dashboard.demo import BUILT

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "deploy/client/web"
OFFLINE = ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ECONNRESET", "ETIMEDOUT")

needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


def _run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the sources with their locked packages, in folders as they are in the repository."""
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed")
    root = tmp_path_factory.mktemp("web")
    copy = root / "deploy/client/web"
    shutil.copytree(WEB, copy, ignore=shutil.ignore_patterns("node_modules"))
    done = _run(copy, "npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline")
    if done.returncode and any(sign in done.stderr for sign in OFFLINE):
        pytest.skip("the packages cannot be fetched: there is no network")
    assert done.returncode == 0, done.stderr[-2000:]
    yield copy
    shutil.rmtree(root)


def test_the_committed_build_is_what_the_sources_make(installed: Path) -> None:
    done = _run(installed, "npm", "run", "build")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    made = installed.parents[2] / BUILT.relative_to(ROOT)
    ours, theirs = (
        {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}
        for root in (made, BUILT)
    )
    assert sorted(ours) == sorted(theirs), "run `npm run build` in deploy/client/web"
    assert ours == theirs


def test_its_own_tests_pass(installed: Path) -> None:
    done = _run(installed, "npm", "test")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@needs_node
def test_types_are_those_of_the_api(tmp_path: Path) -> None:
    done = _run(WEB, "node", "scripts/api-types.mjs", str(tmp_path / "api.ts"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api.ts").read_text() == (WEB / "packages/core/src/api.ts").read_text(), "run `npm run types`"


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_what_their_author_makes(name: str) -> None:
    assert SAMPLES[name]() == (HOME / name).read_bytes(), "run `python -m renderer.samples.glb`"
