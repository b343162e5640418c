"""Diaphane's own sample scenes: small USD stages of different kinds, written from code, the same bytes every time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from renderer.samples.built import engine, voxel_town
from renderer.samples.cards import foliage, hair_cards, smoke_cards
from renderer.samples.drapes import curtains, jellyfish
from renderer.samples.glass import bottles, nested_shells
from renderer.samples.knots import torus_knots

SAMPLES: dict[str, Callable[[Path], Path]] = {
    "nested_shells": nested_shells,
    "bottles": bottles,
    "torus_knots": torus_knots,
    "voxel_town": voxel_town,
    "hair_cards": hair_cards,
    "foliage": foliage,
    "engine": engine,
    "smoke_cards": smoke_cards,
    "jellyfish": jellyfish,
    "curtains": curtains,
}
"""Writers by name; each takes the folder and returns the stage's file. Deep scenes are in `renderer.samples.deep`."""


def write_samples(folder: Path, writers: Mapping[str, Callable[[Path], Path]] = SAMPLES) -> list[Path]:
    """Write sample scenes with their textures.

    Args:
        folder: Where they go; created if missing.
        writers: Which; by default the small ones.

    Returns:
        The stages' files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return [write(folder) for write in writers.values()]
