"""What a run of the pipeline is asked for, the same for a local build and for a job of the service."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from schemas.glass import DEFAULT_GLASS
from schemas.job import JobSpec
from schemas.options import Options
from schemas.pixel_weights import DEFAULT_WEIGHTS
from schemas.service import SceneRecord, VersionRecord
from schemas.view import ListedView
from stages.tasks import Source


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
        options: What decides the outcome beside the scenes; without budgets until `services.budgets.decided` where none
            were given.
        from_champion: Whether the training begins with the champion's weights.
        promote: Whether a better version becomes the champion.
        start: Bundle whose weights the training begins with; None: see `from_champion`.
        replay: Shards of an earlier data set in a folder that are trained on as well.
        replayed: Digest of the scene and label artifact of every shard of earlier jobs that is trained on as well.
        learned: Label -> digest of what was learned before, for provenance.
        licences: Digest -> licence of what was learned before, as far as it is known.
        is_scored: Whether a version is to be published with a score.
    """

    name: str
    scenes: tuple[PlannedScene, ...]
    options: Options = field(default_factory=Options)
    from_champion: bool = False
    promote: bool = True
    start: Source | None = None
    replay: Source | None = None
    replayed: tuple[tuple[str, str], ...] = ()
    learned: Mapping[str, str] = field(default_factory=dict)
    licences: Mapping[str, str] = field(default_factory=dict)
    is_scored: bool = True

    @property
    def factors(self) -> tuple[float, ...]:
        """Budgets as multiples of width * height, ascending; empty until they are decided."""
        return self.options.budgets or ()

    @property
    def budgets(self) -> tuple[int, ...]:
        """Budgets in fragments, F, in the order of the factors."""
        assert self.factors, "budgets are decided once the views are captured"
        return tuple(int(factor * self.options.pixels) for factor in self.factors)

    @property
    def settings(self) -> dict[str, Any]:
        """What a user set, for provenance and data sets."""
        options = self.options
        return {
            "alpha": options.alpha,
            "size": [options.width, options.height],
            "budgets": list(self.factors),
            "tail": options.tail,
            "g": options.g,
            "seed": options.seed,
            **({"glass": options.glass} if options.glass != DEFAULT_GLASS else {}),
            **({"weights": options.weights} if options.weights != DEFAULT_WEIGHTS else {}),
        }

    def described_by(self, settings: Mapping[str, Any]) -> Plan:
        """The same plan with the settings that a data set was made with."""
        width, height = settings["size"]
        return self.with_options(
            alpha=settings["alpha"],
            width=width,
            height=height,
            budgets=tuple(settings["budgets"]),
            tail=settings["tail"],
            g=settings["g"],
            glass=settings.get("glass", DEFAULT_GLASS),
            weights=settings.get("weights", DEFAULT_WEIGHTS),
        )

    def with_options(self, **changes: Any) -> Plan:
        """The same plan with some options changed."""
        return replace(self, options=self.options.model_copy(update=changes))


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
        options=spec.options,
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
