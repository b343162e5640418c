"""What can be asked of the service: kinds of jobs, their parameters, and the states they go through."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from schemas.licence import MOST_CHARACTERS
from schemas.limits import LIMITS
from schemas.option import Option
from schemas.options import Options
from schemas.pixel_weights import DEFAULT_WEIGHTS
from schemas.tail import BINNED_TAILS
from schemas.view import ListedView

JobKind = Literal["build", "render", "label", "train", "evaluate"]
"""`render` ends with fragment dumps, `label` with a data set, `train` with a version without a score, `evaluate` with
measurements of the techniques that need no bundle, and of a version if it names one, and with what they advise; `build`
is all of them, and promotes what is better."""

JobState = Literal["queued", "running", "cancelling", "cancelled", "succeeded", "failed"]
FINAL_STATES: tuple[JobState, ...] = ("cancelled", "succeeded", "failed")

TaskState = Literal["queued", "running", "done", "skipped", "quarantined", "cancelled"]
"""`skipped`: the artifact was there already; `quarantined`: it failed to the end, and the job went on without it."""

Priority = Literal["low", "normal", "high"]

ModelName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$")]
ModelReference = Annotated[
    str, StringConstraints(pattern=r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?(?:@[A-Za-z0-9.-]{1,40})?$")
]
SceneId = Annotated[str, StringConstraints(pattern=r"^scn_[0-9a-f]{32}$")]
DatasetId = Annotated[str, StringConstraints(pattern=r"^dst_[0-9a-f]{32}$")]

SCRATCH: Final = "scratch"
OWN_CHAMPION: Final = "champion"
"""What `JobSpec.start_from` can be beside a reference."""

_STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class SceneView(ListedView):
    """A camera of a job: what nobody knows here would be left out without a word, and is refused."""

    model_config = _STRICT


class SceneUse(BaseModel):
    """A scene of a job.

    Attributes:
        scene: Its id.
        holdout: Whether it is evaluated on and never trained on.
        licence: Its licence and whom to name for it, for the model card; None: as its stage states them.
        views: Cameras in stage units and axes; empty: the stage's own, else sampled ones.
    """

    model_config = _STRICT

    scene: SceneId
    holdout: bool = False
    licence: Annotated[str, StringConstraints(strip_whitespace=True, max_length=MOST_CHARACTERS)] | None = None
    views: tuple[SceneView, ...] = Field(default=(), max_length=LIMITS.views)

    @model_validator(mode="after")
    def _have_directions(self) -> Self:
        for number, view in enumerate(self.views):
            if not view.has_direction:
                raise ValueError(f"view {number} has no direction: eye and target coincide, or up is parallel to it")
        return self


class JobSpec(Options):
    """A job as submitted: the options of a build, and what it is made of.

    Attributes:
        kind: What it makes.
        name: Bundle that a `build` or `train` publishes a version of.
        scenes: What it is made from; empty where a `train` names a data set.
        dataset: Data set that a `train` learns from, instead of scenes. Its rows were weighted when it was made.
        model: Version that an `evaluate` measures beside what needs no bundle: `name`, `name@alias` or `name@1.2.0`.
        start_from: Network that the training begins with: `scratch` is none, the weights are drawn by the seed;
            `champion` is that of the job's own name, if there is one yet; else a version, as in `model`. What an alias
            means is decided when the job is submitted: its record names the version.
        replay: Whether what `start_from` was trained on is trained on again, so that it is not forgotten: the views of
            scenes that the job does not have itself.
        promote: Whether a better version becomes the champion, or stays a candidate; a key without the scope `publish`
            gets the latter.
        priority: Class of the job's tasks in the queues; within a class, jobs share fairly.
    """

    kind: JobKind
    name: Annotated[ModelName | None, Option("Name of the bundle in the registry.", absent="none is made")] = None
    scenes: tuple[SceneUse, ...] = Field(default=(), max_length=LIMITS.scenes)
    dataset: Annotated[DatasetId | None, Option("Data set that a train learns from.", absent="its scenes")] = None
    model: Annotated[ModelReference | None, Option("Version that an evaluate measures, too.", absent="none")] = None
    start_from: Annotated[
        ModelReference,
        Option(
            "Network to start from: scratch, champion (the name's own), or NAME@ALIAS.",
            flags=("--from", "--start-from"),
        ),
    ] = SCRATCH
    replay: Annotated[
        bool,
        Option("Train again on the data of the network that training starts from, so as not to forget them."),
    ] = True
    promote: Annotated[Literal["if-better", "never"], Option("Whether a better version becomes the champion.")] = (
        "if-better"
    )
    priority: Annotated[Priority, Option("Priority of the job's tasks in the queues.")] = "normal"

    @property
    def options(self) -> Options:
        """Those of the build."""
        return Options(**{name: getattr(self, name) for name in Options.model_fields})

    @property
    def begins_with(self) -> str | None:
        """The version that is begun with; None if there is none, or which one it is has to be found out."""
        return None if self.start_from in (SCRATCH, OWN_CHAMPION) else self.start_from

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.kind in ("build", "train") and self.name is None:
            raise ValueError(f"a {self.kind} needs a name")
        if self.kind != "render" and self.tail not in BINNED_TAILS:
            raise ValueError(f"labels are made of depth bins, so the tail is one of {', '.join(BINNED_TAILS)}")
        if self.begins_with is not None and self.kind not in ("build", "train"):
            raise ValueError(f"a {self.kind} trains nothing, so there is nothing to start from")
        if self.weights != DEFAULT_WEIGHTS and self.kind in ("render", "evaluate"):
            article = "an" if self.kind == "evaluate" else "a"
            raise ValueError(f"{article} {self.kind} makes no rows to train on, so there is nothing to weight")
        if self.weights != DEFAULT_WEIGHTS and self.dataset is not None:
            raise ValueError("the rows of a data set were weighted when it was made: weights are for a job with scenes")
        if self.dataset is not None and (self.kind != "train" or self.scenes):
            raise ValueError("a data set is for a train without scenes")
        if self.dataset is None and not self.scenes:
            raise ValueError(f"a {self.kind} needs at least one scene")
        if len({use.scene for use in self.scenes}) != len(self.scenes):
            raise ValueError("a scene is listed twice")
        if self.kind in ("build", "train") and self.scenes and all(use.holdout for use in self.scenes):
            raise ValueError("every scene is held out, so there is none to train on")
        return self
