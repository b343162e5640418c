"""A rendered picture: numbers, and what it cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from diaphane import figures
from diaphane.cli.lines import size
from evaluation.looks import title
from evaluation.pictures import write_png
from evaluation.wording import counted
from evaluation.writing import replacing
from schemas.colour import display8

if TYPE_CHECKING:
    from evaluation.rendering import Picture as Cost


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Picture:
    """A picture by one technique within one budget. `numpy.asarray` of it is `linear`.

    Attributes:
        linear: float32 [H, W, 3], linear RGB, row 0 at the top.
        cost: What is known of it beside: technique, view, fragments, milliseconds of each pass, bytes, errors.
    """

    linear: NDArray[np.float32]
    cost: Cost

    @property
    def srgb(self) -> NDArray[np.uint8]:
        """uint8 [H, W, 3], sRGB, as a screen shows it."""
        return display8(self.linear)

    def save(self, path: str | Path) -> None:
        """Write the picture as PNG, 8-bit sRGB, in the place of a file of that name.

        Args:
            path: The file.
        """
        with replacing(Path(path)) as file:
            write_png(file, self.srgb)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.linear, dtype=dtype) if copy else np.asarray(self.linear, dtype=dtype)

    def __repr__(self) -> str:
        return f"<Picture {self._caption()}>"

    def _repr_html_(self) -> str:
        return figures.figure(self.srgb, self._caption())

    def _repr_png_(self) -> bytes:
        return figures.png(self.srgb)

    def _caption(self) -> str:
        cost = self.cost
        parts = [f"{title(cost.technique)}, {cost.width}x{cost.height}", counted(cost.fragments or 0, "fragments")]
        if cost.family == "bounded":
            parts.append(f"budget {counted(cost.budget, 'fragments')}")
        parts += [size(cost.total_bytes or 0), f"{cost.milliseconds or 0.0:.1f} ms"]
        if cost.mse is not None:
            parts.append(f"MSE {1e5 * cost.mse:.4g}e-5")
        return ", ".join(parts)
