"""What several commands take, checked before any work starts: budget, tail and its steepness, bundle, glass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from schemas.bundle import TailSpec
from schemas.flags import checked
from schemas.glass import DEFAULT_GLASS, GLASS_READINGS, GlassReading
from schemas.limits import LIMITS
from schemas.options import Options
from schemas.problem import ExitCode, Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, DENSITY_G, TAIL_NAMES, TailName

Name = TypeVar("Name", bound=str)


def check_budget(budget: float, option: str, size: tuple[int, int] | None = None) -> None:
    """Refuse a budget that no picture can have.

    Args:
        budget: F as a multiple of width * height.
        option: How it is given, with an example.
        size: Width and height of the smallest picture, pixels; None: not known yet.

    Raises:
        Problem: It is no number above 0, more than any picture may have, or less than one fragment of this one.
    """
    if not (math.isfinite(budget) and 0.0 < budget <= LIMITS.budget):
        raise Problem(
            f"A budget of {budget:g} cannot be used.",
            f"Budgets are multiples of width x height, above 0 and at most {LIMITS.budget:g}: {option}.",
        )
    if size is not None and budget * size[0] * size[1] < 1.0:
        # A hundredth more, so that the number is enough when it is rounded too.
        least = 1.01 / (size[0] * size[1])
        raise Problem(
            f"A budget of {budget:g} is less than one fragment of a picture of {size[0]}x{size[1]} pixels.",
            f"Budgets are multiples of width x height, here {least:.3g} or more: {option}.",
        )


def check_steepness(g: float | None, *, has_bundle: bool, is_tail_named: bool, option: str = "--tail") -> None:
    """Refuse a steepness that would not be that of the tail which is rendered: a bundle has a tail of its own.

    Args:
        g: As asked for; None: not asked for.
        has_bundle: Whether there is a bundle.
        is_tail_named: Whether a tail was asked for, which then takes the place of the bundle's.
        option: Where a tail is given.

    Raises:
        Problem: It is out of range, or says nothing about the bundle's tail.
    """
    if g is None:
        return
    checked(Options, {"g": g})
    if has_bundle and not is_tail_named:
        raise Problem(
            f"--g {g:g} is the steepness of a tail, and none is named: the bundle brings its own, with its own g.",
            f"Leave out --g, or name the tail as well: {option} density --g {g:g}.",
        )


@dataclass(frozen=True, slots=True)
class ChosenTail:
    """A tail to render with; unlike a bundle's, it may be any.

    Attributes:
        name: Of the tail.
        g: The density tail's constant.
    """

    name: TailName
    g: float


def chosen_tail(tail: TailName | None, g: float | None, trained: TailSpec | None) -> ChosenTail:
    """What is rendered: a tail that is asked for, else the one that a network was trained with, else the usual one.

    Args:
        tail: Asked for; None: not.
        g: Its steepness, asked for; None: that of the network, if it was trained with this tail, else the usual one.
        trained: Tail of the network; None: there is none.
    """
    name = tail or (DEFAULT_TAIL if trained is None else trained.name)
    usual = trained.g if trained is not None and trained.name == name else DENSITY_G
    return ChosenTail(name, usual if g is None else g)


def check_trained_tail(tail: TailName | None, trained: TailSpec | None) -> None:
    """Refuse to render a bundle with another tail than its own.

    Args:
        tail: Asked for; None: not.
        trained: Tail of the bundle that is rendered; None: none is.

    Raises:
        Problem: They differ.
    """
    if tail is None or trained is None or tail == trained.name:
        return
    train = f", or train a bundle with `diaphane build --tail {tail}`" if tail in BINNED_TAILS else ""
    raise Problem(
        f"The bundle was trained with the tail {trained.name}, and cannot be rendered with {tail}.",
        f"Leave out --tail or the techniques that need a bundle{train}.",
    )


def check_bundle(reference: str | None, option: str) -> None:
    """Refuse an empty name of a bundle, which as a path is the working folder, and a path where no folder is.

    Args:
        reference: A folder, or NAME@ALIAS; None: not given.
        option: Where it was given.

    Raises:
        Problem: It is neither.
    """
    if reference is None:
        return
    if not reference.strip():
        raise Problem(f"{option} is empty.", f"Name a folder, or a bundle of the registry: {option} glass@champion.")
    path = Path(reference)
    if len(path.parts) > 1 or path.exists() or reference.startswith((".", "~")):
        _check_folder(path, option)


def _check_folder(path: Path, option: str) -> None:
    if path.is_dir():
        return
    if path.exists():
        raise Problem(f"{option} {path} is a file, not the folder of a bundle.", "Name the folder that it is in.")
    raise Problem(
        f"{option}: there is no folder {path}.",
        f"Check the path, or name a bundle of the registry: {option} glass@champion.",
        ExitCode.NOT_FOUND,
    )


def parse_tail(text: str, option: str = "--tail") -> TailName:
    """The tail of that name.

    Args:
        text: The name.
        option: Where it was given.

    Raises:
        Problem: There is none.
    """
    return _named(text, TAIL_NAMES, "There is no tail", f"{option} {DEFAULT_TAIL}")


def parse_glass(text: str) -> GlassReading:
    """The reading of glass of that name.

    Raises:
        Problem: There is none.
    """
    return _named(text, GLASS_READINGS, "There is no reading of glass", f"--glass {DEFAULT_GLASS}")


def _named(text: str, names: Sequence[Name], refusal: str, example: str) -> Name:
    for name in names:
        if name == text:
            return name
    raise Problem(f"{refusal} '{text}'.", f"Use one of {', '.join(names)}: {example}.")
