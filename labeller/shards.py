"""Label shards: per-pixel rows of one view with all that training needs, in one safetensors file.

A row holds a pixel's features and the lower hull of its error curve. The file's metadata hold what concerns the
whole view as JSON, and a sha256 over that JSON and all tensors, so that damage is found when a shard is read.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from labeller.curves import Curves
from labeller.hull import Hulls
from labeller.rules import allocate_curves
from renderer.features import derive, gather
from schemas.fragments import FragmentDump
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
        k_min: Fewest fragments of an occupied pixel at this budget.
        log_lambda: Natural logarithm of the error saved per fragment where the budget is used up; None where
            less than the budget suffices.
        error: Total squared error of the view.
        bound: Lower bound of it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    budget: int
    share: float
    scored: bool
    k_min: int
    log_lambda: float | None
    error: float
    bound: float


class ShardMeta(BaseModel):
    """What a shard says about its view.

    Attributes:
        width: Pixels per row.
        height: Rows.
        fragments: N.
        occupied: Pixels with at least one fragment.
        eligible: Pixels with more than k_min fragments, of which the rows are a sample.
        tail: Tail of the error curves.
        g: Steepness of the density tail.
        metric: Space of the error.
        k_min: First k of the hulls.
        seed: Seed of the sample.
        levels: Optimal allocations, by rising budget.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: int
    height: int
    fragments: int
    occupied: int
    eligible: int
    tail: TailName
    g: float
    metric: MetricName
    k_min: int
    seed: int
    levels: tuple[Level, ...]


@dataclass(frozen=True, slots=True)
class Shard:
    """Sampled pixels of one view.

    Attributes:
        features: float32 [R, 26], columns `renderer.features.FEATURES`.
        n: int32 [R], fragments.
        pixel: int32 [R], pixel index in the view, ascending.
        hull_offsets: int64 [R+1], hull vertices of row r are `hull_offsets[r]:hull_offsets[r+1]`.
        hull_k: int32 [M], from k_min, ascending.
        hull_error: float32 [M], falling to 0.
        meta: The view.
    """

    features: NDArray[np.float32]
    n: NDArray[np.int32]
    pixel: NDArray[np.int32]
    hull_offsets: NDArray[np.int64]
    hull_k: NDArray[np.int32]
    hull_error: NDArray[np.float32]
    meta: ShardMeta

    @property
    def k_min(self) -> int:
        """First k of the hulls."""
        return self.meta.k_min

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
        """Pixels of the image that the rows stand for: W*H times the share of eligible pixels that was sampled."""
        return self.meta.width * self.meta.height * len(self.n) / max(self.meta.eligible, 1)


def write_shard(
    path: Path,
    dump: FragmentDump,
    curves: Curves,
    hulls: Hulls,
    budgets: Sequence[int],
    fraction: float = 0.2,
    seed: int = 0,
) -> None:
    """Sample a view and write its shard, atomically.

    Args:
        path: File to write; its folder exists.
        dump: Fragments of the view.
        curves: Its error curves.
        hulls: The curves' hulls.
        budgets: Fragment counts F that results are measured at; those of N and above are left out.
        fraction: Share of the pixels with more than k_min fragments that become rows, the same for every n.
        seed: Seed of the sample.
    """
    sizes = np.diff(hulls.offsets)
    # Pixels without a hull gain nothing, but a predictor that does not know them would spend on them all the same.
    eligible = np.flatnonzero(dump.counts > hulls.k_min)
    pixel = stratified_sample(eligible, dump.counts[eligible], fraction, seed)
    rows = sizes[pixel]
    hull_offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(rows)])
    vertices = np.arange(hull_offsets[-1]) + np.repeat(hulls.offsets[pixel] - hull_offsets[:-1], rows)
    shard = Shard(
        features=derive(gather(dump)[pixel]),
        n=dump.counts[pixel].astype(np.int32),
        pixel=pixel.astype(np.int32),
        hull_offsets=hull_offsets,
        hull_k=hulls.k[vertices],
        hull_error=hulls.error[vertices],
        meta=ShardMeta(
            width=dump.width,
            height=dump.height,
            fragments=dump.total,
            occupied=int(np.count_nonzero(dump.counts)),
            eligible=len(eligible),
            tail=curves.tail,
            g=curves.g,
            metric=curves.metric,
            k_min=hulls.k_min,
            seed=seed,
            levels=_levels(dump, curves, hulls, budgets),
        ),
    )
    _write_atomically(path, _serialised(shard))


