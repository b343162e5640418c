"""The picture that a view is captured and measured at."""

from __future__ import annotations

from schemas.view import View
from services.stages.stage import Params


class Pictured(Params):
    """Parameters of a stage that draws a view.

    Attributes:
        view: The camera.
        size: Width and height in pixels.
        alpha: Opacity that every surface gets; None keeps the materials' own.
    """

    view: View
    size: tuple[int, int]
    alpha: float | None
