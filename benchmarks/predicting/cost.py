"""What a way to allocate costs a pixel, and the budget that it leaves of a given memory."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

from renderer.features import FEATURES, texels_of
from renderer.frame import NEAREST, Gathered, front_bytes
from renderer.techniques.chain import RANGE_BYTES, SLOT_BYTES, chain_bytes
from renderer.techniques.kbuffer_deep import before_bytes
from schemas.tail import DENSITY_BINS, TailName
from trainer.weights import Weights

FIXED_BYTES: Final = 64
"""Beside its pool, what a fixed k-buffer with the `density` tail needs a pixel: the memory that all are given."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a pixel costs, the pool of fragments aside.

    Attributes:
        weights: Numbers of the network.
        multiply_adds: Of one run of it.
        feature_bytes: What it reads of a pixel beside n and the depth range, while that is gathered.
        gather_bytes: All that is alive while sums are gathered and the network runs. There is no pool yet.
        capture_bytes: All that is alive while fragments are captured.
    """

    weights: int
    multiply_adds: int
    feature_bytes: int
    gather_bytes: int
    capture_bytes: int

    def budget(self, total: int, pixels: int) -> int | None:
        """Fragments that fit into so many bytes together with everything else, F; None: not even the gather pass fits.

        What is alive is `max(capture, gather - 8 F / pixels) + 8 F / pixels` a pixel: sums are dead before the first
        fragment is captured, so they may lie where the pool will be.
        """
        if max(self.gather_bytes, self.capture_bytes) * pixels > total:
            return None
        return (total - self.capture_bytes * pixels) // SLOT_BYTES


def memory_of(multiple: int, pixels: int) -> int:
    """M, bytes: a pool of `multiple` slots a pixel, and what fixed k needs beside it."""
    return (SLOT_BYTES * multiple + FIXED_BYTES) * pixels


def network_cost(weights: Weights, tail: TailName, block: int = 1) -> Cost:
    """Of `kbuffer-deep` with a network.

    Args:
        weights: The network; features that are not in `renderer.features.FEATURES` cost nothing to gather: n and
            depths are there anyway.
        tail: That the frame uses.
        block: Pixels across a block that has one pixel's sums (`benchmarks.predicting.inputs.stand_ins`).
    """
    bins = DENSITY_BINS.get(tail, 0)
    names = [name for name in weights.features if name in FEATURES]
    read = texels_of(names, binned=bool(bins)) | (frozenset() if bins else {0})
    gathered = _gathered(read, bins, block=block)
    return Cost(
        weights=sum(weight.size + bias.size for weight, bias in weights.layers),
        multiply_adds=sum(weight.size for weight, _ in weights.layers),
        feature_bytes=gathered.pass_bytes,
        gather_bytes=before_bytes(gathered),
        capture_bytes=_chain(tail),
    )


def rule_cost(tail: TailName, nearest: bool) -> Cost:
    """Of a rule without a network: the tail's own sums only.

    Args:
        tail: That the frame uses.
        nearest: Whether the rule reads the nearest fragment.
    """
    features = _tail_sums(tail, frozenset({NEAREST}) if nearest else frozenset()).pass_bytes
    return Cost(0, 0, features, RANGE_BYTES + features, _chain(tail))


def gather_costs(tail: TailName) -> list[int]:
    """Bytes a pixel until fragments are captured, for more and more texels: what decides them is the renderer."""
    bins = DENSITY_BINS.get(tail, 0)
    return [before_bytes(_gathered(frozenset(range(texels)), bins)) for texels in range(NEAREST + 2)]


def _chain(tail: TailName) -> int:
    """Bytes a pixel while fragments are captured: what the tail reads stays."""
    return chain_bytes(_tail_sums(tail, frozenset()), tail)


def _tail_sums(tail: TailName, others: frozenset[int]) -> Gathered:
    own = frozenset({0}) if tail == "density" else frozenset()
    return _gathered(own | others, DENSITY_BINS.get(tail, 0), is_facing=NEAREST in others)


@dataclass
class _Coarse(Gathered):
    """A gather pass of whose sums and nearest fragments there is one for a block of pixels; bins have every pixel."""

    block: int = 1

    @property
    def pixel_bytes(self) -> int:
        """Bytes a pixel of all this, rounded up."""
        kept = front_bytes(self.bins)
        return kept + math.ceil((super().pixel_bytes - kept) / self.block**2)


def _gathered(texels: Set[int], bins: int, is_facing: bool = False, block: int = 1) -> Gathered:
    """What a gather pass of these texels leaves, as far as its size goes: nothing of it is on a GPU."""
    stand_in: Any = SimpleNamespace
    sums = [stand_in(glo=texel, dtype="f2" if bins else "f4") for texel in texels if texel < NEAREST]
    nearest = stand_in() if NEAREST in texels else None
    return _Coarse("gather", sums, nearest, stand_in() if is_facing else None, bins=bins, block=block)
