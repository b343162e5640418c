"""What the pipeline asks for and who does it: a task is an artifact's address, and a runner makes what is missing.

The pipeline (`services.pipeline`) is the same on a laptop and on a cluster; a runner is what differs. Only addresses
and small facts pass between them, everything else goes through the store.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol, get_args

from pydantic import BaseModel, ConfigDict, model_validator

from evaluation.progress import Progress
from services.store import Address, Store

if TYPE_CHECKING:
    from services.measured import Measured
    from services.registry import Registry
    from services.storage import Blobs

Role = Literal["jobs", "render", "label", "train"]
ROLES: tuple[Role, ...] = ("jobs", "render", "label", "train")

StageName = Literal["scene", "render", "label", "train", "export", "evaluate", "report"]
"""In an order in which each stage comes after those that it needs; a task needs artifacts of earlier ones only."""

FACTS = "facts.json"
"""File of every artifact with what the pipeline has to know of it: small, JSON."""


class Source(BaseModel):
    """Files that a task reads and that are not artifacts: a scene or a published bundle.

    Attributes:
        digest: Content hash that names it.
        root: File of a scene that is opened; relative to the folder.
        folder: Local folder where the files lie already; None: they are blobs.
        files: Relative path -> hex sha256 of its blob.
        trusted: Whether it is a local user's own; a file that came over the network is opened with limits.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    digest: str
    root: str = ""
    folder: str | None = None
    files: dict[str, str] = {}
    trusted: bool = False


class Task(BaseModel):
    """One artifact to make.

    Attributes:
        name: What a user calls it, unique in its stage: `bottles front`.
        stage: Stage of the address.
        version: Code version of the address.
        inputs: Inputs of the address.
        params: Parameters of the address, JSON of the stage's own (`services.stages.stage.Stage.params`).
        needs: Artifacts that are read, as `stage/key`.
        scene: The scene, where the stage reads it.
        bundle: The published bundle, where the stage renders one that is no artifact.
        replay: Folder of a data set, and the shards of it that a training replays beside those that its inputs name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    stage: StageName
    version: str
    inputs: tuple[str, ...] = ()
    params: dict[str, Any] = {}
    needs: tuple[str, ...] = ()
    scene: Source | None = None
    bundle: Source | None = None
    replay: Source | None = None

    @model_validator(mode="after")
    def _needs_earlier_stages(self) -> Task:
        order: tuple[str, ...] = get_args(StageName)
        later = {need.partition("/")[0] for need in self.needs} - set(order[: order.index(self.stage)])
        if later:
            raise ValueError(f"the stage {self.stage} does not come after {', '.join(sorted(later))}")
        return self

    @property
    def address(self) -> Address:
        """Where the artifact is, or will be."""
        return Address(self.stage, self.version, self.inputs, self.params)

    @property
    def artifact(self) -> str:
        """`stage/key`, as in another task's `needs`."""
        return f"{self.stage}/{self.address.key}"


Report = Callable[[float, str], None]
"""How a stage's body tells how far it is: the fraction done, and how it goes."""

JsonFacts = dict[str, Any]
"""Facts of an artifact as they lie in the store; `Stage.facts` is their type."""


class Runner(Protocol):
    """Makes artifacts.

    Attributes:
        progress: Where notes and counts of skipped work go.
        store: Where artifacts lie.
        blobs: Where files lie that are asked for by hash.
        registry: Where bundles are published.
        measured: Where measurements and data sets are kept.
        job_id: Of the job, None outside the service.
        who: Id of the key that submitted it, None outside the service.
    """

    progress: Progress
    store: Store
    blobs: Blobs
    registry: Registry
    measured: Measured
    job_id: str | None
    who: str | None

    def map(self, stage: StageName, tasks: Sequence[Task]) -> list[JsonFacts | None]:
        """Makes what is missing of a stage's artifacts.

        Returns:
            The facts of each artifact, in the order of the tasks; None for a task that failed to the end.
        """

    def step(self, name: str, body: Callable[[], Any]) -> Any:
        """Runs something idempotent beside the artifacts (publishing, recording), and remembers its JSON result."""
