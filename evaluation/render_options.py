"""What a user can ask `diaphane render` for, checked before any work starts."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np

from evaluation.choices import check_budget, check_bundle, check_steepness, parse_glass
from renderer.allocation.importance import VkbOptions
from renderer.antialias import SAMPLES
from renderer.aovs import CHANNELS, AovName
from renderer.scene import LoadOptions
from renderer.techniques import TECHNIQUES, Needs
from renderer.techniques.base import Inference
from renderer.timecodes import check_pattern, parse_frames
from schemas.colour import srgb_to_linear
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import TailName

RGB = tuple[float, float, float]

COMPLEXITIES = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}
"""Levels of refinement by usdrecord's words."""
SUFFIXES = (".png", ".exr")
EVERY = "all"
DEFAULT_TECHNIQUE = "sbuffer"

_FACTORS = ("depth", "periphery", "fresnel", "noise")


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """What to render, from where, how, and where to.

    Attributes:
        scenes: Files.
        techniques: Names; see `parse_techniques`.
        needs: What some techniques need; the bundle is found by `bundle`.
        budget: F as a multiple of width * height.
        tail: How fragments beyond the core are approximated; None: as the bundle says, or the default.
        g: Steepness of the density tail; None: as the bundle says, or the usual one.
        bundle: Folder of a bundle, or a name in the registry, for the techniques that need one.
        camera: Name or path of a camera.
        views: A views file.
        image_width: Pixels per row; rows follow from the camera.
        size: Width and height instead.
        frames: Time codes; empty: the start of the stage. Not a number: the default time.
        load: How scenes are read; the time is that of the frame.
        background: Linear RGB where nothing opaque is.
        samples: Frames that the mean of is a picture, one for each sample of a pixel.
        aovs: Planes beside the picture, in EXR files.
        output: Path with a suffix of SUFFIXES, and # where a frame's number goes; None: named after the scene.
        is_full: Whether EXR channels are 32-bit instead of half floats.
        compare: Whether each picture is compared with the exact one.

    Raises:
        Problem: Something of it cannot be.
    """

    scenes: tuple[Path, ...]
    techniques: tuple[str, ...] = (DEFAULT_TECHNIQUE,)
    needs: Needs = field(default_factory=Needs)
    budget: float = 2.0
    tail: TailName | None = None
    g: float | None = None
    bundle: str | None = None
    camera: str | None = None
    views: Path | None = None
    image_width: int = 960
    size: tuple[int, int] | None = None
    frames: tuple[float, ...] = ()
    load: LoadOptions = field(default_factory=LoadOptions)
    background: RGB = (1.0, 1.0, 1.0)
    samples: int = 1
    aovs: tuple[AovName, ...] = ()
    output: Path | None = None
    is_full: bool = False
    compare: bool = False

    def __post_init__(self) -> None:
        for side in (self.image_width, *(self.size or ())):
            if not 1 <= side <= LIMITS.max_side:
                raise Problem(
                    f"Invalid size: {side} pixels.", f"Give width and height of 1 to {LIMITS.max_side} pixels."
                )
        if self.samples not in SAMPLES:
            raise Problem(
                f"A pixel cannot have {self.samples} samples.",
                f"Use one of {', '.join(map(str, SAMPLES))}: --samples 4.",
            )
        if self.aovs and (self.output is None or self.output.suffix.lower() != ".exr"):
            raise Problem("A PNG picture has no layers, which --aov asks for.", "Name an EXR picture: -o picture.exr.")
        check_budget(self.budget, "--budget 2", self.size)
        check_bundle(self.bundle, "--bundle")
        check_steepness(self.g, has_bundle=self.bundle is not None, is_tail_named=self.tail is not None)
        if self.output is not None:
            if self.output.suffix.lower() not in SUFFIXES:
                raise Problem(f"{self.output} is not the name of a picture.", "End it in .png or .exr.")
            check_pattern(self.output, self.frames)


def parse_techniques(names: Sequence[str], has_bundle: bool) -> tuple[str, ...]:
    """Names of techniques, also with commas between.

    Args:
        names: As given; `all` means every one, without a bundle all that need none. None: the exact one.
        has_bundle: Whether a bundle is given.

    Raises:
        Problem: There is none of that name, or nothing but commas is given.
    """
    listed = _listed(names)
    if names and not listed:
        raise Problem("No technique is named.", f"Choose among: {', '.join((*TECHNIQUES, EVERY))}.")
    found: list[str] = []
    for name in listed or [DEFAULT_TECHNIQUE]:
        if name == EVERY:
            found += [each for each, entry in TECHNIQUES.items() if has_bundle or not entry.needs_bundle]
        elif name in TECHNIQUES:
            found.append(name)
        else:
            raise Problem(
                f"There is no technique '{name}'.",
                f"Choose among: {', '.join((*TECHNIQUES, EVERY))}.",
                ExitCode.NOT_FOUND,
            )
    return tuple(dict.fromkeys(found))


