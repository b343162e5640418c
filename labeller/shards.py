"""Label shards: per-pixel rows of one view with all that training needs, in one safetensors file.

A row holds a pixel's features and the lower hull of its error curve. What concerns the whole view is in the file's
metadata. `labeller.shard_file` is about the bytes and how they are verified, `labeller.columns` about the columns,
`labeller.dataset` about many shards together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)

from labeller.curves import Curves
from labeller.hull import Hulls
from labeller.rules import allocate_curves
from labeller.sampling import Sampling, SamplingKind, sample_pixels
from labeller.shard_file import Columns, Damage, OtherSchema, ShardFile, Written, open_columns, write_columns
from labeller.skips import needed_budgets
from renderer.depth_bins import bin_counts
from renderer.features import derive, gather
from schemas.fragments import FragmentDump
from schemas.pixel_weights import DEFAULT_WEIGHTS, PixelWeights, without_default
from schemas.problem import ExitCode, Problem
from schemas.tail import MetricName, TailName

SHARES: Final = (0.05, 0.1, 0.25, 0.4, 0.6, 0.8, 0.9)
"""Budgets, as shares of the view's fragments, at which every shard knows the price."""

LAST_SHARE: Final = 0.98
"""Share of what the hulls can use at all, for one more price: beyond it next to nothing is gained."""


