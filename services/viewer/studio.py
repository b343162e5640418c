"""What is rendered for the viewer: each technique's picture once for each camera and budget, timed, and compared.

Pictures, times and errors are those of `diaphane bench` (`services.bench`): the same frames, the same recording, the
same exact picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer import metrics
from renderer.frame import RGB, Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, Needs, Rendered, Technique, technique
from renderer.timing import Recording
from schemas.colour import display8
from schemas.problem import Problem
from schemas.tail import TailName
from schemas.view import View
from services.bench.rounds import shoot
from services.bench.subject import Subject
from services.viewer.layout import Pane

_WARM_SIZE = (64, 48)
"""Drivers compile shaders at their first use: what is timed is not the first."""
_KEPT = 24
"""Pictures of one camera that are kept, so that going back and forth between techniques renders nothing."""


@dataclass(frozen=True, slots=True)
class Wish:
    """A picture to make.

    Attributes:
        technique: Name.
        view: The camera.
        size: Width and height, pixels.
        factor: Budget as a multiple of width * height.
        tail: Of the bounded techniques.
    """

    technique: str
    view: View
    size: tuple[int, int]
    factor: float
    tail: TailName


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture, and what it cost.

    Attributes:
        wish: What was asked for.
        budget: F, and the tail.
        rendered: The picture.
        recording: Its times.
    """

    wish: Wish
    budget: Budget
    rendered: Rendered
    recording: Recording

    def pane(self) -> Pane:
        """As it is shown."""
        width, height = self.wish.size
        return Pane(display8(self.rendered.linear), self.rendered.k.reshape(height, width))


@dataclass(frozen=True, slots=True)
class Compared:
    """A picture against the exact one of its camera; see `services.bench.subject.Errors`.

    Attributes:
        mse: Of 8-bit sRGB, values in [0,1].
        mse_display: Of sRGB values before rounding.
        psnr: dB, of `mse`; None for no error.
        flip: Mean LDR-FLIP; None if it was not asked for.
        fragments: N of the view.
        k: Least and greatest k of a pixel that has fragments.
    """

    mse: float
    mse_display: float
    psnr: float | None
    flip: float | None
    fragments: int
    k: tuple[int, int]


class Studio:
    """Renders a scene by any technique.

    Args:
        gpu: The scene.
        needs: What some techniques need, but for the allocation, which is the certified optimum.
        background: Linear RGB where nothing is.
        g: Steepness of the density tail.

    Attributes:
        edition: Counts the bundles that were loaded: with another one, pictures are others.
    """

    def __init__(self, gpu: GpuScene, needs: Needs, background: RGB, g: float) -> None:
        self.gpu, self.edition = gpu, 0
        self._background, self._g = background, g
        self._needs = replace(needs, allocate=self._optimal)
        self._techniques: dict[str, Technique] = {}
        self._subject: Subject | None = None
        self._made: dict[Wish, Shot | Problem] = {}
        self._compared: dict[tuple[Wish, bool], Compared] = {}

    def load(self, bundle: Path) -> None:
        """Take another bundle for what reads one."""
        made = technique("kbuffer-deep", replace(self._needs, bundle=bundle))
        self._needs = replace(self._needs, bundle=bundle)
        self._techniques = {**self._techniques, "kbuffer-deep": made}
        self._made = {wish: shot for wish, shot in self._made.items() if wish.technique != "kbuffer-deep"}
        self._compared = {key: found for key, found in self._compared.items() if key[0] in self._made}
        self.edition += 1

    def shot(self, wish: Wish) -> Shot | Problem:
        """A picture, or why there is none; made if it is not there yet."""
        if wish not in self._made:
            subject = self.subject(wish)
            if len(self._made) >= _KEPT:
                self._made.pop(next(iter(self._made)))
            try:
                self._made[wish] = self._shoot(subject, wish)
            except Problem as problem:
                self._made[wish] = problem
        return self._made[wish]

    def subject(self, wish: Wish) -> Subject:
        """The view of a picture; with another camera or size, what was made of the last one is forgotten."""
        subject = self._subject
        if subject is None or (subject.view, subject.size) != (wish.view, wish.size):
            self._made, self._compared = {}, {}
            subject = self._subject = Subject(self.gpu, wish.view, wish.size, self._background)
        return subject

    def known(self, shot: Shot, perceptual: bool) -> Compared | None:
        """The comparison of a picture, if it was made."""
        return self._compared.get((shot.wish, perceptual))

    def compare(self, shot: Shot, perceptual: bool) -> Compared:
        """Compare a picture with the exact one of its camera, which is made for the first picture of a camera.

        Args:
            shot: The picture.
            perceptual: Whether FLIP is computed, which takes longer than all else.
        """
        found = self.known(shot, perceptual)
        if found is None:
            found = self._compared[shot.wish, perceptual] = _compare(self.subject(shot.wish), shot, perceptual)
        return found

    def _shoot(self, subject: Subject, wish: Wish) -> Shot:
        if wish.technique not in self._techniques:
            self._techniques[wish.technique] = made = technique(wish.technique, self._needs)
            self._subject = Subject(self.gpu, wish.view, _WARM_SIZE, self._background)
            try:
                shoot(self._subject, made, self._budget(wish, _WARM_SIZE))
            finally:
                self._subject = subject
        budget = self._budget(wish, wish.size)
        rendered, recording = shoot(subject, self._techniques[wish.technique], budget)
        return Shot(wish, budget, rendered, recording)

    def _budget(self, wish: Wish, size: tuple[int, int]) -> Budget:
        return Budget(max(1, int(wish.factor * size[0] * size[1])), wish.tail, self._g)

    def _optimal(self, frame: Frame, budget: Budget) -> NDArray[np.int32]:
        """What `kbuffer-optimal` renders of the view under way."""
        assert self._subject is not None
        return self._subject.allocate(frame, budget)


def _compare(subject: Subject, shot: Shot, perceptual: bool) -> Compared:
    image, counts = display8(shot.rendered.linear), subject.dump.counts
    error = metrics.mse(image, subject.exact8)
    k = shot.rendered.k[counts > 0]
    return Compared(
        mse=error,
        mse_display=subject.display_error(shot.rendered.linear.reshape(-1, 3)),
        psnr=None if error == 0.0 else metrics.psnr(error),
        flip=metrics.flip(image, subject.exact8)[0] if perceptual else None,
        fragments=int(counts.sum(dtype=np.int64)),
        k=(int(k.min()), int(k.max())) if len(k) else (0, 0),
    )
