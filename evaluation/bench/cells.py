"""Which cells a view has, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.bench.options import BenchOptions
from evaluation.choices import chosen_tail
from renderer.techniques import TECHNIQUES
from renderer.techniques.chain import SLOT_BYTES
from schemas.bench import Basis, CellKey
from schemas.bundle import TailSpec, load_manifest, network_digest
from schemas.tail import DEFAULT_TAIL, TAILS, TailKind, TailName

FIXED = "kbuffer"
"""Whose total bytes are what the others are given at equal memory."""


@dataclass(frozen=True, slots=True)
class Bundle:
    """The bundle under test.

    Attributes:
        folder: Where it lies.
        label: Name and digest of its network: a model card says what was measured under this label.
        tail: Tail that it was trained for, and is rendered with.
    """

    folder: Path
    label: str
    tail: TailSpec


def bundle_of(folder: Path) -> Bundle:
    """A bundle, verified.

    Raises:
        Problem: It is none, or damaged.
    """
    manifest = load_manifest(folder)
    network = network_digest({name: file.sha256 for name, file in manifest.files.items()})
    return Bundle(folder, f"{manifest.name}@{network[:12]}", manifest.tail)


def planned(options: BenchOptions, bundle: Bundle | None) -> list[CellKey]:
    """All cells of a view."""
    cells = []
    for name in options.techniques:
        if TECHNIQUES[name].family != "bounded":
            cells.append(CellKey(technique=name, basis="none"))
            continue
        for tail, g, label in _tails(name, options, bundle):
            cells += [
                CellKey(technique=name, basis=basis, budget_factor=factor, tail=tail, g=g, bundle=label)
                for factor in options.factors
                for basis in _bases(options, factor)
            ]
    return cells


def _bases(options: BenchOptions, factor: float) -> Sequence[Basis]:
    """What budgets are equal in; the fixed k-buffer, whose memory the others get, has at least one slot a pixel."""
    return ("fragments", "memory") if options.equal_memory and factor >= 1.0 else ("fragments",)


def _tails(name: str, options: BenchOptions, bundle: Bundle | None) -> list[tuple[TailName, float | None, str | None]]:
    if TECHNIQUES[name].needs_bundle and bundle is not None:
        return [(bundle.tail.name, steepness(bundle.tail.name, bundle.tail.g), bundle.label)]
    trained = None if bundle is None else bundle.tail
    chosen = [chosen_tail(tail, options.g, trained) for tail in options.tails or (DEFAULT_TAIL,)]
    return [(tail.name, steepness(tail.name, tail.g), None) for tail in chosen]


def steepness(tail: TailName, g: float) -> float | None:
    """The g of a tail that has one; None for the others."""
    return g if TAILS[tail].kind == TailKind.DENSITY else None


def fragments_within(total_bytes: int, pixels: int, pixel_bytes: int, early_bytes: int = 0) -> int:
    """F that a total memory buys: `F(M) = floor((M - |P| S_p) / S_f)` (DHOIT, Eq. 1; all of S_i is in S_p).

    Args:
        total_bytes: M.
        pixels: |P|.
        pixel_bytes: S_p, bytes per pixel of everything beside the pool.
        early_bytes: Bytes a pixel before there is a pool; they have to fit as well, and may lie where it will be.

    Returns:
        Fragments; negative where the buffers of the pixels alone take more.
    """
    if pixels * early_bytes > total_bytes:
        return -1
    return (total_bytes - pixels * pixel_bytes) // SLOT_BYTES
