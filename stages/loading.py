"""What decides how a scene's surfaces are loaded."""

from __future__ import annotations

from schemas.glass import GlassReading
from stages.stage import Params


class Loading(Params):
    """Parameters of a stage that loads a scene.

    Attributes:
        alpha: Opacity that every surface gets; None keeps the materials' own.
        glass: How surfaces that transmit light are read.
    """

    alpha: float | None
    glass: GlassReading
