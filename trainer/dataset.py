"""Label shards as training data: hull segments in CSR form, prices per view, and batches drawn on the fly."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from labeller.dataset import read_ahead
from labeller.shard_file import BLOCK_ROWS
from labeller.shards import Shard, read_shard
from renderer.allocation.cuts import usable_counts
from renderer.allocation.prices import feature_prior
from schemas.problem import ExitCode, Problem
from schemas.tail import TAILS, TailName
from trainer.segments import bin_slopes, hull_segments

GROUP: Final = 128
"""Rows of a batch that share a view and a price."""

ANCHOR_SHARE: Final = 0.5
"""How often a group's price is near a budget that is scored."""

ANCHOR_SPREAD: Final = 0.3
"""Standard deviation of log lambda around such a budget's."""

LOSSLESS_MSE: Final = 1e-7
"""Mean squared error per channel that counts as none."""

NEGLIGIBLE: Final = 0.1
"""Share of the lossless error below which the optimum's error is not worth a lower price."""

AnyView = TypeVar("AnyView")


@dataclass(frozen=True)
class PaperInputs:
    """What DHOIT's network reads of the rows (METHOD.md section 4), and the budgets of its labels.

    Attributes:
        depth: float32 [R, 2], window depth of the nearest and of the farthest fragment.
        colours: float32 [R, 6], mean and nearest stored RGB, 0 to 1.
        scene_depth: Window depth of the whole view's nearest and farthest fragment.
        fragments: N, fragments of the view.
        pixels: Pixels of the view.
        budgets: F of each of the view's `anchors`.
    """

    depth: NDArray[np.float32]
    colours: NDArray[np.float32]
    scene_depth: tuple[float, float]
    fragments: int
    pixels: int
    budgets: tuple[int, ...]


