"""What a window and a folder of frames have in common: the pictures of a look, composed, with their numbers."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.pictures import write_png
from evaluation.report.colours import COUNT, HEAT
from evaluation.viewer import statistics
from evaluation.viewer.comparing import Compared, Comparer
from evaluation.viewer.controls import Look, key_help
from evaluation.viewer.layout import Pane, across, blank, compose, is_paired
from evaluation.viewer.overlay import Corner, Note, draw, in_columns
from evaluation.viewer.statistics import Row
from evaluation.viewer.studio import Shot, Studio, Wish
from evaluation.writing import replacing
from renderer.techniques import TECHNIQUES
from schemas.bundle import TailSpec
from schemas.problem import Problem
from schemas.view import View

_WRAP = 44
"""Letters of a line of the read-out."""
_JOINED = "\N{NO-BREAK SPACE}"
"""Between the name of a pass and its time, which stay on one line; the font has no such letter."""


@dataclass(slots=True)
class Session:
    """A scene that is being looked at.

    Attributes:
        studio: Renders it.
        look: What is shown.
        name: Of the scene.
        bundle: Name of the bundle that is read; empty: none.
        trained: The tail that the bundle was trained for; None: another one was asked for, or there is no bundle.
        message: What was done last; empty: nothing to say.
        is_computing: Whether what is shown is being compared with the exact picture.
    """

    studio: Studio
    look: Look
    name: str
    bundle: str
    trained: TailSpec | None = None
    message: str = ""
    is_computing: bool = False
    _asked: tuple[Shot, bool] | None = None

    def sides(self) -> dict[str, Shot | Problem]:
        """The pictures that the layout shows, `left` and `right`, rendered if they are not there yet."""
        look = self.look
        names = {"left": look.left, **({"right": look.right} if is_paired(look.layout) else {})}
        return {
            side: self.studio.shot(Wish(name, look.view, look.size, look.factor, look.tail))
            for side, name in names.items()
        }

    def image(self) -> NDArray[np.uint8]:
        """The composition, without text."""
        look, panes = self.look, self._panes()
        if look.layout == "difference" and any(isinstance(shot, Problem) for shot in self.sides().values()):
            return blank(*look.size).image
        left = panes["left"]
        return compose(look.layout, left, panes.get("right", left), look.split, look.gain, self._top())

    def screen(self) -> NDArray[np.uint8]:
        """The composition with the text that the look asks for."""
        look = self.look
        width, height = look.size[0] * across(look.layout), look.size[1]
        notes = self._notes() if look.readout and not look.help else []
        if look.help:
            notes.append(Note(in_columns(key_help(), height), "middle", 0, width))
        if self.message:
            notes.append(Note(textwrap.wrap(self.message, _WRAP), "bottom-right", 0, width))
        return draw(self.image(), notes)

    def load(self, bundle: Path, name: str) -> None:
        """Take another bundle, and its tail where that of the last one is shown.

        Raises:
            Problem: It is damaged or not understood.
        """
        trained = self.studio.load(bundle)
        self.bundle, self.message = name, f"Now {name}."
        if trained and self.trained:
            if self.look.tail == self.trained.name:
                self.look = replace(self.look, tail=trained.name)
            self.trained, self.studio.g = trained, trained.g

    def go_on(self) -> bool:
        """Render the next frame of what learns from frame to frame, while the camera rests; whether any does still."""
        return any(self.studio.go_on(shot) for shot in self.sides().values() if isinstance(shot, Shot))

    def ask(self, comparer: Comparer) -> bool:
        """Have what is shown compared with the exact picture, one picture after the other.

        However often the look changes meanwhile, one comparison at most is under way that no one waits for.

        Returns:
            Whether something is shown that is not compared yet.
        """
        perceptual = self.look.perceptual
        missing = [shot for shot in self.sides().values() if isinstance(shot, Shot) and self._known(shot) is None]
        if missing and self._asked is None:
            shot = missing[0]
            try:
                dump = self.studio.subject(shot.wish).dump
            except Problem as problem:  # as of a view with more fragments than can be held
                for each in missing:
                    self._answered(each, perceptual, problem)
                return False
            comparer.ask((shot.wish.view, shot.wish.size), dump, shot.picture(perceptual))
            self._asked = shot, perceptual
        return bool(missing)

    def take(self, comparer: Comparer) -> bool:
        """Take the answer to what was asked; whether it is about a picture that is still there."""
        found = comparer.answer()
        if found is None or self._asked is None:
            return False
        (shot, perceptual), self._asked = self._asked, None
        return self._answered(shot, perceptual, found)

    def rows(self, frame: int) -> list[Row]:
        """The numbers of what is shown, one row for each picture.

        Raises:
            Problem: A technique cannot render this.
        """
        return [
            statistics.row(frame, side, shot, self.studio.compare(shot, self.look.perceptual), self._bundle(shot))
            for side, shot in self._shots().items()
        ]

    def save(self, folder: Path) -> list[Path]:
        """Write what is shown: the pictures by themselves, and the composition with its text.

        Returns:
            Their paths, of a number that nothing in the folder has yet.

        Raises:
            Problem: A technique cannot render this, or the folder cannot be written.
        """
        panes = {f"{side}-{shot.wish.technique}": shot.pane().image for side, shot in self._shots().items()}
        stem = _free_stem(folder, self.name)
        pictures = {stem: self.screen(), **{f"{stem}-{name}": image for name, image in panes.items()}}
        paths = []
        for name, image in pictures.items():
            paths.append(folder / f"{name}.png")
            with replacing(paths[-1]) as path:
                write_png(path, image)
        return paths

    @property
    def title(self) -> str:
        """Of a window."""
        look = self.look
        names = " | ".join((look.left, look.right) if is_paired(look.layout) else (look.left,))
        return f"{self.name} - {names} - {look.factor:g} fragments per pixel - Diaphane"

    def show(self, view: View) -> None:
        """Look from somewhere else."""
        self.look = replace(self.look, view=view)

    def _shots(self) -> dict[str, Shot]:
        found: dict[str, Shot] = {}
        for side, shot in self.sides().items():
            if isinstance(shot, Problem):
                raise shot
            found[side] = shot
        return found

    def _panes(self) -> dict[str, Pane]:
        shots = self.sides().items()
        return {side: shot.pane() if isinstance(shot, Shot) else blank(*self.look.size) for side, shot in shots}

    def _top(self) -> int:
        """The k of the brightest colour: the greatest that a technique with a choice has.

        An exact one keeps all fragments; on its scale the differences between the others would all be dark.
        """
        shots = [shot for shot in self.sides().values() if isinstance(shot, Shot)]
        chosen = [shot for shot in shots if TECHNIQUES[shot.wish.technique].family != "exact"]
        return max((int(shot.rendered.k.max(initial=0)) for shot in chosen or shots), default=1) or 1

    def _answered(self, shot: Shot, perceptual: bool, found: Compared | Problem) -> bool:
        is_kept = self.studio.remember(shot, perceptual, found)
        if is_kept and isinstance(found, Problem):
            self.message = f"{found.title} {found.remedy}"
        return is_kept

    def _known(self, shot: Shot) -> Compared | Problem | None:
        return self.studio.known(shot, self.look.perceptual)

    def _bundle(self, shot: Shot) -> str:
        return self.bundle if TECHNIQUES[shot.wish.technique].needs_bundle else ""

    def _notes(self) -> list[Note]:
        look, width = self.look, self.look.size[0]
        # Upon one picture that shows two, each read-out has half of it.
        parts = {"left": (0, width), "right": (width, width)}
        if is_paired(look.layout) and across(look.layout) == 1:
            parts = {"left": (0, width // 2), "right": (width // 2, width - width // 2)}
        notes = []
        for side, shot in self.sides().items():
            corner: Corner = "top-right" if side == "right" and across(look.layout) == 1 else "top-left"
            notes.append(Note(self._lines(side, shot), corner, *parts[side]))
        if look.layout == "difference":
            notes.append(Note([f"0 .. 1 of the difference x {look.gain:g}"], "bottom-left", 0, width, HEAT))
        if look.layout == "k":
            notes.append(Note([f"k 0 .. {self._top()}"], "bottom-left", 0, width, COUNT))
        return notes

    def _lines(self, side: str, shot: Shot | Problem) -> list[str]:
        """The read-out of a picture."""
        if isinstance(shot, Problem):
            return [getattr(self.look, side), *textwrap.wrap(f"No picture: {shot.title} {shot.remedy}", _WRAP)]
        wish, rendered = shot.wish, shot.rendered
        lines = [f"{wish.technique} {self._bundle(shot)}".rstrip()]
        if TECHNIQUES[wish.technique].family == "bounded":
            lines.append(f"F {wish.factor:g} per pixel, {shot.budget.fragments:,}; tail {shot.budget.tail}")
        passes = ", ".join(f"{name}{_JOINED}{taken:.1f}" for name, taken in shot.recording.passes.items())
        times = textwrap.wrap(f"{shot.recording.milliseconds:.1f} ms: {passes}", _WRAP, break_on_hyphens=False)
        lines += [line.replace(_JOINED, " ") for line in times]
        known = self._known(shot)
        compared = known if isinstance(known, Compared) else None
        k = f"k up to {int(rendered.k.max(initial=0))}" if compared is None else "k {}..{}".format(*compared.k)
        of = "" if compared is None else f" of {compared.fragments:,}"
        lines.append(f"captured {rendered.captured:,}{of}, {k}")
        lines.append(f"pool {rendered.pool_bytes / 2**20:.1f} MiB, {rendered.total_bytes / 2**20:.1f} MiB at most")
        return [*lines, *self._against_exact(known)]

    def _against_exact(self, known: Compared | Problem | None) -> list[str]:
        if isinstance(known, Compared):
            return _errors(known)
        if known is not None:
            return ["against exact: could not be computed"]
        return ["against exact: computing" if self.is_computing else "against exact: when the camera rests"]


def _free_stem(folder: Path, name: str) -> str:
    """A name with the first number that no picture of the folder has."""
    there = {path.name for path in folder.glob("*.png")}
    for number in count(1):
        stem = f"{name}-{number:03}"
        if not any(other.startswith(stem) for other in there):
            return stem
    raise AssertionError


def _errors(compared: Compared) -> list[str]:
    psnr = "no error" if compared.psnr is None else f"PSNR {compared.psnr:.2f} dB"
    mse = f"against exact: MSE {1e5 * compared.mse:.4g} x1e-5, {psnr}"
    return [mse] if compared.flip is None else [mse, f"FLIP {compared.flip:.4g}"]
