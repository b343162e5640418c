"""Hostile and good uploads through the whole intake: what is refused, by whom, and that nothing outside is touched.

`stage` in expected.json: `gate` problems are found without opening a stage, `child` ones in the sandboxed process.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from attacks import make

from renderer.gate import REMEDIES

HERE = Path(__file__).parent
EXPECTED: dict[str, dict[str, str]] = json.loads((HERE / "expected.json").read_text(encoding="utf-8"))
ACCEPTED = sorted(path.name for path in (HERE / "accept").iterdir())
MARKER = "canary-content-that-nobody-may-read"
OUTWARD = ("scene-path-outside", "scene-url", "scene-expression", "scene-file-name")
UNWRITTEN = (
    "link",
    "link-to-folder",
    "pipe",
    "pipe-layer",
    "socket",
    "root-is-pipe",
    "root-is-link",
    "line-break",
    "root-missing",
)
"""Uploads that cannot be kept as files; they are made by the test."""

Results = dict[tuple[str, str], dict[str, Any]]


def _canary(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("canary.usda", "canary.00.usda", "canary.01.usda"):
        (folder / name).write_text(f"#usda 1.0\n{make.MESH}\n{MARKER}\n", encoding="utf-8")
    for name in ("canary.txt", "canary.bin", "canary.mtlx", "canary.png", "canary.1001.png"):
        (folder / name).write_text(MARKER, encoding="utf-8")
    if not (folder / "pipe.usda").exists():
        os.mkfifo(folder / "pipe.usda")
    return folder


def _unwritten(name: str, upload: Path, canary: Path) -> str:
    """Makes an upload that cannot be kept; the name of its root."""
    (upload / "a.usda").write_text(make.textured("./t.png"), encoding="utf-8")
    odd = upload / "t.png"
    if name == "link":
        odd.symlink_to(canary / "canary.png")
    elif name == "link-to-folder":
        (upload / "t").symlink_to(canary, target_is_directory=True)
    elif name == "pipe":
        os.mkfifo(odd)
    elif name == "pipe-layer":
        (upload / "a.usda").write_text(make.prim("references = @./b.usda@"), encoding="utf-8")
        os.mkfifo(upload / "b.usda")
    elif name == "socket":
        server = socket.socket(socket.AF_UNIX)
        # The address of such a socket may be short only.
        here = os.open(upload, os.O_RDONLY)
        server.bind(f"/proc/self/fd/{here}/t.png")
        os.close(here)
        server.close()
    elif name == "root-is-pipe":
        os.mkfifo(upload / "b.usda")
        return "b.usda"
    elif name == "root-is-link":
        (upload / "b.usda").symlink_to(canary / "canary.usda")
        return "b.usda"
    elif name == "line-break":
        (upload / "b\n.png").write_bytes(make.png())
    else:
        return "b.usda"
    return "a.usda"


UNWRITTEN_SLUGS = {"line-break": "scene-file-name", "root-missing": "scene-damaged"}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory, kernels: Path) -> Iterator[Results]:
    """What became of every upload, in every mode."""
    home = tmp_path_factory.mktemp("attacks")
    watched = [_canary(Path(make.CANARY))]
    cases = []

    def add(name: str, file: Path | None, modes: tuple[str, ...], seconds: float = 30.0) -> None:
        upload = home / name / "upload"
        upload.mkdir(parents=True)
        watched.append(_canary(home / name / "canary"))
        root = name
        if file is None:
            root = _unwritten(name, upload, watched[-1])
        else:
            shutil.copy(file, upload / name)
        for mode in modes:
            cases.append({"name": name, "folder": str(upload), "root": root, "mode": mode, "seconds": seconds})

    for name in ACCEPTED:
        add(name, HERE / "accept" / name, ("gate", "whole"))
    for name, expected in EXPECTED.items():
        modes = ("gate", "whole", "stage") if expected["slug"] in OUTWARD else ("gate", "whole")
        add(name, HERE / "reject" / name, modes)
    for name in UNWRITTEN:
        add(name, None, ("gate", "whole"))
    more = {(case["name"], case["mode"]): case for case in cases}
    cases.append({**more["pipe-layer", "whole"], "mode": "stage", "seconds": 1.0})
    cases.append({**more["reference-parent.usda", "gate"], "mode": "bare"})
    file = home / "cases.json"
    file.write_text(json.dumps({"cases": cases, "watched": list(map(str, watched)), "port": make.PORT}))
    # One thread: a fork has one, and all that a process had before it is shut in is shut in.
    threads = {"OPENBLAS_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1"}
    environment = {**os.environ, **threads, "NUMBA_CACHE_DIR": str(kernels)}
    done = subprocess.run(
        [sys.executable, str(HERE / "runner.py"), str(file)], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    yield {(line["name"], line["mode"]): line for line in lines}
    shutil.rmtree(make.CANARY, ignore_errors=True)


@pytest.mark.parametrize("name", ACCEPTED)
def test_a_good_upload_is_accepted(results: Results, name: str) -> None:
    assert results[name, "gate"]["slug"] is None, results[name, "gate"]["message"]
    whole = results[name, "whole"]
    assert whole["slug"] is None, whole.get("message")
    assert whole["facts"]["triangles"] >= 1


@pytest.mark.parametrize("name", EXPECTED)
def test_an_attack_is_refused_for_the_right_reason(results: Results, name: str) -> None:
    expected = EXPECTED[name]
    gate, whole = results[name, "gate"], results[name, "whole"]
    assert whole["slug"] == expected["slug"], whole
    assert gate["slug"] == (expected["slug"] if expected["stage"] == "gate" else None), gate


@pytest.mark.parametrize("name", UNWRITTEN)
def test_what_is_no_plain_file_is_refused(results: Results, name: str) -> None:
    assert results[name, "gate"]["slug"] == UNWRITTEN_SLUGS.get(name, "scene-symlink"), results[name, "gate"]
    assert results[name, "whole"]["slug"] == results[name, "gate"]["slug"]


def test_nothing_outside_an_upload_is_opened_with_the_gate_alone_the_sandbox_alone_or_both(results: Results) -> None:
    guarded = {key: line for key, line in results.items() if line["mode"] != "bare"}
    assert {key: line["opened"] for key, line in guarded.items() if line["opened"]} == {}
    assert [key for key, line in guarded.items() if line["connected"]] == []
    assert {line["mode"] for line in guarded.values()} == {"gate", "whole", "stage"}


def test_without_both_the_canary_is_opened_and_seen(results: Results) -> None:
    assert results["reference-parent.usda", "bare"]["opened"] == ["canary.usda"]


def test_no_message_quotes_what_a_file_contains(results: Results) -> None:
    for key, line in results.items():
        message = line.get("message", "")
        assert MARKER not in message or line["mode"] == "bare", key
        assert make.CANARY not in message or line["mode"] in ("stage", "bare"), key
        assert str(Path(line["folder"]).parent) not in message or line["mode"] in ("stage", "bare"), key
        if line["slug"] in REMEDIES:
            assert len(message) < 400, key


def test_a_pipe_that_hangs_a_process_ends_by_the_clock(results: Results) -> None:
    line = results["pipe-layer", "stage"]
    assert line["slug"] == "ended"
    assert line["seconds"] < 3.0


def test_a_small_file_of_many_prims_is_refused_before_it_is_composed(results: Results) -> None:
    bomb = HERE / "reject" / "bomb-prims-references.usda"
    assert bomb.stat().st_size < 2700
    assert results[bomb.name, "whole"]["seconds"] < 2.0


def test_every_slug_is_met(results: Results) -> None:
    met = {line["slug"] for line in results.values()}
    assert set(REMEDIES) - met == set()


def test_the_files_are_what_make_writes() -> None:
    written = {**{k: v for k, (_, v) in make.rejected().items()}, **make.accepted()}
    for name, upload in written.items():
        folder = HERE / ("reject" if name in EXPECTED else "accept")
        data = upload.encode() if isinstance(upload, str) else upload
        # A crate names the release of USD that wrote it.
        if not name.endswith((".usdc", ".usd")):
            assert (folder / name).read_bytes() == data, name
    assert len(ACCEPTED) + len(EXPECTED) >= 60
