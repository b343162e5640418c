"""The exact picture of a view: what all errors are measured against."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from labeller.curves import composite
from schemas.colour import display8, linear_to_srgb
from schemas.fragments import FragmentDump


class Exact:
    """All fragments of a view composited on the CPU in float64; each form is made when it is first asked for.

    Args:
        dump: All transparent fragments.
    """

    def __init__(self, dump: FragmentDump) -> None:
        self._dump = dump

    @property
    def counts(self) -> NDArray[np.integer]:
        """Fragments of every pixel, n, [P]."""
        return self._dump.counts

    @cached_property
    def linear(self) -> NDArray[np.float32]:
        """float32 [P, 3], linear RGB."""
        return composite(self._dump, self.counts)

    @cached_property
    def image(self) -> NDArray[np.uint8]:
        """As displayed, uint8 [H, W, 3]."""
        return display8(self.linear).reshape(self._dump.height, self._dump.width, 3)

    @cached_property
    def display(self) -> NDArray[np.float32]:
        """As sRGB values before rounding, float32 [P, 3]."""
        return linear_to_srgb(self.linear).astype(np.float32)

    def display_error(self, linear: NDArray[np.floating]) -> float:
        """Mean squared difference of sRGB values before rounding, of a picture as linear RGB, [P, 3].

        Args:
            linear: [P, 3], linear RGB of the picture, row 0 at the top.
        """
        return float(np.mean(np.square(linear_to_srgb(linear) - self.display, dtype=np.float64)))
