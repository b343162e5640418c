"""Colour maps of the heat maps, as anchors in sRGB that are interpolated linearly.

`HEAT` runs from black over red and orange to pale yellow: dark is good, as FLIP maps are usually shown.
`COUNT` runs from dark blue over green to yellow and is perceptually ordered, for the number of core fragments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Anchors = tuple[tuple[int, int, int], ...]

HEAT: Anchors = (
    (0, 0, 4),
    (40, 12, 84),
    (101, 21, 110),
    (159, 42, 99),
    (212, 72, 66),
    (245, 125, 21),
    (250, 193, 39),
    (252, 255, 164),
)
COUNT: Anchors = (
    (68, 1, 84),
    (70, 50, 127),
    (54, 92, 141),
    (39, 127, 142),
    (31, 161, 135),
    (74, 194, 109),
    (159, 218, 58),
    (253, 231, 37),
)

LEVELS = 256


def apply(values: NDArray[np.floating], anchors: Anchors) -> NDArray[np.uint8]:
    """Values in [0,1] (clamped; NaN is 0) of any shape to sRGB of that shape + [3], in 256 levels.

    Args:
        values: Numbers of any shape; 0 is the first colour, 1 the last.
        anchors: Colours of the map, in order.
    """
    level = (np.clip(np.nan_to_num(values), 0.0, 1.0) * (LEVELS - 1) + 0.5).astype(np.uint8)
    return np.asarray(_table(anchors)[level])


def css_gradient(anchors: Anchors) -> str:
    """The same map as a CSS gradient from left to right, for colour bars."""
    stops = ", ".join(f"rgb({r} {g} {b})" for r, g, b in anchors)
    return f"linear-gradient(to right, {stops})"


def _table(anchors: Anchors) -> NDArray[np.uint8]:
    position = np.linspace(0.0, 1.0, len(anchors))
    channels = np.array(anchors, dtype=np.float64).T
    levels = np.linspace(0.0, 1.0, LEVELS)
    table = np.stack([np.interp(levels, position, channel) for channel in channels], axis=-1)
    return np.asarray(np.round(table), dtype=np.uint8)
