"""What is in a data set: counts, and histograms of n, of gains and of budgets."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from labeller.dataset import Dataset, read_ahead
from labeller.dataset_index import INDEX, read_index
from labeller.shards import Shard, read_shard
from schemas.problem import ExitCode, Problem

Item = TypeVar("Item")

STORED_SHARD: Final = "shard.safetensors"
"""Name of the shards in a store of artifacts, which has no index."""

_SINGLE: Final = 8  # n of one bin each; then a bin for each power of two
_BUDGET_BINS: Final = 10  # of F / N


class Bin(BaseModel):
    """A bar of a histogram: `low <= value < high` (the last bin of budgets: `<=`).

    Attributes:
        low: Least value.
        high: Value that the next bin begins with.
        count: How often.
    """

    model_config = ConfigDict(frozen=True)

    low: float
    high: float
    count: int


class Split(BaseModel):
    """What one split holds.

    Attributes:
        shards: Number of shards; each is a view.
        assets: Names of its assets.
        rows: Sampled pixels.
        exact_rows: Those exact at k = 0, without a segment.
        segments: Hull segments.
        fragments: N, over its views.
        bytes: Of its files.
    """

    model_config = ConfigDict(frozen=True)

    shards: int
    assets: tuple[str, ...]
    rows: int
    exact_rows: int
    segments: int
    fragments: int
    bytes: int


class Inspection(BaseModel):
    """What is in a data set, or in shards without an index.

    Attributes:
        path: What was looked at.
        indexed: Whether there is an index, which the shards were verified against.
        code: Version of the code that made the labels; None without an index.
        splits: By name; without an index all shards are in `all`, and their assets are not known.
        n: Rows by n, fragments of the pixel.
        gains: Hull segments by the error that a fragment of theirs saves, a bin for each power of ten.
        budgets: Budgets with an optimal allocation by F / N.
        short_budgets: Those of them that have a price lambda: not all that could be gained fits in.
        log10_lambda: Least and greatest price, log10 of squared error per fragment; None if there is none.
    """

    model_config = ConfigDict(frozen=True)

    path: str
    indexed: bool
    code: str | None
    splits: dict[str, Split]
    n: tuple[Bin, ...]
    gains: tuple[Bin, ...]
    budgets: tuple[Bin, ...]
    short_budgets: int
    log10_lambda: tuple[float, float] | None


def inspect(path: Path, threads: int | None = None) -> Inspection:
    """Reads and verifies a data set and counts what is in it.

    Args:
        path: A shard, an index, the folder of an index, or a folder of artifacts with shards anywhere below it.
        threads: That read; None: one for each core.

    Raises:
        Problem: There is nothing, or a file is damaged or missing; it names all of those.
    """
    if not path.exists():
        raise Problem(f"There is no {path}.", "Name a shard, an index, or a folder.", ExitCode.NOT_FOUND)
    if path.is_dir() and not (path / INDEX).is_file():
        return _without_index(path, sorted(path.rglob(STORED_SHARD)), threads)
    if path.is_dir() or path.suffix == ".json":
        return _with_index(path, threads)
    return _without_index(path, [path], threads)


def _with_index(path: Path, threads: int | None) -> Inspection:
    dataset = Dataset(path if path.is_dir() else path.parent, read_index(path))
    entries = dataset.index.shards
    tally = _Tally()
    for entry, shard in zip(entries, _verified(dataset.check, entries, threads), strict=True):
        tally.add(entry.split, entry.asset, shard, entry.bytes)
    return tally.inspection(path, dataset.index.code)


def _without_index(path: Path, files: list[Path], threads: int | None) -> Inspection:
    if not files:
        raise Problem(
            f"There is no data set in {path}: neither {INDEX} nor a {STORED_SHARD} below it.",
            "Name a shard, an index, or a folder with one of them.",
            ExitCode.NOT_FOUND,
        )
    tally = _Tally()
    for file, shard in zip(files, _verified(read_shard, files, threads), strict=True):
        tally.add("all", "", shard, file.stat().st_size)
    return tally.inspection(path, None)


def _verified(read: Callable[[Item], Shard], items: Sequence[Item], threads: int | None) -> Iterator[Shard]:
    """The shards in order; after the last one, one problem for all that cannot be read.

    Raises:
        Problem: As `inspect`.
    """

    def attempt(item: Item) -> Shard | Problem:
        try:
            return read(item)
        except Problem as problem:
            return problem

    faults: list[Problem] = []
    for found in read_ahead(attempt, items, threads):
        if isinstance(found, Problem):
            faults.append(found)
        else:
            yield found
    if faults:
        listed = " ".join(fault.title for fault in faults)
        title = f"{len(faults)} of {len(items)} shards cannot be used. {listed}" if len(items) > 1 else listed
        raise Problem(title, faults[0].remedy, ExitCode.CHECK_FAILED)


class _Tally:
    """Sums over shards, one at a time."""

    def __init__(self) -> None:
        self._splits: dict[str, dict[str, int]] = {}
        self._assets: dict[str, set[str]] = {}
        self._n: dict[int, int] = {}
        self._gains: dict[int, int] = {}
        self._shares: list[float] = []
        self._prices: list[float] = []

    def add(self, split: str, asset: str, shard: Shard, size: int) -> None:
        """One more shard."""
        vertices = np.diff(shard.hull_offsets)
        counted = {
            "shards": 1,
            "rows": len(shard.n),
            "exact_rows": int(np.count_nonzero(vertices == 0)),
            "segments": shard.segments,
            "fragments": shard.meta.fragments,
            "bytes": size,
        }
        sums = self._splits.setdefault(split, dict.fromkeys(counted, 0))
        for name, count in counted.items():
            sums[name] += count
        self._assets.setdefault(split, set()).update({asset} - {""})
        _count(shard.n, self._n)
        _count(np.floor(np.log10(hull_slopes(shard))).astype(int), self._gains)
        self._shares += [level.share for level in shard.meta.levels]
        self._prices += [x.log_lambda / math.log(10.0) for x in shard.meta.levels if x.log_lambda is not None]

    def inspection(self, path: Path, code: str | None) -> Inspection:
        """What was added."""
        return Inspection(
            path=str(path),
            indexed=code is not None,
            code=code,
            splits={
                split: Split(assets=tuple(sorted(self._assets[split])), **sums) for split, sums in self._splits.items()
            },
            n=_n_bins(self._n),
            gains=_decades(self._gains),
            budgets=_budget_bins(self._shares),
            short_budgets=len(self._prices),
            log10_lambda=(min(self._prices), max(self._prices)) if self._prices else None,
        )


def hull_slopes(shard: Shard) -> NDArray[np.float64]:
    """float64 [S], squared error that each fragment of a hull segment saves, over all rows."""
    inner = np.ones(max(len(shard.hull_k) - 1, 0), dtype=bool)
    ends = shard.hull_offsets[1:-1]
    inner[ends[(ends > 0) & (ends < len(shard.hull_k))] - 1] = False
    saved = -np.diff(shard.hull_error.astype(np.float64))[inner]
    return np.asarray(saved / np.diff(shard.hull_k)[inner], dtype=np.float64)


def _count(values: NDArray[np.integer], counts: dict[int, int]) -> None:
    """Adds how often each value occurs."""
    for value, count in zip(*(found.tolist() for found in np.unique(values, return_counts=True)), strict=True):
        counts[value] = counts.get(value, 0) + count


def _n_bins(counts: dict[int, int]) -> tuple[Bin, ...]:
    """Bins 1, 2, .. 8, then 9-16, 17-32, ..; from the least n that occurs to the greatest."""
    if not counts:
        return ()
    edges = [*range(1, _SINGLE + 2)]
    while edges[-1] <= max(counts):
        edges.append(2 * (edges[-1] - 1) + 1)
    bins = _bins(edges, [sum(counts[n] for n in counts if low <= n < high) for low, high in pairwise(edges)])
    return _trimmed(bins)


def _decades(counts: dict[int, int]) -> tuple[Bin, ...]:
    if not counts:
        return ()
    powers = range(min(counts), max(counts) + 1)
    return tuple(Bin(low=10.0**power, high=10.0 ** (power + 1), count=counts.get(power, 0)) for power in powers)


def _budget_bins(shares: Iterable[float]) -> tuple[Bin, ...]:
    edges = [number / _BUDGET_BINS for number in range(_BUDGET_BINS + 1)]
    counts, _ = np.histogram(list(shares), bins=edges)
    return _bins(edges, counts.tolist())


def _bins(edges: Iterable[float], counts: Iterable[int]) -> tuple[Bin, ...]:
    return tuple(Bin(low=low, high=high, count=n) for (low, high), n in zip(pairwise(edges), counts, strict=True))


def _trimmed(bins: tuple[Bin, ...]) -> tuple[Bin, ...]:
    filled = [number for number, found in enumerate(bins) if found.count]
    return bins[filled[0] : filled[-1] + 1]
