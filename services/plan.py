"""What a run of the pipeline is asked for, the same for a local build and for a job of the service."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.job import JobSpec
from schemas.network import DEFAULT_NETWORK, NetworkSize
from schemas.pixel_weights import DEFAULT_WEIGHTS, PixelWeights
from schemas.service import SceneRecord, VersionRecord
from schemas.tail import TailName
from schemas.view import ListedView
from services.options import BuildOptions
from services.tasks import Source


@dataclass(frozen=True, slots=True)
class PlannedScene:
    """A scene to work on.

    Attributes:
        label: Unique short name.
        source: Its files.
        held_out: Whether it is evaluated on and never trained on.
        licence: Its licence and whom to name for it; None: as its stage states them.
        listed: Cameras in stage units; empty: the stage's own, else sampled ones.
    """

    label: str
    source: Source
    held_out: bool
    listed: tuple[ListedView, ...] = ()
    licence: str | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything that decides the outcome.

    Attributes:
        name: Name of the bundle; empty where none is made.
        scenes: The scenes, in the order given.
        factors: Budgets as multiples of width * height, ascending; empty until `services.budgets.decided` where none
            were given.
        alpha: Opacity that every surface gets; None keeps the materials' own.
        glass: How surfaces that transmit light are read.
        views_per_scene: How many views are sampled of a scene without cameras.
        width: Pixels per row.
        height: Rows.
        tail: How the fragments beyond k are averaged.
        g: Steepness of the density tail.
        seed: Seed of everything drawn at random.
        steps: Optimiser steps; None: the trainer's default.
        network: Size of the network.
        from_champion: Whether the training begins with the champion's weights.
        promote: Whether a better version becomes the champion.
        patience: Validations without a better score after which the training stops; 0: never.
        weights: What a pixel's errors count in the rows that are trained on.
        start: Bundle whose weights the training begins with; None: see `from_champion`.
        replay: Shards of an earlier data set in a folder that are trained on as well.
        replayed: Digest of the scene and label artifact of every shard of earlier jobs that is trained on as well.
        learned: Label -> digest of what was learned before, for provenance.
        licences: Digest -> licence of what was learned before, as far as it is known.
        is_scored: Whether a version is to be published with a score.
    """

    name: str
    scenes: tuple[PlannedScene, ...]
    factors: tuple[float, ...]
    alpha: float | None
    views_per_scene: int
    width: int
    height: int
    tail: TailName
    g: float
    seed: int
    steps: int | None
    network: NetworkSize = DEFAULT_NETWORK
    from_champion: bool = False
    promote: bool = True
    patience: int = 0
    weights: PixelWeights = DEFAULT_WEIGHTS
    glass: GlassReading = DEFAULT_GLASS
    start: Source | None = None
    replay: Source | None = None
    replayed: tuple[tuple[str, str], ...] = ()
    learned: Mapping[str, str] = field(default_factory=dict)
    licences: Mapping[str, str] = field(default_factory=dict)
    is_scored: bool = True

    @property
    def pixels(self) -> int:
        """Of a picture."""
        return self.width * self.height

    @property
    def budgets(self) -> tuple[int, ...]:
        """Budgets in fragments, F, in the order of the factors."""
        assert self.factors, "budgets are decided once the views are captured"
        return tuple(int(factor * self.pixels) for factor in self.factors)

    @property
    def settings(self) -> dict[str, Any]:
        """What a user set, for provenance and data sets."""
        return {
            "alpha": self.alpha,
            "size": [self.width, self.height],
            "budgets": list(self.factors),
            "tail": self.tail,
            "g": self.g,
            "seed": self.seed,
            **({"glass": self.glass} if self.glass != DEFAULT_GLASS else {}),
            **({"weights": self.weights} if self.weights != DEFAULT_WEIGHTS else {}),
        }

    def described_by(self, settings: Mapping[str, Any]) -> Plan:
        """The same plan with the settings that a data set was made with."""
        width, height = settings["size"]
        return replace(
            self,
            alpha=settings["alpha"],
            width=width,
            height=height,
            factors=tuple(settings["budgets"]),
            tail=settings["tail"],
            g=settings["g"],
            glass=settings.get("glass", DEFAULT_GLASS),
            weights=settings.get("weights", DEFAULT_WEIGHTS),
        )


def plan_of_build(options: BuildOptions) -> Plan:
    """The plan of a local build: scenes are the user's own files, and resolve as they do for any USD program.

    Raises:
        Problem: A file cannot be read.
    """
    # USD is loaded only here: a job's scenes have their digest already.
    from renderer.scene import scene_digest
    from renderer.views import listed_views

    scenes = []
    for path in options.scenes:
        root = path.resolve()
        source = Source(digest=scene_digest(path), root=root.name, folder=str(root.parent), trusted=True)
        listed = () if options.views is None else listed_views(options.views, path)
        licence = options.licences.get(path)
        scenes.append(PlannedScene(options.labels[path], source, path in options.holdout, listed, licence))
    return Plan(
        name=options.name,
        scenes=tuple(scenes),
        factors=options.budgets or (),
        alpha=options.alpha,
        views_per_scene=options.views_per_scene,
        width=options.width,
        height=options.height,
        tail=options.tail,
        g=options.g,
        seed=options.seed,
        steps=options.steps,
        network=options.network,
        patience=options.patience,
        weights=options.weights,
        glass=options.glass,
    )


def plan_of_job(spec: JobSpec, scenes: Mapping[str, SceneRecord]) -> Plan:
    """The plan of a job.

    Args:
        spec: The job as submitted.
        scenes: Records of all its scenes, by id.
    """
    used = [scenes[use.scene] for use in spec.scenes]
    same = Counter(record.name for record in used)
    planned = []
    for use, record in zip(spec.scenes, used, strict=True):
        # Two scenes of one name are told apart by the beginning of their ids.
        label = record.name if same[record.name] == 1 else f"{record.name}-{record.id[4:12]}"
        planned.append(PlannedScene(label, source_of_scene(record), use.holdout, use.views, use.licence))
    return Plan(
        name=spec.name or "",
        scenes=tuple(planned),
        factors=tuple(sorted(set(spec.budgets or ()))),
        alpha=spec.alpha,
        views_per_scene=spec.views_per_scene,
        width=spec.width,
        height=spec.height,
        tail=spec.tail,
        g=spec.g,
        seed=spec.seed,
        steps=spec.steps,
        network=spec.network,
        patience=spec.patience,
        weights=spec.weights,
        glass=spec.glass,
        from_champion=spec.start_from == "champion",
        promote=spec.promote == "if-better",
        is_scored=spec.kind == "build",
    )


def source_of_scene(record: SceneRecord) -> Source:
    """The files of an uploaded scene."""
    files = {name: file.sha256 for name, file in record.files.items()}
    return Source(digest=record.digest, root=record.root, files=files)


def source_of_version(version: VersionRecord) -> Source:
    """The files of a published version."""
    files = {name: file.sha256 for name, file in version.files.items()}
    return Source(digest=version.digest, files=files, trusted=True)
