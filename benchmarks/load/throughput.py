"""Speed of blobs over the loopback interface: the service, nginx with sendfile, and `cat`, in turns within one run."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import shutil
import socket
import statistics
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.load.http import HOST, Connection
from benchmarks.load.phases import run
from benchmarks.load.seed import HUGE, SMALL, Seed
from benchmarks.load.service import free_port

BUFFER = 1 << 20
PARALLEL = 100
PARALLEL_SECONDS = 3.0
_NGINX = """
daemon off; worker_processes auto; pid {folder}/pid; error_log {folder}/error.log;
events {{ worker_connections 1024; }}
http {{
  access_log off; sendfile on; tcp_nopush on; keepalive_requests 1000000; default_type application/octet-stream;
  client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy; fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi; scgi_temp_path {folder}/scgi;
  server {{ listen 127.0.0.1:{port}; location /v1/blobs/ {{ alias {blobs}/; }} }}
}}
"""
_UNPRIVILEGED = "nobody"


@dataclass(frozen=True)
class Rival:
    """A server of the same file.

    Attributes:
        name: Of the server.
        port: Where it listens.
        huge: Path of the file of 256 MiB.
        small: Paths of the small ones; none: it is not asked for them.
    """

    name: str
    port: int
    huge: str
    small: tuple[str, ...] = ()


def compare(port: int, seed: Seed, blobs: Path, folder: Path, rounds: int) -> dict[str, Any]:
    """Figures of all servers, in MiB/s and requests a second, and the service's share of each rival's.

    Args:
        port: Of the service.
        seed: What it holds; with the huge blob.
        blobs: Folder of its blobs.
        folder: For the rivals.
        rounds: How often each is asked, in turns.
    """
    small = tuple(f"/v1/blobs/sha256/{sha256}" for sha256 in seed.small)
    rivals = [Rival("service", port, f"/v1/blobs/sha256/{seed.huge}", small)]
    with ExitStack() as stack:
        rivals.append(stack.enter_context(cat(_place(blobs, seed.huge))))
        if shutil.which("nginx"):
            rivals.append(stack.enter_context(nginx(blobs, seed, folder)))
        huge: dict[str, list[float]] = {rival.name: [] for rival in rivals}
        rates: dict[str, list[float]] = {rival.name: [] for rival in rivals if rival.small}
        for rival in rivals:
            download(rival, seed.key)  # the pages are in memory, and the service has verified the file
        for number in range(rounds):
            turn = rivals[number % len(rivals) :] + rivals[: number % len(rivals)]
            for rival in turn:
                huge[rival.name].append(HUGE / 2**20 / download(rival, seed.key))
            for rival in turn:
                if rival.small:
                    rates[rival.name].append(run(_parallel, rival, seed.key))
    return {
        "bytes": HUGE,
        "rounds": rounds,
        "mib_per_second": {name: _summary(values) for name, values in huge.items()},
        "share": {name: _ratios(huge["service"], values) for name, values in huge.items() if name != "service"},
        "parallel_64_kib": {"connections": PARALLEL, "bytes": SMALL, "per_second": _each(rates)},
        "parallel_share": {n: _ratios(rates["service"], values) for n, values in rates.items() if n != "service"},
        **({} if "nginx" in huge else {"note": "nginx is not installed here, and was left out"}),
    }


def download(rival: Rival, key: str) -> float:
    """Seconds of a download into a buffer that is used again and again.

    Raises:
        RuntimeError: It is not the file.
    """
    buffer = bytearray(BUFFER)
    begun = time.perf_counter()
    with socket.create_connection((HOST, rival.port)) as connection:
        request = f"GET {rival.huge} HTTP/1.1\r\nHost: {HOST}:{rival.port}\r\nAuthorization: Bearer {key}\r\n"
        connection.sendall(f"{request}Connection: close\r\n\r\n".encode())
        head = b""
        while b"\r\n\r\n" not in head:
            received = connection.recv(4096)
            if not received:
                raise RuntimeError(f"{rival.name} closed the connection")
            head += received
        left = HUGE - len(head.partition(b"\r\n\r\n")[2])
        while left and (count := connection.recv_into(buffer)):
            left -= count
    if left or not head.startswith(b"HTTP/1.1 200"):
        raise RuntimeError(f"{rival.name} answered {head[:40]!r}, and {left} bytes are missing")
    return time.perf_counter() - begun


@contextmanager
def cat(path: Path) -> Iterator[Rival]:
    """A server that does as `cat` does: reads a piece and writes it, whatever it was asked for."""
    listening = socket.create_server((HOST, 0))
    process = multiprocessing.get_context("fork").Process(target=_serve_cat, args=(listening, path), daemon=True)
    process.start()
    try:
        yield Rival("cat", listening.getsockname()[1], "/")
    finally:
        process.kill()
        process.join()
        listening.close()


@contextmanager
def nginx(blobs: Path, seed: Seed, folder: Path) -> Iterator[Rival]:
    """The same files from nginx, with a configuration of its own, without privileges."""
    folder.mkdir(parents=True)
    port = free_port()
    paths = {sha256: f"/v1/blobs/{_place(blobs, sha256).relative_to(blobs)}" for sha256 in (seed.huge, *seed.small)}
    (folder / "nginx.conf").write_text(_NGINX.format(folder=folder, port=port, blobs=blobs))
    command = ["nginx", "-p", str(folder), "-c", str(folder / "nginx.conf"), "-e", str(folder / "error.log")]
    if os.getuid() == 0:
        shutil.chown(folder, _UNPRIVILEGED)
        command = ["setpriv", f"--reuid={_UNPRIVILEGED}", "--clear-groups", *command]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _wait_for(port, process)
        yield Rival("nginx", port, paths[seed.huge], tuple(paths[sha256] for sha256 in seed.small))
    finally:
        process.terminate()
        process.wait(10.0)


async def _parallel(rival: Rival, key: str) -> float:
    """Requests of small files a second, over many connections."""
    end, done = time.perf_counter() + PARALLEL_SECONDS, 0

    async def client(number: int) -> None:
        nonlocal done
        async with Connection(rival.port, key) as connection:
            while time.perf_counter() < end:
                path = rival.small[(number + done) % len(rival.small)]
                answer = await connection.request("GET", path, keep=False)
                if answer.status != 200 or answer.bytes != SMALL:
                    raise RuntimeError(f"{rival.name} answered {answer.status} with {answer.bytes} bytes")
                done += 1

    begun = time.perf_counter()
    await asyncio.gather(*(client(number) for number in range(PARALLEL)))
    return done / (time.perf_counter() - begun)


def _serve_cat(listening: socket.socket, path: Path) -> None:
    while True:
        connection, _ = listening.accept()
        with connection, path.open("rb", 0) as stream:
            connection.recv(4096)
            connection.sendall(b"HTTP/1.1 200 OK\r\n\r\n")
            buffer = memoryview(bytearray(BUFFER))
            while count := stream.readinto(buffer):
                connection.sendall(buffer[:count])


def _wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 10.0
    while True:
        try:
            socket.create_connection((HOST, port)).close()
            return
        except OSError:
            if process.poll() is not None or time.monotonic() > end:
                raise RuntimeError("nginx does not start") from None
            time.sleep(0.05)


def _place(blobs: Path, sha256: str) -> Path:
    return blobs / "sha256" / sha256[:2] / sha256


def _each(values: dict[str, list[float]]) -> dict[str, dict[str, float]]:
    return {name: _summary(found) for name, found in values.items()}


def _summary(values: Sequence[float], digits: int = 1) -> dict[str, float]:
    return {
        "median": round(statistics.median(values), digits),
        "least": round(min(values), digits),
        "most": round(max(values), digits),
    }


def _ratios(ours: Sequence[float], theirs: Sequence[float]) -> dict[str, float]:
    """Round by round, so that whatever else the machine does falls on both."""
    return _summary([mine / other for mine, other in zip(ours, theirs, strict=True)], 3)
