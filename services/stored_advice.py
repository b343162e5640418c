"""Advice on a stored scene, by what the service's jobs measured on it."""

from __future__ import annotations

from evaluation.advice.gathered import of_measurements
from schemas.advice import Advice, Size
from services.database import Database
from services.scene_views import SeenView, views


def stored_advice(
    database: Database, name: str, digest: str, size: Size | None = None, memory: int | None = None
) -> Advice | None:
    """Advice on a scene; None where nothing was measured on it.

    Args:
        database: Where measurements are.
        name: How the scene is called.
        digest: Of its content.
        size: Of the picture; None: as measured.
        memory: Bytes that all buffers of a frame may take; None: the usual ones.
    """
    return advice_of(name, views(database, digest), size, memory)


def advice_of(name: str, seen: list[SeenView], size: Size | None = None, memory: int | None = None) -> Advice | None:
    """The same of views that were read already.

    Args:
        name: See `stored_advice`.
        seen: The views.
        size: See `stored_advice`.
        memory: See `stored_advice`.
    """
    measured = [(shot.measured, shot.model or "") for view in seen for shot in view.shots]
    return of_measurements(name, measured, size, memory)
