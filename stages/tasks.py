"""What the pipeline asks for: a task is an artifact's address, with what is needed to make it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, model_validator

from stages.store import Address

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
        params: Parameters of the address, JSON of the stage's own (`stages.stage.Stage.params`).
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
