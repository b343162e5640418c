"""Deep sample scene of leaves: a clipped hedge with topiary, of cut-out and of translucent leaf cards."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import StageAuthor
from renderer.samples.images import leaf
from renderer.samples.shapes import Floats, Polygons, bent_cards, box, directions, joined, lathe, sphere, tube, unit

_KINDS = 6
"""Of leaf cards; the last one is a cut-out."""


def hedge(folder: Path) -> Path:
    """A garden: a hedge, a ball and a cone of 59,000 instanced leaves, most translucent, some cut out."""
    author = StageAuthor(folder / "hedge.usdc")
    rng = np.random.default_rng(71)
    author.mesh(
        "Ground/Lawn", box((12.0, 0.1, 6.0)).moved(by=(0, -0.05, 0)), author.material("Lawn", (0.24, 0.36, 0.12))
    )
    author.mesh(
        "Ground/Path", box((12.0, 0.1, 0.8)).moved(by=(0, -0.04, 1.9)), author.material("Path", (0.55, 0.48, 0.38))
    )
    wall = author.material("Wall", (0.60, 0.40, 0.30))
    author.mesh("Wall", box((12.0, 3.4, 0.2)).moved(by=(0, 1.6, -1.5)), wall)
    _looks(author)
    wood = author.material("Wood", (0.22, 0.14, 0.08))
    author.mesh(
        "Wood/Stems", joined([_stem(x, z, 1.15, rng) for x in np.arange(-3.4, 3.5, 0.42) for z in (-0.6, -0.2)]), wood
    )
    pot = author.material("Pot", (0.62, 0.30, 0.18))
    places = [_in_box(52000, (7.2, 1.6, 1.3), (0.0, 0.82, -0.4), rng)]
    for number, x in enumerate((-1.55, 1.55)):
        author.mesh(
            f"Pots/Pot{number}",
            lathe([(0.0, 0.0), (0.2, 0.0), (0.27, 0.38), (0.24, 0.38), (0.2, 0.3), (0.0, 0.3)], 32).moved(
                by=(x, 0.0, 1.05)
            ),
            pot,
        )
        author.mesh(f"Pots/Trunk{number}", tube(np.linspace([x, 0.2, 1.05], [x, 1.1, 1.05], 6), 0.035, 12), wood)
    out = directions(3600, rng)
    places.append(np.array([-1.55, 1.12, 1.05]) + 0.42 * out * rng.uniform(0.25, 1.0, (3600, 1)) ** 0.45)
    up = rng.uniform(0.0, 1.0, 3600) ** 1.6
    angle, reach = rng.uniform(0, 2 * np.pi, 3600), 0.42 * (1.0 - up) * rng.uniform(0.2, 1.0, 3600) ** 0.45
    places.append(np.column_stack((1.55 + reach * np.cos(angle), 0.5 + 1.3 * up, 1.05 + reach * np.sin(angle))))
    at = np.concatenate(places)
    which = np.where(rng.uniform(size=len(at)) < 0.012, _KINDS - 1, rng.integers(0, _KINDS - 1, len(at)))
    turns = unit(rng.normal(size=(len(at), 4)))
    author.scatter(
        "Leaves", [f"Kinds/Leaf{k}" for k in range(_KINDS)], which, at, turns, rng.uniform(0.7, 1.25, len(at))
    )
    author.mesh("Ball", sphere(0.16, 16, 28).moved(by=(0.35, 0.16, 1.6)), author.material("Ball", (0.80, 0.15, 0.10)))
    author.camera("Front", (0.25, 1.25, 4.5), (0.0, 0.80, 0.0), 34.0)
    author.camera("Along", (-3.9, 1.5, 2.6), (0.2, 0.7, 0.0), 40.0)
    author.camera("Near", (0.5, 1.1, 1.9), (-0.1, 0.85, -0.2), 46.0)
    return author.save()


def _looks(author: StageAuthor) -> None:
    """One prototype for each kind of leaf."""
    author.prototypes("Kinds")
    greens = (
        (0.20, 0.50, 0.10),
        (0.30, 0.60, 0.14),
        (0.42, 0.66, 0.18),
        (0.26, 0.55, 0.20),
        (0.55, 0.68, 0.20),
        (0.16, 0.40, 0.10),
    )
    up, out = np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    for kind, green in enumerate(greens):
        cut = kind == _KINDS - 1
        image = author.image(f"hedge{kind}.png", leaf(green, 1.0 if cut else 0.34 + 0.07 * kind, 80 + kind))
        look = author.textured(f"Leaf{kind}", image, threshold=0.5 if cut else 0.0)
        size = np.array([0.16 + 0.01 * (kind % 3)])
        author.mesh(f"Kinds/Leaf{kind}/Card", bent_cards(np.zeros((1, 3)), out, up, size, 0.7, 0.5), look)


def _stem(x: float, z: float, height: float, rng: np.random.Generator) -> Polygons:
    """A thin trunk that leans."""
    t = np.linspace(0.0, 1.0, 8)[:, None]
    lean = rng.uniform(-0.2, 0.2, 3) * np.array([1.0, 0.0, 1.0])
    return tube(np.array([x, 0.0, z]) + np.array([0.0, height, 0.0]) * t + lean * t**2, 0.02 * (1.2 - t[:, 0]), 6)


def _in_box(
    count: int, size: tuple[float, float, float], at: tuple[float, float, float], rng: np.random.Generator
) -> Floats:
    """Places [count, 3] in a box, more of them near its faces: light keeps leaves outside."""
    place = rng.uniform(-1.0, 1.0, (count, 3))
    place[:, 1:] = np.sign(place[:, 1:]) * np.abs(place[:, 1:]) ** 0.7
    return np.asarray(0.5 * place * np.array(size) + np.array(at) + rng.normal(scale=0.02, size=(count, 3)))