class Level(BaseModel):
    """The optimal allocation of one budget.

    Attributes:
        budget: F, fragments.
        share: F / N.
        scored: Whether F is one of the budgets that results are measured at.
        log_lambda: Natural logarithm of the error saved per fragment where the budget is used up; None where
            less than the budget suffices.
        error: Total squared error of the view.
        bound: Lower bound of it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    budget: int
    share: float = Field(ge=0.0, le=1.0)
    scored: bool
    log_lambda: float | None
    error: float
    bound: float


class ShardMeta(BaseModel):
    """What a shard says about its view.

    Attributes:
        width: Pixels per row.
        height: Rows.
        fragments: N.
        occupied: Pixels with at least one fragment, of which the rows are a sample.
        tail: Tail of the error curves.
        g: Steepness of the density tail.
        metric: Space of the error.
        weights: What the errors of a pixel count, in its hull and in the levels.
        sampling: How the rows were drawn.
        levels: Optimal allocations, by rising budget.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    width: int = Field(ge=1)
    height: int = Field(ge=1)
    fragments: int = Field(ge=0)
    occupied: int
    tail: TailName
    g: float
    metric: MetricName
    weights: PixelWeights = DEFAULT_WEIGHTS
    sampling: Sampling
    levels: tuple[Level, ...]

    @model_serializer(mode="wrap")
    def _written(self, usual: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without weights a shard's bytes are those from before there were any."""
        return without_default(usual(self))


@dataclass(frozen=True, slots=True)
class Shard:
    """Sampled pixels of one view.

    Attributes:
        features: float32 [R, C], columns `renderer.features.FEATURES`.
        n: int32 [R], fragments.
        bin_counts: uint8 [R, MOST_BINS], fragments of each depth bin, `COUNT_LIMIT` for that many or more.
        pixel: int32 [R], pixel index in the view, ascending.
        hull_offsets: int64 [R+1], hull vertices of row r are `hull_offsets[r]:hull_offsets[r+1]`.
        hull_k: int32 [M], from 0, ascending.
        hull_error: float32 [M], falling to 0.
        meta: The view.
    """

    features: NDArray[np.float32]
    n: NDArray[np.int32]
    bin_counts: NDArray[np.uint8]
    pixel: NDArray[np.int32]
    hull_offsets: NDArray[np.int64]
    hull_k: NDArray[np.int32]
    hull_error: NDArray[np.float32]
    meta: ShardMeta

    @property
    def segments(self) -> int:
        """Hull segments of all rows: vertices, less one for each row that has any."""
        return len(self.hull_k) - int(np.count_nonzero(np.diff(self.hull_offsets)))

    @property
    def price_range(self) -> tuple[float, float]:
        """Least and greatest log lambda of the levels; (0, 0) if no budget of the view is short."""
        prices = [level.log_lambda for level in self.meta.levels if level.log_lambda is not None]
        return (min(prices), max(prices)) if prices else (0.0, 0.0)

    @property
    def anchors(self) -> tuple[float, ...]:
        """Log lambda at the scored budgets, by rising budget; without those that all needs fit in."""
        return tuple(x.log_lambda for x in self.meta.levels if x.scored and x.log_lambda is not None)

    @property
    def sampled_pixels(self) -> float:
        """Pixels of the image that the rows stand for: W*H times the share of occupied pixels that was sampled."""
        return self.meta.width * self.meta.height * len(self.n) / max(self.meta.occupied, 1)


def write_shard(
    path: Path,
    dump: FragmentDump,
    curves: Curves,
    hulls: Hulls,
    budgets: Sequence[int],
    fraction: float = 0.2,
    seed: int = 0,
    kind: SamplingKind = "stratified",
    weights: PixelWeights = DEFAULT_WEIGHTS,
) -> Written:
    """Sample a view and write its shard, atomically. Any number of processes may write shards of one data set.

    Args:
        path: File to write; its folder exists.
        dump: Fragments of the view.
        curves: Its error curves, weighted already.
        hulls: The curves' hulls.
        budgets: Fragment counts F that results are measured at; those of N and above are left out.
        fraction: Share of the pixels with fragments that become rows.
        seed: Seed of the sample.
        kind: `stratified`: the same share of every n; `uniform`: the same probability for every pixel, as in DHOIT.
        weights: What the errors in `curves` were weighted with.

    Returns:
        Sums and size, for the index of a data set.
    """
    sampling = Sampling(kind=kind, fraction=fraction, seed=seed)
    # Pixels that are exact at k = 0 gain nothing, but a predictor meets them in every frame: rows without a segment.
    occupied = np.flatnonzero(dump.counts)
    meta = ShardMeta(
        width=dump.width,
        height=dump.height,
        fragments=dump.total,
        occupied=len(occupied),
        tail=curves.tail,
        g=curves.g,
        metric=curves.metric,
        weights=weights,
        sampling=sampling,
        levels=_levels(dump, curves, hulls, budgets),
    )
    sampled = sample_pixels(occupied, dump.counts[occupied], sampling)
    columns = _columns(dump, curves.tail, hulls, sampled)
    return write_columns(path, columns, meta.model_dump(mode="json"))


def read_shard(path: Path, header_sha256: str | None = None) -> Shard:
    """Read a shard and verify all of it.

    Args:
        path: The file.
        header_sha256: What the index says of it; None: the shard is verified by itself.

    Raises:
        Problem: The file is missing, is not a shard, or is damaged; it names the file.
    """
    return _read(path, header_sha256, lambda file: (0, file.layout.rows))


def read_rows(path: Path, start: int, stop: int, header_sha256: str | None = None) -> Shard:
    """Read the rows `start <= r < stop` of a shard: the header and the blocks of rows that hold them, verified.

    Args:
        path: The file.
        start: First row, 0..R.
        stop: Row after the last, start..R.
        header_sha256: What the index says of it; None: the shard is verified by itself.

    Raises:
        Problem: The file is missing, is not a shard, or what was read of it is damaged; it names the file.
        IndexError: The shard does not have these rows.
    """

    def part(file: ShardFile) -> tuple[int, int]:
        if not 0 <= start <= stop <= file.layout.rows:
            raise IndexError(f"{path} has the rows 0..{file.layout.rows}, not {start}..{stop}")
        return start, stop

    return _read(path, header_sha256, part)


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """What goes wrong while a shard is read, as a problem that names the file and says what to do.

    Args:
        path: The shard.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise Problem(
            f"There is no label shard {path}.", "Build it again, or copy the data set again.", ExitCode.NOT_FOUND
        ) from error
    except OtherSchema as error:
        raise Problem(
            f"The label shard {path} cannot be read: {error}.", "Build it again.", ExitCode.CHECK_FAILED
        ) from error
    except ValidationError as error:
        raise damaged(path, "its header is not valid") from error
    except (Damage, OSError) as error:
        raise damaged(path, error) from error


def damaged(path: Path, why: object) -> Problem:
    """A shard that is not what was written: named, with what to do."""
    return Problem(
        f"The label shard {path} is damaged: {why}.",
        "Delete it and run the same command again, or copy the data set again.",
        ExitCode.CHECK_FAILED,
    )


def _read(path: Path, header_sha256: str | None, part: Callable[[ShardFile], tuple[int, int]]) -> Shard:
    with explained(path), open_columns(path, header_sha256) as file:
        meta = ShardMeta.model_validate(file.layout.view)
        shard = _shard(file.read(*part(file)), meta)
        _check_values(shard)
        return shard


def _check_values(shard: Shard) -> None:
    """Refuses numbers that no view has: sums only say that they are the ones that were written.

    Raises:
        Damage: Which ones.
    """
    meta, inner = shard.meta, np.ones(max(len(shard.hull_k) - 1, 0), dtype=bool)
    has_hull = np.diff(shard.hull_offsets) > 0
    last = shard.hull_offsets[1:][has_hull] - 1
    inner[last[:-1]] = False  # from one row to the next
    checks = {
        "features that are not finite": np.isfinite(shard.features).all(),
        "pixels that the view does not have": (np.diff(shard.pixel) > 0).all()
        and shard.pixel.min(initial=0) >= 0
        and shard.pixel.max(initial=0) < meta.width * meta.height,
        "counts that the view does not have": shard.n.min(initial=1) > 0
        and int(shard.n.sum(dtype=np.int64)) <= meta.fragments,
        "more fragments in bins than in their pixel": (shard.bin_counts.sum(axis=1, dtype=np.int64) <= shard.n).all(),
        "hulls that are not in 0..n": (np.diff(shard.hull_k)[inner] > 0).all()
        and (shard.hull_k[last] <= shard.n[has_hull]).all(),
        "errors that do not fall to 0": np.isfinite(shard.hull_error).all()
        and (np.diff(shard.hull_error)[inner] < 0.0).all(),
    }
    wrong = [name for name, fits in checks.items() if not fits]
    if wrong:
        raise Damage(f"it has {', '.join(wrong)}")


def _columns(dump: FragmentDump, tail: TailName, hulls: Hulls, pixel: NDArray[np.int64]) -> Columns:
    """What the file holds of the rows: of each hull segment its length, and the error at its start."""
    vertices = np.diff(hulls.offsets)[pixel]
    segments = np.maximum(vertices - 1, 0)
    ends = np.cumsum(segments)
    first = np.repeat(hulls.offsets[pixel] - (ends - segments), segments)
    start = np.arange(len(first)) + first
    n = dump.counts[pixel]
    count = np.uint16 if n.max(initial=0) < 1 << 16 else np.uint32
    return {
        "features": derive(gather(dump, tail)[pixel]),
        "n": n.astype(count),
        "bin_counts": bin_counts(dump, tail)[pixel],
        "pixel": pixel.astype(np.uint32),
        "hull_segments": segments.astype(count),
        "hull_length": (hulls.k[start + 1] - hulls.k[start]).astype(count),
        "hull_error": hulls.error[start],
    }


def _shard(columns: Columns, meta: ShardMeta) -> Shard:
    """The rows with their hulls' vertices."""
    segments = columns["hull_segments"].astype(np.int64)
    has_hull = segments > 0
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(segments + has_hull)])
    starts = np.ones(offsets[-1], dtype=bool)
    starts[offsets[1:][has_hull] - 1] = False
    error = np.zeros(offsets[-1], dtype=np.float32)
    error[starts] = columns["hull_error"]
    step = np.zeros(offsets[-1] + 1, dtype=np.int64)
    step[1:][starts] = columns["hull_length"]
    k = np.cumsum(step)[:-1]
    k -= np.repeat(k[offsets[:-1][has_hull]], segments[has_hull] + 1)
    return Shard(
        features=columns["features"].astype(np.float32, copy=False),
        n=columns["n"].astype(np.int32),
        bin_counts=columns["bin_counts"].astype(np.uint8, copy=False),
        pixel=columns["pixel"].astype(np.int32),
        hull_offsets=offsets,
        hull_k=k.astype(np.int32),
        hull_error=error,
        meta=meta,
    )


def _levels(dump: FragmentDump, curves: Curves, hulls: Hulls, budgets: Sequence[int]) -> tuple[Level, ...]:
    scored = {int(budget) for budget in budgets}
    usable = int(hulls.steps()[1].sum(dtype=np.int64))
    wanted = (*(int(share * dump.total) for share in SHARES), int(LAST_SHARE * usable), *scored)
    short = [budget for budget in needed_budgets(wanted, dump.total) if budget > 0]
    return tuple(
        Level(
            budget=found.budget,
            share=found.budget / dump.total,
            scored=found.budget in scored,
            log_lambda=math.log(found.lam) if found.lam else None,
            error=found.error,
            bound=found.bound or 0.0,
        )
        for found in allocate_curves(dump, curves, short, "optimal", hulls)
    )
