"""Small files that would take all the time or memory there is: bounded before the work, or read in linear time."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attacks import glbs, make

from schemas.problem import Problem
from services.engine.children import Assignment, Child, ChildOptions, Hooks, Spawner
from services.settings import Settings

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def _nodes(count: int) -> bytes:
    """A file whose nodes all show the same triangle."""
    made = glbs.document()
    made["nodes"] = [{"mesh": 0, "translation": [number, 0, 0]} for number in range(count)]
    made["scenes"] = [{"nodes": list(range(count))}]
    return glbs.glb(made)


def _faces(copies: int, corners: int) -> bytes:
    """A file of few points and nodes, and many triangles."""
    made = glbs.document()
    indices = np.zeros(corners, np.uint8)
    made["buffers"][0]["byteLength"] = len(glbs.BUFFER) + corners
    made["bufferViews"][2] = {"buffer": 0, "byteOffset": len(glbs.BUFFER), "byteLength": corners}
    made["accessors"][2] = {"bufferView": 2, "componentType": 5121, "count": corners, "type": "SCALAR"}
    made["nodes"] = [{"mesh": 0}] * copies
    made["scenes"] = [{"nodes": list(range(copies))}]
    return glbs.glb(made, glbs.BUFFER + indices.tobytes())


def _taken_in(tmp_path: Path, kernels: Path, uploads: dict[str, bytes]) -> dict[str, dict[str, Any]]:
    cases = []
    for name, data in uploads.items():
        folder = tmp_path / name.replace(".", "-")
        folder.mkdir()
        (folder / name).write_bytes(data)
        cases.append({"name": name, "folder": str(folder), "root": name, "mode": "whole", "seconds": 30.0})
    (tmp_path / "cases.json").write_text(json.dumps({"cases": cases, "watched": [], "port": make.PORT + 2}))
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(kernels)}
    done = subprocess.run(
        [sys.executable, str(HERE / "runner.py"), str(tmp_path / "cases.json")],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    return {line["name"]: line for line in map(json.loads, done.stdout.splitlines())}


def test_many_nodes_are_read_and_too_many_are_refused_before_the_clock_ends_it(tmp_path: Path, kernels: Path) -> None:
    uploads = {"some.glb": _nodes(12_000), "many.glb": _nodes(150_000), "faces.glb": _faces(1000, 1 << 20)}
    lines = _taken_in(tmp_path, kernels, uploads)
    assert lines["some.glb"]["slug"] is None, lines["some.glb"]
    assert lines["some.glb"]["facts"]["triangles"] == 12_000
    for name in ("many.glb", "faces.glb"):
        assert lines[name]["slug"] == "scene-too-large", lines[name]
        assert "too many nodes, points or triangles" in lines[name]["message"]


def test_a_crate_that_asks_for_gigabytes_gets_what_a_check_may_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    corners = 1009
    listed = ", ".join(str(corner % 3) for corner in range(corners))
    data = make.crate(make.usda(sheet=make.mesh().replace("[0, 1, 2]", f"[{listed}]")))
    count = struct.pack("<Q", corners)
    assert data.count(count) == 1
    upload = tmp_path / "upload"
    upload.mkdir()
    (upload / "scene.usdc").write_bytes(data.replace(count, struct.pack("<Q", 1_400_000_000)))
    assert (upload / "scene.usdc").stat().st_size < 1500
    options = ChildOptions(
        make="",
        inspect="services.intake:inspect",
        sandbox="services.sandbox:enter",
        scratch=tmp_path / "work",
        kernels=tmp_path / "kernels",
        memory_bytes=Settings().check_bytes,
    )
    child = Child(options, Spawner(), "check")
    try:
        with pytest.raises(Problem, match=r"cannot be read|needs more memory"):
            child.call("c", {"source": "s", "root": "scene.usdc"}, 60.0, Hooks(), Assignment("s", {}, {"s": upload}))
        status = Path(f"/proc/{child.pid}/status").read_text()
    finally:
        child.stop()
    (peak,) = [int(line.split()[1]) << 10 for line in status.splitlines() if line.startswith("VmHWM")]
    assert peak < 2 << 30


def test_a_check_may_take_half_a_minute_and_two_gigabytes() -> None:
    assert (Settings().check_seconds, Settings().check_bytes) == (30.0, 2 << 30)
    assert Settings().checks_per_key < Settings().slots_check
