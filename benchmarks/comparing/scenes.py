"""Scenes, opacities and sizes of the suite, and in which parts they are measured."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from benchmarks.casting.cases import Case, described_cases
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP

SHARED = ("sponza", "two_cylinder_engine", "minecraft_village_caves", "chess_set", "brickadia_house")
ALPHAS: tuple[float | None, ...] = (None, 0.33)
"""The materials' own, and DHOIT's constant."""
SIZES = ((1430, 960),)
BUNDLE = Path(__file__).resolve().parents[1] / "bundle"
"""What `benchmarks.comparing.bundle` made: it was trained on none of these scenes."""
PARTS = (len(SHARED) + len(SAMPLES)) * len(ALPHAS) * len(SIZES) + len(DEEP)
"""Of the whole suite, with those that are opaque as authored."""
GROUPS = {"shared": SHARED, "samples": tuple(SAMPLES), "deep": tuple(DEEP)}
"""Names for several scenes. Those of `deep` are measured as authored, at the first size: that is what they are for."""
PEELING = ("depth-peeling", "dual-depth-peeling")
"""Techniques that draw a scene as often as its deepest pixel has fragments: hours, where the deep scenes are meant."""
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

    def measures(self, technique: str) -> bool:
        """Whether a technique can be measured on it in less than hours."""
        return self.case.scene not in DEEP or technique not in PEELING


def selected(names: Sequence[str]) -> set[str]:
    """Scenes by their names or by those of their groups."""
    return {scene for name in names for scene in GROUPS.get(name, (name,))}


def cases_of(folder: Path, samples: Path, only: Collection[str] | None = None) -> list[Case]:
    """The suite's scenes that are there.

    Args:
        folder: With a MANIFEST.json and the shared scenes; they are left out where it is missing.
        samples: Folder that the project's own scenes are written to.
        only: Names of scenes; None: all.
    """
    listed = described_cases(folder) if (folder / "MANIFEST.json").is_file() else []
    shared = {case.scene: case for case in listed if case.scene in SHARED}
    own = {name: write for name, write in (SAMPLES | DEEP).items() if only is None or name in only}
    return [shared[name] for name in SHARED if name in shared and (only is None or name in only)] + [
        Case(name, write(samples)) for name, write in own.items()
    ]


def parts_of(
    cases: Sequence[Case], alphas: Sequence[float | None] = ALPHAS, sizes: Sequence[tuple[int, int]] = SIZES
) -> Iterator[Part]:
    """Every scene at the first opacity and size, the deep ones, then the rest: the most telling results come first."""
    deep = [case for case in cases if case.scene in DEEP]
    usual = [case for case in cases if case.scene not in DEEP]
    for number, (size, alpha) in enumerate(product(sizes, alphas)):
        is_first = (alpha, size) == (ALPHAS[0], SIZES[0])
        for case in usual:
            yield Part(case, alpha, size, PATH_FRAMES if is_first else 0)
        if number == 0:
            for case in deep:
                yield Part(case, None, size, 0)
