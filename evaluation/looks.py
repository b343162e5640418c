"""How a technique is called and drawn: one title, one colour and one mark of it on every page and in every chart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

PAGE: Final = "#ffffff"
INK: Final = "#16191d"
SOFT: Final = "#59616b"
GRID: Final = "#e8ebee"
DARK_PAGE: Final = "#14171a"


@dataclass(frozen=True, slots=True)
class Look:
    """A technique as it is shown.

    Attributes:
        title: What it is called: a name, then how it is asked for.
        light: Its colour on a light page, sRGB.
        dark: Its colour on a dark page, sRGB.
        shape: Its mark: a symbol of Vega, or an SVG path within [-1, 1].
    """

    title: str
    light: str
    dark: str
    shape: str


_STAR = "M0,-1L.27,-.37L.95,-.31L.43,.14L.59,.81L0,.46L-.59,.81L-.43,.14L-.95,-.31L-.27,-.37Z"
_SALTIRE = "M-.9,-.6L-.6,-.9L0,-.3L.6,-.9L.9,-.6L.3,0L.9,.6L.6,.9L0,.3L-.6,.9L-.9,.6L-.3,0Z"
_PENTAGON = "M0,-1L.95,-.31L.59,.81L-.59,.81L-.95,-.31Z"
_HEXAGON = "M-.5,-.87L.5,-.87L1,0L.5,.87L-.5,.87L-1,0Z"
_HOURGLASS = "M-.8,-.9L.8,-.9L-.8,.9L.8,.9Z"
_BOW = "M-.9,-.8L.9,.8L.9,-.8L-.9,.8Z"
_HALF = "M-1,.5A1,1,0,0,1,1,.5Z"
_BAR = "M-1,-.35H1V.35H-1Z"
_ARCH = "M-.9,.9V-.9H.9V.9H.35V-.35H-.35V.9Z"
_CROWN = "M-1,.8V-.7L-.4,.1L0,-.8L.4,.1L1,-.7V.8Z"
_TRAPEZIUM = "M-.45,-.8H.45L1,.8H-1Z"
_BOLT = "M.3,-1L-.7,.2H-.05L-.3,1L.7,-.2H.05Z"
_KITE = "M0,-1L.75,-.35L0,1L-.75,-.35Z"
_EXACT = INK, "#e6e9ec"
_SUMS = "#7b3fa0", "#c08be0"
_LAYERS = "#6b6200", "#c9bd45"

LOOKS: Final[Mapping[str, Look]] = {
    "kbuffer": Look("fixed k (kbuffer)", "#6b7280", "#8f98a3", "square"),
    "kbuffer-dynamic": Look("dynamic k+ (kbuffer-dynamic)", "#b87a00", "#e0a04b", "diamond"),
    "kbuffer-importance": Look("VKB (kbuffer-importance)", "#c8322b", "#e8604f", "triangle-up"),
    "kbuffer-deep": Look("bundle (kbuffer-deep)", "#2046a8", "#4f8ef0", "circle"),
    "kbuffer-temporal": Look("bundle over frames (kbuffer-temporal)", "#1a94c4", "#7fdcf0", "triangle-right"),
    "kbuffer-optimal": Look("oracle (kbuffer-optimal)", "#00754a", "#4cc596", _STAR),
    "sbuffer": Look("exact (sbuffer)", *_EXACT, "cross"),
    "abuffer-list": Look("exact (abuffer-list)", *_EXACT, _BAR),
    "abuffer-array": Look("exact (abuffer-array)", *_EXACT, _SALTIRE),
    "depth-peeling": Look("exact (depth-peeling)", *_EXACT, _HOURGLASS),
    "dual-depth-peeling": Look("exact (dual-depth-peeling)", *_EXACT, _BOW),
    "binned": Look("binned", "#b0307a", "#f08bc4", _HEXAGON),
    "weighted-average": Look("weighted-average", *_SUMS, "triangle-down"),
    "weighted-blended": Look("weighted-blended", *_SUMS, _PENTAGON),
    "moment": Look("moment", *_SUMS, "triangle-left"),
    "wavelet": Look("wavelet", *_SUMS, _CROWN),
    "multilayer": Look("multilayer", *_LAYERS, _HALF),
    "adaptive": Look("adaptive", *_LAYERS, _ARCH),
    "bevy": Look("Bevy's rules (bevy)", *_LAYERS, _TRAPEZIUM),
    "storm-rules": Look("Storm's rules (storm-rules)", *_LAYERS, _BOLT),
    "stochastic": Look("stochastic", "#8a5138", "#cf9c80", _KITE),
}
"""Name of a technique -> its look, in the order in which tables and pictures show them.

No two share a mark, so that nothing depends on telling colours apart; the bounded techniques do not share a colour
either, and are told apart in every kind of colour blindness. Colours have a contrast of 3 or more on their pages."""

DARK: Final[Mapping[str, str]] = {
    PAGE: DARK_PAGE,
    SOFT: "#9aa3ad",
    GRID: "#272c32",
    **{look.light: look.dark for look in LOOKS.values()},
}
"""Colour of a chart on a light page -> on a dark one."""

_OTHER: Final = Look("", SOFT, DARK[SOFT], "circle")


def title(technique: str) -> str:
    """What a technique is called; one that is not known, by its own name."""
    return LOOKS[technique].title if technique in LOOKS else technique


def look(technique: str) -> Look:
    """How a technique is drawn."""
    return LOOKS.get(technique, _OTHER)


def technique_order(techniques: Iterable[str]) -> list[str]:
    """Techniques without duplicates, in the order of `LOOKS`, unknown ones last by name."""
    known = list(LOOKS)
    return sorted(set(techniques), key=lambda t: (known.index(t) if t in known else len(known), t))
