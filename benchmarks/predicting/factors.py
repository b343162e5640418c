"""A third output of the network, tried: it scales the exponents of each pixel's tail.

Of the `density` tail that output is its g (METHOD section 2), and the optimum is that of the tail `density, best g a
pixel`; of a binned tail, which has no g, it says how far what the bins know is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numba import njit, prange
from numpy.typing import NDArray
from torch import Tensor

from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.tail_kernels import Bytes, Depths, Floats, Offsets, errors_with
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.curves import Curves
from labeller.hull import Hulls, lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import read_shard, write_shard
from renderer.depth_bins import OPTICAL, binned_exponents
from renderer.features import FEATURES
from schemas.bundle import G_MAX
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS, DENSITY_G, TailName
from trainer.config import TrainConfig
from trainer.dataset import Drawing, ViewData, sample_batch, view_data
from trainer.heads import GainCurveHead
from trainer.loss import lagrangian_regret
from trainer.models import Network
from trainer.segments import hull_segments
from trainer.views import View

FACTORS: Final = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)
"""Those with curves of their own; in between, errors are interpolated."""

ANSWER_BYTES: Final = 4
"""Of a pixel, while sums are gathered and while fragments are captured: what the third output takes."""

Errors = NDArray[np.float32]


def start_of(tail: TailName) -> float:
    """What the product multiplies a tail's exponents with."""
    return 1.0 if tail in DENSITY_BINS else DENSITY_G


def exponents_of(dump: FragmentDump, tail: TailName) -> Floats:
    """A tail's account of the optical depth in front of every fragment, before the factor, float64 [N].

    Args:
        dump: Fragments of a view.
        tail: `density` or one with bins.
    """
    out = np.zeros(dump.total)
    _exponents(dump.offsets, dump.rgba, dump.depth, OPTICAL, DENSITY_BINS.get(tail, 0), out)
    return out


def errors_of(dump: FragmentDump, exponents: Floats, factors: NDArray[np.floating]) -> Errors:
    """Squared errors for every k, float32 [N+P].

    Args:
        dump: Fragments of a view.
        exponents: Those of `exponents_of`.
        factors: [P], or [] for all pixels the same.
    """
    return errors_with(dump, exponents * (np.repeat(factors, dump.counts) if factors.ndim else factors))


@dataclass(frozen=True, slots=True)
class FactorLabels:
    """What is learned of a view.

    Attributes:
        shard: Rows of the lower envelope of all factors' curves: whatever k a pixel gets, its best factor is used.
        hulls: For every factor the hulls of the same rows.
        optimum: Mean squared error of the envelope's certified optimum at each of the view's budgets.
    """

    shard: Path
    hulls: Path
    optimum: list[float]


def factor_labels(store: Store, row: ViewRow, tail: TailName) -> FactorLabels:
    """The labels of a view, made where they are not there.

    Args:
        store: Where they are kept.
        row: The view.
        tail: Whose exponents are scaled.
    """
    key = key_of(row.digest, tail, store.code("labels"), store.code("factors"))
    shard, hulls = store.path("factors", f"{key}.safetensors"), store.path("factors", f"{key}.npz")

    def make() -> dict[str, Any]:
        dump = load_dump(store, row)
        by_factor = _curves(dump, tail)
        envelope = replace(by_factor[0], error=np.minimum.reduce([curves.error for curves in by_factor]))
        least = lower_hulls(envelope)
        write_shard(shard, dump, envelope, least, row.budgets)
        pixel = read_shard(shard).pixel
        made = [_rows_of(lower_hulls(curves), pixel) for curves in by_factor]
        parts = ("offsets", "slopes", "lengths")
        named: dict[str, Any] = {
            f"{part}{j}": array for j, arrays in enumerate(made) for part, array in zip(parts, arrays, strict=True)
        }
        store.write(hulls, lambda path: np.savez(path, **named))
        found = allocate_curves(dump, envelope, row.budgets, "optimal", least)
        return {"optimum": [allocation.error / (3 * dump.pixels) for allocation in found]}

    optimum: list[float] = store.remember("factors", key, make)["optimum"]
    return FactorLabels(shard, hulls, optimum)


@dataclass(frozen=True)
class FactorView(ViewData):
    """Rows with their hulls under every factor.

    Attributes:
        by_factor: The same rows and prices, each with the hulls of one of `FACTORS`.
    """

    by_factor: tuple[ViewData, ...] = ()

    def part(self, chosen: NDArray[np.int64]) -> FactorView:
        """See `ViewData`."""
        kept = super().part(chosen)
        assert isinstance(kept, FactorView)
        return replace(kept, by_factor=tuple(view.part(chosen) for view in self.by_factor))


def factor_view(labels: FactorLabels, asset: str) -> FactorView:
    """Labels as training data.

    Args:
        labels: Of a view.
        asset: What it shows.
    """
    view = view_data(read_shard(labels.shard), asset)
    with np.load(labels.hulls) as file:
        made = tuple(
            replace(view, offsets=file[f"offsets{j}"], slopes=file[f"slopes{j}"], lengths=file[f"lengths{j}"])
            for j in range(len(FACTORS))
        )
    return FactorView(**{name: getattr(view, name) for name in ViewData.__dataclass_fields__}, by_factor=made)


