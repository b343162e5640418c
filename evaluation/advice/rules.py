"""What follows from bytes and errors: pure functions that hold for any scene.

- All buffers grow with the pixels, so bytes at a size are bytes per pixel times its pixels.
- The S-buffer is exact. Where it fits the memory, nothing else is needed.
- Otherwise the technique of least error that fits; of those as good as equal, the one that takes the fewest bytes.
- Peeling is exact in constant memory, but draws the geometry once a layer: it is told, and never the first choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from evaluation.summary import EXACT, MSE_FLOOR, geometric_mean
from schemas.advice import Advice, AdvisedScene, Candidate, Choice, Sample, Size, Verdict, sbuffer_load

TIE: Final = 1.1
"""Errors closer than this factor are as good as equal: other views of the same scene move them by more."""
SIZES: Final = tuple(Size(width=w, height=h) for w, h in ((1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)))


def candidates(samples: Iterable[Sample], views: Sequence[str]) -> tuple[Candidate, ...]:
    """Techniques and budgets over the same views; one that misses a view is left out.

    Args:
        samples: Of several of a technique, budget and view the first counts.
        views: Names of the views that count.
    """
    kinds: dict[tuple[str, str, float | None, str, str], dict[str, Sample]] = {}
    for sample in samples:
        if sample.view in views:
            key = sample.technique, sample.family, sample.budget, sample.tail, sample.bundle
            kinds.setdefault(key, {}).setdefault(sample.view, sample)
    return tuple(_candidate(list(found.values())) for found in kinds.values() if set(found) == set(views))


def _candidate(found: Sequence[Sample]) -> Candidate:
    first, worst = found[0], max(found, key=lambda sample: sample.mse)
    is_exact = first.family == "exact"
    return Candidate(
        technique=first.technique,
        family=first.family,
        budget=first.budget,
        tail=first.tail,
        bundle=first.bundle,
        pixel_bytes=max(sample.pixel_bytes for sample in found),
        mse=0.0 if is_exact else geometric_mean([max(sample.mse, MSE_FLOOR) for sample in found]) or 0.0,
        worst=0.0 if is_exact else worst.mse,
        worst_view=worst.view,
    )


def choose(scene: AdvisedScene, size: Size, memory: int) -> Choice:
    """What to use.

    Args:
        scene: What is known.
        size: Of the picture.
        memory: Bytes that all buffers of the frame may take.
    """
    pays_above = max(0.0, sbuffer_load(memory, size.pixels))

    def made(verdict: Verdict, chosen: Candidate | None = None, ties: Sequence[Candidate] = ()) -> Choice:
        return Choice(verdict=verdict, size=size, memory=memory, chosen=chosen, ties=tuple(ties), pays_above=pays_above)

    if scene.load == 0.0:
        return made("nothing")
    fitting = [one for one in scene.candidates if one.bytes_at(size.pixels) <= memory]
    exact = next((one for one in fitting if one.technique == EXACT), None)
    if exact is not None:
        return made("exact", exact)
    bounded = [one for one in fitting if not one.is_exact]
    if not bounded:
        return made("none")
    least = min(one.mse for one in bounded)
    alike = sorted((one for one in bounded if one.mse <= least * TIE), key=_by_bytes)
    return made("technique", alike[0], _once(alike[1:], alike[0]))


def _once(alike: Iterable[Candidate], chosen: Candidate) -> list[Candidate]:
    """Of each other technique the smallest."""
    by_technique: dict[str, Candidate] = {}
    for one in alike:
        by_technique.setdefault(one.technique, one)
    by_technique.pop(chosen.technique, None)
    return list(by_technique.values())


def advise(scene: AdvisedScene, size: Size, memory: int) -> Advice:
    """All that follows from the numbers; words and accounts come later.

    Args:
        scene: What is known.
        size: Of the picture.
        memory: Bytes that all buffers of the frame may take.
    """
    sizes = sorted({size, *SIZES}, key=lambda one: (one.pixels, one.width))
    return Advice(
        scene=scene,
        choice=choose(scene, size, memory),
        best=best(scene, size, memory),
        front=front(scene),
        resolutions=tuple(choose(scene, one, memory) for one in sizes),
    )


def best(scene: AdvisedScene, size: Size, memory: int) -> tuple[Candidate, ...]:
    """Of each technique the candidate of least error that fits, else its smallest; what fits first, then by error."""
    found: dict[str, Candidate] = {}
    for one in sorted(scene.candidates, key=lambda each: _rank(each, size, memory)):
        found.setdefault(one.technique, one)
    return tuple(sorted(found.values(), key=lambda each: (_rank(each, size, memory)[0], each.mse, _by_bytes(each))))


def _rank(one: Candidate, size: Size, memory: int) -> tuple[bool, float, float]:
    is_over = one.bytes_at(size.pixels) > memory
    # What fits is told by its error, what does not by how little it would take.
    return is_over, one.pixel_bytes if is_over else one.mse, one.pixel_bytes


def front(scene: AdvisedScene) -> tuple[Candidate, ...]:
    """Candidates that no other beats in both bytes and error, by bytes; the S-buffer ends it.

    Peeling is no part of it: it trades geometry passes for bytes.
    """
    shown: list[Candidate] = []
    for one in sorted(scene.candidates, key=lambda each: (each.pixel_bytes, each.mse)):
        is_better = not shown or one.mse * TIE < shown[-1].mse
        if is_better and (not one.is_exact or one.technique == EXACT):
            shown.append(one)
    return tuple(shown)


def shown_instead(advice: Advice) -> Candidate | None:
    """The technique whose errors are worth a look: the chosen one, or where that is exact the best that takes less."""
    chosen = advice.choice.chosen
    if chosen is None or not chosen.is_exact:
        return chosen
    less = [one for one in advice.front if one.pixel_bytes < chosen.pixel_bytes]
    return less[-1] if less else None


def affordable(memory: int, pixels: int, beside: float, early: float, slot: int) -> float:
    """F / P that a memory buys, rounded down to two digits; 0: none.

    Args:
        memory: Bytes of all buffers.
        pixels: Of the picture.
        beside: Bytes a pixel beside the pool.
        early: Bytes a pixel at most before there is a pool.
        slot: Bytes of a fragment.
    """
    left = (memory / pixels - beside) / slot
    if left < 1e-3 or early * pixels > memory:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(left)) - 1)
    return float(f"{math.floor(left / unit + 1e-9) * unit:.2g}")


def _by_bytes(one: Candidate) -> tuple[float, float, str]:
    return one.pixel_bytes, one.mse, one.technique
