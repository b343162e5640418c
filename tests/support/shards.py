"""Small label shards and data sets of random dumps."""

from __future__ import annotations

from pathlib import Path

from labeller.curves import error_curves, whole_bins
from labeller.dataset_index import DatasetIndex, Member, SourceView, Split, write_index
from labeller.hull import lower_hulls
from labeller.sampling import SamplingKind
from labeller.shard_file import Written, open_columns, write_columns
from labeller.shards import write_shard
from schemas.view import View
from support.dumps import random_dump

CODE = "c" * 64


def random_shard(
    path: Path,
    seed: int = 0,
    *,
    side: int = 24,
    max_n: int = 8,
    fraction: float = 0.5,
    kind: SamplingKind = "stratified",
    block_rows: int = 16,
) -> Written:
    """A shard of a random dump, in blocks small enough for several of them."""
    dump = random_dump(side, side, max_n, seed)
    curves = whole_bins(dump, error_curves(dump))
    write_shard(path, dump, curves, lower_hulls(curves), [dump.pixels, 2 * dump.pixels], fraction, kind=kind)
    with open_columns(path) as file:
        columns, view = file.read(0, file.layout.rows), file.layout.view
    return write_columns(path, columns, view, block_rows)


def member(file: str, asset: str, split: Split, sha256: str | None = None, view: str = "front") -> Member:
    """A shard of an asset whose scene has a digest made of its name."""
    camera = View(name=view, eye=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    return Member(file, asset, split, SourceView(scene=f"digest of {asset}", view=view, camera=camera), sha256)


def random_dataset(folder: Path, fraction: float = 0.5) -> DatasetIndex:
    """Two views of `box` and one of `town` to train on, one view of `glass` held out."""
    asked: list[tuple[str, Split, str]] = [
        ("box", "train", "front"),
        ("box", "train", "back"),
        ("town", "train", "front"),
        ("glass", "held-out", "front"),
    ]
    members = []
    for number, (asset, split, view) in enumerate(asked):
        file = f"{asset}-{view}.safetensors"
        written = random_shard(folder / file, seed=number, fraction=fraction)
        members.append(member(file, asset, split, written.sha256, view))
    return write_index(folder, members, CODE)
