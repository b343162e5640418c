"""Sample scenes of thin sheets: jellyfish, curtains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, UsdGeom, Vt

from renderer.samples.author import StageAuthor
from renderer.samples.glass import PALETTE
from renderer.samples.images import lace
from renderer.samples.shapes import Polygons, box, disc, joined, lathe, rounded, sheet, sphere, tube


def jellyfish(folder: Path) -> Path:
    """Nine jellyfish over a reef: several bells inside each other and trailing tentacles; z up."""
    author = StageAuthor(folder / "jellyfish.usdc", up="Z", metres=0.1)
    rng = np.random.default_rng(31)
    author.mesh("Reef/Sand", disc(9.0, 0.4).turned(0, 90.0), author.material("Sand", (0.55, 0.45, 0.30)))
    coral = author.material("Coral", (0.75, 0.25, 0.18))
    for i in range(14):
        x, y = (float(v) for v in rng.uniform(-5.5, 5.5, 2))
        size = float(rng.uniform(0.4, 1.1))
        author.mesh(f"Reef/Coral{i}", sphere(size, 12, 20).moved(scale=(1, 1, 0.7), by=(x, y, 0.0)), coral)
    for number in range(9):
        angle = 2.0 * np.pi * number / 8.0
        reach = 0.0 if number == 8 else 2.7
        at = (reach * float(np.cos(angle)), reach * float(np.sin(angle)), float(rng.uniform(3.2, 7.0)))
        _jellyfish(author, f"Jelly{number}", at, float(rng.uniform(0.9, 1.5)), PALETTE[number % 8], rng)
    author.camera("Front", (1.5, -12.5, 5.5), (0.0, 0.0, 4.2), 40.0)
    author.camera("Low", (-9.0, -4.5, 2.6), (0.0, 0.0, 4.2), 42.0)
    author.camera("Above", (5.5, 6.5, 10.5), (0.0, 0.0, 3.6), 40.0)
    return author.save()


def _jellyfish(
    author: StageAuthor,
    name: str,
    at: tuple[float, float, float],
    size: float,
    colour: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    skins = [author.material(f"{name}Skin{i}", colour, opacity) for i, opacity in enumerate((0.16, 0.28, 0.5))]
    red, green, blue = (0.5 + 0.5 * c for c in colour)
    pale = author.material(f"{name}Pale", (red, green, blue), 0.22)
    for i, inner in enumerate((1.0, 0.8, 0.45)):
        bell = [(1.0, -0.25), (1.05, 0.05), (0.9, 0.45), (0.55, 0.75), (0.0, 0.88)]
        curve = rounded([(r * inner, h * inner + 0.1 * i) for r, h in bell], 8)
        author.mesh(f"{name}/Bell{i}", lathe(curve, 44).turned(0, 90.0).moved(scale=size, by=at), skins[i])
    t = np.linspace(0.0, 1.0, 20)
    for kind, (count, radius, thickness, length) in enumerate(((26, 0.95, 0.02, 2.6), (7, 0.3, 0.09, 1.8))):
        arms = []
        for i in range(count):
            angle = 2.0 * np.pi * i / count
            phase = rng.uniform(0.0, 6.3, 2)
            x = radius * np.cos(angle) * (1 - 0.4 * t) + 0.18 * t * np.sin(6 * t + phase[0])
            y = radius * np.sin(angle) * (1 - 0.4 * t) + 0.18 * t * np.cos(5 * t + phase[1])
            z = -0.2 - length * t * float(rng.uniform(0.7, 1.0))
            path = size * np.column_stack((x, y, z)) + np.array(at)
            arms.append(tube(path, size * thickness * (1.2 - t), 5))
        author.mesh(f"{name}/Arms{kind}", joined(arms), pale if kind else skins[2])


def curtains(folder: Path) -> Path:
    """A pavilion of wavy curtains, one behind the other: sheer ones, and lace with a pattern in its opacity."""
    author = StageAuthor(folder / "curtains.usdc")
    author.mesh("Floor", box((7.0, 0.15, 7.0)).moved(by=(0, -0.075, 0)), author.material("Floor", (0.45, 0.32, 0.2)))
    post = author.material("Post", (0.75, 0.72, 0.68))
    for i, (x, z) in enumerate(((-3, -3), (3, -3), (-3, 3), (3, 3), (0, -3), (0, 3))):
        author.mesh(
            f"Post{i}",
            lathe([(0.0, 0.0), (0.12, 0.0), (0.09, 0.2), (0.09, 3.0), (0.0, 3.0)], 24).moved(by=(x, 0, z)),
            post,
        )
    author.mesh("Ball", sphere(0.55, 24, 40).moved(by=(0.0, 0.55, 0.0)), author.material("Ball", (0.8, 0.2, 0.1)))
    weaves = [
        author.textured(f"Lace{i}", author.image(f"lace{i}.png", lace(c)))
        for i, c in enumerate(((0.95, 0.93, 0.88), (0.45, 0.6, 0.85)))
    ]
    for number in range(14):
        depth = -2.8 + 5.6 * number / 13.0
        across = number % 3 == 1
        cloth = _curtain(5.6, 2.7, 0.16, number).moved(by=(0.0, 1.4, depth))
        cloth = cloth.turned(1, 90.0) if across else cloth
        if number % 4 == 3:
            author.mesh(f"Curtain{number}", cloth, weaves[number % 8 // 4])
            continue
        mesh = author.mesh(f"Curtain{number}", Polygons(cloth.points, cloth.faces))
        # Opacity falls from hem to rail: a value for each face.
        rows, columns = 24, 110
        opacity = np.repeat(np.linspace(0.5, 0.12, rows), columns)
        api = UsdGeom.PrimvarsAPI(mesh)
        api.CreatePrimvar("displayOpacity", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform).Set(
            Vt.FloatArray.FromNumpy(opacity.astype(np.float32))
        )
        colour = np.array([PALETTE[(3 * number) % 8]], dtype=np.float32)
        api.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.constant).Set(
            Vt.Vec3fArray.FromNumpy(colour)
        )
    author.camera("Front", (3.4, 2.3, 7.4), (0.0, 1.25, 0.0), 38.0)
    author.camera("Corner", (-6.2, 2.6, 5.6), (0.0, 1.1, 0.0), 40.0)
    author.camera("Through", (5.6, 1.3, 2.4), (-1.0, 1.2, -0.6), 48.0)
    return author.save()


def _curtain(width: float, height: float, fold: float, seed: int) -> Polygons:
    """A hanging sheet with folds that grow towards the hem."""
    phase = np.random.default_rng(seed).uniform(0.0, 6.3, 3)
    cloth = sheet(width, height, 24, 110)
    x, y = cloth.points[:, 0], cloth.points[:, 1] / height + 0.5
    loose = 0.5 + 0.8 * (1.0 - y)
    wave = np.sin(9.0 * x + phase[0]) + 0.4 * np.sin(17.0 * x + phase[1]) + 0.5 * np.sin(2.0 * x + 3.0 * y + phase[2])
    points = cloth.points.copy()
    points[:, 2] = fold * loose * wave
    return Polygons(points, cloth.faces, cloth.st)
