"""Whether a driver's pictures are right: every technique against its float64 twin, on pixels of a small picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from evaluation.local_scenes import LocalScene
from evaluation.stress.findings import Options
from evaluation.stress.gl_cases import Case, Scenery
from evaluation.stress.gl_twins import Truth, unbounded
from renderer.capture import capture
from renderer.frame import Frame
from renderer.techniques import TECHNIQUES, Budget, Needs, technique
from schemas.problem import ExitCode, Problem
from schemas.tail import TailName
from schemas.view import View

PIXELS = 400
"""That are compared."""
TOLERANCE = 1e-4
"""Of linear light: above what float32 rounds (docs/STRESS.md), far below what is seen."""
MOST_OFF = 0.01
"""Share of the pixels that may be off by more: `moment` in float32 is ill conditioned in some."""
_SEED = 3
_MOST_WORDS = 400
"""Letters of what a driver says."""


@dataclass(frozen=True, slots=True)
class Check:
    """A picture against its twin.

    Attributes:
        technique: Name.
        largest: Largest difference of linear light.
        off: Pixels that differ by more than `TOLERANCE`.
        compared: Pixels that were compared.
        problem: Why there was no picture.
    """

    technique: str
    largest: float = 0.0
    off: int = 0
    compared: int = 0
    problem: str | None = None

    @property
    def is_right(self) -> bool:
        """Whether the driver draws what the mathematics says."""
        return self.problem is None and self.off <= MOST_OFF * self.compared


def checked(
    local: LocalScene, view: View, size: tuple[int, int], names: Sequence[str], needs: Needs, tail: TailName
) -> Iterator[Check]:
    """Every technique, within F = WH where it has a budget.

    Args:
        local: The scene.
        view: The camera.
        size: Of the picture.
        names: Of the techniques.
        needs: What they need.
        tail: Of the bounded ones.
    """
    frame = Frame(local.gpu(), view, *size)
    dump = capture(frame).dump
    occupied = np.flatnonzero(dump.counts)
    count = min(PIXELS, len(occupied))
    pixels = np.sort(np.random.default_rng(_SEED).choice(occupied, count, replace=False))
    truth = Truth.of(Case(Scenery(local.file.stem, local.now.scene, view, size), frame, dump, pixels))
    twins = {each.name: each.twin for each in unbounded(Options(quick=True))}
    for name in names:
        try:
            # What half floats leave of the tail's sums is no fault of a driver.
            judged = Frame(local.gpu(), view, *size, float_sums=True)
            rendered = technique(name, needs).render(judged, Budget(frame.pixels, tail))
        except (Problem, moderngl.Error) as reason:
            yield Check(name, problem=why(reason))
            continue
        is_bounded = TECHNIQUES[name].family == "bounded"
        expected = truth.hybrid(rendered.k, tail) if is_bounded else twins[name](truth)
        yield compared(name, rendered.linear.reshape(-1, 3)[pixels], expected[pixels])


def why(reason: Problem | moderngl.Error) -> str:
    """What a frame failed by; what a driver says of a shader is cut to its first lines.

    Raises:
        Problem: It is no limit of the frame's, but a mistake of whoever asked for it.
    """
    if isinstance(reason, Problem):
        if reason.code != ExitCode.LIMIT:
            raise reason
        return reason.title
    return " ".join(str(reason).split())[:_MOST_WORDS]


def compared(name: str, linear: NDArray[np.floating[Any]], expected: NDArray[np.floating[Any]]) -> Check:
    """Colours against those of the twin, [M, 3]; what is no number is off."""
    if not len(linear):
        return Check(name)
    difference = np.abs(linear - expected).max(axis=1)
    off = int(np.count_nonzero(~(difference <= TOLERANCE)))
    return Check(name, float(np.nan_to_num(difference, nan=1e9).max()), off, len(linear))
