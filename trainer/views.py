"""Training views that stay on disk: what is known of each in memory, their rows read by ranges when they are drawn.

Rules:
- a view is the same to its user whether its rows are in memory (`trainer.dataset.ViewData`) or in a shard
  (`ShardView`), so a training has the same result either way;
- rows come in blocks of `BLOCK_ROWS`, as a shard is verified;
- a `Pool` has the blocks that some steps draw from: all of them where they fit, else a draw by the seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from labeller.dataset import read_ahead
from labeller.shard_file import BLOCK_ROWS
from labeller.shards import read_rows, read_shard
from schemas.tail import TailName
from trainer.dataset import ViewData, moments, refuse_empty, view_data

READERS: Final = 2
"""Shards that are in memory at a time, whole, while data sets are opened and pools are filled."""

LEAST_BLOCKS: Final = 4
"""Blocks of a view in a pool: fewer would show too small a part of the picture."""


class View(Protocol):
    """A view of the training data.

    Attributes:
        asset: What it shows.
        rows: Sampled pixels.
        tail: Tail of its error curves.
        price_range: Natural logarithms of the least and the greatest lambda that are drawn.
    """

    @property
    def asset(self) -> str:
        """What it shows."""

    @property
    def rows(self) -> int:
        """Sampled pixels."""

    @property
    def tail(self) -> TailName:
        """Tail of its error curves."""

    @property
    def price_range(self) -> tuple[float, float]:
        """Natural logarithms of the least and the greatest lambda that are drawn."""

    def moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Means of the features and of their squares, float64 [C] each."""

    def digest(self) -> bytes:
        """sha256 over what is trained on."""

    def subset(self, rows: int, seed: int) -> ViewData:
        """At most `rows` rows, drawn by `seed`, in memory."""

    def blocks(self, chosen: NDArray[np.int64] | None) -> ViewData:
        """Some blocks of rows, by rising number, or all of them, in memory.

        Args:
            chosen: int64 [blocks], ascending numbers of blocks of `BLOCK_ROWS` rows; None: all.
        """


