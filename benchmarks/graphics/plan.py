"""Scenes, techniques and budgets in the order of what they tell: time ends where it ends."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.casting.cases import Case, described_cases
from benchmarks.comparing.scenes import PEELING, SHARED
from evaluation.local_scenes import LocalScene
from evaluation.summary import ORACLE
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP
from renderer.scene import LoadOptions
from renderer.techniques import TECHNIQUES

SIZE = (1920, 1080)
BUDGETS = (1.0, 0.25, 2.0)
"""F / WH of the bounded techniques."""
PLAN: tuple[tuple[str, float | None], ...] = (
    *(("bottles", None), ("marbles", None), ("sponza", 0.33), ("hedge", None), ("fur", None), ("nested_shells", 0.33)),
    *(("brickadia_house", 0.33), ("smoke_plume", None), ("foliage", None), ("two_cylinder_engine", 0.33)),
    *(("turbofan", None), ("jellyfish", None), ("long_hair", None), ("chess_set", 0.33), ("anatomy", None)),
    *(("minecraft_village_caves", 0.33), ("cloudscape", None), ("galaxy", None), ("fountain", None)),
)
"""Scenes, and the opacity of all their surfaces; None: their own."""
FIRST = ("kbuffer-deep", "binned", "sbuffer", "moment", "weighted-blended", "kbuffer", "kbuffer-importance")
"""Techniques that are measured before the others."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A scene to measure.

    Attributes:
        case: Where it is.
        alpha: Opacity of every surface; None: its own.
    """

    case: Case
    alpha: float | None

    def techniques(self) -> list[str]:
        """Names, the most telling first; peeling has no end where scenes are deep."""
        names = [name for name in TECHNIQUES if name != ORACLE and not (self.case.scene in DEEP and name in PEELING)]
        first, last = ([name for name in some if name in names] for some in (FIRST, PEELING))
        return [*first, *(name for name in names if name not in first + last), *last]

    def loaded(self) -> LocalScene:
        """The scene, read."""
        options = LoadOptions(alpha=self.alpha, variants=self.case.variants)
        local = LocalScene(self.case.path, self.case.path, options)
        local.at(None)
        return local


def planned(scenes: Path, samples: Path, only: Collection[str] | None) -> Iterator[Planned]:
    """What is there of the plan, each scene written when it is its turn.

    Args:
        scenes: Folder with a MANIFEST.json and the shared scenes; they are left out where it is missing.
        samples: Folder that the project's own scenes are written to.
        only: Names of scenes; None: all.
    """
    listed = described_cases(scenes) if (scenes / "MANIFEST.json").is_file() else []
    shared = {case.scene: case for case in listed if case.scene in SHARED}
    own = SAMPLES | DEEP
    for name, alpha in PLAN:
        if only is not None and name not in only:
            continue
        if name in own:
            yield Planned(Case(name, own[name](samples)), alpha)
        elif name in shared:
            yield Planned(shared[name], alpha)
