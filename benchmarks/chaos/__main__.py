"""Real builds on PostgreSQL and an object store, while servers, workers and children are killed.

python -m benchmarks.chaos --out benchmarks/results/chaos.json --page benchmarks/CHAOS.md
"""

from __future__ import annotations

import argparse
import logging
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.chaos.builds import SIZE, STEPS, families_of
from benchmarks.chaos.feeder import AT_ONCE
from benchmarks.chaos.page import page
from benchmarks.chaos.recovery import counts, recovery
from benchmarks.chaos.run import PROCESSES, Plan, Run, run
from benchmarks.outputs import add_outputs, write_figures, write_page
from services.settings import Settings
from tests.support.postgres import Postgres
from tests.support.s3 import S3Server

BOUNDS = {"p95": 15.0, "max": 35.0}
"""Seconds, of all recoveries."""


def main() -> int:
    """Runs the builds twice, undisturbed and disturbed; 1 if they differ or anything was lost or left."""
    arguments = _parse()
    found = provenance.head("benchmarks.chaos")
    plan = Plan(arguments.kills, arguments.seed, arguments.away)
    with (
        provenance.load_around(found),
        tempfile.TemporaryDirectory(prefix="diaphane-chaos-", ignore_cleanup_errors=True) as name,
    ):
        folder = Path(name)
        folder.chmod(0o755)  # PostgreSQL runs as another user
        logging.getLogger("werkzeug").setLevel(logging.WARNING)
        postgres, s3 = Postgres(folder / "postgres"), S3Server()
        try:
            runs = {}
            for title, weather in (("undisturbed", None), ("disturbed", plan)):
                _say(f"{arguments.builds} builds, {title}")
                (folder / title).mkdir()
                runs[title] = run(folder / title, postgres, s3, arguments.builds, weather)
                _say(f"{runs[title].seconds:.0f} s")
        finally:
            postgres.stop("immediate")
            s3.stop()
    found |= figures(runs["undisturbed"], runs["disturbed"], plan)
    write_figures(arguments.out, found)
    write_page(arguments.page, page(found))
    _say(f"faults: {found['faults'] or 'none'}; recovery {found['recovery_seconds'].get('all')}")
    return 1 if found["faults"] else 0


def figures(calm: Run, stormy: Run, plan: Plan) -> dict[str, Any]:
    """What was measured, and what should not have been found."""
    times = recovery(stormy.kills)
    different = [n for n, (one, other) in enumerate(zip(calm.digests, stormy.digests, strict=False)) if one != other]
    faults: dict[str, Any] = {**stormy.settled.faults, **{f"left {kind}": names for kind, names in stormy.left.items()}}
    faults |= {f"undisturbed {kind}": names for kind, names in {**calm.settled.faults, **calm.left}.items()}
    if different or len(calm.digests) != len(stormy.digests):
        faults["different bundles"] = different
    if lasting := [f"{kill.what} ({kill.doing})" for kill in stormy.kills if kill.seconds is None]:
        faults["not recovered"] = lasting
    late = {name: times["all"][name] for name, most in BOUNDS.items() if times and times["all"][name] > most}
    if late:
        faults["too late"] = late
    settings = Settings(database="", store="")
    return {
        "settings": {
            "builds": len(calm.jobs),
            "families": families_of(len(calm.jobs)),
            "size": SIZE,
            "steps": STEPS,
            "builds_at_once": AT_ONCE,
            "processes": list(PROCESSES),
            "heartbeat_seconds": settings.heartbeat,
            "ttl_seconds": settings.ttl,
            "seed": plan.seed,
            "away_seconds": plan.away_seconds,
        },
        "seconds": {"undisturbed": round(calm.seconds, 1), "disturbed": round(stormy.seconds, 1)},
        "kills": counts(stormy.kills),
        "hit_at_work": sum(kill.doing != "idle" for kill in stormy.kills),
        "jobs": {"submitted": len(stormy.jobs), "lost": len(stormy.settled.lost)},
        "bundles": {
            "published": stormy.settled.published,
            "published_twice": len(stormy.settled.twice),
            "equal": sum(one == other for one, other in zip(calm.digests, stormy.digests, strict=False)),
        },
        "artifacts": stormy.settled.artifacts,
        "requests_repeated": stormy.repeated,
        "recovery_seconds": times,
        "slowest": [
            {"what": kill.what, "doing": kill.doing, "seconds": round(kill.seconds, 2)}
            for kill in sorted(stormy.kills, key=lambda kill: -(kill.seconds or 0.0))[:10]
            if kill.seconds is not None
        ],
        "faults": faults,
    }


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_outputs(parser)
    parser.add_argument("--builds", type=int, default=100, help="how many builds")
    parser.add_argument("--kills", type=int, default=200, help="SIGKILLs while they run")
    parser.add_argument("--away", type=float, default=60.0, help="seconds without store and PostgreSQL")
    parser.add_argument("--seed", type=int, default=1, help="of what is killed, and when")
    return parser.parse_args()


def _say(text: str) -> None:
    print(f"{datetime.now(UTC):%H:%M:%S} {text}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
