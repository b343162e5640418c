"""Stage `train`: from the training views' rows to a network."""

from __future__ import annotations

from pathlib import Path

from schemas.bundle import WEIGHTS
from schemas.measurement import TrainingPoint
from services.stages.desk import SHARD, Desk, save_facts
from services.tasks import Report, Task
from trainer.bundle import load_bundle
from trainer.dataset import load_shards
from trainer.train import TrainConfig, train
from trainer.weights import save_weights

FINE_TUNING = 0.25
"""Learning rate of a training that begins with a champion's weights, as a multiple of the usual one: the full rate
throws away what they know within its first steps."""


def make(desk: Desk, task: Task, folder: Path, report: Report) -> None:
    """Writes the weights, and how the training went. Interrupted, it goes on from its last checkpoint.

    Raises:
        Problem: There is nothing to learn from.
    """
    config = TrainConfig(seed=task.params["seed"])
    if task.params["steps"] is not None:
        config = config.model_copy(update={"steps": task.params["steps"]})
    if task.bundle is not None:
        config = config.model_copy(update={"lr": FINE_TUNING * config.lr})
    shards = [desk.store.fetch(need) / SHARD for need in task.needs]
    data = load_shards(shards, [asset.partition(":")[0] for asset in task.inputs])
    start = None if task.bundle is None else load_bundle(desk.bundle(task)).weights
    checkpoint = desk.checkpoint(task)

    def progress(step: int, steps: int, loss: float, score: float) -> None:
        report(step / steps, f"step {step}: loss {loss:.3f}, error / optimum {score:.2f}")

    # No held-out view has a say in which state is kept: they are for the evaluation alone.
    result = train(data, (), config, progress, checkpoint, start)
    save_weights(folder / WEIGHTS, result.weights)
    history = [
        TrainingPoint(step=point.step, loss=point.loss, over_optimum=point.score).model_dump()
        for point in result.history
    ]
    save_facts(folder, {"history": history, "config": config.model_dump(mode="json")})
    checkpoint.unlink(missing_ok=True)
