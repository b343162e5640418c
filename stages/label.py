"""Stage `label`: error curves of a view, its allocations by every rule at every budget, and its training rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.pixel_weights import PixelWeights
from schemas.skips import LABELLED_VIEWS
from schemas.tail import MetricName, TailName
from stages.inputs import METRIC
from stages.stage import Facts, Params, Stage
from stages.tasks import Task

if TYPE_CHECKING:
    from stages.plan import Plan
    from stages.records import RenderedView


class LabelParams(Params):
    """How a view is labelled.

    Attributes:
        budgets: F of each budget, fragments, in the order asked.
        tail: How the fragments beyond k are averaged.
        g: Steepness of the density tail.
        metric: Error that the labels are made for.
        seed: Of the sampled pixels.
        weights: What a pixel's errors count in the rows that are trained on.
    """

    budgets: tuple[int, ...]
    tail: TailName
    g: float
    metric: MetricName
    seed: int
    weights: PixelWeights


class Certified(Facts):
    """Error of an allocation, what no allocation can be below, and the relative gap between them."""

    error: float
    bound: float
    gap: float


class Shard(Facts):
    """Hex sha256 and size of the file of training rows."""

    sha256: str
    bytes: int


class LabelFacts(Facts):
    """What is known of a view's labels.

    Attributes:
        errors: Rule -> error at each budget.
        certificates: Of the optimal allocation, one for each budget.
        shard: The training rows.
        skips: What took no part, counted.
    """

    errors: dict[str, tuple[float, ...]]
    certificates: tuple[Certified, ...]
    shard: Shard
    skips: dict[str, int]


class Label(Stage[LabelParams, LabelFacts]):
    """Labels views: all budgets in one task."""

    name, role, title, share = "label", "label", "error curves", 6.0
    after = ("render",)
    params, facts = LabelParams, LabelFacts

    def ask(self, plan: Plan, view: RenderedView) -> Task:
        """The task of a view."""
        options = plan.options
        params = LabelParams(
            budgets=plan.budgets,
            tail=options.tail,
            g=options.g,
            metric=METRIC,
            seed=options.seed,
            weights=options.weights,
        )
        return self.task(view.title, params, inputs=(view.task.address.key,), needs=(view.task.artifact,))

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return LABELLED_VIEWS


LABEL = Label()
