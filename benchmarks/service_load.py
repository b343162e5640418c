"""The service under load, on one machine: latencies, errors, memory, speed of blobs, time until it is ready.

python -m benchmarks.service_load --out benchmarks/results/service-load.json --page benchmarks/LOAD.md
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.load import flow, phases, startup, throughput
from benchmarks.load.figures import Tally
from benchmarks.load.page import page
from benchmarks.load.phases import Plan
from benchmarks.load.seed import Seed, seed
from benchmarks.load.service import UNLIMITED, Sampler, Service
from benchmarks.load.traffic import Mix
from benchmarks.outputs import add_outputs, write_figures, write_page
from services.database import open_database
from services.settings import Settings
from tests.support.postgres import Postgres, postgres_folder

PARTS = ("ready", "blobs", "queued", "flow")
FLOW_SECONDS = 90.0


def main() -> int:
    """Runs what was asked for; 1 if there were errors."""
    arguments = _parse()
    found = provenance.head("benchmarks.service_load")
    with (
        provenance.load_around(found),
        tempfile.TemporaryDirectory(prefix="diaphane-load-", ignore_cleanup_errors=True) as name,
    ):
        folder = Path(name)
        folder.chmod(0o755)  # nginx and PostgreSQL run as other users
        with _databases(arguments, folder) as urls:
            _run(arguments, folder, urls, found)
    if arguments.add and arguments.out.exists():
        earlier = json.loads(arguments.out.read_text(encoding="utf-8"))
        found.update({part: earlier[part] for part in PARTS if part in earlier and part not in found})
    found["errors"] = sum(run["errors"] for part in ("queued", "flow") for run in found.get(part, {}).values())
    write_figures(arguments.out, found)
    write_page(arguments.page, page(found))
    print(f"{found['errors']} errors; figures in {arguments.out}")
    return 1 if found["errors"] else 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_outputs(parser, required=True)
    parser.add_argument("--parts", default=",".join(PARTS), help=f"what is measured, of {','.join(PARTS)}")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each phase")
    parser.add_argument("--jobs", type=int, default=1000, help="submitted in each phase")
    parser.add_argument("--rounds", type=int, default=9, help="of the comparison of blobs")
    parser.add_argument("--starts", type=int, default=5, help="until the service is ready")
    parser.add_argument("--add", action="store_true", help="keep what FILE has of parts that are not measured now")
    parser.add_argument("--postgres", help="URL of an empty database; else a server of its own, where initdb is")
    return parser.parse_args()


def _run(arguments: argparse.Namespace, folder: Path, urls: dict[str, str], found: dict[str, Any]) -> None:
    parts = arguments.parts.split(",")
    if "ready" in parts:
        _say("time until the service is ready")
        found["ready"] = _noted(lambda: startup.measure(folder, arguments.starts))
    if "blobs" in parts:
        _say("speed of blobs")
        found["blobs"] = _noted(lambda: _blobs(folder / "blobs", arguments.rounds))
    for name, url in urls.items():
        if "queued" in parts:
            found.setdefault("queued", {}).update(_queued(name, folder / f"queued-{name}", url, arguments))
    if "flow" in parts:
        _say("jobs that flow")
        found["flow"] = {"sqlite": _noted(lambda: _flow(folder / "flow", arguments))}


def _blobs(state: Path, rounds: int) -> dict[str, Any]:
    settings = Settings(state=state, database="", store="")
    held = seed(settings, state, measurements=0, versions=0, blobs=100, large=0, huge=True)
    with Service(state, "none", UNLIMITED) as service:
        service.wait_ready()
        return throughput.compare(service.port, held, state / "store" / "blobs", state / "nginx", rounds)


def _queued(name: str, state: Path, url: str, arguments: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """The phase with readers that pause, then the one with readers that do not, on one service."""
    settings = Settings(state=state, database=url, store="")
    held = seed(settings, state)
    environment = {**UNLIMITED, **({"DIAPHANE_DATABASE": url} if url else {})}
    calm = Plan(arguments.seconds, arguments.jobs, 1.25 * arguments.jobs / arguments.seconds, 50, 25, 2.0, Mix())
    plans = {"paced": calm, "flat-out": replace(calm, per_second=1e9, mix=Mix(think=0.0))}
    with Service(state, "none", environment) as service:
        service.wait_ready()
        for mode, plan in plans.items():
            _say(f"{arguments.jobs} queued jobs, readers, listeners: {name}, {mode}")
            yield f"{name}, {mode}", _noted(partial(_phase, service, held, plan, settings))


def _flow(state: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    settings = Settings(state=state, database="", store="")
    held = seed(settings, state)
    seconds = max(FLOW_SECONDS, arguments.seconds)
    plan = Plan(seconds, arguments.jobs, 1e9, 50, 50, 0.0, Mix())
    with Service(state, startup.ROLES, UNLIMITED) as service:
        service.wait_ready()
        held = flow.prepare(service.port, held, settings)
        sampler = Sampler(service.process.pid)
        sampler.start()
        tally, counts = flow.run_flowing(service.port, held, plan)
        return _figures(tally, counts, plan, service, sampler, settings)


def _phase(service: Service, held: Seed, plan: Plan, settings: Settings) -> dict[str, Any]:
    sampler = Sampler(service.process.pid)
    sampler.start()
    tally, counts = phases.run_queued(service.port, held, plan, settings)
    return _figures(tally, counts, plan, service, sampler, settings)


def _noted(measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What is measured, with the time and the load of the machine before and after."""
    found: dict[str, Any] = {"created": provenance.now()}
    with provenance.load_around(found):
        found |= measure()
    return found


def _figures(
    tally: Tally, counts: dict[str, Any], plan: Plan, service: Service, sampler: Sampler, settings: Settings
) -> dict[str, Any]:
    memory = sampler.finish()
    database = open_database(settings.database_url)
    try:
        size = phases.database_bytes(database)
    finally:
        database.close()
    return {
        "seconds": plan.seconds,
        "readers": plan.mix.small + plan.mix.large + plan.mix.measurements,
        "think_seconds": plan.mix.think,
        "listeners": plan.listeners,
        **counts,
        **tally.figures(plan.seconds),
        "server": memory,
        "database_mib": round(size / 2**20, 1),
        "unexpected_log_lines": service.unexpected()[:10],
    }


@contextmanager
def _databases(arguments: argparse.Namespace, folder: Path) -> Iterator[dict[str, str]]:
    """URLs by name; an empty one is SQLite in the state folder."""
    if arguments.postgres:
        yield {"sqlite": "", "postgresql": arguments.postgres}
    elif postgres_folder() is None or "queued" not in arguments.parts:
        yield {"sqlite": ""}
    else:
        server = Postgres(folder / "postgres")
        try:
            yield {"sqlite": "", "postgresql": server.new_database()}
        finally:
            server.stop("immediate")


def _say(text: str) -> None:
    print(f"{datetime.now(UTC):%H:%M:%S} {text}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
