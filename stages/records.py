"""What the pipeline knows while it runs: scenes, views and bundles with the tasks that made them and their facts."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.bundle import network_digest
from schemas.measurement import Certificate, Measurement, TrainingPoint
from schemas.view import View
from stages.export import ExportFacts
from stages.label import LabelFacts
from stages.scene import SceneFacts
from stages.tasks import Source, Task


@dataclass(frozen=True, slots=True)
class SceneEntry:
    """A scene that was read.

    Attributes:
        label: Unique short name.
        source: Its files.
        held_out: Whether it is evaluated on and never trained on.
        facts: What was found in it: its views, triangles, warnings.
        licence: Its licence and whom to name for it; empty: none is known.
    """

    label: str
    source: Source
    held_out: bool
    facts: SceneFacts
    licence: str

    @property
    def digest(self) -> str:
        """Content hash of the scene and all that it refers to."""
        return self.source.digest


@dataclass(frozen=True, slots=True)
class RenderedView:
    """A view whose fragments are known.

    Attributes:
        scene: The scene it is a view of.
        view: The camera.
        task: That made the dump.
        total: N, its fragments.
    """

    scene: SceneEntry
    view: View
    task: Task
    total: int

    @property
    def title(self) -> str:
        """Scene and view in words."""
        return f"{self.scene.label} {self.view.name}"


@dataclass(frozen=True, slots=True)
class LabelledView:
    """A view with its curves and allocations.

    Attributes:
        rendered: The view.
        task: That made the labels.
        facts: Of the labels: errors by rule, certificates, the shard.
        certificates: Of the optimal allocation, and the errors of the other rules, one per budget.
    """

    rendered: RenderedView
    task: Task
    facts: LabelFacts
    certificates: tuple[Certificate, ...]

    @property
    def scene(self) -> SceneEntry:
        """The scene it is a view of."""
        return self.rendered.scene


@dataclass(frozen=True, slots=True)
class Bundle:
    """An exported bundle.

    Attributes:
        name: Name that it is published under.
        task: That exported it.
        train: That trained it.
        facts: Its digest and files, before it has a card.
        history: How its training went.
    """

    name: str
    task: Task
    train: Task
    facts: ExportFacts
    history: tuple[TrainingPoint, ...]

    @property
    def source(self) -> Source:
        """Names it by its network; its files lie in the artifact."""
        return Source(digest=self.network, trusted=True)

    @property
    def network(self) -> str:
        """Digest of its network, the same before and after it has a card."""
        return network_digest(self.facts.files)


@dataclass(frozen=True, slots=True)
class EvaluatedView:
    """Measurements of one view.

    Attributes:
        labelled: The view.
        tasks: That rendered its pictures: the baselines' first, then the bundle's.
        measurements: Of all techniques and budgets.
    """

    labelled: LabelledView
    tasks: tuple[Task, ...]
    measurements: tuple[Measurement, ...]
