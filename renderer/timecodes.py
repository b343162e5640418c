"""Frames of a sequence in usdrecord's words: FrameSpecs, and the `#` of a file name that a number replaces."""

from __future__ import annotations

import math
import re
from pathlib import Path

from pxr import Sdf, Usd

from schemas.problem import ExitCode, Problem

MAX_FRAMES = 100_000
"""Frames of one command."""

_FARTHEST = 1e15
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?"
_SPEC = re.compile(rf"({_NUMBER})(?::({_NUMBER})(?:x({_NUMBER}))?)?", re.ASCII)
_PLACEHOLDER = re.compile(r"[^#]*?(#+(?:\.#+)?)[^#]*")


def parse_frames(text: str) -> tuple[float, ...]:
    """Time codes of FrameSpecs, the same as of `UsdUtils.TimeCodeRange` (whose own parser crashes on some others).

    Args:
        text: `START`, `START:END` or `START:ENDxSTRIDE`, or several of them with commas between: `1`, `101:105`,
            `105:101`, `101:109x2`, `101:104x0.5`.

    Returns:
        In the order given; none is left out if it comes twice.

    Raises:
        Problem: One of them is no FrameSpec, or there are too many frames.
    """
    frames: list[float] = []
    for spec in text.split(","):
        start, stride, count = _range(spec.strip(), text)
        if len(frames) + count > MAX_FRAMES:
            raise Problem(f"'{text}' is more than {MAX_FRAMES:,} frames.", "Ask for fewer.", ExitCode.LIMIT)
        frames.extend(start + stride * step for step in range(count))
    return tuple(frames)


def _range(spec: str, text: str) -> tuple[float, float, int]:
    """First time code, stride and number of time codes of one FrameSpec."""
    match = _SPEC.fullmatch(spec)
    if match is None:
        raise _no_frames(text)
    start = float(match[1])
    end = float(match[2]) if match[2] else start
    stride = float(match[3]) if match[3] else (1.0 if end >= start else -1.0)
    # The bounds also keep the quotient finite.
    if stride == 0.0 or (end - start) * stride < 0.0 or max(abs(start), abs(end)) > _FARTHEST:
        raise _no_frames(text)
    return start, stride, math.floor(min((end - start + stride) / stride, _FARTHEST))


def _no_frames(text: str) -> Problem:
    return Problem(
        f"'{text}' is no list of frames.",
        "Write --frames 1, 101:105, 105:101 or 101:109x2; several with commas between.",
    )


def check_pattern(pattern: Path, frames: tuple[float, ...]) -> None:
    """Makes sure that every frame gets a file of its own.

    Raises:
        Problem: There is more than one frame and no placeholder, or one with too few decimals; or there is more than
            one placeholder.
    """
    if "#" in pattern.name and not _PLACEHOLDER.fullmatch(pattern.name):
        raise Problem(
            f"'{pattern.name}' has more than one place for the frame's number.", "Use one, as in out.####.png."
        )
    if len(set(frames)) > 1 and "#" not in pattern.name:
        raise Problem(
            f"All frames would be written to {pattern}.", "Put # where the frame's number goes: out.####.png."
        )
    if len({numbered(pattern, frame) for frame in frames}) < len(set(frames)):
        raise Problem(
            f"'{pattern.name}' has too few decimals to tell the frames apart.",
            "Give it some, as in out.####.##.png.",
        )


def numbered(pattern: Path, frame: float) -> Path:
    """The file of a frame.

    Args:
        pattern: A path whose name may have one placeholder: `###` is replaced by the frame's number, padded with
            zeros to at least as many digits; `###.##` has as many decimals, and is padded as a whole.
        frame: Time code.
    """
    match = _PLACEHOLDER.fullmatch(pattern.name)
    if match is None:
        return pattern
    place = match[1]
    decimals = len(place.partition(".")[2])
    begin, end = match.span(1)
    return pattern.with_name(f"{pattern.name[:begin]}{frame:0{len(place)}.{decimals}f}{pattern.name[end:]}")


def is_animated(stage: Usd.Stage) -> bool:
    """Whether anything but cameras has values at time samples, so that frames differ in more than the view."""
    return any(layer.ListAllTimeSamples() and _animates_more_than_cameras(layer) for layer in stage.GetUsedLayers())


def _animates_more_than_cameras(layer: Sdf.Layer) -> bool:
    found = False

    def look(path: Sdf.Path) -> None:
        nonlocal found
        if not found and path.IsPropertyPath() and layer.GetNumTimeSamplesForPath(path) > 0:
            prim = layer.GetPrimAtPath(path.GetPrimPath())
            found = prim is None or prim.typeName != "Camera"

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    return found
