"""Mesa's two software drivers, each in processes of its own: llvmpipe, and zink on lavapipe with its 64-bit atomics.

`python -m support.drivers` prints what the driver of this process's environment is, and the hashes of a dump.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from evaluation.stress import gl_drivers
from evaluation.stress.gl_drivers import Driver
from renderer.capture import capture
from renderer.context import describe, gl_context
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques.chain import one_pass_available
from schemas.tail import BINNED_TAILS
from support.scenes import SIZE, VIEW, shells

ROOT = Path(__file__).parents[2]

_ICDS = ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")


def lavapipe_installed() -> bool:
    """Whether the Vulkan loader and Mesa's software driver are there."""
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return False
    return any(list(Path(folder).glob("lvp_icd*.json")) for folder in _ICDS)


def environment(driver: Driver, runtime: Path) -> dict[str, str]:
    """The environment of a test process with this driver."""
    made = gl_drivers.environment(driver, runtime)
    return {**made, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}


def facts(driver: Driver, runtime: Path) -> dict[str, Any]:
    """What a process with this driver prints."""
    command = [sys.executable, "-m", "support.drivers"]
    done = subprocess.run(command, env=environment(driver, runtime), cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def _own_facts() -> dict[str, Any]:
    ctx = gl_context()
    frame = Frame(GpuScene(ctx, shells()), VIEW, *SIZE)
    dump = capture(frame).dump
    arrays = {name: getattr(dump, name) for name in ("offsets", "rgba", "depth", "background", "facing", "tile_range")}
    for tail in BINNED_TAILS:
        arrays[f"{tail} words"] = frame.gather_bins(tail, luma=True).read()
    return {
        "driver": describe(ctx),
        "one_pass": one_pass_available(ctx),
        "fragments": dump.total,
        "sha256": {name: hashlib.sha256(array.tobytes()).hexdigest() for name, array in arrays.items()},
    }


if __name__ == "__main__":
    print(json.dumps(_own_facts()))
