"""The picture that a view is captured and measured at."""

from __future__ import annotations

from schemas.view import View
from stages.loading import Loading


class Pictured(Loading):
    """Parameters of a stage that draws a view.

    Attributes:
        view: The camera.
        size: Width and height in pixels.
    """

    view: View
    size: tuple[int, int]
