"""Sample scenes of glass: nested shells, bottles on a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import Colour, StageAuthor
from renderer.samples.shapes import box, disc, lathe, rounded, sphere

PALETTE: tuple[Colour, ...] = (
    (0.85, 0.16, 0.10),
    (0.95, 0.55, 0.10),
    (0.95, 0.85, 0.25),
    (0.20, 0.65, 0.25),
    (0.10, 0.55, 0.70),
    (0.12, 0.22, 0.75),
    (0.55, 0.18, 0.65),
    (0.80, 0.85, 0.88),
)


def nested_shells(folder: Path) -> Path:
    """Clusters of concentric glass spheres with opaque cores on a dark plate; z up, centimetres."""
    author = StageAuthor(folder / "nested_shells.usda", up="Z", metres=0.01)
    rng = np.random.default_rng(11)
    author.mesh("Plate", disc(46.0, 2.0).turned(0, 90.0), author.material("Plate", (0.05, 0.05, 0.06)))
    core = author.material("Core", (0.9, 0.7, 0.25))
    author.prototypes("Shapes")
    author.mesh("Shapes/Sphere", sphere(1.0, 22, 44).turned(0, 90.0))
    glass = [
        author.material(f"Glass{i}", colour, opacity)
        for i, (colour, opacity) in enumerate(zip(PALETTE, (0.3, 0.18, 0.4, 0.25, 0.35, 0.5, 0.22, 0.1), strict=True))
    ]
    # Centre x, y, z, outer radius, number of shells: a ring of eight, four on top of them, one large in the middle.
    clusters = [(0.0, 0.0, 20.0, 19.0, 9)]
    for ring, (number, distance, height) in enumerate(((8, 31.0, 0.0), (4, 23.0, 26.0))):
        for i in range(number):
            angle = 2.0 * np.pi * (i + 0.25 + 0.5 * ring) / number
            radius = float(rng.uniform(8.0, 11.5))
            x, y = distance * float(np.cos(angle)), distance * float(np.sin(angle))
            clusters.append((x, y, height + radius, radius, int(rng.integers(3, 7))))
    for cluster, (x, y, z, radius, shells) in enumerate(clusters):
        author.copy(f"Cluster{cluster}/Core", "Shapes/Sphere", (x, y, z), 0.18 * radius, core)
        tint = int(rng.integers(len(glass)))
        for shell in range(shells):
            size = radius * (0.35 + 0.65 * (shell + 1) / shells)
            material = glass[(tint + 3 * shell) % len(glass)]
            author.copy(f"Cluster{cluster}/Shell{shell}", "Shapes/Sphere", (x, y, z), size, material)
    author.camera("Front", (12.0, -112.0, 46.0), (0.0, 0.0, 20.0), 38.0)
    author.camera("Low", (-92.0, -40.0, 16.0), (0.0, 0.0, 20.0), 38.0)
    author.camera("Above", (38.0, 50.0, 92.0), (0.0, 0.0, 12.0), 44.0)
    return author.save()


def bottles(folder: Path) -> Path:
    """Bottles, glasses and their liquids on a wooden table; the glass has an outside and an inside."""
    author = StageAuthor(folder / "bottles.usdc")
    rng = np.random.default_rng(5)
    wood = author.material("Wood", (0.32, 0.17, 0.08))
    author.mesh("Table/Top", box((1.5, 0.05, 0.95)).moved(by=(0, -0.025, 0)), wood)
    for i, (x, z) in enumerate(((-0.65, -0.4), (0.65, -0.4), (-0.65, 0.4), (0.65, 0.4))):
        author.mesh(f"Table/Leg{i}", box((0.06, 0.5, 0.06)).moved(by=(x, -0.3, z)), wood)
    author.prototypes("Kinds")
    tall = [(0.0, 0.0), (0.036, 0.002), (0.04, 0.02), (0.04, 0.17), (0.034, 0.21), (0.015, 0.245), (0.014, 0.3)]
    round_ = [(0.0, 0.0), (0.045, 0.004), (0.06, 0.05), (0.052, 0.1), (0.02, 0.14), (0.016, 0.2), (0.02, 0.21)]
    cup = [(0.0, 0.0), (0.03, 0.002), (0.006, 0.012), (0.005, 0.08), (0.03, 0.1), (0.042, 0.14), (0.036, 0.2)]
    for kind, (profile, level) in enumerate(((tall, 0.16), (round_, 0.09), (cup, 0.15))):
        for tint in range(3):
            colour = PALETTE[(3 * kind + 2 * tint) % 8]
            name = f"Kinds/Kind{kind}{tint}"
            clear = author.material(
                f"Glass{kind}{tint}", colour if tint else (0.75, 0.85, 0.85), (0.16, 0.28, 0.38)[tint]
            )
            curve = rounded(profile, 5)
            author.mesh(f"{name}/Outside", lathe(curve, 22), clear)
            bowl = [(0.86 * r, h + 0.004) for r, h in curve if kind < 2 or h > 0.085]
            author.mesh(f"{name}/Inside", lathe(bowl, 22), clear)
            drink = author.material(f"Drink{kind}{tint}", PALETTE[(kind + 3 * tint + 1) % 8], 0.45)
            inner = [(0.8 * r, h + 0.006) for r, h in curve if h < level and (kind < 2 or h > 0.085)]
            author.mesh(f"{name}/Drink", lathe([*inner, (0.0, inner[-1][1])], 22), drink)
    for row in range(5):
        for column in range(9):
            kind, tint = int(rng.integers(3)), int(rng.integers(3))
            jitter = rng.uniform(-0.025, 0.025, 2)
            at = (-0.62 + 0.155 * column + float(jitter[0]), 0.0, -0.36 + 0.18 * row + float(jitter[1]))
            scale = float(rng.uniform(0.85, 1.25))
            author.instance(f"Bottle{row}{column}", f"Kinds/Kind{kind}{tint}", at, scale=scale)
    author.camera("Front", (0.15, 0.38, 1.3), (0.0, 0.1, 0.0), 34.0)
    author.camera("Along", (1.25, 0.24, 0.35), (0.0, 0.1, -0.05), 34.0)
    author.camera("Above", (-0.6, 0.8, 0.8), (0.0, 0.05, 0.0), 38.0)
    return author.save()