def said_left_out(names: Sequence[str], has_bundle: bool) -> str | None:
    """A sentence on what `all` leaves out, if anything.

    Args:
        names: As of `parse_techniques`.
        has_bundle: Whether a bundle is given.
    """
    if has_bundle or EVERY not in _listed(names):
        return None
    missing = [name for name, entry in TECHNIQUES.items() if entry.needs_bundle]
    return f"{' and '.join(missing)} are left out: give a bundle with --bundle."


def _listed(names: Sequence[str]) -> list[str]:
    return [part.strip() for name in names for part in name.split(",") if part.strip()]


def parse_times(frames: str | None, default_time: bool) -> tuple[float, ...]:
    """Time codes of `--frames`, or not a number for `--defaultTime`; empty for neither.

    Raises:
        Problem: Both are given, or the frames are none.
    """
    if frames is not None and default_time:
        raise Problem("Both --frames and --defaultTime set the time.", "Leave one of them out.")
    if default_time:
        return (math.nan,)
    return () if frames is None else parse_frames(frames)


def loading(
    alpha: float | None,
    glass: str,
    variant: Sequence[str] | None,
    complexity: str | None,
    refine: int | None,
    time: float | None = None,
) -> LoadOptions:
    """How a scene is read, from what a command was given (`diaphane.cli.scene_options`).

    Raises:
        Problem: A value is not possible.
    """
    return LoadOptions(
        alpha=alpha,
        glass=parse_glass(glass),
        time=time,
        variants=tuple(variant or ()),
        refine=parse_refine(complexity, refine),
    )


def parse_refine(complexity: str | None, refine: int | None) -> int:
    """Levels of refinement, by usdrecord's word or by number.

    Raises:
        Problem: Both are given, or there is no such word.
    """
    if complexity is not None and refine is not None:
        raise Problem("Both --complexity and --refine set the refinement.", "Leave one of them out.")
    if complexity is not None and complexity not in COMPLEXITIES:
        raise Problem(f"There is no complexity '{complexity}'.", f"Use one of {', '.join(COMPLEXITIES)}.")
    return COMPLEXITIES[complexity] if complexity is not None else refine or 0


def parse_background(text: str) -> RGB:
    """Linear RGB of `#rrggbb` (as a screen shows it), or of three linear numbers with commas between.

    Raises:
        Problem: It is neither.
    """
    if match := re.fullmatch(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})", text):
        red, green, blue = srgb_to_linear(np.array([int(part, 16) / 255.0 for part in match.groups()])).tolist()
        return red, green, blue
    try:
        red, green, blue = (float(part) for part in text.split(","))
    except ValueError:
        red = green = blue = math.nan
    if not all(0.0 <= value <= 1.0 for value in (red, green, blue)):
        raise Problem(
            f"'{text}' is not a colour.", "Write it like '#ffffff', or as linear red,green,blue: 0.5,0.5,0.5."
        )
    return red, green, blue


def parse_vkb(text: str) -> VkbOptions:
    """Factors of `kbuffer-importance`.

    Args:
        text: `thesis` for the thesis's variant; `no-depth`, `no-periphery`, `no-fresnel` and `no-noise` switch factors
            off; several with commas between. Empty: the paper's.

    Raises:
        Problem: Something else is in it.
    """
    words = [word.strip() for word in text.split(",") if word.strip()]
    options = VkbOptions.thesis() if "thesis" in words else VkbOptions()
    for word in words:
        factor = word.removeprefix("no-")
        if word != "thesis" and (factor == word or factor not in _FACTORS):
            raise Problem(f"--vkb '{word}' is not a switch.", f"Use thesis, {', '.join(f'no-{f}' for f in _FACTORS)}.")
        if factor == "noise":
            options = replace(options, noise=0.0)
        elif word != "thesis":
            options = replace(options, **{factor: False})
    return options


def parse_aovs(names: Sequence[str]) -> tuple[AovName, ...]:
    """Names of planes, also with commas between.

    Raises:
        Problem: There is no such plane.
    """
    found: list[AovName] = []
    for name in _listed(names):
        known = next((each for each in CHANNELS if each == name), None)
        if known is None:
            raise Problem(f"There is no plane '{name}'.", f"Use some of {', '.join(CHANNELS)}: --aov depth,alpha.")
        found.append(known)
    return tuple(dict.fromkeys(found))


def parse_needs(vkb: str, inference: str, nodes: int | None, samples: int | None) -> Needs:
    """What some techniques need, but for bundle and allocation.

    Args:
        vkb: See `parse_vkb`.
        inference: How `kbuffer-deep` runs its network.
        nodes: Nodes a pixel of `multilayer` and `adaptive`.
        samples: Samples a pixel of `stochastic`.

    Raises:
        Problem: There is no such inference or VKB factor.
    """
    for known in get_args(Inference):
        if inference == known:
            return Needs(vkb=parse_vkb(vkb), inference=known, nodes=nodes, samples=samples)
    raise Problem(f"There is no inference '{inference}'.", f"Use one of {', '.join(get_args(Inference))}.")
