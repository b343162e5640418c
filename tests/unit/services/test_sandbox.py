from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from services.sandbox import rss_bytes

ATTEMPTS = """
import json, os, socket, subprocess, sys, threading
from pathlib import Path
inside, outside = Path(sys.argv[1]), Path(sys.argv[2])
(outside / "secret").write_text("secret")
(inside / "link").symlink_to(outside / "secret")
reading = inside / "reading"
reading.mkdir()
(reading / "given").write_text("given")
left, right = socket.socketpair()
from services.sandbox import enter
report = enter([reading], [inside / "writing"] if (inside / "writing").mkdir() is None else [], 600 << 20, 1 << 20)

def attempt(body):
    try:
        return str(body())
    except MemoryError:
        return "MemoryError"
    except OSError as error:
        return type(error).__name__

def grow():
    with (inside / "writing" / "big").open("wb") as file:
        for _ in range(3):
            file.write(bytes(1 << 20))
            file.flush()
    return "grown"

def thread():
    found = []
    worker = threading.Thread(target=lambda: found.append(attempt(lambda: (outside / "secret").read_text())))
    worker.start()
    worker.join()
    return found[0]

done = {
    "read given": attempt(lambda: (reading / "given").read_text()),
    "write given": attempt(lambda: (reading / "given").write_text("x")),
    "write": attempt(lambda: (inside / "writing" / "a").write_text("x")),
    "rename": attempt(lambda: (inside / "writing" / "a").rename(inside / "writing" / "b").exists()),
    "remove": attempt(lambda: (inside / "writing" / "b").unlink()),
    "write beside": attempt(lambda: (inside / "a").write_text("x")),
    "read outside": attempt(lambda: (outside / "secret").read_text()),
    "read in a thread": thread(),
    "read through a link": attempt(lambda: (inside / "link").read_text()),
    "list outside": attempt(lambda: os.listdir(outside)),
    "passwords": attempt(lambda: Path("/etc/passwd").read_text()),
    "parent's environment": attempt(lambda: Path(f"/proc/{os.getppid()}/environ").read_bytes()),
    "memory": attempt(lambda: len(bytearray(1 << 30))),
    "file size": attempt(grow),
    "internet": attempt(socket.socket),
    "local socket": attempt(lambda: socket.socket(socket.AF_UNIX)),
    "inherited pair": attempt(lambda: left.send(b"x")),
    "new pair": attempt(lambda: len(socket.socketpair())),
    "program": attempt(lambda: subprocess.run(["/bin/true"])),
    "signal to parent": attempt(lambda: os.kill(os.getppid(), 0)),
    "signal to itself": attempt(lambda: os.kill(os.getpid(), 0)),
    "pipe file": attempt(lambda: os.mkfifo(inside / "writing" / "pipe")),
    "capabilities": [line for line in Path("/proc/self/status").read_text().splitlines() if "CapEff" in line][0],
}
print(json.dumps({"report": [report.no_new_privs, report.seccomp, report.landlock], "missing": report.missing, **done}))
"""

LIBRARIES = """
import json, os, sys, warnings
from pathlib import Path
folder = Path(sys.argv[1])
os.environ["NUMBA_CACHE_DIR"] = str(folder / "numba")
from services.sandbox import enter
report = enter([], [folder], 3 << 30, 1 << 30)
warnings.simplefilter("error", RuntimeWarning)
done = {"missing": report.missing}

from renderer.context import gl_context
ctx = gl_context()
buffer = ctx.buffer(b"\\0" * 16)
shader = ctx.compute_shader("#version 450\\nlayout(local_size_x=4) in; buffer B { uint b[]; };"
    "void main() { b[gl_LocalInvocationIndex] = 7u; }")
buffer.bind_to_storage_buffer(0)
shader.run(1)
done["gl"] = list(memoryview(buffer.read()).cast("I"))

from pxr import Usd, UsdGeom
stage = Usd.Stage.CreateNew(str(folder / "a.usda"))
UsdGeom.Cube.Define(stage, "/Cube")
stage.Save()
from renderer.scene import load_scene
done["usd"] = load_scene(folder / "a.usda").triangles

import numba, numpy
@numba.njit(parallel=True)
def total(values):
    found = 0.0
    for i in numba.prange(len(values)):
        found += values[i]
    return found
done["numba"] = total(numpy.ones(10))

import torch
x = torch.ones(4, 4, requires_grad=True)
(x @ x).sum().backward()
done["torch"] = float(x.grad.sum())

import onnxruntime
from onnx import TensorProto, helper
graph = helper.make_graph([helper.make_node("Relu", ["x"], ["y"])], "g",
    [helper.make_tensor_value_info("x", TensorProto.FLOAT, [1])],
    [helper.make_tensor_value_info("y", TensorProto.FLOAT, [1])])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
done["onnx"] = float(session.run(None, {"x": numpy.array([3], dtype=numpy.float32)})[0][0])
print(json.dumps(done))
"""


def _child(script: str, *arguments: Path) -> dict[str, Any]:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def test_a_process_shut_in_cannot_reach_out(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "outside").mkdir()
    done = _child(ATTEMPTS, tmp_path / "inside", tmp_path / "outside")
    privileges, seccomp, landlock = done.pop("report")
    assert privileges
    assert seccomp
    refused = "PermissionError"
    expected = {
        "write": "1",
        "rename": "True",
        "remove": "None",
        "read given": "given",
        "memory": "MemoryError",
        "file size": "OSError",
        "internet": refused,
        "local socket": refused,
        "inherited pair": "1",
        "new pair": "2",
        "program": refused,
        "signal to parent": refused,
        "signal to itself": "None",
        "pipe file": refused,
    }
    if landlock:
        expected |= dict.fromkeys(
            (
                "write given",
                "write beside",
                "read outside",
                "read in a thread",
                "read through a link",
                "list outside",
                "passwords",
                "parent's environment",
            ),
            refused,
        )
    assert {name: done[name] for name in expected} == expected
    assert done["capabilities"].split()[1] == "0" * 16


def test_all_that_stages_need_works_inside(tmp_path: Path) -> None:
    done = _child(LIBRARIES, tmp_path)
    assert done.pop("missing") == []
    assert done == {"gl": [7] * 4, "usd": 12, "numba": 10.0, "torch": 128.0, "onnx": 3.0}


def test_memory_of_a_process_is_told() -> None:
    held = bytearray(b"x" * (64 << 20))
    assert rss_bytes(os.getpid()) > len(held)
    assert rss_bytes(2**22 + 1) == 0


@pytest.mark.parametrize("machine", ["riscv64", ""])
def test_a_machine_without_a_table_says_so(machine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from services import seccomp

    monkeypatch.setattr(seccomp.platform, "machine", lambda: machine)
    assert seccomp.install_filter() == f"no table of system calls for {machine}"
