"""What a user can ask `diaphane bench` for, checked before any work starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from evaluation.choices import check_budget, check_bundle, check_steepness, parse_tail
from renderer.techniques import TECHNIQUES, Needs, technique
from schemas.bench import CellKey
from schemas.flags import parse_size
from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import TailName
from schemas.work import Device

AUTHORED = "authored"
"""The word for the materials' own opacity."""
DEFAULT_SIZE = (1430, 960)
"""DHOIT's."""
MOST_FRAMES = 1000
MOST_REPEATS = 1000


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What to measure.

    Attributes:
        scenes: Files.
        techniques: Names, see `evaluation.render_options.parse_techniques`.
        out: Folder of the results.
        budgets: F as multiples of width * height; None: for each scene and opacity what its views call for
            (`labeller.budgets`).
        alphas: Opacities that every surface gets, one run each; None: the materials' own.
        glass: How surfaces that transmit light are read.
        sizes: Widths and heights, one run each.
        tails: Of the bounded techniques; those that need a bundle always have its tail. Empty: the usual one.
        g: Steepness of the density tail of those that are named; None: see `evaluation.choices.chosen_tail`.
        bundle: Folder of a bundle, or a name in the registry, for the techniques that need one.
        needs: What else some techniques need.
        camera: Name or path of a camera.
        views: A views file.
        most_views: Most views of a scene, spread over those that the file lists; None: all.
        variants: Selections, see `renderer.scene.LoadOptions`.
        refine: Levels of subdivision.
        equal_memory: Whether bounded techniques are also measured at equal total bytes.
        path: Frames of the camera path that flicker is measured on; 0: none.
        repeats: Timed frames of each cell, after a warm-up.
        account: Whether a frame of each cell is counted (`renderer.account`).
        closer: The budget, of those above, whose cells alone are counted and followed along the path, beside those
            without a budget: each costs as much as timing does. None: all.
        device: What bounds of frame times are stated for.
        limit: Seconds that the repeats of one cell may take; what takes longer by itself is timed once.
        resume: Whether cells that were measured into `out` already are kept.

    Raises:
        Problem: Something of it cannot be.
    """

    scenes: tuple[Path, ...]
    techniques: tuple[str, ...]
    out: Path
    budgets: tuple[float, ...] | None = None
    alphas: tuple[float | None, ...] = (None,)
    glass: GlassReading = DEFAULT_GLASS
    sizes: tuple[tuple[int, int], ...] = (DEFAULT_SIZE,)
    tails: tuple[TailName, ...] = ()
    g: float | None = None
    bundle: str | None = None
    needs: Needs = field(default_factory=Needs)
    camera: str | None = None
    views: Path | None = None
    most_views: int | None = None
    variants: tuple[str, ...] = ()
    refine: int = 0
    equal_memory: bool = True
    path: int = 0
    repeats: int = 3
    account: bool = True
    closer: float | None = None
    device: Device = field(default_factory=Device)
    limit: float = 10.0
    resume: bool = True

    def is_closer(self, key: CellKey) -> bool:
        """Whether a cell is counted and followed along the path."""
        return self.closer is None or key.budget_factor in (None, self.closer)

    def __post_init__(self) -> None:
        for scene in self.scenes:
            if not scene.is_file():
                raise Problem(f"There is no scene {scene}.", "Check the path.", ExitCode.NOT_FOUND)
        names = [scene.stem for scene in self.scenes]
        for name in names:
            if names.count(name) > 1:
                raise Problem(f"{names.count(name)} scenes are called {name}.", "Give each file a name of its own.")
        if self.budgets is not None and not 1 <= len(self.budgets) <= LIMITS.budgets:
            raise Problem(f"{len(self.budgets)} budgets are not possible.", f"Give 1 to {LIMITS.budgets}.")
        for side in (side for size in self.sizes for side in size):
            if not LIMITS.min_side <= side <= LIMITS.max_side:
                raise Problem(
                    f"{side} pixels are no side of a picture here.",
                    f"Give {LIMITS.min_side} to {LIMITS.max_side} pixels.",
                )
        for width, height in self.sizes:
            if width * height > LIMITS.pixels:
                raise Problem(f"--size {width}x{height} is too large.", f"Give at most {LIMITS.pixels:,} pixels.")
        smallest = min(self.sizes, key=lambda size: size[0] * size[1])
        for budget in self.budgets or ():
            check_budget(budget, "--budgets .5,1,2", smallest)
        _in_range("--repeats", self.repeats, 1, MOST_REPEATS)
        _in_range("--most-views", self.most_views, 1, LIMITS.views)
        if self.path:
            _in_range("--path", self.path, 2, MOST_FRAMES)
        if not (math.isfinite(self.limit) and self.limit > 0.0):
            raise Problem(f"--limit {self.limit} is no time.", "Give seconds, above 0.")
        check_bundle(self.bundle, "--bundle")
        check_steepness(self.g, has_bundle=self.bundle is not None, is_tail_named=bool(self.tails), option="--tails")
        for name in self.techniques:
            if TECHNIQUES[name].needs_bundle and self.bundle is None:
                raise Problem(f"{name} needs a bundle.", "Name one with --bundle, or leave the technique out.")
            if TECHNIQUES[name].family == "approximate":
                technique(name, self.needs)  # refuses nodes and samples that it cannot work with

    @property
    def factors(self) -> tuple[float, ...]:
        """The budgets, once they are decided."""
        assert self.budgets is not None, "budgets are decided once the views are counted"
        return self.budgets


def parse_budgets(text: str) -> tuple[float, ...]:
    """Multiples of width * height, ascending, without duplicates.

    Args:
        text: Numbers with commas between.

    Raises:
        Problem: It has something else.
    """
    return tuple(sorted({_number(part, "--budgets", ".5,1,2") for part in _parts(text, "--budgets", ".5,1,2")}))


def parse_alphas(text: str | None) -> tuple[float | None, ...]:
    """Opacities of all surfaces; None stands for the materials' own.

    Args:
        text: Numbers and the word `authored`, with commas between; None: authored.

    Raises:
        Problem: It has something else, or a number outside (0, 1].
    """
    found: list[float | None] = []
    for part in _parts(text if text is not None else AUTHORED, "--alpha", ".15,.33,authored"):
        alpha = None if part == AUTHORED else _number(part, "--alpha", ".15,.33,authored")
        if alpha is not None and not 0.0 < alpha <= 1.0:
            raise Problem(f"An alpha of {alpha:g} is not possible.", "Give a number above 0 and at most 1.")
        found.append(alpha)
    return tuple(dict.fromkeys(found))


def parse_sizes(text: str) -> tuple[tuple[int, int], ...]:
    """Sizes of pictures.

    Args:
        text: WIDTHxHEIGHT, several with commas between.

    Raises:
        Problem: It has something else.
    """
    return tuple(dict.fromkeys(parse_size(part) for part in _parts(text, "--size", "1430x960,1920x1080")))


def parse_tails(text: str) -> tuple[TailName, ...]:
    """Tails.

    Args:
        text: Names with commas between.

    Raises:
        Problem: There is no such tail.
    """
    return tuple(
        dict.fromkeys(parse_tail(part, "--tails") for part in _parts(text, "--tails", "density,exact-coverage"))
    )


def _parts(text: str, option: str, example: str) -> Sequence[str]:
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if not parts:
        raise Problem(f"{option} is empty.", f"Write it like {option} {example}.")
    return parts


def _number(part: str, option: str, example: str) -> float:
    try:
        return float(part)
    except ValueError:
        raise Problem(f"{option} has '{part}', which is no number.", f"Write it like {option} {example}.") from None


def _in_range(option: str, value: int | None, low: int, high: int) -> None:
    if value is not None and not low <= value <= high:
        raise Problem(f"{option} {value} cannot be used.", f"Give a number from {low} to {high}.")
