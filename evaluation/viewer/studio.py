"""What is rendered for the viewer: each technique's picture once for each camera and budget, timed, and compared.

Pictures, times and errors are those of `diaphane bench` (`evaluation.bench`): the same frames, the same recording, the
same exact picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.rounds import shoot
from evaluation.bench.subject import Subject
from evaluation.viewer.comparing import Compared, Picture, compare
from evaluation.viewer.layout import Pane
from renderer.frame import RGB, Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, KBufferDeep, Needs, Rendered, Technique, technique
from renderer.timing import Recording
from schemas.bundle import TailSpec
from schemas.colour import display8
from schemas.problem import Problem
from schemas.tail import TailName
from schemas.view import View

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
        tail: Of the bounded techniques without a bundle, which has its own.
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
        number: Of the frame, among those that its technique rendered in a row for this wish.
    """

    wish: Wish
    budget: Budget
    rendered: Rendered
    recording: Recording
    number: int = 1

    def pane(self) -> Pane:
        """As it is shown."""
        width, height = self.wish.size
        return Pane(display8(self.rendered.linear), self.rendered.k.reshape(height, width))

    def picture(self, perceptual: bool) -> Picture:
        """As it is compared."""
        return Picture(self.rendered.linear, self.rendered.k, perceptual)


class Studio:
    """Renders a scene by any technique.

    Args:
        gpu: The scene.
        needs: What some techniques need, but for the allocation, which is the certified optimum.
        background: Linear RGB where nothing is.
        g: Steepness of the density tail.

    Attributes:
        edition: Counts the bundles that were loaded: with another one, pictures are others.
        g: Steepness of the density tail.
    """

    def __init__(self, gpu: GpuScene, needs: Needs, background: RGB, g: float) -> None:
        self.gpu, self.edition, self.g = gpu, 0, g
        self._background = background
        self._needs = replace(needs, allocate=self._optimal)
        self._techniques: dict[str, Technique] = {}
        self._subject: Subject | None = None
        self._made: dict[Wish, Shot | Problem] = {}
        self._last: dict[str, tuple[Wish, int]] = {}
        self._compared: dict[tuple[Wish, bool], Compared | Problem] = {}

    def load(self, bundle: Path) -> TailSpec | None:
        """Take another bundle for what reads one; the tail that it was trained for."""
        readers = [name for name, entry in TECHNIQUES.items() if entry.needs_bundle]
        made = {name: technique(name, replace(self._needs, bundle=bundle)) for name in readers}
        self._needs = replace(self._needs, bundle=bundle)
        self._techniques = {**self._techniques, **made}
        self._made = {wish: shot for wish, shot in self._made.items() if wish.technique not in readers}
        self._last = {}
        self._compared = {key: found for key, found in self._compared.items() if key[0] in self._made}
        self.edition += 1
        return next((each.manifest.tail for each in made.values() if isinstance(each, KBufferDeep)), None)

    def shot(self, wish: Wish) -> Shot | Problem:
        """A picture, or why there is none; made if it is not there yet."""
        if wish not in self._made:
            self._make(wish)
        return self._made[wish]

    def go_on(self, shot: Shot) -> bool:
        """Render the next frame of a picture, until its technique has settled; whether there was one to render."""
        if shot.number >= TECHNIQUES[shot.wish.technique].settles:
            return False
        self._compared = {key: found for key, found in self._compared.items() if key[0] != shot.wish}
        self._make(shot.wish)
        return True

    def subject(self, wish: Wish) -> Subject:
        """The view of a picture; with another camera or size, what was made of the last one is forgotten."""
        subject = self._subject
        if subject is None or (subject.view, subject.size) != (wish.view, wish.size):
            self._made, self._compared = {}, {}
            subject = self._subject = Subject(self.gpu, wish.view, wish.size, self._background)
        return subject

    def known(self, shot: Shot, perceptual: bool) -> Compared | Problem | None:
        """The comparison of a picture, if it was made, or why it could not be."""
        return self._compared.get((shot.wish, perceptual))

    def compare(self, shot: Shot, perceptual: bool) -> Compared:
        """Compare a picture with the exact one of its camera, which is made for the first picture of a camera.

        Args:
            shot: The picture.
            perceptual: Whether FLIP is computed, which takes longer than all else.
        """
        found = self.known(shot, perceptual)
        if not isinstance(found, Compared):
            found = compare(self.subject(shot.wish).reference, shot.picture(perceptual))
            self._compared[shot.wish, perceptual] = found
        return found

    def remember(self, shot: Shot, perceptual: bool, found: Compared | Problem) -> bool:
        """Keep a comparison that was made elsewhere; whether its picture is still one of those of this camera."""
        is_kept = self._made.get(shot.wish) is shot
        if is_kept:
            self._compared[shot.wish, perceptual] = found
        return is_kept

    def _make(self, wish: Wish) -> None:
        subject = self.subject(wish)
        if wish not in self._made and len(self._made) >= _KEPT:
            self._made.pop(next(iter(self._made)))
        try:
            self._made[wish] = self._shoot(subject, wish)
        except Problem as problem:
            self._made[wish] = problem

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
        last, number = self._last.get(wish.technique, (None, 0))
        number = number + 1 if last == wish else 1
        self._last[wish.technique] = wish, number
        return Shot(wish, budget, rendered, recording, number)

    def _budget(self, wish: Wish, size: tuple[int, int]) -> Budget:
        made, fragments = self._techniques[wish.technique], max(1, int(wish.factor * size[0] * size[1]))
        if isinstance(made, KBufferDeep):
            return Budget(fragments, made.manifest.tail.name, made.manifest.tail.g)
        return Budget(fragments, wish.tail, self.g)

    def _optimal(self, frame: Frame, budget: Budget) -> NDArray[np.int32]:
        """What `kbuffer-optimal` renders of the view under way."""
        assert self._subject is not None
        return self._subject.allocate(frame, budget)
