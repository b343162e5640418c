"""A real service, with API, engine and registry, whose pipeline trains nothing: a job's seed says how good it becomes.

`python -m support.live_service` is one, in the folder that DIAPHANE_STATE names; where it is comes into READY there.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.job import JobSpec
from schemas.problem import ExitCode, Problem
from schemas.service import SceneRecord
from services.runner import Runner
from stages.tasks import Task
from support.bundles import make_bundle
from support.receiver import LOOPBACK
from support.workers import until

ROOT = Path(__file__).resolve().parents[2]
SCORES = {0: 0.5, 1: 0.4, 2: 0.6}
"""Score of a build by its seed."""
FAILING_SEED = 3
"""A build with this seed fails until the file MENDED is in the service's folder."""
MENDED = "mended"
READY = "ready.json"


def run_job(spec: JobSpec, scenes: Mapping[str, SceneRecord], runner: Runner, job: Any) -> dict[str, Any]:
    """Makes an artifact for each scene; a build also publishes a version, and compares it with the champion."""
    folder = Path(os.environ["DIAPHANE_STATE"])
    params = {"trace": str(folder / "trace"), "sleep": 0.1}
    tasks = [
        Task(name=scene.name, stage="render", version="1", inputs=(scene.digest,), params={**params, "name": "view"})
        for scene in scenes.values()
    ]
    runner.map("render", tasks)
    if spec.kind != "build":
        return {}
    if spec.seed == FAILING_SEED and not (folder / MENDED).exists():
        raise Problem("No training view is left.", "Add scenes.", ExitCode.CHECK_FAILED)
    name, score = str(spec.name), SCORES.get(spec.seed, 0.3)
    champion = runner.registry.champion(name)
    rival = None if champion is None else champion.score
    digests = sorted(scene.digest for scene in scenes.values())

    def publish() -> dict[str, Any]:
        bundle = make_bundle(folder / "bundles" / f"{job.id}-{time.time_ns()}", weights=f"{spec.seed} {digests}")
        publication = runner.registry.publish(name, bundle, score, {}, job_id=runner.job_id)
        promoted, reason = runner.registry.consider(publication, score, rival, promote=spec.promote == "if-better")
        return {"reference": f"{name}@{publication.version}", "champion": promoted, "reason": reason}

    held_out = [scenes[use.scene].name for use in spec.scenes if use.holdout]
    per_scene = {label: {"score": score, "rival": rival} for label in held_out}
    return {**runner.step("publish", publish), "score": score, "rival_score": rival, "per_scene": per_scene}


@dataclass(frozen=True)
class Live:
    """A service that runs in a process of its own: where it is, its admin key, and its folder."""

    url: str
    key: str
    folder: Path


@contextmanager
def live_service(folder: Path) -> Iterator[Live]:
    """A service; stopped at the end."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("DIAPHANE_")}
    environment |= {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}", "DIAPHANE_STATE": str(folder)}
    environment |= {"DIAPHANE_POLL": "0.05", "DIAPHANE_DRAIN_SECONDS": "1", "DIAPHANE_WEBHOOK_NETWORKS": LOOPBACK}
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "log").open("w") as log:
        command = [sys.executable, "-m", "support.live_service"]
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=ROOT)
    try:
        text = until(lambda: _text(folder / READY), why=(folder / "log").read_text)
        yield Live(**json.loads(text), folder=folder)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(20)


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""


def main() -> None:
    """Serves until it is told to stop."""
    from services.api.server import make_server
    from services.engine.runtime import Bodies, Runtime
    from services.service import open_service
    from services.settings import Settings

    settings = Settings()
    service = open_service(settings)
    _, key = service.keys.create("admin", ["admin"])
    bodies = Bodies("support.live_service:run_job", "support.bodies:make", "support.bodies:inspect", "")
    runtime = Runtime(settings, bodies=bodies)
    runtime.start()
    server = make_server(service, "127.0.0.1", 0)
    thread = threading.Thread(target=server.run)
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    thread.start()
    while not server.started:
        time.sleep(0.02)
    port = server.servers[0].sockets[0].getsockname()[1]
    ready = json.dumps({"url": f"http://127.0.0.1:{port}", "key": key})
    (settings.state / f".{READY}").write_text(ready)
    (settings.state / f".{READY}").rename(settings.state / READY)
    stop.wait()
    server.should_exit = True
    thread.join()
    runtime.stop()


if __name__ == "__main__":
    main()
