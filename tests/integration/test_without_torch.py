"""An installation without PyTorch: small, and all work but training is done in it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import moderngl
import pytest
from support.deploy import ROOT, closure, installed_bytes, roles
from support.processes import BLOCKED, missing_beyond

from renderer.samples import SAMPLES
from schemas.problem import ExitCode

LARGEST = 1e9
OWN = 20e6
"""Diaphane itself, compiled, which is here installed as a link."""
BASE = 150e6
"""The base image of deploy/containers/Dockerfile: Debian and Python."""
PYTORCH = {"torch", "triton", "cuda-toolkit", "nvidia-cudnn-cu13"}

TINY = ["--size", "48x32", "-t", "kbuffer"]
SCRIPT = """
import json, sys
from diaphane.cli.app import run
print(json.dumps([run(command) for command in json.loads(sys.argv[1])]))
"""


def test_what_renders_takes_less_than_a_gigabyte() -> None:
    held = closure("render")
    assert {"moderngl", "numba", "usd-core", "dbos", "moderngl-window"} <= held
    assert not held & PYTORCH
    assert installed_bytes(held) + OWN < LARGEST


def test_the_image_of_the_api_takes_less_than_a_gigabyte() -> None:
    held = closure(*roles()["api"])
    assert {"fastapi", "uvicorn"} <= held
    assert not held & (PYTORCH | {"usd-core", "numba", "onnxruntime"})
    assert installed_bytes(held) + OWN + BASE < LARGEST


def test_what_trains_brings_pytorch() -> None:
    """So that what the sizes are measured with is seen to follow requirements."""
    assert "torch" in closure("train")
    assert installed_bytes(closure("train")) > LARGEST


@pytest.fixture(scope="module")
def environment() -> Mapping[str, str]:
    """Of a process that finds nothing but what `pip install diaphane[render]` installs."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DIAPHANE_")}
    own = {"PYTHONPATH": f"{BLOCKED}:{ROOT}", "BLOCKED_IMPORTS": ",".join(missing_beyond(closure("render")))}
    assert "torch" in own["BLOCKED_IMPORTS"].split(",")
    return {**kept, **own}


def test_scenes_are_rendered_benched_and_viewed_and_a_build_says_what_it_lacks(
    tmp_path: Path, environment: Mapping[str, str], gl: moderngl.Context
) -> None:
    scene = str(SAMPLES["nested_shells"](tmp_path))
    commands = [
        ["render", scene, *TINY, "-o", "picture.png"],
        ["bench", scene, *TINY, "--repeats", "1", "--alpha", ".33", "--budgets", "1", "--no-account", "-o", "bench"],
        ["view", scene, *TINY, "--layout", "single", "--frames", "1", "--out", "view"],
        ["build", scene, "--name", "shells"],
        ["worker", "--roles", "train"],
    ]
    script = [sys.executable, "-c", SCRIPT, json.dumps(commands)]
    done = subprocess.run(script, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300.0)
    assert done.returncode == 0, done.stderr
    failed = ExitCode.CHECK_FAILED
    assert json.loads(done.stdout.splitlines()[-1]) == [0, 0, 0, failed, failed], done.stderr
    for written in ("picture.png", "bench/index.html", "view/frame-0000.png"):
        assert (tmp_path / written).stat().st_size > 0
    said = done.stderr.splitlines()
    assert said.count("error: Training needs torch and onnx, which are not installed.") == 2
    assert sum("pip install 'diaphane[train]'" in line for line in said) == 2
    assert not (tmp_path / ".diaphane").exists(), "nothing is begun that cannot be finished"


def test_a_server_leaves_training_to_others(tmp_path: Path, environment: Mapping[str, str]) -> None:
    script = [sys.executable, "-c", "from diaphane.cli import main; main()", "serve", "--port", "0", "--state", "state"]
    server = subprocess.Popen(
        script, env=environment, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        said = []
        assert server.stdout is not None
        for line in server.stdout:
            said.append(line)
            if line.startswith("Training waits"):
                break
        server.send_signal(signal.SIGTERM)
        _, errors = server.communicate(timeout=60.0)
    finally:
        server.kill()
    assert any(line.startswith("Diaphane serves http://127.0.0.1:") for line in said), errors
    assert said[-1] == "Training waits for a worker of the role train: torch and onnx not installed here\n"
    assert server.returncode == 0, errors
