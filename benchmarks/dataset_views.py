"""The views of a local build's data set, with what DHOIT's network reads of their fragment dumps."""

from __future__ import annotations

import json
from pathlib import Path

from labeller.dataset import open_dataset
from renderer.dump import read_dump
from trainer.dataset import ViewData, view_data
from trainer.paper import with_paper_inputs


def stored_views(state: Path, name: str) -> tuple[list[ViewData], list[ViewData]]:
    """Views to train on, and held-out ones, all of them in memory.

    Args:
        state: Folder of the build.
        name: Of its data set.
    """
    store = state / "store"
    dumps = {}
    for folder in store.glob("label/*/*"):
        facts, meta = (json.loads((folder / file).read_text()) for file in ("facts.json", "meta.json"))
        key = meta["inputs"][0]
        dumps[facts["shard"]["sha256"]] = store / "render" / key[:2] / key
    train: list[ViewData] = []
    held_out: list[ViewData] = []
    for entry, shard in open_dataset(state / "datasets" / name).shards(threads=1):
        scored = [x.budget for x in shard.meta.levels if x.scored and x.log_lambda is not None]
        view = with_paper_inputs(view_data(shard, entry.asset), read_dump(dumps[entry.sha256]), shard.pixel, scored)
        (train if entry.split == "train" else held_out).append(view)
    return train, held_out