def read_shard(path: Path) -> Shard:
    """Read a shard and verify it.

    Raises:
        Problem: The file is missing, is not a shard, or is damaged; it names the file.
    """
    try:
        with safe_open(path, framework="numpy") as file:
            about = json.loads((file.metadata() or {})["shard"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
        if about["sha256"] != _digest(tensors, about["view"]):
            raise ValueError("its content does not match its checksum")
        return Shard(**tensors, meta=ShardMeta.model_validate_json(about["view"]))
    except FileNotFoundError as error:
        raise Problem(f"There is no label shard {path}.", "Build it again.", ExitCode.NOT_FOUND) from error
    except (SafetensorError, ValidationError, OSError, KeyError, TypeError, ValueError) as error:
        raise Problem(
            f"The label shard {path} is damaged: {error}.", "Delete it, and run the same command again."
        ) from error


def stratified_sample(
    pixels: NDArray[np.integer], n: NDArray[np.integer], fraction: float, seed: int
) -> NDArray[np.int64]:
    """A share of the pixels, spread evenly over n: every (1/fraction)-th in random order within equal n.

    Args:
        pixels: [E], pixel indices.
        n: [E], fragments of each.
        fraction: Share to take, in (0, 1].
        seed: Equal seeds give equal samples.

    Returns:
        int64, ascending.
    """
    rng = np.random.default_rng(seed)
    shuffled = rng.permutation(len(pixels))
    ordered = shuffled[np.argsort(n[shuffled], kind="stable")]
    chosen = np.floor((np.arange(math.ceil(len(pixels) * fraction)) + rng.random()) / fraction).astype(np.int64)
    return np.sort(pixels[ordered[chosen[chosen < len(pixels)]]]).astype(np.int64)


def _levels(dump: FragmentDump, curves: Curves, hulls: Hulls, budgets: Sequence[int]) -> tuple[Level, ...]:
    scored = {int(budget) for budget in budgets}
    usable = int(hulls.lengths().sum(dtype=np.int64))
    last = int(np.minimum(dump.counts, hulls.k_min).sum()) + int(LAST_SHARE * usable)
    wanted = sorted({*(int(share * dump.total) for share in SHARES), last, *scored})
    short = [budget for budget in wanted if 0 < budget < dump.total]
    return tuple(
        Level(
            budget=found.budget,
            share=found.budget / dump.total,
            scored=found.budget in scored,
            k_min=found.k_min,
            log_lambda=math.log(found.lam) if found.lam else None,
            error=found.error,
            bound=found.bound or 0.0,
        )
        for found in allocate_curves(dump, curves, short, "optimal", hulls)
    )


def _tensors(shard: Shard) -> dict[str, NDArray[np.generic]]:
    names = ("features", "n", "pixel", "hull_offsets", "hull_k", "hull_error")
    return {name: np.ascontiguousarray(getattr(shard, name)) for name in names}


def _serialised(shard: Shard) -> bytes:
    tensors, view = _tensors(shard), shard.meta.model_dump_json()
    about = json.dumps({"sha256": _digest(tensors, view), "view": view})
    return bytes(save(tensors, metadata={"shard": about}))  # one key: the format keeps no order of several


def _digest(tensors: dict[str, NDArray[np.generic]], view: str) -> str:
    hasher = hashlib.sha256(view.encode())
    for name, tensor in sorted(tensors.items()):
        hasher.update(json.dumps([name, tensor.dtype.str, tensor.shape]).encode())
        hasher.update(np.ascontiguousarray(tensor).tobytes())
    return hasher.hexdigest()


def _write_atomically(path: Path, content: bytes) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
