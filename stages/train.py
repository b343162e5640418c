"""Stage `train`: from the training views' rows to a network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.network import NetworkSize
from stages.inputs import REPLAYED, TrainFacts
from stages.stage import Params, Stage
from stages.tasks import Source, Task

if TYPE_CHECKING:
    from stages.plan import Plan


class TrainParams(Params):
    """How a network is trained.

    Attributes:
        seed: Of the weights and batches.
        steps: Optimiser steps; None: the trainer's default.
        network: Size of the network.
        patience: Validations without a better score after which the training stops; 0: never.
        start: Digest of the bundle whose weights the training begins with; None: none.
        replay: Digest of the shards of an earlier data set that are trained on as well; None: none.
    """

    seed: int
    steps: int | None
    network: NetworkSize
    patience: int
    start: str | None
    replay: str | None


class Train(Stage[TrainParams, TrainFacts]):
    """Trains networks."""

    name, role, title, share = "train", "train", "train", 20.0
    after = ("label",)
    params, facts = TrainParams, TrainFacts

    def ask(self, plan: Plan, shards: Sequence[tuple[str, str]], start: Source | None) -> Task:
        """The task of a network.

        Args:
            plan: Options, and what is replayed.
            shards: Digest of the asset and label artifact of every training view: an asset's label decides which views
                are weighted together, so it belongs to the key.
            start: Bundle whose weights the training begins with.
        """
        options = plan.options
        inputs = [f"{digest}:{artifact.partition('/')[2]}" for digest, artifact in shards]
        inputs += [f"{digest}:{artifact.partition('/')[2]}{REPLAYED}" for digest, artifact in plan.replayed]
        params = TrainParams(
            seed=options.seed,
            steps=options.steps,
            network=options.network,
            patience=options.patience,
            start=None if start is None else start.digest,
            replay=None if plan.replay is None else plan.replay.digest,
        )
        needs = tuple(artifact for _, artifact in (*shards, *plan.replayed))
        return self.task(plan.name, params, inputs=inputs, needs=needs, bundle=start, replay=plan.replay)

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return "models already trained"


TRAIN = Train()