class FactorHead(GainCurveHead):
    """A `gain-curve` head with a third output, `g`, whose loss is the regret under the factor that it answers.

    Args:
        start: The factor that an untrained network answers.
    """

    def __init__(self, start: float) -> None:
        self.start = start

    def network(self, views: Sequence[View], config: TrainConfig) -> Network:
        """See `trainer.heads.Head`."""
        usual = super().network(views, config)
        torch.manual_seed(config.seed)
        mean, std = usual.mean.numpy(), usual.std.numpy()
        network = Network(usual.features, mean, std, config.hidden, "gain-curve", ("a", "b", "g"))
        with torch.no_grad():
            last = network.dense[-1]
            last.bias[:2] = usual.dense[-1].bias
            last.bias[2] = float(np.log(self.start / (G_MAX - self.start)))
        return network

    def loss(
        self, network: Network, views: Sequence[ViewData], config: TrainConfig, step: int, drawing: Drawing
    ) -> Tensor:
        """See `trainer.heads.Head`. `config.feature_noise` is ignored, and there is nothing to replay."""
        seen = [view for view in views if isinstance(view, FactorView)]
        drawn = (config.seed, step), config.batch, drawing
        batch = sample_batch(seen, [FEATURES.index(name) for name in network.features], *drawn)
        a, b, factor = network(torch.from_numpy(batch.features)).unbind(dim=1)
        n, price = map(torch.from_numpy, (batch.n, batch.log_lambda))
        costs, least, leaks = [], [], []
        for j in range(len(FACTORS)):
            # The same draw: rows and prices are those of the batch.
            other = sample_batch([view.by_factor[j] for view in seen], [], *drawn)
            slopes, lengths = torch.from_numpy(other.slopes), torch.from_numpy(other.lengths)
            regret, overshoot = lagrangian_regret(a, b, n, slopes, lengths, price)
            least.append(least_cost(slopes, lengths, price))
            costs.append(torch.relu(regret) + least[-1])
            leaks.append(overshoot)
        shares, best = interpolation(factor), torch.stack(least).amin(dim=0)
        regret = torch.relu((shares * torch.stack(costs, dim=1)).sum(dim=1) - best)
        rows = torch.log1p(regret).mean()
        scale = torch.from_numpy(batch.scale)
        of_views = torch.log1p(regret.view(len(scale), -1).mean(dim=1) / scale).mean()
        leak = torch.log1p((shares * torch.stack(leaks, dim=1)).sum(dim=1)).mean()
        return batch.share * ((1.0 - config.view_weight) * rows + config.view_weight * of_views + config.leak * leak)


def least_cost(slopes: Tensor, lengths: Tensor, log_lambda: Tensor) -> Tensor:
    """`min_j (E(j) + lambda j) / lambda` of hulls, float32 [R], in fragments.

    Args:
        slopes: float32 [R, H], error gained per fragment; 0 where a hull has ended.
        lengths: float32 [R, H], fragments of each segment.
        log_lambda: float32 [R].
    """
    # A segment is bought or its error stays: whichever is less.
    return (lengths * torch.clamp(slopes * torch.exp(-log_lambda)[:, None], max=1.0)).sum(dim=1)


def interpolation(factor: Tensor) -> Tensor:
    """Shares of `FACTORS` that a factor is between, float32 [R, G]; beyond the last one, the last.

    Args:
        factor: float32 [R], >= 0.
    """
    knots = torch.tensor(FACTORS)
    f = torch.clamp(factor, knots[0], knots[-1])[:, None]
    gaps = knots[1:] - knots[:-1]
    rising, one = (f - knots[:-1]) / gaps, torch.ones_like(f)
    after, before = torch.cat([one, rising], dim=1), torch.cat([1.0 - rising, one], dim=1)
    return torch.clamp(torch.minimum(after, before), min=0.0)


def _curves(dump: FragmentDump, tail: TailName) -> list[Curves]:
    exponents, offsets = exponents_of(dump, tail), dump.offsets + np.arange(dump.pixels + 1)
    errors = [errors_of(dump, exponents, np.array(factor)) for factor in FACTORS]
    return [Curves(offsets, error, tail, factor, "display") for error, factor in zip(errors, FACTORS, strict=True)]


def _rows_of(
    hulls: Hulls, pixel: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]:
    """Segments of some pixels, as `trainer.segments.hull_segments` gives them."""
    sizes = np.diff(hulls.offsets)[pixel]
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])
    vertices = np.arange(offsets[-1]) + np.repeat(hulls.offsets[pixel] - offsets[:-1], sizes)
    found: tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]] = hull_segments(
        offsets, hulls.k[vertices], hulls.error[vertices]
    )
    return found


@njit(parallel=True, cache=True, error_model="numpy")
def _exponents(offsets: Offsets, rgba: Bytes, depth: Depths, optical: Floats, bins: int, out: Floats) -> None:
    for p in prange(len(offsets) - 1):
        first, last = offsets[p], offsets[p + 1]
        if first == last:
            continue
        total = 0.0
        for i in range(first, last):
            total += optical[rgba[i, 3]]
        if bins:
            binned_exponents(depth[first:last], rgba[first:last], total, np.empty(bins + 1), out[first:last])
            continue
        extent = np.float64(depth[last - 1]) - np.float64(depth[first])
        steepness = total / extent if extent > 0.0 else 0.0
        for i in range(first, last):
            out[i] = steepness * (np.float64(depth[i]) - np.float64(depth[first]))
