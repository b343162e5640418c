"""What a conversion to USD left out: it says so in the stage, and whoever loads that says so again."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from pxr import Sdf

from renderer.usd.stage import WarningLog
from schemas.licence import tidy

KEY: Final = "leftOut"
"""Entry of `customLayerData`."""
_MOST: Final = 40
_LENGTH: Final = 200


def write_left_out(layer: Sdf.Layer, lines: Iterable[str]) -> None:
    """Writes into a layer what it lacks of the file that it was made of."""
    if listed := list(lines):
        layer.customLayerData = {**layer.customLayerData, KEY: "\n".join(listed[:_MOST])}


def log_left_out(layer: Sdf.Layer, log: WarningLog) -> None:
    """Adds the lines of a root layer to what is said of the scene."""
    written = layer.customLayerData.get(KEY)
    for line in written.split("\n")[:_MOST] if isinstance(written, str) else ():
        if text := tidy(line)[:_LENGTH]:
            log.add(text, "the converted file")
