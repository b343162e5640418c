"""A service with something of everything for the dashboard to show, hostile names among it, and a signed-in browser."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
from fastapi.testclient import TestClient
from PIL import Image

from schemas.bundle import write_card
from schemas.service import ProblemDocument
from services.database import tables
from stages.tasks import FACTS, Task
from support.api import Api, build_spec, measurement
from support.bundles import make_bundle

HOSTILE = "<script>alert('x')</script>\"><img src=x onerror=alert(1)>"
ORIGIN = "http://localhost"
SIZE = (12, 8)


class Visitor:
    """A browser without scripts.

    Args:
        api: The service.
        scope: Of the key that it signs in with; None: it does not.
    """

    def __init__(self, api: Api, scope: str | None = "admin") -> None:
        self.client = TestClient(api.app, base_url=ORIGIN, raise_server_exceptions=False, follow_redirects=False)
        if scope is not None:
            answer = self.sign_in(api.secrets[scope])
            assert (answer.status_code, answer.headers["location"]) == (303, "/")

    def sign_in(self, secret: str, **more: str) -> Any:
        return self.client.post("/sign-in", data={"key": secret, **more}, headers={"Origin": ORIGIN})

    def get(self, path: str, **headers: str) -> Any:
        return self.client.get(path, headers=headers)

    def post(self, path: str, page: str = "/", origin: str = ORIGIN, **fields: str) -> Any:
        """Sends a form with the token that a page has."""
        token = re.search(r'name="csrf" value="([0-9a-f]{64})"', self.get(page).text)
        assert token is not None
        return self.client.post(path, data={"csrf": token[1], **fields}, headers={"Origin": origin})


class Shown:
    """Ids of what `fill` made.

    Attributes:
        running: A job under way, with tasks in several states.
        failed: A job with a problem.
        built: A job that succeeded, with a report.
        scene: A scene with measurements and pictures.
        rejected: A scene with a problem.
    """

    running: str
    failed: str
    built: str
    scene: str
    rejected: str


def fill(api: Api, folder: Path, said: str = HOSTILE) -> Shown:
    """Writes through the service's own classes and tables what workers would have written.

    Args:
        api: The service.
        folder: For bundles.
        said: What those who use it write wherever they may write anything.
    """
    made = Shown()
    made.scene, made.rejected = _scenes(api, said)
    evaluate = _evaluation(api)
    made.running = _job(api, made.scene, "running", stage="label", started=time.time() - 90.0)
    _task(api, made.running, "render", "bottles front", "skipped", 0)
    _task(api, made.running, "label", f"bottles {said}", "running", 1, progress=0.4, note=said)
    problem = ProblemDocument(type="/v1/problems/check-failed", title="A check failed.", status=422, detail=said)
    _task(api, made.running, "label", "bottles side", "quarantined", 2, problem=problem.model_dump(mode="json"))
    api.log(made.running, "a line", said)
    remedial = problem.model_copy(update={"remedy": "Add scenes."}).model_dump(mode="json")
    made.failed = _job(api, made.scene, "failed", problem=remedial, finished=time.time())
    report = api.service.storage.blobs.put_bytes(b"<!doctype html><title>Report</title><script>1</script>").sha256
    result = {"reference": "glass@1.0.0", "score": 0.5, "champion": True, "reason": "It is first.", "report": report}
    made.built = _job(api, made.scene, "succeeded", result=result, finished=time.time(), skipped={"views captured": 3})
    _task(api, made.built, "render", "bottles front", "done", 0, seconds=75.0)
    _task(api, made.built, "evaluate", "bottles front", "done", 1, task=evaluate)
    _models(api, folder, evaluate, api.service.scenes.get(made.scene).digest, said)
    with api.service.database.write() as connection:
        row = {
            "id": "e",
            "host": "here/1",
            "pid": 1,
            "started": "0",
            "roles": "jobs:1,label:2",
            "last_seen": time.time(),
        }
        connection.execute(tables.executors.insert().values(**row))
    return made


def _scenes(api: Api, said: str) -> tuple[str, str]:
    accepted = api.scene()
    with api.service.database.write() as connection:
        facts = {"triangles": 1234567, "cameras": 2, "opaque": False, "warnings": [said]}
        connection.execute(tables.scenes.update().values(name=said, facts=facts))
    sha256 = api.service.storage.blobs.put_bytes(b"#usda 1.0\n# other\n").sha256
    record, _ = api.service.scenes.create("other", "scene.usda", {"scene.usda": sha256}, "key_000000000000")
    problem = ProblemDocument(
        type="/v1/problems/scene-url", title="The scene refers to an address.", status=422, remedy="Pack the file."
    )
    api.service.scenes.resolve_check(record.id, None, problem)
    return accepted, record.id


def _job(api: Api, scene: str, state: str, **values: Any) -> str:
    answer = api.post("/v1/jobs", json=build_spec(scene))
    assert answer.status_code == 202, answer.text
    job_id = str(answer.json()["id"])
    api.move(job_id, state)
    with api.service.database.write() as connection:
        connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(**values))
    return job_id


def _task(api: Api, job_id: str, stage: Any, name: str, state: str, position: int, **values: Any) -> None:
    task: Task = values.pop("task", None) or Task(name=name, stage=stage, version="v1", params={"name": name})
    row = {"job_id": job_id, "stage": stage, "name": name, "position": position, "artifact": task.artifact}
    row |= {"task": task.model_dump(mode="json"), "state": state, **values}
    with api.service.database.write() as connection:
        connection.execute(tables.tasks.insert().values(**row))


def _evaluation(api: Api) -> Task:
    """An evaluation's artifact with pictures, and the labels that it was made from."""
    label = Task(name="bottles front", stage="label", version="v1")
    with api.service.storage.store.put(label.address) as folder:
        facts = {"certificates": [{"error": 0.25, "bound": 0.2, "gap": 0.2}]}
        (folder / FACTS).write_text(json.dumps(facts), encoding="utf-8")
    task = Task(
        name="bottles front",
        stage="evaluate",
        version="v1",
        inputs=("0" * 64, label.address.key),
        params={"factors": [1.0]},
    )
    counts = np.arange(SIZE[0] * SIZE[1], dtype=np.uint8).reshape(SIZE[1], SIZE[0])
    with api.service.storage.store.put(task.address) as folder:
        Image.fromarray(np.stack([counts] * 3, axis=-1)).save(folder / "exact.png")
        for name in ("sbuffer-2", "kbuffer-1", "kbuffer-importance-1", "kbuffer-optimal-1", "kbuffer-deep-1"):
            Image.fromarray(counts // 8).save(folder / f"{name}.k.png")
    return task


def _models(api: Api, folder: Path, evaluate: Task, digest: str, said: str) -> None:
    registry, measured = api.service.registry, api.service.measured
    for number, weights in enumerate("abc"):
        bundle = make_bundle(folder / weights, weights)
        write_card(bundle, "# Model card: glass\n\n## What it is for\n\nGlass.\n")
        registry.publish("glass", bundle, 0.5 + 0.1 * number, {"views": ["a"]})
        registry.promote("glass", f"1.{number}.0", f"{said} {number}", who="key_000000000000")
    digests = {"bottles": digest, said: "1" * 64}
    size = {"width": SIZE[0], "height": SIZE[1], "k_min": 1, "k_max": 9, "total_bytes": 1 << 20}
    times = {"kbuffer": (4e-4, 2.0), "kbuffer-importance": (3e-4, 3.0), "kbuffer-optimal": (1e-4, 9.0)}
    base = [measurement(technique=name, mse=mse, total_ms=ms, **size) for name, (mse, ms) in times.items()]
    base.append(measurement(technique="sbuffer", budget_factor=2.0, mse=0.0, exact=True, total_ms=7.0, **size))
    measured.record(evaluate.artifact, base, digests, None, None)
    for number, factor in enumerate((1.0, 1.2, 1.01)):  # the second is worse on one scene
        own = [measurement(technique="kbuffer-deep", mse=2e-4 * factor, total_ms=4.0, **size)]
        own.append(measurement(technique="kbuffer-deep", mse=2e-4, total_ms=4.0, scene=said, **size))
        measured.record(f"evaluate/{number:064x}", own, digests, f"glass@1.{number}.0", None)
