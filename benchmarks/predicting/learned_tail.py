"""A small learned tail, tried: what the bins say is corrected by a network of a few units, for colour or for coverage.

`exponents`: while fragments are captured, every one of the tail gets its exponent corrected by what the bins around it
hold; the sums stay commutative. `coverage`: when a pixel is resolved, the transmittance of its tail is corrected by
what is known of the pixel then. Both are fitted to the errors of the pictures that the deployed allocation gives, view
by view in their logarithm, as they are scored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import torch
from numba import njit, prange
from numpy.typing import NDArray
from torch import Tensor, nn

from benchmarks.predicting.tail_kernels import Bytes, Depths, Floats, Offsets
from renderer.depth_bins import OPTICAL, kept_share, place_of, units_in_front
from schemas.colour import decode_gamma2, linear_to_srgb
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS, MAX_EXPONENT, TailName
from trainer.adam import Adam
from trainer.dataset import LOSSLESS_MSE
from trainer.weights import Layer

Kind = Literal["exponents", "coverage"]

UNITS: Final = 12
"""Of the one hidden layer."""

INPUTS: Final[dict[Kind, int]] = {"exponents": 8, "coverage": 7}
"""How many numbers each reads."""

DRAWN: Final = 400
"""Pixels of a view at a budget that are fitted to."""

STEPS: Final = 600
LR: Final = 5e-3
BATCH: Final = 16
"""Steps of the optimiser, its first rate, and the views (each at one of its budgets) of a step."""

Corrections = Sequence[Layer]


@dataclass(frozen=True, slots=True)
class Pixels:
    """Pixels of a view at a budget, and the fragments of their tails.

    Attributes:
        rgb: float32 [M, 3], linear colours of the tails' fragments.
        alpha: float32 [M].
        exponent: float32 [M], without a correction.
        around: float32 [M, 8], what a fragment's correction reads.
        pixel: int64 [M], whose it is.
        core: float32 [R, 3], linear.
        through: float32 [R], transmittance of the core.
        behind: float32 [R], that of the tail.
        background: float32 [R, 3], linear.
        known: float32 [R, 7], what a pixel's correction reads.
        exact: float32 [R, 3], the colour that is right, in display space.
        share: float32 [R], what the squared errors are multiplied with: their sum is the view's mean squared error.
    """

    rgb: NDArray[np.float32]
    alpha: NDArray[np.float32]
    exponent: NDArray[np.float32]
    around: NDArray[np.float32]
    pixel: NDArray[np.int64]
    core: NDArray[np.float32]
    through: NDArray[np.float32]
    behind: NDArray[np.float32]
    background: NDArray[np.float32]
    known: NDArray[np.float32]
    exact: NDArray[np.float32]
    share: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class BinnedView:
    """A view with what the bins say of every fragment.

    Attributes:
        dump: The view.
        exponent: float64 [N].
        around: float32 [N, 8].
    """

    dump: FragmentDump
    exponent: Floats
    around: NDArray[np.float32]


def binned_view(dump: FragmentDump, tail: TailName) -> BinnedView:
    """What the bins of a tail say of a view's fragments.

    Args:
        dump: The view.
        tail: One with bins.
    """
    exponent, around = np.zeros(dump.total), np.zeros((dump.total, INPUTS["exponents"]), dtype=np.float32)
    _look_around(dump.offsets, dump.rgba, dump.depth, OPTICAL, DENSITY_BINS[tail], exponent, around)
    return BinnedView(dump, exponent, around)


def pixels_of(view: BinnedView, k: NDArray[np.integer], seed: int) -> Pixels | None:
    """Pixels of a view to fit to, drawn by how wrong they are, half of them; None if a tail changes nothing.

    Args:
        view: What the bins say of it.
        k: int [P], core fragments.
        seed: Of the draw.
    """
    dump = view.dump
    found = resolved(view, k)
    exact = linear_to_srgb(_shown(resolved(view, dump.counts), dump))
    wrong = np.square(linear_to_srgb(_shown(found, dump)) - exact).sum(axis=1)
    open_pixels = np.flatnonzero(dump.counts - k > 1)
    if len(open_pixels) == 0 or wrong[open_pixels].sum() <= 0.0:
        return None
    chance = wrong[open_pixels] + wrong[open_pixels].mean()
    chance /= chance.sum()
    drawn = np.random.default_rng(seed).choice(len(open_pixels), size=DRAWN, p=chance)
    chosen = open_pixels[drawn]
    first, sizes = dump.offsets[chosen] + k[chosen], dump.counts[chosen] - k[chosen]
    ends = np.cumsum(sizes)
    fragment = np.arange(ends[-1]) + np.repeat(first - (ends - sizes), sizes)
    part = {
        "rgb": decode_gamma2(dump.rgba[fragment, :3]),
        "alpha": dump.rgba[fragment, 3] / 255.0,
        "exponent": np.minimum(view.exponent[fragment], MAX_EXPONENT),
        "around": view.around[fragment],
        "core": found[chosen, :3],
        "through": found[chosen, 3],
        "behind": found[chosen, 4],
        "background": decode_gamma2(dump.background[chosen]),
        "known": known_of(view, k, found)[chosen],
        "exact": exact[chosen],
        "share": 1.0 / (3.0 * dump.pixels * DRAWN * chance[drawn]),
    }
    return Pixels(
        **{name: np.asarray(values, dtype=np.float32) for name, values in part.items()},
        pixel=np.repeat(np.arange(DRAWN), sizes),
    )


def resolved(view: BinnedView, k: NDArray[np.integer], exponent: Floats | None = None) -> Floats:
    """What is known of pixels when they are resolved.

    Args:
        view: What the bins say of it.
        k: int [P], core fragments.
        exponent: float64 [N], that the tail's weights are made with; None: the bins'.

    Returns:
        float64 [P, 9]: linear colour and transmittance of the core, transmittance of the tail, sum of its weights and
        of its weighted colours.
    """
    dump = view.dump
    exponents = view.exponent if exponent is None else exponent
    weights = dump.rgba[:, 3] / 255.0 * np.exp(-np.minimum(exponents, MAX_EXPONENT))
    out = np.zeros((dump.pixels, 9))
    _resolve(dump.offsets, dump.rgba, weights, np.square(np.arange(256) / 255.0), k.astype(np.int64), out)
    return out


def known_of(view: BinnedView, k: NDArray[np.integer], found: Floats) -> NDArray[np.float32]:
    """What a pixel's correction reads, float32 [P, 7]: no more than a pixel has when it is resolved.

    Args:
        view: What the bins say of it.
        k: int [P], core fragments.
        found: Of `resolved`.
    """
    dump, grey = view.dump, np.full(3, 1.0 / 3.0)
    core, through, behind, weight = found[:, :3] @ grey, found[:, 3], found[:, 4], found[:, 5]
    mean = found[:, 6:] @ grey / np.maximum(weight, 1e-30)
    least = np.exp(-MAX_EXPONENT)
    columns = (
        np.log1p(-np.log(np.maximum(behind, least))),
        np.log1p(-np.log(np.maximum(through, least))),
        np.log1p(k),
        np.log1p(dump.counts),
        # 0 if the exponents were exact: both are what is seen of the tail.
        np.clip(np.log(np.maximum(weight, 1e-30) / np.maximum(through * (1.0 - behind), 1e-30)), -4.0, 4.0),
        mean - decode_gamma2(dump.background) @ grey,
        mean - core / np.maximum(1.0 - through, 1e-6),
    )
    return np.stack(columns, axis=1).astype(np.float32)


def corrected_exponents(view: BinnedView, corrections: Corrections) -> Floats:
    """Exponents of all fragments after their correction, float64 [N]."""
    return np.maximum(view.exponent + _answer(corrections, view.around), 0.0)


def corrected_errors(view: BinnedView, k: NDArray[np.integer], corrections: Corrections | None) -> Floats:
    """Squared errors of pixels whose tails have a corrected coverage, float64 [P], in display space.

    Args:
        view: What the bins say of it.
        k: int [P], core fragments.
        corrections: The network; None: no correction.
    """
    found, dump = resolved(view, k), view.dump
    exact = linear_to_srgb(_shown(resolved(view, dump.counts), dump))
    if corrections is not None:
        change = np.clip(_answer(corrections, known_of(view, k, found)), -2.0, 2.0)
        tails = dump.counts - k > 1  # the last one alone shows what it is
        found[tails, 4] **= np.exp(change[tails])
    return np.asarray(np.square(linear_to_srgb(_shown(found, dump)) - exact).sum(axis=1))


def fitted(kind: Kind, views: Sequence[Pixels], seed: int) -> Corrections:
    """A network that makes the logarithm of the views' mean squared errors least.

    Args:
        kind: What it corrects.
        views: What it is fitted to.
        seed: Of its first weights and of the batches.
    """
    inputs = np.concatenate([view.around if kind == "exponents" else view.known for view in views])
    mean, std = inputs.mean(axis=0, dtype=np.float64), np.maximum(inputs.std(axis=0, dtype=np.float64), 1e-3)
    torch.manual_seed(seed)
    hidden, last = nn.Linear(INPUTS[kind], UNITS), nn.Linear(UNITS, 1)
    with torch.no_grad():
        last.weight.zero_()  # the first step is taken from the tail as it is
        last.bias.zero_()
    moved, scaled = (torch.from_numpy(x.astype(np.float32)) for x in (mean, 1.0 / std))

    def answer(x: Tensor) -> Tensor:
        found: Tensor = last(torch.relu(hidden((x - moved) * scaled)))[:, 0]
        return found

    optimiser, rng = Adam([*hidden.parameters(), *last.parameters()]), np.random.default_rng(seed)
    for step in range(STEPS):
        drawn = rng.choice(len(views), size=min(BATCH, len(views)), replace=False)
        loss = torch.stack([_log_error(kind, views[i], answer) for i in drawn]).mean()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step(LR * 0.5 * (1.0 + np.cos(np.pi * step / STEPS)))
    weight, bias = (x.detach().numpy().astype(np.float64) for x in (hidden.weight, hidden.bias))
    folded = (weight / std).astype(np.float32), (bias - weight @ (mean / std)).astype(np.float32)
    return folded, (last.weight.detach().numpy().copy(), last.bias.detach().numpy().copy())


def _log_error(kind: Kind, view: Pixels, answer: Callable[[Tensor], Tensor]) -> Tensor:
    """Logarithm of a view's mean squared error under a correction."""
    t = {name: torch.from_numpy(getattr(view, name)) for name in Pixels.__dataclass_fields__}
    exponent, behind = t["exponent"], t["behind"]
    if kind == "exponents":
        exponent = torch.clamp(exponent + answer(t["around"]), 0.0, MAX_EXPONENT)
    else:
        behind = torch.clamp(behind, min=1e-30) ** torch.exp(torch.clamp(answer(t["known"]), -2.0, 2.0))
    weight = t["alpha"] * torch.exp(-exponent)
    weighted = weight[:, None] * torch.cat([torch.ones_like(weight)[:, None], t["rgb"]], dim=1)
    sums = torch.zeros(len(behind), 4).index_add(0, t["pixel"], weighted)
    mean = sums[:, 1:] / torch.clamp(sums[:, :1], min=1e-30)
    tail = (1.0 - behind[:, None]) * mean + behind[:, None] * t["background"]
    wrong = torch.square(_display(t["core"] + t["through"][:, None] * tail) - t["exact"]).sum(dim=1)
    return torch.log((t["share"] * wrong).sum() + LOSSLESS_MSE)


