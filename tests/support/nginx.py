"""nginx as a process of a test's own, with the configuration that is deployed."""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import httpx

from support.cluster import ROOT, free_port

CONFIG = ROOT / "deploy" / "nginx" / "diaphane.conf"
# As root, its processes stay root: the folders of tests belong to it alone.
_MAIN = """
user root; daemon off; worker_processes 1; pid {folder}/pid; error_log {folder}/error.log;
events {{ worker_connections 512; }}
http {{
  access_log {folder}/access.log;
  client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy; fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi; scgi_temp_path {folder}/scgi;
  include {folder}/diaphane.conf;
}}
"""


@contextmanager
def nginx(folder: Path, ports: Sequence[int]) -> Iterator[str]:
    """The address before two servers.

    Args:
        folder: For its files; empty.
        ports: Of the servers.
    """
    port, text = free_port(), CONFIG.read_text()
    written = re.findall(r"127\.0\.0\.1:(\d+) max_fails", text)
    for before, after in zip(written, ports, strict=True):
        text = text.replace(f"server 127.0.0.1:{before}", f"server 127.0.0.1:{after}")
    (folder / "diaphane.conf").write_text(text.replace("listen 127.0.0.1:8080", f"listen 127.0.0.1:{port}"))
    (folder / "nginx.conf").write_text(_MAIN.format(folder=folder))
    command = ["nginx", "-p", str(folder), "-c", str(folder / "nginx.conf"), "-e", str(folder / "error.log")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        _wait(f"http://127.0.0.1:{port}", process)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(10.0)


def _wait(url: str, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 20.0
    while True:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        try:
            httpx.get(f"{url}/v1/health/live", timeout=5.0).raise_for_status()
            return
        except httpx.HTTPError:
            assert time.monotonic() < end
            time.sleep(0.05)
