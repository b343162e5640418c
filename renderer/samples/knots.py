"""Sample scene of torus knots whose colour and opacity are primvars that vary along the tubes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, UsdGeom, Vt

from renderer.samples.author import StageAuthor
from renderer.samples.shapes import disc, torus_knot


def torus_knots(folder: Path) -> Path:
    """Seven knots, one through another, without materials: displayColor and displayOpacity at every point."""
    author = StageAuthor(folder / "torus_knots.usdc")
    author.mesh("Floor", disc(2.6, 0.1).moved(by=(0, -1.5, 0)), author.material("Floor", (0.55, 0.5, 0.45)))
    for number, (p, q) in enumerate(((2, 3), (3, 4), (2, 5), (3, 5), (2, 7), (5, 3), (4, 5))):
        steps, around = 300, 14
        knot = torus_knot(p, q, 1.1 + 0.12 * number, 0.07 + 0.012 * (number % 3), steps, around)
        mesh = author.mesh(f"Knot{number}", knot.turned(number % 3, 51.0 * number))
        along = np.repeat(np.arange(steps) / steps, around)
        phase = 2.0 * np.pi * (along + number / 7.0)
        colour = 0.5 + 0.45 * np.cos(phase[:, None] + np.array([0.0, 2.1, 4.2]))
        opacity = 0.32 + 0.22 * np.sin(3.0 * phase)
        api = UsdGeom.PrimvarsAPI(mesh)
        api.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex).Set(
            Vt.Vec3fArray.FromNumpy(colour.astype(np.float32))
        )
        api.CreatePrimvar("displayOpacity", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex).Set(
            Vt.FloatArray.FromNumpy(opacity.astype(np.float32))
        )
    author.camera("Front", (0.4, 0.9, 4.6), (0.0, -0.1, 0.0), 40.0)
    author.camera("Side", (-3.9, 0.3, 1.6), (0.0, -0.1, 0.0), 40.0)
    author.camera("Near", (1.2, 1.4, 1.9), (0.0, 0.0, 0.0), 48.0)
    return author.save()
