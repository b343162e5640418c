"""What must hold once jobs have ended, whatever was done to the processes meanwhile."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from services.service import Service
from stages.store import MissingArtifact

PUBLISHING = ("build", "train")
"""Kinds of jobs that end with a version."""


@dataclass
class Settled:
    """What was found.

    Attributes:
        jobs: Jobs that were looked at.
        lost: Those that did not succeed, with the reason.
        published: Versions of them.
        twice: Bundles with more than one version, and jobs with more than one version or none.
        pending: Tasks that still wait or run.
        quarantined: Tasks that were given up.
        damaged: Artifacts that are missing or do not have the content that they should.
        artifacts: How many different artifacts the jobs are made of.
        bodies: How often a body began, whatever became of what it made.
        events: Jobs whose events have gaps, or more than one end.
        records: Evaluations whose measurements are not there exactly once.
    """

    jobs: int = 0
    lost: list[str] = field(default_factory=list)
    published: int = 0
    twice: list[str] = field(default_factory=list)
    pending: list[str] = field(default_factory=list)
    quarantined: list[str] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    artifacts: int = 0
    bodies: int = 0
    events: list[str] = field(default_factory=list)
    records: list[str] = field(default_factory=list)

    @property
    def faults(self) -> dict[str, list[str]]:
        """What should be empty and is not."""
        kinds = ("lost", "twice", "pending", "quarantined", "damaged", "events", "records")
        return {kind: getattr(self, kind) for kind in kinds if getattr(self, kind)}


def settled(service: Service, job_ids: Sequence[str]) -> tuple[Settled, set[str]]:
    """Looks at jobs that have ended: their tasks, versions, events and artifacts.

    Args:
        service: Database and store.
        job_ids: Jobs of different specs.

    Returns:
        What was found, and the artifacts that the jobs are made of.
    """
    found = Settled(jobs=len(job_ids))
    artifacts = _look_at_tasks(service, job_ids, found)
    found.artifacts = len(artifacts)
    _look_at_versions(service, job_ids, found)
    for job_id in job_ids:
        _look_at_events(service, job_id, found)
    found.damaged += [artifact for artifact in sorted(artifacts) if not _is_there(service, artifact)]
    return found, artifacts


def _look_at_tasks(service: Service, job_ids: Sequence[str], found: Settled) -> set[str]:
    artifacts: set[str] = set()
    for job_id in job_ids:
        for task in service.jobs.tasks(job_id, limit=10_000):
            title = f"{job_id} {task.stage} {task.name}"
            if task.state == "quarantined":
                reason = "" if task.problem is None else task.problem.detail
                found.quarantined.append(f"{title}: {reason}")
            elif task.state not in ("done", "skipped"):
                found.pending.append(f"{title}: {task.state}")
            else:
                artifacts.add(task.artifact)
    return artifacts


def _look_at_versions(service: Service, job_ids: Sequence[str], found: Settled) -> None:
    jobs = [service.jobs.get(job_id) for job_id in job_ids]
    for job in jobs:
        if job.state != "succeeded":
            detail = "" if job.problem is None else job.problem.detail
            found.lost.append(f"{job.id} {job.state} at attempt {job.attempt}: {detail}")
    jobs = [job for job in jobs if job.kind in PUBLISHING]
    registry, mine = service.registry, set(job_ids)
    for name in sorted({str(job.name) for job in jobs}):
        records = [registry.record(publication) for publication in registry.versions(name)]
        own = [record for record in records if record.job_id in mine]
        found.published += len(own)
        for record in own:
            registry.folder(next(p for p in registry.versions(name) if p.version == record.version))
        digests = Counter(record.digest for record in records)
        found.twice += [f"{name}: {digest} has {count} versions" for digest, count in digests.items() if count > 1]
        references = Counter(str(job.result["reference"]) for job in jobs if job.name == name and job.result)
        counts = Counter(record.job_id for record in own)
        for job in jobs:
            if job.name == name and job.state == "succeeded" and counts[job.id] != 1:
                found.twice.append(f"{job.id} has {counts[job.id]} versions")
        found.twice += [f"{reference} is the result of {n} jobs" for reference, n in references.items() if n > 1]


def _look_at_events(service: Service, job_id: str, found: Settled) -> None:
    events = service.jobs.events(job_id, limit=100_000)
    if [event.number for event in events] != list(range(1, len(events) + 1)):
        found.events.append(f"{job_id}: numbers have gaps")
    ends = [event.data["state"] for event in events if event.kind == "state" and event.data["state"] == "succeeded"]
    if len(ends) > 1:
        found.events.append(f"{job_id}: ended {len(ends)} times")


def _is_there(service: Service, artifact: str) -> bool:
    """Whether an artifact is whole: each of its files is what it was."""
    try:
        service.storage.store.fetch(artifact)
    except MissingArtifact:
        return False
    return True
