"""What a version that was fine-tuned on the service forgets: `diaphane serve` on SQLite, all stages as they are.

python -m benchmarks.forgetting --out benchmarks/results/forgetting.json --page benchmarks/FORGETTING.md

A version learns some scenes, another one begins with it and learns a further scene, with the replay of the first ones
and without; all are then measured on all of the scenes by jobs of the kind `evaluate`.
"""

from __future__ import annotations

import argparse
import tempfile
import textwrap
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from benchmarks import provenance
from benchmarks.load.http import HOST
from benchmarks.load.service import Service
from benchmarks.load.startup import ROLES
from benchmarks.markdown import table
from benchmarks.outputs import add_outputs, write_figures, write_page
from diaphane.cli.inputs import bring
from diaphane.cli.watching import ensure_success
from diaphane.client import Client
from evaluation.summary import geometric_mean
from renderer.samples import SAMPLES
from services.service import open_service
from services.settings import Settings

OLD, NEW = ("bottles", "nested_shells"), "foliage"
"""The project's own scenes that are learned first, and the one that is learned then: glass, and leaves."""
SETTINGS: Mapping[str, Any] = {"width": 320, "height": 214, "views_per_scene": 2, "budgets": [1.0, 2.0], "seed": 0}
"""Of every job."""
READY_SECONDS = 600.0
_POLL_SECONDS = 2.0
_WIDTH = 120
"""Characters of a line of the page."""

JSON = dict[str, Any]


class Server(Protocol):
    """What is needed of `diaphane.client.jobs.Jobs`."""

    def submit(self, spec: Mapping[str, Any]) -> tuple[JSON, bool]:
        """Submits a job."""

    def get(self, job_id: str) -> JSON:
        """A job."""


def main() -> None:
    """Runs a service, and writes what came of its jobs."""
    arguments = _parse()
    found: JSON = {
        **provenance.head("benchmarks.forgetting"),
        "old": list(OLD),
        "new": NEW,
        "settings": {**SETTINGS, "steps": arguments.steps},
    }
    with (
        provenance.load_around(found),
        tempfile.TemporaryDirectory(prefix="diaphane-forgetting-", ignore_cleanup_errors=True) as folder,
    ):
        found["rows"] = _served(Path(folder), arguments.steps)
    text = page(found)
    write_figures(arguments.out, found)
    write_page(arguments.page, text)
    print(text)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_outputs(parser, required=True)
    parser.add_argument("--steps", type=int, default=600, help="of each training")
    return parser.parse_args()


def _served(folder: Path, steps: int) -> list[JSON]:
    """The rows, measured by a service of its own."""
    settings = Settings(state=folder / "state", database="", store="")
    opened = open_service(settings)
    _, key = opened.keys.create("benchmark", ["admin"])
    opened.database.close()
    files = {name: SAMPLES[name](folder) for name in (*OLD, NEW)}
    with Service(settings.state, ROLES) as service:
        service.wait_ready(READY_SECONDS)
        client = Client(f"http://{HOST}:{service.port}", key)
        brought = bring(client, [str(file) for file in files.values()], silent=True)
        return measure(client.jobs, {scene["name"]: scene["id"] for scene in brought}, steps)


def measure(server: Server, scenes: Mapping[str, str], steps: int) -> list[JSON]:
    """Trains the versions, and has each of them measured on all scenes.

    Args:
        server: The service.
        scenes: Name -> id, of `OLD` and `NEW`.
        steps: Of each training.

    Returns:
        For each version `title`, `reference`, `training_seconds`, and `scores`: scene -> error over that of VKB.

    Raises:
        Problem: A job fails.
    """
    began = _ended(server, _training("before", OLD, scenes, steps))
    first = str(began["result"]["reference"])
    trained = {
        "before": began,
        "fine-tuned on the new scene alone": _ended(
            server, _training("alone", [NEW], scenes, steps, start_from=first, replay=False)
        ),
        "fine-tuned, old scenes replayed": _ended(
            server, _training("replayed", [NEW], scenes, steps, start_from=first)
        ),
        "all scenes from scratch": _ended(server, _training("scratch", [*OLD, NEW], scenes, steps)),
    }
    rows = []
    for title, job in trained.items():
        reference = job["result"]["reference"]
        uses = [{"scene": identity} for identity in scenes.values()]
        judged = _ended(server, {**SETTINGS, "kind": "evaluate", "model": reference, "scenes": uses})
        scores = {name: found["score"] for name, found in judged["result"]["per_scene"].items()}
        rows.append({"title": title, "reference": reference, "training_seconds": job["seconds"], "scores": scores})
    return rows


def _training(name: str, learned: Sequence[str], scenes: Mapping[str, str], steps: int, **more: Any) -> JSON:
    uses = [{"scene": scenes[scene]} for scene in learned]
    return {**SETTINGS, "kind": "train", "name": name, "scenes": uses, "steps": steps, **more}


def _ended(server: Server, spec: Mapping[str, Any]) -> JSON:
    """A job that succeeded, with the `seconds` that it took."""
    begun = time.perf_counter()
    job, _ = server.submit(spec)
    while job["state"] in ("queued", "running"):
        time.sleep(_POLL_SECONDS)
        job = server.get(job["id"])
    ensure_success(job)
    seconds = round(time.perf_counter() - begun, 1)
    print(f"{datetime.now(UTC):%H:%M:%S} {spec['kind']} {spec.get('name') or spec['model']}: {seconds} s", flush=True)
    return {**job, "seconds": seconds}


def page(found: Mapping[str, Any]) -> str:
    """The page of a result."""
    settings, names = found["settings"], [*found["old"], found["new"]]
    how = (
        "`diaphane serve` with all roles on SQLite; the project's own scenes, uploaded; jobs of the kind `train`, and "
        "one of the kind `evaluate` for every version, on every scene. The second and the third version begin with the "
        "first one, at a quarter of its learning rate ([docs/TRAINING.md](../docs/TRAINING.md)). Numbers are the "
        "squared error over that of VKB on the same view and budget, geometric means over views and budgets: less is "
        "better."
    )
    budgets = ", ".join(f"{budget:g}" for budget in settings["budgets"])
    what = (
        f"Old scenes: {', '.join(found['old'])}; new scene: {found['new']}; {settings['width']}x{settings['height']}, "
        f"{settings['views_per_scene']} views of a scene without cameras, F = W H x {budgets}; "
        f"{settings['steps']} steps, seed {settings['seed']}. What is measured is what a version still knows of scenes "
        "that it was trained on, not what it makes of unseen ones."
    )
    lines = ["# Forgetting, measured on the service", "", f"```\n{found['command']}\n```", ""]
    lines += [textwrap.fill(how, _WIDTH), "", textwrap.fill(what, _WIDTH), ""]
    rows = []
    for row in found["rows"]:
        scores = row["scores"]
        old = geometric_mean([scores[name] for name in found["old"]])
        rows.append([row["title"], *map(_shown, [old, *(scores[name] for name in names)])])
    return "\n".join([*lines, table(("", "old scenes", *names), rows), f"*{provenance.said(found)}.*", ""])


def _shown(score: float | None) -> str:
    return "" if score is None else f"{score:.3f}"


if __name__ == "__main__":
    main()
