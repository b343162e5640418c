"""How long the dashboard's pages take with 200 models, 1,000 jobs and 10,000 measurements: the server, and the paint.

And the parts of the page Compare at 1430x960: a pixel that was not looked at before, and pictures that are made anew.

python -m benchmarks.dashboard --out benchmarks/results/dashboard.json
"""

from __future__ import annotations

import argparse
import random
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import httpx

from benchmarks import compared_view, provenance
from benchmarks.load.seed import SCENES, WHO, Seed, seed
from benchmarks.load.service import UNLIMITED
from benchmarks.load.service import Service as Served
from benchmarks.outputs import add_outputs, write_figures
from schemas.job import JobSpec
from services.database import tables
from services.service import Service, open_service
from services.settings import Settings
from stages.tasks import Task
from tests.support.bundles import make_bundle

MODELS, JOBS, MEASUREMENTS = 200, 1000, 10_000
TASKS_PER_JOB = 24
EVENTS_PER_JOB = 40
SECONDS = 1.0
"""What the first paint of a page may take."""

_STAGES = ("scene", "render", "label", "train", "export", "evaluate")


def main() -> int:
    """Measures; 1 if a page's first paint, or without a browser its answer, takes longer than `SECONDS`."""
    arguments = _parse()
    found: dict[str, Any] = {
        **provenance.head("benchmarks.dashboard"),
        "seeded": {"models": MODELS, "jobs": JOBS, "measurements": MEASUREMENTS, "tasks": JOBS * TASKS_PER_JOB},
    }
    with (
        provenance.load_around(found),
        tempfile.TemporaryDirectory(prefix="diaphane-dashboard-", ignore_cleanup_errors=True) as name,
    ):
        folder = Path(name)
        key, pages = fill(Settings(state=folder / "state"), folder)
        with Served(folder / "state", "none", UNLIMITED) as service:
            service.wait_ready(600.0)
            url = f"http://127.0.0.1:{service.port}"
            found["pages"] = measure(url, key, pages, arguments.rounds)
            found["compare_ms"] = measure_compare(url, key, pages["compare"], arguments.rounds)
    write_figures(arguments.out, found)
    print(f"{'page':10} {'server, ms':>10} {'paint, ms':>10} {'kB':>6}")
    for name, one in found["pages"].items():
        print(f"{name:10} {one['server_ms']:10.1f} {one.get('paint_ms', float('nan')):10.1f} {one['kilobytes']:6.0f}")
    for name, milliseconds in found["compare_ms"].items():
        print(f"{name:24} {milliseconds:10.1f} ms")
    slowest = max(one.get("paint_ms", one["server_ms"]) for one in found["pages"].values())
    return 1 if slowest > 1e3 * SECONDS else 0


def fill(settings: Settings, folder: Path) -> tuple[str, dict[str, str]]:
    """Seeds an empty service.

    Args:
        settings: Of the service.
        folder: For bundles.

    Returns:
        Secret of a key, and the pages by name.
    """
    made = seed(settings, folder, measurements=MEASUREMENTS, versions=MODELS, blobs=0, large=0)
    service = open_service(settings)
    with closing(service.jobs):
        _models(service, folder)
        running = _jobs(service, made)
        scene = service.scenes.get(made.scene)
        with service.database.write() as connection:  # what was measured was measured on the one scene there is
            mine = tables.measurements.c.scene == SCENES[0]
            connection.execute(tables.measurements.update().where(mine).values(scene_digest=scene.digest))
        compared = f"/compare?scene={scene.id}&{compared_view.make(service, scene.digest)}"
        service.database.close()
    return made.key, {
        "overview": "/",
        "jobs": "/jobs",
        "job": f"/jobs/{running}",
        "models": "/models",
        "model": "/models/glass",
        "scenes": "/scenes",
        "scene": f"/scenes/{scene.id}",
        "compare": compared,
    }


def measure(url: str, secret: str, pages: Mapping[str, str], rounds: int) -> dict[str, dict[str, float]]:
    """Medians of each page: until the answer is complete, and until a browser paints it for the first time."""
    found: dict[str, dict[str, float]] = {}
    with _signed_in(url, secret) as client:
        for name, path in pages.items():
            client.get(path)
            took, size = [], 0
            for _ in range(rounds):
                begun = time.perf_counter()
                answer = client.get(path)
                took.append(time.perf_counter() - begun)
                assert answer.status_code == 200, (path, answer.status_code)
                size = len(answer.content)
            found[name] = {"server_ms": round(1e3 * statistics.median(took), 1), "kilobytes": round(size / 1e3, 1)}
    for name, paint in _paints(url, secret, pages, rounds).items():
        found[name]["paint_ms"] = paint
    return found


