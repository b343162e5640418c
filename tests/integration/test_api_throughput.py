"""How fast a blob is served, beside a server that does nothing but `sendfile`, in the same run."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from support.api import Api

SIZE = 256 << 20
ROUNDS = 3

CLIENT = """
import socket, sys, time
port, request = int(sys.argv[1]), sys.argv[2].encode().decode("unicode_escape").encode()
with socket.create_connection(("127.0.0.1", port)) as connection:
    begun = time.perf_counter()
    connection.sendall(request)
    buffer, size = bytearray(1 << 20), 0
    while count := connection.recv_into(buffer):
        size += count
    print(size, size / (time.perf_counter() - begun))
"""


def _fetch(port: int, request: str) -> float:
    """Bytes a second; the client is a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", CLIENT, str(port), request], capture_output=True, text=True, check=True
    )
    size, speed = done.stdout.split()
    assert int(size) >= SIZE
    return float(speed)


@contextmanager
def _sendfile_server(path: Path) -> Iterator[int]:
    """Port of a server that sends a file to whoever connects."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            with connection, path.open("rb") as stream:
                connection.recv(1 << 16)
                offset = 0
                while sent := os.sendfile(connection.fileno(), stream.fileno(), offset, SIZE):
                    offset += sent

    threading.Thread(target=serve, daemon=True).start()
    yield listener.getsockname()[1]
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()


def test_a_blob_is_served_at_half_the_speed_of_sendfile_or_more(tmp_path: Path) -> None:
    api = Api(tmp_path)
    block = os.urandom(1 << 20)
    folder = api.service.settings.state
    (folder / "large").write_bytes(block * (SIZE >> 20))
    sha256 = api.service.storage.blobs.put_file(folder / "large").sha256
    path = api.service.storage.blobs.path(sha256)
    with api.served() as url, _sendfile_server(path) as port:
        headers = f"Authorization: {api.headers('read')['Authorization']}\\r\\nConnection: close\\r\\n"
        request = f"GET /v1/blobs/sha256/{sha256} HTTP/1.1\\r\\nHost: localhost\\r\\n{headers}\\r\\n"
        ours = int(url.rpartition(":")[2])
        pairs = [(_fetch(ours, request), _fetch(port, "x")) for _ in range(ROUNDS)]
    best, reference = (max(speeds) for speeds in zip(*pairs, strict=True))
    print(f"blob {best / 1e6:.0f} MB/s, sendfile {reference / 1e6:.0f} MB/s")
    assert best >= 0.5 * reference