@dataclass(frozen=True)
class ViewData:
    """Rows of one shard.

    Attributes:
        asset: What the view shows; assets are weighted equally.
        features: float32 [R, C], columns `renderer.features.FEATURES`.
        n: float32 [R], fragments.
        tail: Of the error curves.
        bin_counts: uint8 [R, B], fragments of each depth bin of the tail.
        offsets: int64 [R+1], segments of row r are `offsets[r]:offsets[r+1]`.
        slopes: float32 [S], error gained per fragment, > 0, falling in a row.
        lengths: float32 [S], fragments of a segment.
        price_range: Natural logarithms of the least and the greatest lambda that are drawn.
        anchors: float64 [A], log lambda at the budgets that are scored (W * H * {1, 2, 4}), may be empty.
        price_grid: float64 [G], log lambda, rising.
        scale_grid: float64 [G], mean over the rows of `(E* + lossless) / lambda` at those prices: the scale of the
            regret, E* the optimum's error.
        sampled_pixels: Pixels of the image that the rows stand for.
        paper: Inputs of the `paper` presets, where they are known (`trainer.paper.with_paper_inputs`).
    """

    asset: str
    features: NDArray[np.float32]
    n: NDArray[np.float32]
    tail: TailName
    bin_counts: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    slopes: NDArray[np.float32]
    lengths: NDArray[np.float32]
    price_range: tuple[float, float]
    anchors: NDArray[np.float64]
    price_grid: NDArray[np.float64]
    scale_grid: NDArray[np.float64]
    sampled_pixels: float
    paper: PaperInputs | None = None

    @property
    def rows(self) -> int:
        """R."""
        return len(self.n)

    def subset(self, rows: int, seed: int) -> ViewData:
        """At most `rows` rows, drawn by `seed`; prices and scale stay those of the whole."""
        if self.rows <= rows:
            return self
        return self.part(np.sort(np.random.default_rng(seed).choice(self.rows, size=rows, replace=False)))

    def blocks(self, chosen: NDArray[np.int64] | None) -> ViewData:
        """Some blocks of `BLOCK_ROWS` rows, by rising number; None: all rows.

        Args:
            chosen: int64 [blocks], ascending numbers of blocks; None: all.
        """
        if chosen is None:
            return self
        rows = (chosen[:, None] * BLOCK_ROWS + np.arange(BLOCK_ROWS)).ravel()
        return self.part(rows[rows < self.rows])

    def part(self, chosen: NDArray[np.int64]) -> ViewData:
        """Some rows, by rising index; prices and scale stay those of the whole.

        Args:
            chosen: int64 [rows], ascending indices of rows.
        """
        starts, counts = self.offsets[chosen], np.diff(self.offsets)[chosen]
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        segments = np.arange(offsets[-1]) + np.repeat(starts - offsets[:-1], counts)
        return replace(
            self,
            features=self.features[chosen],
            n=self.n[chosen],
            bin_counts=self.bin_counts[chosen],
            offsets=offsets,
            slopes=self.slopes[segments],
            lengths=self.lengths[segments],
            sampled_pixels=self.sampled_pixels * len(chosen) / max(1, self.rows),
            paper=self.paper
            and replace(self.paper, depth=self.paper.depth[chosen], colours=self.paper.colours[chosen]),
        )

    def prior(self, rows: NDArray[np.int64] | slice) -> NDArray[np.float32]:
        """What the tail tells of the log gain of each bin of some rows, float32 [rows, B].

        Args:
            rows: int64 [rows], indices of rows, or a slice of them.
        """
        return feature_prior(self.features[rows], self.bin_counts[rows], TAILS[self.tail])

    def moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Means of the features and of their squares, float64 [C] each."""
        return moments(self.features)

    def digest(self) -> bytes:
        """sha256 over what is trained on."""
        hasher = hashlib.sha256(self.asset.encode())
        arrays = [self.features, self.n, self.bin_counts, self.offsets, self.slopes, self.lengths, self.anchors]
        for array in arrays + ([self.paper.depth, self.paper.colours] if self.paper is not None else []):
            hasher.update(np.ascontiguousarray(array).tobytes())
        return hasher.digest()


@dataclass(frozen=True)
class Drawing:
    """How rows are drawn from a data set.

    Attributes:
        replay: Views of another data set, so that what was learned from them is not forgotten.
        replay_share: How often a group is one of theirs.
        hardness: Of each view, >= 0: how much there is still to learn; empty: not known.
        mining: How often a view is drawn in proportion to its hardness.
        noise: float32 [F], standard deviation of what is added to the features; empty: nothing.
        rank: Of the process that draws, 0..size-1: it gets every `size`-th group of the same batch.
        size: Processes that share a batch.
    """

    replay: Sequence[ViewData] = ()
    replay_share: float = 0.5
    hardness: Sequence[float] = ()
    mining: float = 0.0
    noise: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    rank: int = 0
    size: int = 1


@dataclass(frozen=True)
class Batch:
    """Rows of G views, `group` rows each, with one price per row.

    Attributes:
        features: float32 [B, F].
        counts: float32 [B, bins], fragments of each depth bin that can be in a core.
        slopes: float32 [B, bins], error that each fragment of the bin gains, by the row's hull.
        prior: float32 [B, bins], what the tail tells of their log gain.
        log_lambda: float32 [B], one price per group.
        scale: float32 [G], mean of `(E* + lossless) / lambda` of each group's view at its price.
        share: Of the whole batch that these rows are: 1 for a process alone.
    """

    features: NDArray[np.float32]
    counts: NDArray[np.float32]
    slopes: NDArray[np.float32]
    prior: NDArray[np.float32]
    log_lambda: NDArray[np.float32]
    scale: NDArray[np.float32]
    share: float


def lossless_error(pixels: float) -> float:
    """Squared error, summed over channels, that counts as none on that many pixels."""
    return LOSSLESS_MSE * 3.0 * pixels


def load_shards(paths: Sequence[Path], assets: Sequence[str], threads: int | None = None) -> list[ViewData]:
    """Read label shards, some at a time in threads: reading, hashing and the segments need no interpreter lock.

    Args:
        paths: Shards of `labeller.shards`.
        assets: The asset of each shard.
        threads: That read; None: one for each core.

    Raises:
        Problem: No shard has a row that a budget could change, or one is missing or damaged; it is named.
    """
    shards = zip(paths, assets, strict=True)
    read = read_ahead(lambda item: view_data(read_shard(item[0]), item[1]), shards, threads)
    return refuse_empty([view for view in read if len(view.slopes)])


def refuse_empty(views: list[AnyView]) -> list[AnyView]:
    """The views with rows, unless there are none.

    Raises:
        Problem: There are none.
    """
    if not views:
        raise Problem(
            "There is nothing to learn: no pixel's colour depends on the budget.",
            "Add a scene or a view with several transparent layers.",
            ExitCode.CHECK_FAILED,
        )
    return views


def view_data(shard: Shard, asset: str) -> ViewData:
    """One shard as training data."""
    return make_view(
        asset,
        features=shard.features,
        n=shard.n,
        tail=shard.meta.tail,
        bin_counts=shard.bin_counts[:, : TAILS[shard.meta.tail].bins],
        hull=(shard.hull_offsets, shard.hull_k, shard.hull_error),
        price_range=shard.price_range,
        anchors=shard.anchors,
        sampled_pixels=shard.sampled_pixels,
    )


def make_view(
    asset: str,
    *,
    features: NDArray[np.float32],
    n: NDArray[np.int32],
    tail: TailName,
    bin_counts: NDArray[np.uint8],
    hull: tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]],
    price_range: tuple[float, float],
    anchors: Sequence[float],
    sampled_pixels: float,
) -> ViewData:
    """Rows and their hulls as training data.

    Args:
        asset: What the view shows.
        features: float32 [R, C].
        n: int32 [R], fragments.
        tail: Of the error curves.
        bin_counts: uint8 [R, B], fragments of each depth bin.
        hull: Offsets int64 [R+1], k int32 [M] and error float32 [M] of the hulls' vertices.
        price_range: Natural logarithms of the least and the greatest lambda that matter.
        anchors: log lambda at the budgets that are scored.
        sampled_pixels: Pixels of the image that the rows stand for.
    """
    offsets, slopes, lengths = hull_segments(*hull)
    lossless = lossless_error(sampled_pixels)
    order = np.argsort(slopes, kind="stable")
    below = np.concatenate([[0.0], np.cumsum((slopes * lengths).astype(np.float64)[order])])
    # Prices at which even the optimum is far below what counts as lossless teach nothing.
    first = int(np.searchsorted(below, NEGLIGIBLE * lossless))
    if 0 < first < len(below):
        least = float(np.log(slopes[order][first - 1]))
        price_range = min(max(price_range[0], least), price_range[1]), price_range[1]
    grid = np.linspace(price_range[0] - 1.5, price_range[1] + 1.5, 65)
    optimum = below[np.searchsorted(slopes[order], np.exp(grid), side="right")]
    return ViewData(
        asset=asset,
        features=features,
        n=n.astype(np.float32),
        tail=tail,
        bin_counts=np.ascontiguousarray(bin_counts),
        offsets=offsets,
        slopes=slopes,
        lengths=lengths,
        price_range=price_range,
        anchors=np.array(anchors, dtype=np.float64),
        price_grid=grid,
        scale_grid=(optimum + lossless) * np.exp(-grid) / max(1, len(n)),
        sampled_pixels=sampled_pixels,
    )


def sample_batch(
    views: Sequence[ViewData],
    columns: Sequence[int],
    seed: tuple[int, int],
    size: int,
    drawing: Drawing | None = None,
) -> Batch:
    """A batch, the same for the same seed.

    Each group comes from one view (every asset equally often, then every view of it) and has one price: half of
    the time near one of the budgets that are scored, where the view has any, else anywhere in its range.

    Args:
        views: The data set.
        columns: Columns of the features that the model reads.
        seed: Seed of the training and number of the step.
        size: Rows; rounded down to whole groups of `GROUP`.
        drawing: How rows are drawn; None: as above, and all of them.
    """
    how = drawing or Drawing()
    total = max(1, size // GROUP)
    groups = len(range(how.rank, total, how.size))
    features = np.empty((groups * GROUP, len(columns)), dtype=np.float32)
    log_lambda = np.empty(groups * GROUP, dtype=np.float32)
    bins = views[0].bin_counts.shape[1]
    counts, slopes, prior = (np.zeros((groups * GROUP, bins), dtype=np.float32) for _ in range(3))
    scale = np.empty(groups, dtype=np.float32)
    for g, view, rng in draw_views(views, seed, total, how):
        rows = rng.integers(view.rows, size=GROUP)
        price = _draw_price(view, rng)
        if g % how.size != how.rank:
            continue
        own = g // how.size
        part = slice(own * GROUP, (own + 1) * GROUP)
        features[part] = view.features[rows][:, columns]
        if len(how.noise):
            noise = np.random.default_rng((*seed, g)).standard_normal((GROUP, len(columns)), dtype=np.float32)
            features[part] += how.noise * noise
        log_lambda[part] = price
        counts[part], prior[part] = usable_counts(view.bin_counts[rows]), view.prior(rows)
        bin_slopes(view.offsets, view.slopes, view.lengths, rows, counts[part], slopes[part])
        scale[own] = np.exp(np.interp(price, view.price_grid, np.log(view.scale_grid)))
    return Batch(features, counts, slopes, prior, log_lambda, scale, groups / total)


def draw_views(
    views: Sequence[ViewData], seed: tuple[int, int], groups: int, drawing: Drawing
) -> Iterator[tuple[int, ViewData, np.random.Generator]]:
    """The view of each group of a batch, and what its rows are drawn with, by every process in the same way.

    Args:
        views: The data set.
        seed: Seed of the training and number of the step.
        groups: How many.
        drawing: How views are drawn.
    """
    rng = np.random.default_rng(seed)
    by_asset, replayed = _views_by_asset(views), _views_by_asset(drawing.replay)
    hardness = np.cumsum(drawing.hardness)
    for g in range(groups):
        if replayed and rng.random() < drawing.replay_share:
            yield g, _draw_view(replayed, rng), rng
        elif drawing.mining and len(hardness) and hardness[-1] > 0.0 and rng.random() < drawing.mining:
            place = np.searchsorted(hardness, rng.random() * hardness[-1], side="right")
            yield g, views[min(int(place), len(views) - 1)], rng
        else:
            yield g, _draw_view(by_asset, rng), rng


def normalisation(
    assets: Sequence[str], statistics: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean and spread of every feature, float32 [C] each; every asset weighs the same, so do its views.

    Args:
        assets: Of each view.
        statistics: `moments` of each view.
    """
    means, squares = [], []
    for name in sorted(set(assets)):
        same = [found for asset, found in zip(assets, statistics, strict=True) if asset == name]
        means.append(np.mean([mean for mean, _ in same], axis=0))
        squares.append(np.mean([square for _, square in same], axis=0))
    mean = np.mean(means, axis=0)
    variance = np.maximum(np.mean(squares, axis=0) - mean * mean, 0.0)
    return mean.astype(np.float32), np.sqrt(variance).astype(np.float32)


def moments(features: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means of the columns of float32 [R, C] and of their squares, float64 [C] each.

    Args:
        features: float32 [R, C], one row per pixel.
    """
    return features.mean(axis=0, dtype=np.float64), np.square(features, dtype=np.float64).mean(axis=0)


def _views_by_asset(views: Sequence[ViewData]) -> list[list[ViewData]]:
    names = sorted({view.asset for view in views})
    return [[view for view in views if view.asset == name] for name in names]


def _draw_view(by_asset: Sequence[Sequence[ViewData]], rng: np.random.Generator) -> ViewData:
    same = by_asset[int(rng.integers(len(by_asset)))]
    return same[int(rng.integers(len(same)))]


def _draw_price(view: ViewData, rng: np.random.Generator) -> float:
    if len(view.anchors) and rng.random() < ANCHOR_SHARE:
        anchor = max(float(rng.choice(view.anchors)), view.price_range[0])
        return anchor + float(rng.normal(0.0, ANCHOR_SPREAD))
    return float(rng.uniform(*view.price_range))
