"""The browser client's sources, copied to where their packages can be installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "deploy/client/web"
BESIDE = ("LICENSE", "benchmarks/bundle/manifest.json", "benchmarks/bundle/predict.wgsl")
"""What its build reads elsewhere in the repository."""
OFFLINE = ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ECONNRESET", "ETIMEDOUT")


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """A command in a folder, whatever becomes of it."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


def install(root: Path) -> Path:
    """Copies the sources with their locked packages, in folders as they are in the repository; skips without network.

    Args:
        root: In the place of the repository.
    """
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed")
    copy = root / "deploy/client/web"
    shutil.copytree(WEB, copy, ignore=shutil.ignore_patterns("node_modules", "dist"))
    for name in BESIDE:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    done = run(copy, "npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline")
    if done.returncode and any(sign in done.stderr for sign in OFFLINE):
        pytest.skip("the packages cannot be fetched: there is no network")
    assert done.returncode == 0, done.stderr[-2000:]
    return copy