@dataclass(frozen=True, slots=True)
class ShardView:
    """A view whose rows are in a shard.

    Attributes:
        path: The shard.
        header_sha256: What the index says of it; None: the shard is verified by itself.
        outline: The view without its rows.
        rows: R.
        statistics: Means of the features and of their squares, float64 [C] each.
        sha256: Digest of the whole view.
    """

    path: Path
    header_sha256: str | None
    outline: ViewData
    rows: int
    statistics: tuple[NDArray[np.float64], NDArray[np.float64]]
    sha256: bytes

    @property
    def asset(self) -> str:
        """See `View`."""
        return self.outline.asset

    @property
    def tail(self) -> TailName:
        """See `View`."""
        return self.outline.tail

    @property
    def price_range(self) -> tuple[float, float]:
        """See `View`."""
        return self.outline.price_range

    def moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `View`."""
        return self.statistics

    def digest(self) -> bytes:
        """See `View`."""
        return self.sha256

    def subset(self, rows: int, seed: int) -> ViewData:
        """See `View`. The shard is in memory meanwhile."""
        return self.blocks(None).subset(rows, seed)

    def blocks(self, chosen: NDArray[np.int64] | None) -> ViewData:
        """See `View`.

        Args:
            chosen: int64 [blocks], ascending numbers of blocks of `BLOCK_ROWS` rows; None: all.

        Raises:
            Problem: The shard is missing or damaged; it is named.
        """
        if chosen is None:
            return self._as_part(view_data(read_shard(self.path, self.header_sha256), self.asset))
        parts = []
        for start, stop in _runs(chosen, self.rows):
            parts.append(view_data(read_rows(self.path, start, stop, self.header_sha256), self.asset))
        return self._as_part(_joined(parts))

    def _as_part(self, found: ViewData) -> ViewData:
        whole = self.outline
        return replace(
            found,
            price_range=whole.price_range,
            price_grid=whole.price_grid,
            scale_grid=whole.scale_grid,
            sampled_pixels=whole.sampled_pixels * found.rows / self.rows,
        )


def open_views(
    shards: Sequence[Path], assets: Sequence[str], headers: Sequence[str | None] | None = None
) -> list[ShardView]:
    """Read each shard once, for what has to be known of it; its rows are not kept.

    Args:
        shards: Files of `labeller.shards`.
        assets: The asset of each.
        headers: What an index says of each.

    Raises:
        Problem: No shard has a row that a budget could change, or one is missing or damaged; it is named.
    """
    listed = zip(shards, assets, headers or [None] * len(shards), strict=True)
    found = read_ahead(lambda item: _outlined(*item), listed, READERS)
    return refuse_empty([view for view in found if view is not None])


class Pool:
    """The rows that are drawn from at a step.

    Args:
        views: The data set.
        rows: How many rows may be in memory.
        steps: Steps until other rows take their place, if not all fit.
        seed: Of the draw.
    """

    def __init__(self, views: Sequence[View], rows: int, steps: int, seed: int) -> None:
        self._views, self._rows, self._steps, self._seed = views, rows, steps, seed
        self._all_fit = sum(view.rows for view in views) <= rows
        self._round = -1
        self._drawn: list[tuple[int, ViewData]] = []

    def at(self, step: int) -> list[tuple[int, ViewData]]:
        """Numbers of views, and the rows of them that this step draws from. The step before is forgotten."""
        wanted = 0 if self._all_fit else step // self._steps
        if wanted != self._round:
            self._drawn = []  # first of all: two pools would take twice the memory
            self._round = wanted
            chosen = self._choice(wanted)
            numbers = [number for number, _ in chosen]
            read = read_ahead(lambda item: self._views[item[0]].blocks(item[1]), chosen, READERS)
            self._drawn = list(zip(numbers, read, strict=True))
        return self._drawn

    def _choice(self, turn: int) -> list[tuple[int, NDArray[np.int64] | None]]:
        """View and blocks, by rising number of the view: as many views as have room, every asset equally often."""
        if self._all_fit:
            return [(number, None) for number in range(len(self._views))]
        rng = np.random.default_rng((self._seed, turn))
        room = max(1, self._rows // BLOCK_ROWS)
        views = self._order(rng)[: max(1, room // LEAST_BLOCKS)]
        share = max(1, room // len(views))
        chosen = []
        for number in views:
            blocks = -(-self._views[number].rows // BLOCK_ROWS)
            drawn = rng.choice(blocks, size=min(share, blocks), replace=False)
            chosen.append((number, np.sort(drawn).astype(np.int64)))
        return sorted(chosen, key=lambda item: item[0])

    def _order(self, rng: np.random.Generator) -> list[int]:
        """All views in random order, assets taking turns."""
        queues: dict[str, list[int]] = {}
        for number in rng.permutation(len(self._views)):
            queues.setdefault(self._views[number].asset, []).append(int(number))
        turns = sorted((place, number) for queue in queues.values() for place, number in enumerate(queue))
        by_place: list[list[int]] = [[] for _ in range(turns[-1][0] + 1)]
        for place, number in turns:
            by_place[place].append(number)
        return [number for same in by_place for number in rng.permutation(same).tolist()]


def _outlined(path: Path, asset: str, header_sha256: str | None) -> ShardView | None:
    """A shard's view; None where no row has anything to gain."""
    view = view_data(read_shard(path, header_sha256), asset)
    if not len(view.slopes):
        return None
    outline = replace(view.part(np.zeros(0, dtype=np.int64)), sampled_pixels=view.sampled_pixels)
    return ShardView(path, header_sha256, outline, view.rows, moments(view.features), view.digest())


def _runs(chosen: NDArray[np.int64], rows: int) -> list[tuple[int, int]]:
    """First row and the one after the last, of each run of blocks without a hole."""
    runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
    return [(int(run[0]) * BLOCK_ROWS, min(rows, (int(run[-1]) + 1) * BLOCK_ROWS)) for run in runs]


def _joined(parts: Sequence[ViewData]) -> ViewData:
    starts = np.cumsum([0, *(len(part.slopes) for part in parts)])
    offsets = [part.offsets[1:] + start for part, start in zip(parts, starts[:-1], strict=True)]
    return replace(
        parts[0],
        features=np.concatenate([part.features for part in parts]),
        n=np.concatenate([part.n for part in parts]),
        bin_counts=np.concatenate([part.bin_counts for part in parts]),
        offsets=np.concatenate([np.zeros(1, np.int64), *offsets]),
        slopes=np.concatenate([part.slopes for part in parts]),
        lengths=np.concatenate([part.lengths for part in parts]),
    )
