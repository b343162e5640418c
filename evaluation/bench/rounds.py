"""Timing in turns: a busy machine is busy for all cells alike, and no cell takes longer than it may."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from evaluation.bench.subject import Subject
from renderer.account.ledger import count_frame
from renderer.techniques import TECHNIQUES, Budget, Rendered, Technique
from renderer.timing import Recording, recording, shared_clock
from schemas.bench import CellKey, Times
from schemas.work import PassWork


@dataclass(slots=True)
class Run:
    """A cell being measured.

    Attributes:
        key: The cell.
        technique: An instance of its own, which may remember the last frame.
        budget: What it is given.
        cost: Seconds of its first frame, everything counted.
        recordings: Of the timed frames.
    """

    key: CellKey
    technique: Technique
    budget: Budget
    cost: float = 0.0
    recordings: list[Recording] = field(default_factory=list)

    def first(self, subject: Subject, limit: float) -> Rendered:
        """The warm-up, for which drivers compile shaders; one frame beyond the limit is all there will be.

        Of a technique that learns from its frames, these are as many as it takes to settle, and the last one counts.

        Raises:
            Problem: The technique cannot render this.
        """
        for _ in range(TECHNIQUES[self.key.technique].settles):
            start = time.perf_counter()
            rendered, found = shoot(subject, self.technique, self.budget, shared_clock(subject.gpu.ctx))
            self.cost = time.perf_counter() - start
        if self.cost > limit:
            self.recordings.append(found)
        return rendered

    def repeats(self, most: int, limit: float) -> int:
        """How often it is timed after the warm-up: as often as asked for and as the limit holds."""
        return 0 if self.recordings else max(1, min(most, int(limit / max(self.cost, 1e-9))))

    def passes(self) -> dict[str, Times]:
        """Times of each pass, in the order in which they ran first."""
        return {name: times_of([found.passes[name] for found in self.recordings]) for name in self._names()}

    def gpu(self) -> dict[str, float]:
        """Medians by timer queries, for passes that every frame had."""
        everywhere = [name for name in self._names() if all(name in found.gpu for found in self.recordings)]
        return {name: float(np.median([found.gpu[name] for found in self.recordings])) for name in everywhere}

    def work(self, subject: Subject) -> dict[str, PassWork]:
        """What the passes of one more frame do, counted."""
        frame = subject.frame()
        return count_frame(subject.gpu, lambda: self.technique.render(frame, self.budget))

    def frame(self) -> Times | None:
        """Times of the sum of the passes."""
        return times_of([found.milliseconds for found in self.recordings]) if self.recordings else None

    def _names(self) -> list[str]:
        # A technique that remembers may skip a pass in some frames: only those that all frames have are medians.
        first = self.recordings[0].passes if self.recordings else {}
        return [name for name in first if all(name in found.passes for found in self.recordings)]


def shoot(
    subject: Subject, technique: Technique, budget: Budget, seconds: Callable[[], float] = time.perf_counter
) -> tuple[Rendered, Recording]:
    """One frame from nothing, the opaque pass included, and what it took by a clock."""
    with recording(subject.gpu.ctx, seconds) as found:
        rendered = technique.render(subject.frame(), budget)
    return rendered, found


def in_turns(subject: Subject, runs: Sequence[Run], most: int, limit: float) -> None:
    """Time all cells, one frame of each after the other, every second round backwards.

    Args:
        subject: The view.
        runs: Cells that had their first frame.
        most: Frames of each.
        limit: Seconds that the frames of one may take.
    """
    wanted = {id(run): run.repeats(most, limit) for run in runs}
    seconds = shared_clock(subject.gpu.ctx)
    for number in range(max(wanted.values(), default=0)):
        for run in runs if number % 2 == 0 else reversed(runs):
            if number < wanted[id(run)]:
                run.recordings.append(shoot(subject, run.technique, run.budget, seconds)[1])


def times_of(values: Sequence[float]) -> Times:
    """Median and spread."""
    return Times(median=float(np.median(values)), least=float(np.min(values)), most=float(np.max(values)))
