"""Every technique, and the allocation on the GPU, again on zink over lavapipe.

It has the 64-bit atomics of the one-pass chain and needs no GPU.

A process has one context, so they run in another one.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.drivers import ROOT, environment, facts, lavapipe_installed

from evaluation.stress.gl_drivers import LLVMPIPE, ZINK
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL

ONE_PASS = "tests/differential/test_chain_one_pass.py"
NOT_OF_DRIVERS = {
    "test_stress_gl_passes.py",  # how the stress test judges; the stress test itself draws on every driver
    "test_many_fragments.py",  # stacks that the stress test draws on every driver (evaluation/stress/gl_stacks.py)
    "test_bench.py",  # what a benchmark plans and keeps
    "test_glsl.py",  # the reference compiler of GLSL, which is no driver's
    "test_account.py",  # what a frame's shaders count of themselves, by the dump that both drivers capture
}
NOT_OF_DRIVERS_EITHER = ("test_it_learns_and_then_stands_still", "test_the_benchmark_measures_the_frames")
"""Tests among the others: a path of many frames, of passes that single frames of the same file draw here too."""
DEFAULT_ALONE = " and ".join(
    f"not {left_out}" for left_out in (*(tail for tail in BINNED_TAILS if tail != DEFAULT_TAIL), *NOT_OF_DRIVERS_EITHER)
)
"""Tests with one tail: the stress test draws every bounded technique with every tail on every driver, and what is kept
of their bins is the same to the bit. Most of the time here shaders are compiled, and each tail has its own."""
TECHNIQUES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "tests" / "differential").glob("test_*.py")
    if path.name not in NOT_OF_DRIVERS
    and re.search(r"^from renderer\.(techniques|allocation\.gpu)", path.read_text(encoding="utf-8"), re.MULTILINE)
)

pytestmark = pytest.mark.skipif(
    not lavapipe_installed(), reason=f"there is no Vulkan driver for zink: apt-get install {ZINK.packages}"
)


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runtime")
    folder.chmod(0o700)
    return folder


def test_fragments_are_bit_identical_on_both_software_drivers(runtime: Path) -> None:
    zink, llvmpipe = facts(ZINK, runtime), facts(LLVMPIPE, runtime)
    assert zink["driver"].startswith("zink")
    assert zink["one_pass"]
    assert llvmpipe["driver"].startswith("llvmpipe")
    assert not llvmpipe["one_pass"]
    assert zink["fragments"] > 10_000
    assert zink["sha256"] == llvmpipe["sha256"]


def test_the_differential_tests_of_all_techniques_pass_on_zink(runtime: Path, tmp_path: Path) -> None:
    assert ONE_PASS in TECHNIQUES
    command = [sys.executable, "-m", "pytest", *TECHNIQUES, "-k", DEFAULT_ALONE, "-p", "no:cacheprovider"]
    command += [f"--basetemp={tmp_path / 'run'}", "--durations=10"]
    done = subprocess.run(command, env=environment(ZINK, runtime), cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    skipped = [line for line in done.stdout.splitlines() if line.startswith("SKIPPED") and ONE_PASS in line]
    assert not skipped, "the one-pass chain was not tested"
