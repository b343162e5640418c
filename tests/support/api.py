"""The API over a service that nobody works for, in the process or behind a real server: tests move the jobs."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from schemas.measurement import Measurement
from schemas.service import SCOPES, ShardRef
from services.api.application import create_app
from services.api.server import server_of
from services.database import tables
from services.engine import events
from services.registry import Publication
from services.service import Service, open_service
from services.settings import Settings
from support.bundles import make_bundle

SCENE = "#usda 1.0\n"
HASH = "0" * 64


class Api:
    """An application, and a key of every scope.

    Args:
        folder: Of its state.
        url: Of its database; empty: SQLite in the folder.
        settings: Others.

    Attributes:
        service: What it answers from.
        secrets: Scope -> secret of a key with it.
    """

    def __init__(self, folder: Path, url: str = "", **settings: Any) -> None:
        self.service: Service = open_service(Settings(state=folder / "state", database=url, **settings))
        self.app = create_app(self.service)
        self.secrets: dict[str, str] = {scope: self.service.keys.create(scope, [scope])[1] for scope in SCOPES}
        self.client = TestClient(self.app, base_url="http://localhost", raise_server_exceptions=False)

    def headers(self, scope: str = "admin") -> dict[str, str]:
        return {"Authorization": f"Bearer {self.secrets[scope]}"}

    def request(self, method: str, path: str, scope: str | None = "admin", **options: Any) -> Any:
        headers = (self.headers(scope) if scope else {}) | dict(options.pop("headers", None) or {})
        return self.client.request(method, path, headers=headers, **options)

    def get(self, path: str, scope: str | None = "read", **options: Any) -> Any:
        return self.request("GET", path, scope, **options)

    def post(self, path: str, scope: str | None = "submit", **options: Any) -> Any:
        return self.request("POST", path, scope, **options)

    @contextmanager
    def served(self, proxies: Sequence[str] = ()) -> Iterator[str]:
        """URL of a real server."""
        server = server_of(self.app, "127.0.0.1", 0, proxies)
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        end = time.monotonic() + 30.0
        while not server.started:
            assert time.monotonic() < end
            assert thread.is_alive()
            time.sleep(0.01)
        try:
            yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join(30.0)
            assert not thread.is_alive()

    # What workers would do

    def scene(self, content: str = SCENE) -> str:
        """Id of a scene that was uploaded and accepted."""
        sha256 = self.service.storage.blobs.put_bytes(content.encode()).sha256
        record, _ = self.service.scenes.create("a scene", "scene.usda", {"scene.usda": sha256}, "key_000000000000")
        self.service.scenes.resolve_check(record.id, {"triangles": 1})
        return record.id

    def job(self, **more: Any) -> str:
        """Id of a new job."""
        answer = self.post("/v1/jobs", json=build_spec(self.scene(), **more))
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    def move(self, job_id: str, state: str) -> None:
        """Writes another state of a job, with its event."""
        with self.service.database.write() as connection:
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(state=state))
            events.add(connection, job_id, ("state", {"state": state}))

    def log(self, job_id: str, *texts: str) -> None:
        """Writes events of a job."""
        with self.service.database.write() as connection:
            events.append(connection, job_id, [("log", {"text": text}) for text in texts])

    def version(self, folder: Path, weights: str = "a") -> Publication:
        """Publishes a bundle."""
        return self.service.registry.publish("glass", make_bundle(folder, weights), 0.5, {"views": 2})


def build_spec(scene: str, **more: Any) -> dict[str, Any]:
    """A job that builds a bundle of one scene."""
    return {"kind": "build", "name": "glass", "scenes": [{"scene": scene}], **more}


def measurement(**more: Any) -> Measurement:
    """A measurement of a picture."""
    values = {"scene": "bottles", "view": "front", "technique": "kbuffer", "budget": 100, "budget_factor": 1.0}
    values |= {"width": 10, "height": 10, "alpha": None, "tail": "density", "mse": 0.5, "total_fragments": 200}
    return Measurement.model_validate(values | more)


def shard(view: str = "front") -> ShardRef:
    """A shard of a data set."""
    return ShardRef(scene="bottles", scene_digest=HASH, view=view, artifact=f"label/{HASH}", sha256=HASH, bytes=10)
