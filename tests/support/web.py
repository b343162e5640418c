"""The browser client's sources, copied to where their packages can be installed."""

from __future__ import annotations

import functools
import http.server
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the test's own output is enough."""


@contextmanager
def three_page(installed: Path, built: Path) -> Iterator[str]:
    """Builds the page that compares pictures of @diaphane/three, and serves it.

    Args:
        installed: Sources with their packages.
        built: An empty folder.
    """
    config = "packages/three/tests/page/vite.config.ts"
    done = run(installed, "npx", "vite", "build", "-c", config, "--outDir", str(built))
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=built)) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
