"""What stages read of others: it says nothing of plans, so that a new option trains no network anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from schemas.measurement import Measurement, TrainingPoint
from schemas.tail import MetricName
from stages.stage import Facts

METRIC: MetricName = "display"
"""Error that labels are made for."""

REPLAYED = ":replayed"
"""End of an input of a training that names a shard which the network had learned before."""


class TrainFacts(Facts):
    """What is known of a training.

    Attributes:
        history: How it went.
        config: Its settings (`trainer.config.TrainConfig`), JSON.
        kept_out: Digests of the assets that decided which state is kept.
    """

    history: tuple[TrainingPoint, ...]
    config: dict[str, Any]
    kept_out: tuple[str, ...] = ()


class EvaluateFacts(Facts):
    """What was measured of a view.

    Attributes:
        measurements: Of all techniques and budgets. The scene's label is empty: it is no part of the artifact, since
            another run may call the scene otherwise.
    """

    measurements: tuple[Measurement, ...]


@dataclass(frozen=True, slots=True)
class TrainedOn:
    """A shard that a training read.

    Attributes:
        scene: Digest of its scene.
        artifact: Its labels, `label/key`.
        replayed: Whether it is one that the network had learned before.
    """

    scene: str
    artifact: str
    replayed: bool


def trained_on(inputs: Sequence[str]) -> list[TrainedOn]:
    """The shards of a training, in the order of its needs.

    Args:
        inputs: Of its address.
    """
    found = []
    for text in inputs:
        scene, _, key = text.removesuffix(REPLAYED).partition(":")
        found.append(TrainedOn(scene, f"label/{key}", text.endswith(REPLAYED)))
    return found
