"""Advice in words, and as the table and lists that terminal and pages share."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from typing import Final

from evaluation.advice.rules import shown_instead
from evaluation.looks import title
from evaluation.summary import EXACT, MSE_FLOOR, number
from schemas.advice import Advice, Candidate, Choice, Work

HEADINGS: Final = ("technique", "budget", "MiB", "MSE e-5", "within the memory", "tail", "worst view")
"""Of `table`."""
SIZE_HEADINGS: Final = ("size", "S-buffer, MiB", "advised", "MiB", "MSE e-5")
"""Of `sizes`."""
WORK_HEADINGS: Final = ("technique", "geometry passes", "shaded / pixel", "B / pixel", "atomics / pixel")
"""Of `work_rows`."""
TEXT: Final = ("technique", "tail", "within the memory", "worst view", "size", "advised")
"""Headings of columns that are text."""
ADVISED: Final = "advised"
"""Marks the row of what was chosen."""


@dataclass(frozen=True, slots=True)
class Asked:
    """How a scene was asked about, so that commands ask the same.

    Attributes:
        file: The scene; '' where the commands cannot know it.
        loading: Options that say how it is read.
        views: A views file, or None.
        bundle: A bundle, or None.
    """

    file: str
    loading: tuple[str, ...] = ()
    views: str | None = None
    bundle: str | None = None


def sentences(advice: Advice) -> tuple[str, ...]:
    """What to use and why, the most important first."""
    choice, scene = advice.choice, advice.scene
    if choice.verdict == "nothing":
        return (
            f"Nothing transparent is seen in {_views(advice)}: no technique is needed. --alpha .33 asks what the "
            "scene would need if all its surfaces were transparent.",
        )
    return tuple(text for text in (_verdict(advice), _peeling(advice), _memory(advice), _basis(advice)) if text) + (
        (f"Not measured: {' '.join(scene.left_out)}",) if scene.left_out else ()
    )


def _verdict(advice: Advice) -> str:
    choice = advice.choice
    memory, exact = said_bytes(choice.memory), _exact(advice)
    needs = f"the S-buffer, which is exact, takes {_mib(exact, choice)} MiB" if exact is not None else ""
    if choice.verdict == "exact" and choice.chosen is not None:
        return (
            f"{_loads(advice)} fragments per pixel: use the S-buffer (sbuffer). It is exact and takes "
            f"{_mib(choice.chosen, choice)} MiB of {memory} at {choice.size}. A budget pays above "
            f"{number(choice.pays_above)} fragments per pixel, where the S-buffer does not fit any more."
        )
    if choice.chosen is None:
        least = _least(advice)
        what = "" if least.technique == EXACT else f", and what takes least, {said(least)}, {_mib(least, choice)} MiB"
        return (
            f"{_loads(advice)} fragments per pixel, and nothing that was measured fits {memory} at {choice.size}: "
            f"{needs}{what}. Allow more memory or render fewer pixels."
        )
    return (
        f"{_loads(advice)} fragments per pixel: {needs}, and {memory} at {choice.size} hold "
        f"{number(choice.pays_above)} per pixel. Use {said(choice.chosen)}: {_mib(choice.chosen, choice)} MiB, "
        f"{said_error(choice.chosen.mse)}, the least error that fits.{_ties(choice)}"
    )


def _ties(choice: Choice) -> str:
    if not choice.ties:
        return ""
    told = ", ".join(f"{said(one)} ({_mib(one, choice)} MiB, {said_error(one.mse)})" for one in choice.ties)
    return f" As good within what other views would change, but larger: {told}."


def _peeling(advice: Advice) -> str:
    """Peeling is exact as well: what it takes where the S-buffer does not fit."""
    choice = advice.choice
    found = [one for one in advice.scene.candidates if one.technique == "depth-peeling"]
    most = max((view.most or 0 for view in advice.scene.views), default=0)
    if choice.verdict == "exact" or not found or not most or found[0].bytes_at(choice.size.pixels) > choice.memory:
        return ""
    return (
        f"depth-peeling fits too, exact in {_mib(found[0], choice)} MiB, and draws the transparent geometry "
        f"once for each layer: up to {most} times here."
    )


def _memory(advice: Advice) -> str:
    if len(advice.front) < 2:
        return ""
    told = "; ".join(f"from {_mib(one, advice.choice)} MiB {said(one)}, {said_error(one.mse)}" for one in advice.front)
    return f"By memory at {advice.choice.size}: {told}."


def _basis(advice: Advice) -> str:
    scene = advice.scene
    return (
        f"Measured on {_views(advice)}: fragments counted at {scene.counted}, errors at {scene.measured}; bytes follow "
        "the pixels. MSE: as displayed, geometric mean over the views."
    )


def _views(advice: Advice) -> str:
    count = len(advice.scene.views)
    return f"{count} view{'s' if count > 1 else ''}"


def _loads(advice: Advice) -> str:
    loads = [view.load for view in advice.scene.views]
    low, high = number(min(loads)), number(max(loads))
    return high if low == high else f"{low} to {high}"


def _exact(advice: Advice) -> Candidate | None:
    return next((one for one in advice.scene.candidates if one.technique == EXACT), None)


def said(one: Candidate) -> str:
    """A candidate in words: technique, budget, tail, bundle."""
    if one.technique == EXACT:
        return "the S-buffer (sbuffer)"
    parts = [f"budget {one.budget:g}" if one.budget is not None else "", f"{one.tail} tail" if one.tail else ""]
    parts.append(f"bundle {one.bundle}" if one.bundle else "")
    told = ", ".join(part for part in parts if part)
    return f"{title(one.technique)}, {told}" if told else title(one.technique)


def said_error(mse: float) -> str:
    """An error in words."""
    return "exact" if mse == 0.0 else f"MSE {said_mse(mse)}e-5"


def said_mse(mse: float) -> str:
    """An error times 1e5; `exact` for none, `≤` at the floor."""
    if mse == 0.0:
        return "exact"
    return f"≤ {number(1e5 * MSE_FLOOR)}" if mse <= MSE_FLOOR else number(1e5 * mse)


def said_bytes(count: int) -> str:
    """Bytes in MiB."""
    return f"{number(count / 2**20)} MiB" if count < 2**30 else f"{number(count / 2**30)} GiB"


def _mib(one: Candidate, choice: Choice) -> str:
    return f"{one.bytes_at(choice.size.pixels) / 2**20:.1f}"


def table(advice: Advice) -> list[list[str]]:
    """Rows of `HEADINGS`: every technique once, the advised one marked."""
    choice = advice.choice
    rows = []
    for one in advice.best:
        budget = "–" if one.budget is None else f"{one.budget:g}"
        worst = "–" if one.is_exact else f"{said_mse(max(one.worst, MSE_FLOOR))}, {one.worst_view}"
        measured = _mib(one, choice), said_mse(one.mse), _place(one, choice)
        rows.append([title(one.technique), budget, *measured, one.tail or "–", worst])
    return rows


def _place(one: Candidate, choice: Choice) -> str:
    if one == choice.chosen:
        return ADVISED
    if one in choice.ties:
        return "as good"
    return "fits" if one.bytes_at(choice.size.pixels) <= choice.memory else "no"


def sizes(advice: Advice) -> list[list[str]]:
    """Rows of `SIZE_HEADINGS`: the choice within the same memory at other sizes."""
    exact = _exact(advice)
    rows = []
    for choice in advice.resolutions:
        needs = "–" if exact is None else _mib(exact, choice)
        if choice.chosen is None:
            rows.append([str(choice.size), needs, "nothing fits", "–", "–"])
        else:
            one = choice.chosen
            rows.append([str(choice.size), needs, said(one), _mib(one, choice), said_mse(one.mse)])
    return rows


def work_rows(advice: Advice) -> list[list[str]]:
    """Rows of `WORK_HEADINGS`."""
    return [_work(one) for one in advice.work]


def _work(one: Work) -> list[str]:
    return [title(one.technique), str(one.geometry_passes), *map(number, (one.shaded, one.moved_bytes, one.atomics))]


def commands(advice: Advice, asked: Asked) -> tuple[str, ...]:
    """What to run next.

    Args:
        advice: What to use.
        asked: How it was asked for.
    """
    scene = [asked.file, *asked.loading]
    views = [] if asked.views is None else ["--views", asked.views]
    bundle = [] if asked.bundle is None else ["--bundle", asked.bundle]
    chosen, size = advice.choice.chosen, ["--size", str(advice.choice.size)]
    if advice.choice.verdict == "nothing":
        return _joined(["scene", "inspect", asked.file], ["advise", asked.file, "--alpha", ".33", *views])
    if chosen is None:
        return _joined(["advise", *scene, *views, "--memory", _enough(advice), "--size", str(advice.choice.size)])
    needs = bundle if chosen.bundle else []
    budget = [] if chosen.budget is None else ["--budget", f"{chosen.budget:g}"]
    tail = ["--tail", chosen.tail] if chosen.tail and not chosen.bundle else []
    picture = ["render", *scene, *views, "-t", chosen.technique, *budget, *tail, *needs, *size, "-o", "out.png"]
    found = [[*picture, *([] if chosen.is_exact else ["--compare"])]]
    other = shown_instead(advice)
    if other is not None:
        names = f"{EXACT},{other.technique}"
        budgets = [] if other.budget is None else ["--budgets", f"{other.budget:g}"]
        needs = bundle if other.bundle else []
        found.append(["bench", *scene, *views, "-t", names, *budgets, *needs, *size, "-o", "bench"])
    if not chosen.is_exact and chosen.budget is not None and asked.bundle is not None:
        begun = ["--from", asked.bundle, "--budgets", f"{chosen.budget:g}"]
        found.append(["build", *scene, *views, *begun, "--name", "mine"])
    return _joined(*found)


def _enough(advice: Advice) -> str:
    return f"{-(-_least(advice).bytes_at(advice.choice.size.pixels) // 2**20)}MiB"


def _least(advice: Advice) -> Candidate:
    """What takes the fewest bytes, peeling apart."""
    found = [one for one in advice.scene.candidates if not one.is_exact or one.technique == EXACT]
    return min(found, key=lambda one: one.pixel_bytes)


def _joined(*commands: list[str]) -> tuple[str, ...]:
    return tuple(shlex.join(["diaphane", *parts]) for parts in commands)