def measure_compare(url: str, secret: str, page: str, rounds: int) -> dict[str, float]:
    """Parts of the page Compare, ms: the first of its kind, and the median of further pixels."""
    where, found = page.partition("?")[2], {}
    with _signed_in(url, secret) as client:

        def took(path: str) -> float:
            begun = time.perf_counter()
            answer = client.get(path)
            assert answer.status_code == 200, (path, answer.status_code)
            return 1e3 * (time.perf_counter() - begun)

        chosen, (width, height) = random.Random(0), compared_view.SIZE
        pixels = [f"x={chosen.randrange(width)}&y={chosen.randrange(height)}" for _ in range(5 * rounds)]
        found["first pixel"], *others = (took(f"/compare/pixel?{where}&{pixel}") for pixel in pixels)
        found["another pixel"] = statistics.median(others)
        found["another pixel, worst"] = max(others)
        for show in ("picture", "k", "difference", "flip"):
            found[show] = took(f"/compare/picture.png?{where}&show={show}")
        found["flip again"] = took(f"/compare/picture.png?{where}&show=flip")
    return {name: round(milliseconds, 1) for name, milliseconds in found.items()}


@contextmanager
def _signed_in(url: str, secret: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=url, timeout=60.0) as client:
        answer = client.post("/sign-in", data={"key": secret}, headers={"Origin": url})
        assert answer.status_code == 303, answer.text
        yield client


def _paints(url: str, secret: str, pages: Mapping[str, str], rounds: int) -> dict[str, float]:
    """First contentful paint after the beginning of the navigation, ms, with a warm cache; empty without a browser."""
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return {}
    if chromium is None:
        return {}
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.goto(f"{url}/sign-in")
        page.get_by_label("API key").fill(secret)
        page.keyboard.press("Enter")
        page.wait_for_url(f"{url}/")
        found = {
            name: statistics.median(_paint(page, url + path) for _ in range(rounds)) for name, path in pages.items()
        }
        browser.close()
    return found


def _paint(page: Any, address: str) -> float:
    page.goto(address, wait_until="load")
    entry = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
    while (found := page.evaluate(entry)) is None:
        page.wait_for_timeout(10.0)
    return float(found)


def _models(service: Service, folder: Path) -> None:
    """More names, so that there are as many names as versions of the seed's."""
    bundle = make_bundle(folder / "another")
    for number in range(MODELS - len(service.registry.models())):
        name = f"model-{number:03d}"
        service.registry.publish(name, bundle, 0.9, {"views": ["front"]})
        service.registry.promote(name, "1.0.0", "It is the first version with a score.")


def _jobs(service: Service, made: Seed) -> str:
    """Writes jobs with tasks and events; the id of one that runs."""
    spec = JobSpec.model_validate({**made.spec(), "kind": "build", "name": "glass"})
    now = time.time()
    jobs = [_job(number, spec, now) for number in range(JOBS)]
    tasks = [_task(job["id"], number, now) for job in jobs for number in range(TASKS_PER_JOB)]
    events = [
        {"job_id": job["id"], "number": 1 + number, "at": now, "kind": "log", "data": {"text": f"line {number}"}}
        for job in jobs
        for number in range(EVENTS_PER_JOB)
    ]
    with service.database.write() as connection:
        for table, rows in ((tables.jobs, jobs), (tables.tasks, tasks), (tables.events, events)):
            connection.execute(table.insert(), rows)
    return str(jobs[-1]["id"])


def _job(number: int, spec: JobSpec, now: float) -> dict[str, Any]:
    state = "running" if number >= JOBS - 8 else ("failed" if number % 10 == 0 else "succeeded")
    created = now - 300.0 * (JOBS - number)
    problem = {"type": "/v1/problems/check-failed", "title": "A check failed.", "status": 422, "remedy": "Retry."}
    return {
        "id": f"job_{number:024x}",
        "kind": spec.kind,
        "name": spec.name,
        "spec": spec.model_dump(mode="json"),
        "state": state,
        "attempt": 1,
        "stage": "render" if state == "running" else None,
        "priority": "normal",
        "created": created,
        "started": created + 1.0,
        "finished": None if state == "running" else created + 250.0,
        "submitted_by": WHO,
        "last_event": EVENTS_PER_JOB,
        "problem": problem if state == "failed" else None,
        "result": {"reference": "glass@1.0.0", "score": 0.5} if state == "succeeded" else None,
        "skipped": {"views captured before": 3},
    }


def _task(job_id: str, number: int, now: float) -> dict[str, Any]:
    """Every third task's artifact is the same in all jobs: the first job made it, and the others found it."""
    stage: Any = _STAGES[number % len(_STAGES)]
    shared = number % 3 == 0
    found = shared and int(job_id[4:], 16) > 0
    params = {"number": number, "job": "" if shared else job_id}
    task = Task(name=f"{stage} {number}", stage=stage, version="v1", params=params)
    return {
        "job_id": job_id,
        "stage": stage,
        "name": task.name,
        "position": number,
        "artifact": task.artifact,
        "task": task.model_dump(mode="json"),
        "state": "skipped" if found else "done",
        "progress": 1.0,
        "started": now - 60.0,
        "finished": now - 50.0,
        "seconds": None if found else 10.0,
    }


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_outputs(parser, required=True, has_page=False)
    parser.add_argument("--rounds", type=int, default=9, help="of each page")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
