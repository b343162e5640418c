"""Fine-tuning of a local build: the network that it begins with, and the data set on disk that it replays.

The rules are those of `services.fine_tuning`.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from diaphane.local.options import BuildOptions
from evaluation.progress import Progress
from labeller.dataset import Dataset, open_dataset
from labeller.dataset_index import INDEX, Labels, ShardEntry
from labeller.sampling import Sampling
from schemas.bundle import Manifest, load_manifest
from schemas.bundle_files import bundle_digest
from services.fine_tuning import check_labels, is_replayed, refuse_known, scenes_of
from services.registry import Registry
from stages.inputs import METRIC
from stages.plan import Plan, source_of_version
from stages.tasks import Source
from trainer.config import TrainConfig


@dataclass(frozen=True, slots=True)
class Replay:
    """Shards of an earlier data set.

    Attributes:
        dataset: The data set.
        entries: Those of its shards that are trained on again.
    """

    dataset: Dataset
    entries: tuple[ShardEntry, ...]

    @property
    def source(self) -> Source:
        """Names the shards by their content."""
        files = {entry.file: entry.header_sha256 for entry in self.entries}
        named = "".join(f"{entry.source.scene}:{entry.header_sha256}\n" for entry in self.entries)
        digest = hashlib.sha256(named.encode()).hexdigest()
        return Source(digest=digest, folder=str(self.dataset.folder.resolve()), files=files, trusted=True)


def fine_tuning(
    plan: Plan, options: BuildOptions, registry: Registry, progress: Progress
) -> tuple[Plan, Replay | None]:
    """A plan that begins with the network of `--from`, and what is replayed beside its scenes.

    Args:
        plan: The plan of the build.
        options: What was asked for.
        registry: Where names are looked up.
        progress: Told if there is nothing to replay, or the network is of another size than was asked for.

    Raises:
        Problem: There is no such bundle or data set, they do not fit the build, or a held-out scene is one that the
            network was trained on.
    """
    if options.start is None and options.replay is None:
        return plan, None
    seen: dict[str, str] = {}
    found = options.replay
    if options.start is not None:
        source, manifest = _bundle(options.start, registry)
        seen |= manifest.provenance.scenes
        plan = replace(plan, start=source, licences=manifest.provenance.known_licences)
        if manifest.hidden != TrainConfig.sized(plan.options.network).hidden:
            units = "-".join(map(str, manifest.hidden))
            progress.note(
                f"The network keeps the size of {options.start}, {units} units; --network does not change it."
            )
        usual = options.state / "datasets" / manifest.name
        found = found or (usual if (usual / INDEX).is_file() else None)
    replay = None if found is None else _replay(found, plan)
    if replay is None:
        progress.note(
            f"No data set of {options.start} is known: what it learned may be forgotten. Give --replay FOLDER."
        )
    else:
        seen |= {entry.asset: entry.source.scene for entry in replay.entries}
        plan = replace(plan, replay=replay.source)
    refuse_known(plan.scenes, set(seen.values()))
    return replace(plan, learned=seen), replay


def _bundle(reference: str, registry: Registry) -> tuple[Source, Manifest]:
    """A bundle in a folder, or `name`, `name@alias`, `name@version` of the registry."""
    folder = Path(reference)
    if folder.is_dir():
        manifest = load_manifest(folder)
        return Source(digest=bundle_digest(folder), folder=str(folder.resolve()), trusted=True), manifest
    publication = registry.resolve(reference)
    return source_of_version(registry.record(publication)), load_manifest(registry.folder(publication))


def _replay(folder: Path, plan: Plan) -> Replay | None:
    """The shards to train on again; None if the build has all of their scenes."""
    dataset = open_dataset(folder)
    own = scenes_of(plan)
    entries = tuple(
        entry
        for entry in dataset.index.shards
        if entry.split == "train" and is_replayed(own, entry.asset, entry.source.scene)
    )
    if not entries:
        return None
    check_labels(
        f"The data set {folder}",
        _settings(dataset.index.labels, dataset.index.sampling),
        _settings(
            Labels(tail=plan.options.tail, g=plan.options.g, metric=METRIC, weights=plan.options.weights),
            Sampling(seed=plan.options.seed),
        ),
        "Give the build its --tail, --g, --seed and --weights, or another data set with --replay.",
    )
    return Replay(dataset, entries)


def _settings(labels: Labels, sampling: Sampling) -> dict[str, Any]:
    """Every setting by name."""
    return {name: getattr(part, name) for part in (labels, sampling) for name in type(part).model_fields}
