"""Scenes, opacities and sizes of the suite, and in which parts they are measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.casting.cases import Case, described_cases
from renderer.samples import SAMPLES

SHARED = ("sponza", "two_cylinder_engine", "minecraft_village_caves", "chess_set", "brickadia_house")
ALPHAS: tuple[float | None, ...] = (0.33, 0.15, None)
"""The papers' constants (DHOIT .33, DFA .15), and the materials' own. The first is that of the page's tables."""
SIZES = ((1430, 960), (1920, 1080))
BUNDLE = Path(__file__).resolve().parents[1] / "bundle"
"""What `benchmarks.comparing.bundle` made: it was trained on none of these scenes."""
PARTS = (len(SHARED) + len(SAMPLES)) * len(ALPHAS) * len(SIZES)
"""Of the whole suite, with those that are opaque as authored."""
PATH_FRAMES = 3
"""Of the camera path, at the suite's first opacity and size: flicker costs as much as everything else there."""


@dataclass(frozen=True, slots=True)
class Part:
    """What is measured in one go; parts can be measured one by one.

    Attributes:
        case: The scene.
        alpha: Opacity of every surface; None: its own.
        size: Pixels per row, rows.
        path: Frames of the camera path, or 0.
    """

    case: Case
    alpha: float | None
    size: tuple[int, int]
    path: int


def cases_of(folder: Path, samples: Path) -> list[Case]:
    """The suite's scenes that are there.

    Args:
        folder: With a MANIFEST.json and the shared scenes; they are left out where it is missing.
        samples: Folder that the project's own scenes are written to.
    """
    listed = described_cases(folder) if (folder / "MANIFEST.json").is_file() else []
    shared = {case.scene: case for case in listed if case.scene in SHARED}
    return [shared[name] for name in SHARED if name in shared] + [
        Case(name, write(samples)) for name, write in SAMPLES.items()
    ]


def parts_of(
    cases: Sequence[Case], alphas: Sequence[float | None] = ALPHAS, sizes: Sequence[tuple[int, int]] = SIZES
) -> Iterator[Part]:
    """Every scene at the first opacity and size, then the rest: the most telling results come first."""
    for size in sizes:
        for alpha in alphas:
            for case in cases:
                is_first = (alpha, size) == (ALPHAS[0], SIZES[0])
                yield Part(case, alpha, size, PATH_FRAMES if is_first else 0)
