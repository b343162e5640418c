"""What a published version was trained on, and a job's plan that begins with it.

The registry keeps the artifacts that a version was made from, retention never removes them, and neither changes: a job
that begins with a version has the same training however often it is tried, and whenever. The rules are those of
`services.fine_tuning`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from schemas.bundle import Provenance
from schemas.pixel_weights import DEFAULT_WEIGHTS
from schemas.problem import ExitCode, Problem
from schemas.service import DatasetRecord
from services.fine_tuning import check_labels, is_replayed, refuse_known, scenes_of
from services.registry import Registry
from stages.inputs import METRIC, trained_on
from stages.label import LABEL
from stages.plan import Plan, source_of_version
from stages.store import Address, MissingArtifact, Store

_SETTINGS = ("tail", "g", "metric", "seed", "weights")
"""What decides whether labels mean the same."""


@dataclass(frozen=True, slots=True)
class Own:
    """What a job trains on whatever it begins with.

    Attributes:
        scenes: Label -> hex digest, those that it holds out too.
        labels: How their views are labelled: name of a setting -> value.
    """

    scenes: Mapping[str, str]
    labels: Mapping[str, Any]

    @classmethod
    def of_plan(cls, plan: Plan) -> Own:
        """The scenes of a plan."""
        labels = {
            "tail": plan.options.tail,
            "g": plan.options.g,
            "metric": METRIC,
            "seed": plan.options.seed,
            "weights": plan.options.weights,
        }
        return cls(scenes_of(plan), labels)

    @classmethod
    def of_dataset(cls, record: DatasetRecord) -> Own:
        """The scenes of a data set; the seed is that of its sampled pixels, not that of the training."""
        scenes = {shard.scene: shard.scene_digest for shard in record.shards}
        return cls(scenes, {"metric": METRIC, "weights": DEFAULT_WEIGHTS, **record.settings})


@dataclass(frozen=True, slots=True)
class Begun:
    """A plan that begins with a version.

    Attributes:
        plan: The plan.
        forgotten: Labels of scenes that the version was trained on and that no one trains on again, though that was
            asked for: their shards are not known.
    """

    plan: Plan
    forgotten: tuple[str, ...]


def begin_with(plan: Plan, own: Own, reference: str, replay: bool, registry: Registry, store: Store) -> Begun:
    """A plan whose training begins with a version.

    Args:
        plan: The plan of the job.
        own: What it trains on anyhow.
        reference: The version.
        replay: Whether what the version was trained on is trained on again.
        registry: Where it is published.
        store: Where its labels lie.

    Raises:
        Problem: There is no such version, a held-out scene is one that it was trained on, or its labels do not mean
            what the job's mean, or are gone.
    """
    publication = registry.resolve(reference)
    version = registry.record(publication)
    learned: dict[str, str] = dict(version.provenance["scenes"])
    refuse_known(plan.scenes, set(learned.values()))
    called = f"What {publication.name}@{publication.version} was trained on"
    trainings = [made for made in registry.made_from(publication) if made.startswith("train/")] if replay else []
    shards = [shard for made in trainings for shard in trained_on(_made_from(store, made, called).inputs)]
    found = {shard.scene for shard in shards}
    names = {digest: label for label, digest in learned.items()}
    again = [shard for shard in shards if is_replayed(own.scenes, names.get(shard.scene, shard.scene), shard.scene)]
    lost = [name for name, digest in learned.items() if digest not in found and is_replayed(own.scenes, name, digest)]
    for shard in again[:1]:  # those of one training are labelled alike: the first one speaks for all
        made = LABEL.params.model_validate(_made_from(store, shard.artifact, called).params)
        remedy = "Give the job the same settings, or leave out the replay (--no-replay)."
        check_labels(called, {name: getattr(made, name) for name in _SETTINGS}, own.labels, remedy)
    begun = replace(
        plan,
        start=source_of_version(version),
        replayed=tuple((shard.scene, shard.artifact) for shard in again),
        learned=learned,
        licences=Provenance.model_validate(version.provenance).known_licences,
    )
    return Begun(begun, tuple(lost) if replay else ())


def _made_from(store: Store, artifact: str, called: str) -> Address:
    try:
        return store.made_from(artifact)
    except MissingArtifact as missing:
        raise Problem(
            f"{called} cannot be replayed: {artifact} is gone.",
            "Start from another version, or leave out the replay (--no-replay).",
            ExitCode.CONFLICT,
        ) from missing