def _display(linear: Tensor) -> Tensor:
    """Encode as sRGB (IEC 61966-2-1), with a gradient everywhere."""
    c = torch.clamp(linear, 1e-7, 1.0)
    return torch.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055)


def _shown(found: Floats, dump: FragmentDump) -> Floats:
    """Linear colours of what `resolved` gives, float64 [P, 3]."""
    through, behind, weight = found[:, 3:4], found[:, 4:5], np.maximum(found[:, 5:6], 1e-30)
    tail = (1.0 - behind) * found[:, 6:] / weight + behind * decode_gamma2(dump.background)
    return np.asarray(found[:, :3] + through * tail)


def _answer(corrections: Corrections, inputs: NDArray[np.float32]) -> Floats:
    (weight, bias), (last, offset) = corrections
    return np.asarray((np.maximum(inputs @ weight.T + bias, 0.0) @ last.T + offset)[:, 0], dtype=np.float64)


@njit(parallel=True, cache=True, error_model="numpy")
def _look_around(
    offsets: Offsets,
    rgba: Bytes,
    depth: Depths,
    optical: Floats,
    bins: int,
    exponent: Floats,
    around: NDArray[np.float32],
) -> None:
    for p in prange(len(offsets) - 1):
        first, last = offsets[p], offsets[p + 1]
        if first == last:
            continue
        total, front = 0.0, np.empty(bins + 1)
        for i in range(first, last):
            total += optical[rgba[i, 3]]
        units_in_front(depth[first:last], rgba[first:last], front)
        units = front[bins]
        for j in range(bins + 1):
            front[j] = total * kept_share(front[j], units)
        nearest, extent = depth[first], depth[last - 1] - depth[first]
        for i in range(first, last):
            place = place_of(depth[i], nearest, extent, bins)
            b = min(int(place), bins - 1)
            own, inside = optical[rgba[i, 3]], place - b
            others = max(front[b + 1] - front[b] - own, 0.0)
            exponent[i] = front[b] + others * inside
            around[i, 0] = np.log1p(total)
            around[i, 1] = np.log1p(front[b])
            around[i, 2] = np.log1p(others)
            around[i, 3] = np.log1p(front[b] - front[max(b - 1, 0)])
            around[i, 4] = np.log1p(front[min(b + 2, bins)] - front[b + 1])
            around[i, 5] = inside
            around[i, 6] = own
            around[i, 7] = others * inside / (1.0 + others)


@njit(parallel=True, cache=True, error_model="numpy")
def _resolve(
    offsets: Offsets, rgba: Bytes, weights: Floats, decode: Floats, kept: NDArray[np.int64], out: Floats
) -> None:
    for p in prange(len(offsets) - 1):
        core = min(offsets[p] + kept[p], offsets[p + 1])
        through, behind = 1.0, 1.0
        for i in range(offsets[p], offsets[p + 1]):
            alpha = rgba[i, 3] / 255.0
            if i < core:
                for c in range(3):
                    out[p, c] += through * alpha * decode[rgba[i, c]]
                through *= 1.0 - alpha
                continue
            behind *= 1.0 - alpha
            out[p, 5] += weights[i]
            for c in range(3):
                out[p, 6 + c] += weights[i] * decode[rgba[i, c]]
        out[p, 3], out[p, 4] = through, behind
