"""Training by several processes: `torchrun --nproc-per-node 2 -m trainer.distributed DATASET --out FILE`.

Every process draws the same batches by the same seed, takes its share of their groups and adds its gradients to those
of the others: the network is that of one process but for the rounding of that sum. The first process writes the
checkpoint, the log and the weights; the others read the checkpoint, so it lies where all of them see it.

This module alone imports torch.distributed: see `trainer.adam` for why.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import torch
import torch.distributed as dist
from torch import Tensor

from labeller.dataset import open_dataset
from schemas.problem import Problem
from trainer.train import TrainConfig, train
from trainer.views import ShardView, open_views
from trainer.weights import save_weights


class Processes:
    """The processes of torchrun, as a `trainer.team.Team`."""

    def __init__(self) -> None:
        self.rank: int = dist.get_rank()
        self.size: int = dist.get_world_size()

    def add(self, tensors: Sequence[Tensor]) -> None:
        """See `Team`. One message for all: they are small."""
        flat = torch.cat([tensor.reshape(-1) for tensor in tensors])
        dist.all_reduce(flat)
        start = 0
        for tensor in tensors:
            tensor.copy_(flat[start : start + tensor.numel()].view_as(tensor))
            start += tensor.numel()

    def agreed(self, value: float) -> float:
        """See `Team`."""
        message = torch.tensor([value], dtype=torch.float64)
        dist.broadcast(message, src=0)
        return float(message)


@contextmanager
def processes() -> Iterator[Processes]:
    """Joins the processes that torchrun started (its environment variables), and leaves them at the end."""
    dist.init_process_group("gloo")
    try:
        yield Processes()
    finally:
        dist.destroy_process_group()


def dataset_views(folder: Path) -> list[ShardView]:
    """The training views of a data set on disk; its held-out ones are not read.

    Raises:
        Problem: The data set is missing or damaged, or there is nothing to learn from.
    """
    dataset = open_dataset(folder)
    entries = [entry for entry in dataset.index.shards if entry.split == "train"]
    return open_views(
        [dataset.folder / entry.file for entry in entries],
        [entry.asset for entry in entries],
        [entry.header_sha256 for entry in entries],
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Trains with the other processes; the exit status."""
    parser = argparse.ArgumentParser(prog="trainer.distributed", description="Train on a data set, in each process.")
    parser.add_argument("dataset", type=Path, help="folder of a data set")
    parser.add_argument("--out", type=Path, required=True, help="safetensors file of the network")
    parser.add_argument("--config", default="{}", help="settings of trainer.config.TrainConfig, JSON")
    parser.add_argument("--checkpoint", type=Path, help="file to continue from")
    parser.add_argument("--jsonl", type=Path, help="file that the log goes to, JSON lines")
    given = parser.parse_args(arguments)
    with processes() as team:
        try:
            config = TrainConfig.model_validate_json(given.config)
            views = dataset_views(given.dataset)
            result = train(views, (), config, checkpoint=given.checkpoint, log=given.jsonl, team=team)
        except Problem as problem:
            print(problem, file=sys.stderr)
            return int(problem.code)
        if team.rank == 0:
            save_weights(given.out, result.weights)
            print(f"{result.history[-1].step} steps, error / optimum {result.score:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
