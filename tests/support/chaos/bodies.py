"""Stand-ins for the work of the stages: they sleep a little and write what the pipeline expects of each."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path
from typing import Any

from support.chaos.probe import reach

DATA = "data.bin"
"""File of every artifact, with content that follows from the artifact's key."""
DATA_BYTES = 64 << 10
TECHNIQUES = {"kbuffer": 4e-5, "kbuffer-importance": 2e-5, "kbuffer-optimal": 1e-6}


def load() -> None:
    """Imports what `make` needs, before the process is shut in."""
    import support.bundles  # noqa: F401


def make(stage: Any, desk: Any, task: Any, params: Any, folder: Path, report: Any) -> Any:
    """Makes an artifact of a stage. The larger a job's seed, the better is its bundle."""
    from stages.catalogue import STAGES

    reach(f"{stage}:begin", artifact=task.artifact)
    for need in task.needs:
        desk.store.fetch(need)
    end = time.monotonic() + float(os.environ["CHAOS_SLEEP"])
    while time.monotonic() < end:
        time.sleep(0.02)
        report(0.5, "working")
    (folder / DATA).write_bytes(content(task.artifact))
    facts = STAGES[stage].facts.model_validate(_FACTS[stage](task, folder, desk))
    reach(f"{stage}:end", artifact=task.artifact)
    return facts


def content(artifact: str) -> bytes:
    """What `DATA` of an artifact holds."""
    return hashlib.shake_128(artifact.encode()).digest(DATA_BYTES)


def _scene(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    seed = task.params["seed"]
    views = [
        {"name": f"view{index}", "eye": (0.0, index, 5.0 + seed), "target": (0.0, 0.0, 0.0), "up": (0.0, 1.0, 0.0)}
        for index in range(task.params["count"])
    ]
    return {"views": views, "triangles": 12, "opaque": False, "content": task.inputs[0], "warnings": [], "licence": ""}


def _render(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    return {"total": 1000, "occupied": 10, "passes": {}}


def _label(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    count = len(task.params["budgets"])
    return {
        "errors": {"optimal": [1.0] * count, "greedy": [1.5] * count},
        "certificates": [{"error": 1.0, "bound": 1.0, "gap": 0.0}] * count,
        "shard": {"sha256": hashlib.sha256(content(task.artifact)).hexdigest(), "bytes": DATA_BYTES},
        "skips": {"pixels exact at k = 0": 3, "budgets given more than once": 0},
    }


def _train(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    return {"history": [{"step": 1, "loss": 1.0, "over_optimum": 2.0}], "config": {}}


def _export(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    from schemas.bundle_files import bundle_digest
    from schemas.canonical import file_sha256
    from stages.desk import BUNDLE
    from support.bundles import make_bundle

    weights = f"{task.params['settings']['seed']} {task.address.key}"
    bundle = make_bundle(folder / BUNDLE, weights=weights, scenes=task.params["scenes"])
    files = {path.name: file_sha256(path) for path in sorted(bundle.iterdir())}
    return {"digest": bundle_digest(bundle), "files": files, "parity": 1e-7}


def _evaluate(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    from schemas.bundle import FILES

    params = task.params
    measured = TECHNIQUES
    if params["kind"] == "bundle":
        _, seed, _ = (desk.bundle(task) / FILES[0]).read_text().split()
        measured = {"kbuffer-deep": 1e-5 / (1.0 + int(seed))}
    return {"measurements": [_measurement(params, name, mse) for name, mse in measured.items()]}


def _report(task: Any, folder: Path, desk: Any) -> dict[str, Any]:
    page = folder / "index.html"
    page.write_text(f"<!doctype html><title>{task.artifact}</title>")
    return {"sha256": hashlib.sha256(page.read_bytes()).hexdigest(), "bytes": page.stat().st_size}


def _measurement(params: dict[str, Any], technique: str, mse: float) -> dict[str, Any]:
    width, height = params["size"]
    return {
        "scene": "",
        "view": params["view"]["name"],
        "technique": technique,
        "budget": params["budgets"][0],
        "budget_factor": params["factors"][0],
        "width": width,
        "height": height,
        "alpha": params["alpha"],
        "tail": params["tail"],
        "mse": mse,
        "total_fragments": 1000,
    }


_FACTS = {
    "scene": _scene,
    "render": _render,
    "label": _label,
    "train": _train,
    "export": _export,
    "evaluate": _evaluate,
    "report": _report,
}
