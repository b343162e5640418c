"""What is decided of a job when it is submitted, once and for all: a repeat, a retry and a look at it find the same.

Rules:
- what a job begins with is a version from here on: aliases may move while it waits;
- what its training would refuse later is refused now.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from schemas.job import OWN_CHAMPION, SCRATCH, JobSpec
from schemas.service import SceneRecord
from services.fine_tuning import without_champion
from services.lineage import Begun, Own, begin_with
from services.measured import Measured
from services.registry import Registry
from stages.plan import Plan, plan_of_job
from stages.store import Store


@dataclass(frozen=True, slots=True)
class Accepted:
    """A job that can be queued.

    Attributes:
        spec: With every reference that may come to mean something else replaced by what it means now.
        notes: What a user should know of that.
    """

    spec: JobSpec
    notes: tuple[str, ...] = ()


def accept(
    spec: JobSpec, scenes: Mapping[str, SceneRecord], registry: Registry, measured: Measured, store: Store
) -> Accepted:
    """Decides what a job begins with.

    Args:
        spec: As submitted; its scenes and its data set are known to exist.
        scenes: Records of its scenes, by id.
        registry: Where versions are published.
        measured: Where data sets are recorded.
        store: Where labels lie.

    Raises:
        Problem: There is no such version, or a rule of `services.fine_tuning` is broken.
    """
    if spec.kind not in ("build", "train") or spec.start_from == SCRATCH:
        return Accepted(spec)
    reference = f"{spec.name}@{OWN_CHAMPION}" if spec.begins_with is None else spec.begins_with
    if spec.begins_with is None and registry.champion(str(spec.name)) is None:
        return Accepted(spec.model_copy(update={"start_from": SCRATCH}), (without_champion(str(spec.name)),))
    publication = registry.resolve(reference)
    meant = f"{publication.name}@{publication.version}"
    pinned = spec.model_copy(update={"start_from": meant})
    begun = begun_plan(pinned, plan_of_job(pinned, scenes), registry, measured, store)
    units = "-".join(str(count) for count in registry.manifest(publication).hidden)
    notes = [f"The training starts from {meant}, and the network keeps its size, {units} units."]
    if begun.forgotten:
        names = ", ".join(begun.forgotten)
        notes.append(f"No labels of {names} are known, which {meant} was trained on: it may forget them.")
    return Accepted(pinned, tuple(notes))


def begun_plan(spec: JobSpec, plan: Plan, registry: Registry, measured: Measured, store: Store) -> Begun:
    """The plan of a job with the version that it begins with, if its spec names one; see `begin_with`.

    Args:
        spec: The job.
        plan: Its plan.
        registry: Where versions are published.
        measured: Where data sets are recorded.
        store: Where labels lie.

    Raises:
        Problem: As `begin_with`, or there is no such data set.
    """
    if spec.begins_with is None:
        return Begun(plan, ())
    own = Own.of_plan(plan) if spec.dataset is None else Own.of_dataset(measured.dataset(spec.dataset))
    return begin_with(plan, own, spec.begins_with, spec.replay, registry, store)
