"""Data sets of label shards on disk: a folder with `index.json` and the shards that it names.

    dataset = open_dataset(Path("datasets/glass"))
    for entry, shard in dataset.shards("train"):
        shard.features, shard.n, shard.hull_k, shard.hull_error
    dataset.rows(dataset.index.shards[0], 1000, 2000)

Nothing but this package is needed to read one; any number of threads and processes may do so at the same time.
"""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from labeller.dataset_index import INDEX, DatasetIndex, Labels, ShardEntry, Split, read_index
from labeller.shards import Shard, damaged, explained, read_rows, read_shard
from schemas.problem import ExitCode, Problem

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Dataset:
    """An open data set.

    Attributes:
        folder: Where it lies.
        index: Its index, verified.
    """

    folder: Path
    index: DatasetIndex

    def read(self, entry: ShardEntry) -> Shard:
        """A shard, all of it verified against the index.

        Raises:
            Problem: The shard is missing, damaged, or another one; it names the file.
        """
        return read_shard(self.folder / entry.file, entry.header_sha256)

    def rows(self, entry: ShardEntry, start: int, stop: int) -> Shard:
        """The rows `start <= r < stop` of a shard: only what they need is read, and that is verified.

        Raises:
            Problem: The shard is missing, damaged in what was read, or another one; it names the file.
            IndexError: The shard does not have these rows.
        """
        return read_rows(self.folder / entry.file, start, stop, entry.header_sha256)

    def shards(self, split: Split | None = None, threads: int | None = None) -> Iterator[tuple[ShardEntry, Shard]]:
        """The shards of a split, or all, in the order of the index; the next ones are read meanwhile.

        Args:
            split: `train` or `held-out`; None: all.
            threads: That read; None: one for each core.

        Raises:
            Problem: As `read`.
        """
        entries = [entry for entry in self.index.shards if split in (None, entry.split)]
        return zip(entries, read_ahead(self.read, entries, threads), strict=True)

    def check(self, entry: ShardEntry) -> Shard:
        """A shard, verified against all that the index says of it, the sum of the whole file too.

        Raises:
            Problem: As `read`.
        """
        path = self.folder / entry.file
        shard = self.read(entry)
        with explained(path), path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
        meta = shard.meta
        found = sha256, len(shard.n), shard.segments, meta.fragments, Labels.of(meta), meta.sampling
        stated = entry.sha256, entry.rows, entry.segments, entry.fragments, self.index.labels, self.index.sampling
        if found != stated:
            raise damaged(path, "it does not fit the index")
        return shard


def open_dataset(path: Path) -> Dataset:
    """Opens a data set: its index is verified, and that every shard is there with its size.

    Args:
        path: The folder, or the index in it.

    Raises:
        Problem: The index is missing or damaged, or a shard is missing or cut off.
    """
    folder = path if path.is_dir() else path.parent
    dataset = Dataset(folder, read_index(path))
    for entry in dataset.index.shards:
        try:
            size = (folder / entry.file).stat().st_size
        except FileNotFoundError as error:
            raise Problem(
                f"The shard {folder / entry.file} is missing, which {INDEX} names.",
                "Copy the data set again, or run the command that made it again.",
                ExitCode.CHECK_FAILED,
            ) from error
        if size != entry.bytes:
            raise damaged(folder / entry.file, f"it has {size:,} bytes instead of {entry.bytes:,}")
    return dataset


def read_ahead(read: Callable[[Item], Result], items: Iterable[Item], threads: int | None = None) -> Iterator[Result]:
    """`map` in threads, in order, that is never more than `threads` results ahead of its reader.

    Args:
        read: Called once for each item; hashing and reading from disk let other threads run.
        items: What to read.
        threads: How many; None: one for each core.
    """
    count = threads or len(os.sched_getaffinity(0))
    with ThreadPoolExecutor(count) as pool:
        waiting: deque[Future[Result]] = deque()
        for item in items:
            waiting.append(pool.submit(read, item))
            if len(waiting) > count:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
