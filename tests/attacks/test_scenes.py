"""Real scenes through the whole intake: those that hold all they need are accepted."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from attacks import make

HERE = Path(__file__).parent
SCENES = Path(os.environ.get("DIAPHANE_TEST_SCENES", HERE.parents[2] / "shared" / "scenes"))
BIGGEST = 4 << 20
"""Bytes of a scene that is read here: larger ones take long."""
NAMES_PARENTS = ("mini_car_kit", "intent_vfx_teapots")
"""Scenes whose layers name others by `..`, within the scene's folder."""


def _roots() -> list[tuple[str, str]]:
    listed = json.loads((SCENES / "MANIFEST.json").read_text(encoding="utf-8"))["scenes"]
    mains = [scene["main"] for scene in listed if scene["main"]]
    mains += [path.relative_to(SCENES).as_posix() for path in (SCENES / "openusd_opacity").glob("*.usda")]
    found = [(folder, root) for folder, _, root in (main.partition("/") for main in sorted(mains))]
    return [(folder, root) for folder, root in found if _size(SCENES / folder) < BIGGEST or folder in NAMES_PARENTS]


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


@pytest.mark.skipif(not (SCENES / "MANIFEST.json").exists(), reason="there are no scenes beside the repository")
def test_scenes_that_hold_all_they_need_are_accepted(tmp_path: Path, kernels: Path) -> None:
    cases = [
        {"name": folder, "folder": str(SCENES / folder), "root": root, "mode": "whole", "seconds": 60.0}
        for folder, root in _roots()
    ]
    (tmp_path / "cases.json").write_text(json.dumps({"cases": cases, "watched": [], "port": make.PORT + 1}))
    done = subprocess.run(
        [sys.executable, str(HERE / "runner.py"), str(tmp_path / "cases.json")],
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(kernels)},
    )
    lines: list[dict[str, Any]] = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == len(cases) > 20, done.stderr
    slugs = {(line["name"], line["root"]): line["slug"] for line in lines}
    assert slugs == dict.fromkeys(slugs)
    assert {folder for folder, _ in slugs} >= set(NAMES_PARENTS)
