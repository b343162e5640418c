"""One run: a cluster with a database and a store of its own, the builds, and what became of them."""

from __future__ import annotations

import hashlib
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.chaos.builds import families_of, upload
from benchmarks.chaos.feeder import AT_ONCE, Feeder
from benchmarks.chaos.leftovers import leftovers
from benchmarks.chaos.storm import Kill, Storm
from schemas.canonical import canonical_json
from schemas.job import JobKind
from services.settings import Settings
from stages.store import read_meta
from tests.support.cluster import API, Cluster
from tests.support.kernels import warm
from tests.support.postgres import Postgres
from tests.support.s3 import S3Server, environment
from tests.support.settled import Settled, settled

PROCESSES = (API, API, "jobs", "jobs", "render", "render", "label", "train", "train")
MACHINES = 2
"""State folders, each with a cache of its own, that the processes share."""
VARIABLES = {"RATE": "10000", "BURST": "10000", "JOBS": "1000", "CHECKS_PER_KEY": "2", "DRAIN_SECONDS": "20"}
"""Beside the database's and the store's: all that has to do with recovery is as it comes."""
ENDED_SECONDS = 900.0
"""Builds that have not ended so long after the last kill are lost."""


@dataclass
class Run:
    """What became of the builds.

    Attributes:
        seconds: From the first submission to the last end.
        jobs: Ids, in order.
        digests: Of each build's bundle or labels, in order; None: it has none.
        settled: What was found.
        kills: Faults.
        repeated: Requests that had to be sent again.
        left: What should be gone and is not, by kind.
    """

    seconds: float
    jobs: list[str]
    digests: list[str | None]
    settled: Settled
    kills: list[Kill] = field(default_factory=list)
    repeated: int = 0
    left: dict[str, list[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """What a storm is.

    Attributes:
        kills: SIGKILLs.
        seed: Of what is killed, and when.
        away_seconds: How long the database, and then the store, is away; 0: neither is.
    """

    kills: int
    seed: int = 1
    away_seconds: float = 60.0


def run(
    folder: Path,
    postgres: Postgres,
    s3: S3Server,
    builds: int,
    plan: Plan | None = None,
    processes: tuple[str, ...] = PROCESSES,
    variables: Mapping[str, str] = {},
    scenes: int = 2,
    kind: JobKind = "build",
) -> Run:
    """Has builds done.

    Args:
        folder: For everything; empty.
        postgres: Database server.
        s3: Store server.
        builds: How many.
        plan: What happens meanwhile; None: nothing.
        processes: API servers, and workers by their roles.
        variables: Settings that differ from those of a benchmark.
        scenes: Of each build; the second one is held out.
        kind: `build`, or `label`: a build that ends when its labels are made.
    """
    mark = f"CHAOS_RUN={uuid.uuid4().hex}"
    given = {**VARIABLES, "DATABASE": postgres.new_database(), "STORE": f"s3://{s3.new_bucket()}/chaos", **variables}
    own = {"CHAOS_RUN": mark.partition("=")[2], **s3.environment}
    with environment(s3.environment), Cluster(folder, given, own, MACHINES) as cluster:
        warm(cluster.kernels)
        cluster.start(*processes)
        families = upload(cluster, families_of(builds), scenes)
        begun = time.monotonic()
        feeder, kills = _weather(cluster, postgres, s3, families, builds, plan, kind)
        seconds = time.monotonic() - begun
        found, _ = settled(cluster.service, feeder.jobs)
        if feeder.fault is not None:
            found.lost.append(feeder.fault)
        digests = _labels(cluster, feeder.jobs) if kind == "label" else _bundles(cluster, feeder.jobs)
        cluster.end(*cluster.members)
        settings = Settings(**{name.lower(): value for name, value in given.items()})
        left = leftovers(cluster, mark, settings)
        return Run(seconds, feeder.jobs, digests, found, kills, feeder.repeated, left)


def _weather(
    cluster: Cluster,
    postgres: Postgres,
    s3: S3Server,
    families: list[list[str]],
    builds: int,
    plan: Plan | None,
    kind: JobKind,
) -> tuple[Feeder, list[Kill]]:
    """Submits all builds and waits for their end, while what the plan says happens."""
    if plan is None:
        calm = Feeder(cluster, families, builds, kind)
        calm.start()
        calm.join(ENDED_SECONDS + 60.0 * builds)
        return calm, []
    storm = Storm(cluster, plan.seed)
    # Kills and builds keep step, so that there is work under way until the last kill.
    in_step: Callable[[int], bool] = lambda number: (number - AT_ONCE) * plan.kills < storm.struck * builds  # noqa: E731
    feeder = Feeder(cluster, families, builds, kind, in_step)
    outages: list[tuple[int, str, Callable[[], None], Callable[[], None]]] = []
    if plan.away_seconds:
        outages = [
            (plan.kills // 3, "store", s3.stop, s3.start),
            (2 * plan.kills // 3, "database", lambda: postgres.stop("immediate"), postgres.start),
        ]
    with storm:
        feeder.start()
        while storm.struck < plan.kills and feeder.fault is None:
            if outages and storm.struck >= outages[0][0]:
                _, what, leave, come_back = outages.pop(0)
                storm.away(what, leave, come_back, plan.away_seconds)
            elif storm.struck * builds <= len(feeder.jobs) * plan.kills:
                storm.strike()
            else:
                time.sleep(0.1)
        storm.settle()
        feeder.join(ENDED_SECONDS)
    return feeder, storm.kills


def _bundles(cluster: Cluster, job_ids: Sequence[str]) -> list[str | None]:
    """Digest of the bundle that each job published."""
    registry, found = cluster.service.registry, dict[str, str]()
    for name in {str(cluster.service.jobs.get(job_id).name) for job_id in job_ids}:
        for record in registry.records(name, registry.versions(name)):
            if record.job_id is not None:
                found[record.job_id] = record.digest
    return [found.get(job_id) for job_id in job_ids]


def _labels(cluster: Cluster, job_ids: Sequence[str]) -> list[str | None]:
    """Digest of all files of the labels that each job made."""
    found: list[str | None] = []
    for job_id in job_ids:
        digest = hashlib.sha256()
        for task in cluster.service.jobs.tasks(job_id, stage="label"):
            files = read_meta(cluster.service.storage.store.fetch(task.artifact), task.artifact)["files"]
            digest.update(canonical_json({name: file["sha256"] for name, file in files.items()}).encode())
        found.append(digest.hexdigest())
    return found
