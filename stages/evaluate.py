"""Stage `evaluate`: real pictures of every technique, within every budget, against the exact one.

Techniques that do not depend on the bundle (`baseline`) and the bundle itself (`bundle`) are separate artifacts, so
that a new bundle renders only its own pictures.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from schemas.bundle import network_digest
from schemas.tail import TailName
from stages.inputs import EvaluateFacts
from stages.pictured import Pictured
from stages.stage import Stage
from stages.tasks import Source, Task

if TYPE_CHECKING:
    from stages.plan import Plan
    from stages.records import LabelledView

EvaluationKind = Literal["baseline", "bundle"]


class EvaluateParams(Pictured):
    """What is measured of a view.

    Attributes:
        kind: The techniques that need no bundle, or a bundle.
        budgets: F of each budget, fragments.
        factors: The same as multiples of width * height.
        tail: How the fragments beyond k are averaged; a bundle has its own.
        g: Steepness of the density tail.
    """

    kind: EvaluationKind
    budgets: tuple[int, ...]
    factors: tuple[float, ...]
    tail: TailName
    g: float


class Evaluate(Stage[EvaluateParams, EvaluateFacts]):
    """Renders and measures views."""

    name, role, title, share = "evaluate", "render", "evaluate pictures", 10.0
    after = ("label", "export")
    params, facts = EvaluateParams, EvaluateFacts

    def ask(
        self,
        plan: Plan,
        view: LabelledView,
        kind: EvaluationKind,
        bundle: Source | None = None,
        export: Task | None = None,
    ) -> Task:
        """The task of a view: with the techniques that need no bundle, or with a bundle.

        Args:
            plan: Budgets and picture.
            view: The view.
            kind: `baseline` or `bundle`.
            bundle: The bundle, for its digest and, if it is published, its files.
            export: The task that exported it, if it is not published.
        """
        options = plan.options
        params = EvaluateParams(
            view=view.rendered.view,
            size=(options.width, options.height),
            alpha=options.alpha,
            glass=options.glass,
            kind=kind,
            budgets=plan.budgets,
            factors=plan.factors,
            tail=options.tail,
            g=options.g,
        )
        made_from = [view.rendered.task.address.key, view.task.address.key]
        needs = [view.rendered.task.artifact, view.task.artifact]
        if export is not None:
            needs.append(export.artifact)
        published = bundle is not None and export is None
        return self.task(
            f"{view.rendered.title} {'published ' if published else ''}{kind}",
            params,
            inputs=(*made_from, _network(bundle)) if bundle is not None else made_from,
            needs=needs,
            scene=view.scene.source,
            bundle=bundle,
        )

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return f"{self.params_of(task).kind} pictures already rendered"


EVALUATE = Evaluate()


def evaluated_from(inputs: Sequence[str]) -> tuple[str, str]:
    """The artifacts (`stage/key`) of fragments and of labels that an evaluation was made from.

    Args:
        inputs: Of its address.
    """
    return f"render/{inputs[0]}", f"label/{inputs[1]}"


def _network(bundle: Source) -> str:
    """Names the network of a bundle: its pictures are the same before and after it has a model card."""
    return network_digest(bundle.files) if bundle.files else bundle.digest
