"""From the training views' rows to a network."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from evaluation.report.live import write_live
from labeller.dataset import open_dataset
from schemas.bundle import WEIGHTS
from schemas.measurement import TrainingPoint
from stages.desk import SHARD, Desk
from stages.inputs import TrainedOn, TrainFacts, trained_on
from stages.tasks import Report, Source, Task
from stages.train import TrainParams
from trainer.bundle import load_bundle
from trainer.log import read_log
from trainer.train import TrainConfig, train
from trainer.views import ShardView, open_views
from trainer.weights import Weights, save_weights

FINE_TUNING = 0.25
"""Learning rate of a training that begins with a champion's weights, as a multiple of the usual one: the full rate
throws away what they know within its first steps."""

LOG = "log.jsonl"
"""File of a `train` artifact: how the training went, a JSON object a line (`trainer.log`)."""


def make(desk: Desk, task: Task, params: TrainParams, folder: Path, report: Report) -> TrainFacts:
    """Writes the weights, and how the training went. Interrupted, it goes on from its last checkpoint.

    Raises:
        Problem: There is nothing to learn from.
    """
    start = None if task.bundle is None else load_bundle(desk.bundle(task)).weights
    config = _config(params, start)
    shards = trained_on(task.inputs)
    views = _opened(desk, [shard for shard in shards if not shard.replayed])
    replay = _opened(desk, [shard for shard in shards if shard.replayed])
    if task.replay is not None:
        replay += _replayed(task.replay)
    checkpoint = desk.checkpoint(task)
    log, page = checkpoint.with_suffix(".jsonl"), checkpoint.with_name(f"{task.name}.html")

    def progress(step: int, steps: int, loss: float, score: float) -> None:
        report(step / steps, f"step {step}: loss {loss:.3f}, error / optimum {score:.2f}")
        write_live(page, task.name, read_log(log), steps)

    # No held-out view has a say in which state is kept: they are for the evaluation alone.
    result = train(views, (), config, progress, checkpoint, start, replay, log)
    save_weights(folder / WEIGHTS, result.weights)
    write_live(page, task.name, read_log(log), config.steps, is_over=True)
    if log.exists():
        shutil.copyfile(log, folder / LOG)
    checkpoint.unlink(missing_ok=True)
    log.unlink(missing_ok=True)
    history = (TrainingPoint(step=point.step, loss=point.loss, over_optimum=point.score) for point in result.history)
    return TrainFacts(history=tuple(history), config=config.model_dump(mode="json"), kept_out=tuple(result.kept_out))


def _config(params: TrainParams, start: Weights | None) -> TrainConfig:
    """Settings of the training. A network that is begun with keeps its own inputs and units."""
    steps = {} if params.steps is None else {"steps": params.steps}
    config = TrainConfig.sized(params.network, seed=params.seed, patience=params.patience, **steps)
    if start is None:
        return config
    own = {"features": start.features, "hidden": start.hidden}
    return config.model_copy(update={**own, "lr": FINE_TUNING * config.lr})


def _opened(desk: Desk, shards: Sequence[TrainedOn]) -> list[ShardView]:
    """The views of label artifacts, assets named by the content of their scenes."""
    if not shards:
        return []
    return open_views([desk.store.fetch(s.artifact) / SHARD for s in shards], [s.scene for s in shards])


def _replayed(source: Source) -> list[ShardView]:
    """The views of an earlier data set, assets named by the content of their scenes."""
    dataset = open_dataset(Path(source.folder or ""))
    entries = [entry for entry in dataset.index.shards if source.files.get(entry.file) == entry.header_sha256]
    return open_views(
        [dataset.folder / entry.file for entry in entries],
        [entry.source.scene for entry in entries],
        [entry.header_sha256 for entry in entries],
    )
