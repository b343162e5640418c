"""The browser client's sources: what is committed is what they make, and their own tests pass."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.web import ROOT, WEB, run

from renderer.samples.glb import HOME, SAMPLES
from services.dashboard.demo import BUILT

needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


def test_the_committed_build_is_what_the_sources_make(installed: Path) -> None:
    done = run(installed, "npm", "run", "build")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    made = installed.parents[2] / BUILT.relative_to(ROOT)
    ours, theirs = (
        {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}
        for root in (made, BUILT)
    )
    assert sorted(ours) == sorted(theirs), "run `npm run build` in deploy/client/web"
    assert ours == theirs


def test_its_own_tests_pass(installed: Path) -> None:
    done = run(installed, "npm", "test")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@needs_node
def test_types_are_those_of_the_api(tmp_path: Path) -> None:
    done = run(WEB, "node", "scripts/api-types.mjs", str(tmp_path / "api.ts"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api.ts").read_text() == (WEB / "packages/core/src/api.ts").read_text(), "run `npm run types`"


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_what_their_author_makes(name: str) -> None:
    assert SAMPLES[name]() == (HOME / name).read_bytes(), "run `python -m renderer.samples.glb`"
