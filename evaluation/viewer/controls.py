"""What can be changed while one looks, and the keys that change it.

A `Look` never changes: a key or a movement of the mouse makes a new one, and what differs tells what to render.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evaluation.viewer.camera import aimed, panned, turned, zoomed
from evaluation.viewer.layout import LAYOUTS, Layout
from schemas.limits import LIMITS
from schemas.tail import TAIL_NAMES, TailName
from schemas.view import Vec3, View

FACTORS = (0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
"""Budgets that the keys go through, fragments per pixel."""
_GAINS = (1.0, 1024.0)
"""Least and greatest amplification of a difference."""
_TURN = np.radians(5.0)
_PAN = 0.05
_ZOOM = 0.9
_SPLIT = 0.02


@dataclass(frozen=True, slots=True)
class Look:
    """What is shown.

    Attributes:
        view: The camera.
        size: Width and height of one picture, pixels.
        left: Technique on the left.
        right: Technique on the right.
        factor: Budget as a multiple of width * height.
        tail: Of bounded techniques.
        layout: How both are put together.
        split: Where the divider of `split` is, as a share of the width.
        gain: What a difference is multiplied by.
        perceptual: Whether FLIP is computed.
        readout: Whether numbers are shown.
        help: Whether the keys are.
    """

    view: View
    size: tuple[int, int]
    left: str
    right: str
    factor: float
    tail: TailName
    layout: Layout = "side-by-side"
    split: float = 0.5
    gain: float = 8.0
    perceptual: bool = False
    readout: bool = True
    help: bool = False


@dataclass(frozen=True, slots=True)
class Place:
    """What movements are relative to.

    Attributes:
        techniques: Those that can be chosen, in order.
        views: Those that the scene or a file lists; the first one is where it begins.
        up: The scene's up axis.
        bounds: [2, 3] of the scene, metres.
    """

    techniques: Sequence[str]
    views: Sequence[View]
    up: Vec3
    bounds: NDArray[np.floating]


Change = Callable[[Look, Place], Look]


@dataclass(frozen=True, slots=True)
class Control:
    """A key.

    Attributes:
        shown: As the help names it.
        about: What it does.
        change: Does it.
    """

    shown: str
    about: str
    change: Change


def turn(look: Look, place: Place, azimuth: float, elevation: float) -> Look:
    """The camera led around what it looks at, radians."""
    return replace(look, view=turned(aimed(look.view, place.bounds), place.up, azimuth, elevation))


def pan(look: Look, place: Place, right: float, over: float) -> Look:
    """The camera moved sideways, in heights of the picture."""
    return replace(look, view=panned(aimed(look.view, place.bounds), right, over))


def zoom(look: Look, place: Place, factor: float) -> Look:
    """The camera at another distance."""
    return replace(look, view=zoomed(aimed(look.view, place.bounds), factor, place.bounds))


def _left(step: int) -> Change:
    return lambda look, place: replace(look, left=_beside(look.left, place, step))


def _right(step: int) -> Change:
    return lambda look, place: replace(look, right=_beside(look.right, place, step))


def _beside(name: str, place: Place, step: int) -> str:
    names = place.techniques
    return names[(names.index(name) + step) % len(names)]


def _budget(step: int) -> Change:
    def change(look: Look, _place: Place) -> Look:
        others = [f for f in FACTORS if (f > look.factor if step > 0 else f < look.factor) and f <= LIMITS.budget]
        pixels = look.size[0] * look.size[1]
        found = (others[0] if step > 0 else others[-1]) if others else look.factor
        return replace(look, factor=found) if found * pixels >= 1.0 else look

    return change


def _tail(step: int) -> Change:
    return lambda look, _: replace(look, tail=TAIL_NAMES[(TAIL_NAMES.index(look.tail) + step) % len(TAIL_NAMES)])


def _layout(layout: Layout) -> Change:
    return lambda look, _: replace(look, layout=layout)


def _gain(factor: float) -> Change:
    return lambda look, _: replace(look, gain=min(max(look.gain * factor, _GAINS[0]), _GAINS[1]))


def _divider(step: float) -> Change:
    return lambda look, _: replace(look, split=min(max(look.split + step, 0.0), 1.0))


def _next_view(look: Look, place: Place) -> Look:
    names = [view.name for view in place.views]
    now = names.index(look.view.name) if look.view.name in names else -1
    return replace(look, view=place.views[(now + 1) % len(place.views)])


def _same_view(look: Look, place: Place) -> Look:
    return replace(look, view=next((v for v in place.views if v.name == look.view.name), place.views[0]))


_ABOUT_LAYOUTS: Mapping[Layout, str] = {
    "single": "the left picture alone",
    "side-by-side": "both side by side",
    "split": "both, with a divider to drag",
    "difference": "heat map of their difference",
    "k": "heat maps of k",
}

KEYS: Mapping[str, Control] = {
    "LEFT": Control("arrows", "turn", lambda look, place: turn(look, place, -_TURN, 0.0)),
    "RIGHT": Control("", "", lambda look, place: turn(look, place, _TURN, 0.0)),
    "UP": Control("", "", lambda look, place: turn(look, place, 0.0, _TURN)),
    "DOWN": Control("", "", lambda look, place: turn(look, place, 0.0, -_TURN)),
    "shift+LEFT": Control("Shift arrows", "move sideways", lambda look, place: pan(look, place, -_PAN, 0.0)),
    "shift+RIGHT": Control("", "", lambda look, place: pan(look, place, _PAN, 0.0)),
    "shift+UP": Control("", "", lambda look, place: pan(look, place, 0.0, _PAN)),
    "shift+DOWN": Control("", "", lambda look, place: pan(look, place, 0.0, -_PAN)),
    "PAGE_UP": Control("Page up, down", "nearer, farther", lambda look, place: zoom(look, place, _ZOOM)),
    "PAGE_DOWN": Control("", "", lambda look, place: zoom(look, place, 1.0 / _ZOOM)),
    "HOME": Control("Home", "the camera as it was", _same_view),
    "N": Control("N", "the next camera", _next_view),
    "Q": Control("Q, A", "technique on the left", _left(1)),
    "A": Control("", "", _left(-1)),
    "W": Control("W, S", "technique on the right", _right(1)),
    "S": Control("", "", _right(-1)),
    "B": Control("B, V", "budget up, down", _budget(1)),
    "V": Control("", "", _budget(-1)),
    "T": Control("T, Shift T", "tail", _tail(1)),
    "shift+T": Control("", "", _tail(-1)),
    **{
        f"NUMBER_{number}": Control(str(number), _ABOUT_LAYOUTS[layout], _layout(layout))
        for number, layout in enumerate(LAYOUTS, 1)
    },
    "COMMA": Control("comma, period", "divider", _divider(-_SPLIT)),
    "PERIOD": Control("", "", _divider(_SPLIT)),
    "G": Control("G, Shift G", "difference times 2, by 2", _gain(2.0)),
    "shift+G": Control("", "", _gain(0.5)),
    "F": Control("F", "FLIP on, off", lambda look, _: replace(look, perceptual=not look.perceptual)),
    "I": Control("I", "read-out on, off", lambda look, _: replace(look, readout=not look.readout)),
    "H": Control("H", "these keys", lambda look, _: replace(look, help=not look.help)),
}
"""Keys by moderngl-window's names, `shift+` before those that need it."""

PICTURES, STATISTICS = "P", "C"
"""Keys that write files."""


def key_help() -> list[str]:
    """The list of keys, a tab between key and meaning."""
    listed = [f"{each.shown}\t{each.about}" for each in KEYS.values() if each.shown]
    mouse = ("drag\tturn; with Shift or the right button: move", "wheel\tnearer, farther")
    files = (f"{PICTURES}\twrite the pictures (PNG)", f"{STATISTICS}\twrite a row of statistics (CSV)", "Esc\tclose")
    return [*mouse, *listed, *files]
