"""What stages read of the tasks of others: it says nothing of plans, so that a new option trains no network anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from schemas.tail import MetricName

METRIC: MetricName = "display"
"""Error that labels are made for."""

REPLAYED = ":replayed"
"""End of an input of a training that names a shard which the network had learned before."""


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
