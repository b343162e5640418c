"""The benchmark's own scene: 96 instanced torus knots of glass, 0.8 million triangles, 6 to 7 million fragments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import StageAuthor
from renderer.samples.shapes import disc, torus_knot

KNOTS = 96
COLOURS = ((0.85, 0.25, 0.2), (0.2, 0.55, 0.85), (0.3, 0.75, 0.35), (0.9, 0.75, 0.3), (0.7, 0.4, 0.8), (0.8, 0.8, 0.82))


def thicket(folder: Path) -> Path:
    """Writes the scene: knots in a box, at random turns, over an opaque floor; one camera.

    Args:
        folder: Where the stage goes.

    Returns:
        The stage. At 1430x960 its camera sees about 6.7 million transparent fragments.
    """
    author = StageAuthor(folder / "thicket.usdc")
    rng = np.random.default_rng(23)
    author.mesh("Floor", disc(5.0, 0.1).moved(by=(0, -2.0, 0)), author.material("Floor", (0.5, 0.48, 0.45)))
    author.prototypes("Knots")
    names = []
    for number, colour in enumerate(COLOURS):
        knot = torus_knot(2 + number % 3, 3 + 2 * (number % 2), 1.0, 0.14, steps=300, around=14)
        author.mesh(f"Knots/Knot{number}", knot, author.material(f"Glass{number}", colour, 0.2 + 0.08 * number))
        names.append(f"Knots/Knot{number}")
    turns = rng.normal(size=(KNOTS, 4))
    author.scatter(
        "Thicket",
        names,
        np.arange(KNOTS) % len(COLOURS),
        rng.uniform((-2.6, -1.5, -2.6), (2.6, 1.6, 2.6), (KNOTS, 3)),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        rng.uniform(0.75, 1.15, KNOTS),
    )
    author.camera("Front", (1.1, 1.6, 11.0), (0.0, -0.1, 0.0), 44.0)
    return author.save()
