"""Runs a whole service whose children are traced: `audit.py FOLDER`, in a folder with files that nobody may open.

FOLDER/scenes/NAME/ are uploads with the root scene.usda, by two keys, and FOLDER/victim.png is a file of a third one.
Every scene is checked, then those that were accepted are rendered. What each thread of a child asked for comes into
FOLDER/asked.CHILD.THREAD, and what became of scenes and job into FOLDER/done.json.
"""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path

from schemas.job import FINAL_STATES, JobSpec, SceneUse
from services.engine.runtime import Runtime
from services.service import open_service
from services.settings import Settings

PATIENCE_SECONDS = 240.0
TRACED = "%file,socket,connect,bind"
"""Every call that names a file, and those that make or use a way to other processes."""


def _traced(folder: Path) -> str:
    """A program that runs Python under strace; the tracer is nobody's parent, and outlives a child that is killed."""
    script = folder / "traced-python"
    # A log for each thread, as two threads in one log cut each other's lines; `exit` is not quiet: it ends a whole log.
    words = ["strace", "-DDD", "-ff", "--seccomp-bpf", "--quiet=attach,personality", "-y", "-e", f"trace={TRACED}"]
    log = shlex.quote(str(folder / "asked"))
    script.write_text(f'#!/bin/sh\nexec {shlex.join(words)} -o {log}.$$ {shlex.quote(sys.executable)} "$@"\n')
    script.chmod(0o755)
    return str(script)


def main() -> None:
    """Does it, and stops."""
    folder = Path(sys.argv[1])
    sys.executable = _traced(folder)
    settings = Settings(state=Path(".diaphane"), poll=0.05)
    service = open_service(settings)
    service.storage.blobs.put_bytes((folder / "victim.png").read_bytes())
    runtime = Runtime(settings)
    runtime.start()
    ids = []
    for number, home in enumerate(sorted((folder / "scenes").iterdir())):
        files = {path.relative_to(home).as_posix(): path for path in sorted(home.rglob("*")) if path.is_file()}
        hashes = {name: service.storage.blobs.put_bytes(path.read_bytes()).sha256 for name, path in files.items()}
        record, _ = service.scenes.create(home.name, "scene.usda", hashes, f"key_{number % 2}")
        ids.append(record.id)
    end = time.monotonic() + PATIENCE_SECONDS

    def checked() -> bool:
        return all(service.scenes.get(scene_id).state != "checking" for scene_id in ids)

    while not checked() and time.monotonic() < end:
        time.sleep(0.1)
    records = [service.scenes.get(scene_id) for scene_id in ids]
    accepted = tuple(SceneUse(scene=record.id) for record in records if record.state == "accepted")
    spec = JobSpec(kind="render", scenes=accepted, views_per_scene=1, width=64, height=48, alpha=0.5)
    job = service.jobs.submit(spec, submitted_by="key_0")[0]
    while service.jobs.get(job.id).state not in FINAL_STATES and time.monotonic() < end:
        time.sleep(0.1)
    job = service.jobs.get(job.id)
    tasks = service.jobs.tasks(job.id)
    warnings = {
        task.name: json.loads(service.storage.store.read(task.artifact, "facts.json"))["warnings"]
        for task in tasks
        if task.stage == "scene" and task.state == "done"
    }
    runtime.stop()
    done = {
        "scenes": {record.name: record.model_dump(mode="json") for record in records},
        "job": job.model_dump(mode="json"),
        "tasks": {f"{task.stage} {task.name}": task.state for task in tasks},
        "warnings": warnings,
    }
    (folder / "done.json").write_text(json.dumps(done))


if __name__ == "__main__":
    main()
