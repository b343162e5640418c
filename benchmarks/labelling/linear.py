"""How time and memory grow with N: one view at several resolutions, then many views as bands of one tall picture."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.labelling.child import Cost, Rule, cost
from benchmarks.labelling.stored import store
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.tile_range import tile_grid, tile_ranges
from renderer.views import sampled_views
from schemas.fragments import FragmentDump
from schemas.tail import RANGE_TILE
from schemas.view import View

_SEED = 5
_BANDS: Final = 4
"""Of each view."""
_EXPONENT_FROM: Final = 1e6
"""N from which on the exponent is fitted; below, what does not depend on N can be seen."""


@dataclass(frozen=True, slots=True)
class Extent:
    """What growth is measured on.

    Attributes:
        scales: Of width and height.
        tall: Fragments that the pictures in bands shall have at least; their bands are views around the scene.
        rules: Rules.
    """

    scales: tuple[float, ...]
    tall: tuple[int, ...]
    rules: tuple[Rule, ...]


WHOLE: Final = Extent(
    (0.042, 0.07, 0.125, 0.22, 0.4, 0.7, 1.0, 2.0),
    (1_000_000, 6_000_000, 25_000_000, 100_000_000),
    ("optimal", "greedy"),
)
"""N from 1e4 to 2.5e7 in one piece, and to 1e8 in bands."""
QUICK: Final = Extent((0.5,), (1000,), ("optimal",))


def growth(gpu: GpuScene, view: View, size: tuple[int, int], extent: Extent, rounds: int) -> Iterator[Cost]:
    """Costs by rising N, each in a process of its own.

    Args:
        gpu: A scene.
        view: The camera of what is labelled in one piece.
        size: Pixels per row and rows at scale 1, and of the views that are cut into bands.
        extent: What is labelled.
        rounds: How often.
    """
    for scale in extent.scales:
        with tempfile.TemporaryDirectory(prefix="diaphane-labeller-") as folder:
            width, height = (max(1, round(scale * side)) for side in size)
            stored = store(capture(Frame(gpu, view, width, height)).dump, Path(folder) / "view")
            for rule in extent.rules:
                yield cost([stored], rule, rounds, banded=False)
    with tempfile.TemporaryDirectory(prefix="diaphane-labeller-") as folder:
        bands: list[Path] = []
        have, around = 0, _around(gpu, view, size)
        for wanted in sorted(extent.tall):
            while have < wanted:
                band = next(around)
                have += band.total
                bands.append(store(band, Path(folder) / str(len(bands))))
            for rule in extent.rules:
                yield cost(bands, rule, max(1, rounds // 2), banded=True)


def _around(gpu: GpuScene, view: View, size: tuple[int, int]) -> Iterator[FragmentDump]:
    """Row bands of what the camera sees, and then of other views around the scene; without end."""
    yield from row_bands(capture(Frame(gpu, view, *size)).dump, _BANDS)
    done, count = 0, 8
    while True:
        for other in sampled_views(gpu.scene, count, _SEED)[done:]:
            yield from row_bands(capture(Frame(gpu, other, *size)).dump, _BANDS)
        done, count = count, 2 * count


def row_bands(dump: FragmentDump, count: int) -> Iterator[FragmentDump]:
    """A dump in bands of whole rows of tiles, from top to bottom: a pixel keeps its depth bins.

    Args:
        dump: Fragments of a view.
        count: How many bands; fewer, where there are not as many rows of tiles.
    """
    ranges, (columns, tiles) = tile_ranges(dump), tile_grid(dump.width, dump.height)
    ends = sorted({tiles * band // count for band in range(count + 1)})
    for above, below in pairwise(ends):
        first, last = RANGE_TILE * above, min(RANGE_TILE * below, dump.height)
        pixels = slice(first * dump.width, last * dump.width)
        begin, end = dump.offsets[pixels.start], dump.offsets[pixels.stop]
        yield FragmentDump(
            width=dump.width,
            height=last - first,
            offsets=dump.offsets[pixels.start : pixels.stop + 1] - begin,
            rgba=dump.rgba[begin:end],
            depth=dump.depth[begin:end],
            background=dump.background[pixels],
            facing=dump.facing[pixels],
            tile_range=ranges[columns * above : columns * below],
        )


def exponent(costs: Sequence[Cost], least: float = _EXPONENT_FROM) -> float | None:
    """Slope of log time over log N, for N >= `least`; None with fewer than two such points."""
    points = [c for c in costs if c.fragments >= least]
    if len(points) < 2:
        return None
    fragments, seconds = np.array([c.fragments for c in points]), np.array([c.median for c in points])
    return float(np.polyfit(np.log(fragments), np.log(seconds), 1)[0])
