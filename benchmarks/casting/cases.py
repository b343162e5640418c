"""The stages that are checked, and the views they are checked from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.samples import write_samples
from renderer.views import listed_views, placed_views, sampled_views
from schemas.scene import SceneArrays
from schemas.view import View

SHARED = Path(__file__).resolve().parents[3] / "shared" / "scenes"
"""Where the scenes lie that do not come with the project, with their MANIFEST.json; they may be missing."""
MODES: dict[str, float | None] = {"alpha .33": 0.33, "authored": None}
"""Opacity of every surface, by name: one for all, so that every surface counts; and each its own."""
_SAMPLED = 2
"""Views of a stage for which none are listed."""
_SEED = 11


@dataclass(frozen=True, slots=True)
class Case:
    """A stage of a scene.

    Attributes:
        scene: Name of the scene; a scene may have many stages.
        path: The stage's file.
        variants: `/prim:set=choice` each.
        triangles: How many the scene's description says it has, or None.
        views: A views file (`renderer.views.listed_views`), or None.
    """

    scene: str
    path: Path
    variants: tuple[str, ...] = ()
    triangles: int | None = None
    views: Path | None = None

    def cameras(self, scene: SceneArrays, most: int | None) -> tuple[View, ...]:
        """The views of the stage.

        Args:
            scene: As loaded.
            most: So many, spread over those that are listed, or sampled where none are; None: all, or two.
        """
        listed = listed_views(self.views, self.path) if self.views is not None else ()
        if not listed:
            return sampled_views(scene, _SAMPLED if most is None else most, _SEED)
        placed = placed_views(listed, scene)
        return placed if most is None else placed[:: max(1, len(placed) // most)][:most]


def described_cases(folder: Path) -> list[Case]:
    """The stages that `folder/MANIFEST.json` lists."""
    manifest = folder / "MANIFEST.json"
    scenes = json.loads(manifest.read_text(encoding="utf-8"))["scenes"]
    return [case for scene in scenes for case in _cases(scene, folder, manifest)]


def sample_cases(folder: Path) -> list[Case]:
    """The project's own scenes, written into `folder`."""
    return [Case(path.stem, path) for path in write_samples(folder)]


def _cases(scene: dict[str, Any], folder: Path, manifest: Path) -> Iterator[Case]:
    if not scene["main"]:
        for file in scene["files"]:
            yield Case(scene["name"], folder / scene["name"] / file)
        return
    chosen = scene["variant_selection"] or {}
    variants = tuple(f"{prim}:{name}={choice}" for prim, sets in chosen.items() for name, choice in sets.items())
    yield Case(scene["name"], folder / scene["main"], variants, scene["triangles"], manifest)
