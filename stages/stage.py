"""What a stage is: its name, who does it, what it needs, its parameters and facts, and its version.

A stage's module loads no renderer and no trainer: the pipeline asks with it, and a worker makes with the module of the
same name in `stages.making`. Plans are not among its imports, so that a new option makes anew only what it
decides.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from typing import ClassVar, Generic, TypeVar, get_args

from pydantic import BaseModel, ConfigDict

from stages.closure import Tree
from stages.tasks import Role, Source, StageName, Task


class Params(BaseModel):
    """Parameters of a stage: part of the address of what it makes."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Facts(BaseModel):
    """What the pipeline has to know of an artifact, small."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


P = TypeVar("P", bound=Params)
F = TypeVar("F", bound=Facts)


class Stage(ABC, Generic[P, F]):
    """A stage of the pipeline.

    Attributes:
        name: As in addresses; `module_of` it is what makes it.
        role: Which kind of worker does it.
        after: The stages that come right before it, by name: their code is no part of this one's version.
        title: What a user is told that it does.
        share: Rough part of the time of a build, for one number over stages whose tasks are not known yet.
        params: Type of its parameters.
        facts: Type of its facts.
    """

    name: ClassVar[StageName]
    role: ClassVar[Role]
    after: ClassVar[tuple[StageName, ...]]
    title: ClassVar[str]
    share: ClassVar[float]
    params: type[P]
    facts: type[F]

    @abstractmethod
    def known(self, task: Task) -> str:
        """What is counted when a task's artifact is there already."""

    @property
    def version(self) -> str:
        """Code version of the stage in this process: part of the address of whatever it makes."""
        return _versions()[0][self.name]

    def task(
        self,
        name: str,
        params: P,
        *,
        inputs: Sequence[str],
        needs: Sequence[str] = (),
        scene: Source | None = None,
        bundle: Source | None = None,
        replay: Source | None = None,
    ) -> Task:
        """A task of the stage; the arguments are those of `Task`."""
        return Task(
            name=name,
            stage=self.name,
            version=self.version,
            inputs=tuple(inputs),
            params=params.model_dump(mode="json"),
            needs=tuple(needs),
            scene=scene,
            bundle=bundle,
            replay=replay,
        )

    def params_of(self, task: Task) -> P:
        """The parameters of a task of the stage."""
        return self.params.model_validate(task.params)


def training_version() -> str:
    """Code version of whatever decides what a bundle is, for its provenance."""
    return _versions()[1]


def module_of(stage: StageName) -> str:
    """The module that makes a stage.

    With all that it imports it decides the result: a change of any of that makes the stage's artifacts anew.
    """
    return f"stages.making.{stage}"


@cache
def _versions() -> tuple[dict[StageName, str], str]:
    """Of all stages at once: where files change under a running process, none may be newer than the others."""
    tree = Tree()
    names: tuple[StageName, ...] = get_args(StageName)
    stages = {name: tree.version(module_of(name)) for name in names}
    return stages, tree.version(module_of("train"), module_of("export"))
