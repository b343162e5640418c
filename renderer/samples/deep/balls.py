"""Deep sample scenes of many small solids: a bowl of glass marbles, a fountain of spray."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import StageAuthor
from renderer.samples.glass import PALETTE
from renderer.samples.shapes import Floats, Polygons, disc, lathe, rounded, sphere


def marbles(folder: Path) -> Path:
    """A glass bowl with 1,000 instanced marbles, each of clear glass round a coloured heart."""
    author = StageAuthor(folder / "marbles.usdc", metres=0.01)
    rng = np.random.default_rng(47)
    author.sky(200.0, (0.10, 0.09, 0.12))
    author.mesh("Table", disc(190.0, 1.0), author.material("Table", (0.30, 0.19, 0.11)))
    jar = [(11.0, 0.15), (13.2, 0.8), (14.6, 3.0), (15.2, 7.0), (14.6, 11.5), (13.0, 14.5), (12.4, 15.6), (12.9, 16.4)]
    glass = author.material("Jar", (0.80, 0.92, 0.90), 0.12)
    for name, scale in (("Outside", 1.0), ("Inside", 0.965)):
        author.mesh(f"Bowl/{name}", lathe([(0.0, 0.15), *rounded(jar, 5)], 72).moved(scale=(scale, 1.0, scale)), glass)
    author.prototypes("Kinds")
    for kind, colour in enumerate(PALETTE):
        red, green, blue = (0.4 + 0.6 * c for c in colour)
        clear = author.material(f"Clear{kind}", (red, green, blue), 0.12)
        author.mesh(f"Kinds/Marble{kind}/Glass", sphere(1.0, 10, 18), clear)
        for turn, size in enumerate((0.78, 0.5)):
            heart = sphere(size, 6, 12).moved(scale=(1.0, 1.0, 0.45)).turned(turn, 50.0 + 40.0 * turn)
            author.mesh(f"Kinds/Marble{kind}/Heart{turn}", heart, author.material(f"Heart{kind}{turn}", colour, 0.42))
    at = np.concatenate((_packed(1.0, rng), _spilt(rng)))
    turns = rng.normal(size=(len(at), 4))
    author.scatter(
        "Marbles",
        [f"Kinds/Marble{kind}" for kind in range(len(PALETTE))],
        rng.integers(0, len(PALETTE), len(at)),
        at,
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        rng.uniform(0.9, 1.0, len(at)),
    )
    author.camera("Front", (6.0, 15.0, 38.0), (0.0, 7.6, 0.0), 34.0)
    author.camera("Above", (-18.0, 34.0, 24.0), (0.0, 6.5, 0.0), 36.0)
    author.camera("Near", (14.0, 13.0, 20.0), (0.0, 8.5, 0.0), 42.0)
    return author.save()


def _packed(ball: float, rng: np.random.Generator) -> Floats:
    """Centres [M, 3] of balls in the bowl, heaped: a hexagonal close packing, turned and a little out of place."""
    layers = []
    for number, y in enumerate(ball * np.sqrt(8.0 / 3.0) * np.arange(-12, 13)):
        odd = number % 2
        rows = np.arange(-12, 13)
        x = 2.0 * ball * np.arange(-12, 13)[None] + ball * (rows[:, None] % 2) + odd * ball
        z = np.sqrt(3.0) * ball * rows[:, None] + odd * ball / np.sqrt(3.0) + 0.0 * x
        layers.append(np.column_stack((x.ravel(), np.full(x.size, y), z.ravel())))
    at = np.concatenate(layers)
    tilt = Polygons(at, np.zeros((0, 3), np.int64)).turned(0, 33.0).turned(2, 21.0).points
    at = tilt + np.array([0.0, 8.0, 0.0]) + rng.normal(scale=0.10 * ball, size=at.shape)
    reach = np.hypot(at[:, 0], at[:, 2])
    width = np.interp(at[:, 1], (0.8, 2.0, 4.0, 7.0, 11.5, 14.0), (11.0, 12.5, 13.2, 13.6, 13.0, 11.4))
    heap = 13.0 + 2.5 * np.cos(np.minimum(reach / 12.0, 1.0) * np.pi)
    return np.asarray(at[(at[:, 1] > 1.3) & (at[:, 1] < heap) & (reach < width)])


def _spilt(rng: np.random.Generator) -> Floats:
    """Centres [24, 3] of marbles that lie on the table round the jar."""
    angle, reach = 2.4 * np.arange(24) + rng.uniform(-0.2, 0.2, 24), rng.uniform(18.0, 29.0, 24)
    return np.column_stack((reach * np.cos(angle), np.full(24, 0.95), reach * np.sin(angle)))


def fountain(folder: Path) -> Path:
    """A fountain: 78,000 points of spray in five jets over two translucent pools."""
    author = StageAuthor(folder / "fountain.usdc")
    rng = np.random.default_rng(53)
    author.sky(40.0, (0.16, 0.30, 0.62))
    author.mesh("Court", disc(39.0, 0.1).moved(by=(0, -0.02, 0)), author.material("Court", (0.42, 0.36, 0.30)))
    stone = author.material("Stone", (0.55, 0.52, 0.47))
    basin = [(2.25, 0.0), (2.45, 0.1), (2.4, 0.42), (2.2, 0.42), (2.15, 0.15), (0.0, 0.12)]
    author.mesh("Basin/Rim", lathe([(0.0, 0.0), *basin], 72), stone)
    bowl = [(0.22, 0.0), (0.16, 0.5), (0.2, 0.85), (0.75, 1.05), (0.86, 1.2), (0.8, 1.2), (0.6, 1.1), (0.0, 1.05)]
    author.mesh("Basin/Bowl", lathe(rounded(bowl, 5), 56), stone)
    water = author.material("Water", (0.25, 0.50, 0.58), 0.45)
    author.mesh("Water/Pool", disc(2.15, 0.004).moved(by=(0, 0.36, 0)), water)
    author.mesh("Water/Bowl", disc(0.8, 0.004).moved(by=(0, 1.17, 0)), water)
    at = np.concatenate((_jet(34000, 0.1, 0.62, 5.0, 1.2, rng), *(_ring(11000, i, rng) for i in range(4))))
    height = np.clip(at[:, 1] / 2.6, 0.0, 1.0)[:, None]
    colour = (1 - height) * np.array([0.36, 0.62, 0.78]) + height * np.array([0.90, 0.96, 1.0])
    widths = rng.gamma(3.0, 0.009, len(at)) + 0.013
    author.points("Spray", at, widths, colour, np.clip(0.0028 / widths, 0.05, 0.25))
    author.camera("Front", (1.2, 1.9, 5.6), (0.0, 1.15, 0.0), 36.0)
    author.camera("Low", (-4.2, 0.9, 2.4), (0.0, 1.2, 0.0), 38.0)
    author.camera("Near", (1.6, 1.9, 2.3), (0.0, 1.5, 0.0), 46.0)
    return author.save()


def _jet(count: int, lean: float, spread: float, speed: float, foot: float, rng: np.random.Generator) -> Floats:
    """Drops [count, 3] on ballistic paths from a nozzle at height `foot`, thrown out all round."""
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    out = lean + spread * np.abs(rng.normal(size=count))
    up = speed * np.sqrt(rng.uniform(0.12, 1.0, count)) * np.exp(-0.25 * out)
    flight = (up + np.sqrt(up**2 + 2.0 * 9.81 * (foot - 0.36))) / 9.81
    t = flight * rng.uniform(0.0, 1.0, count)
    at = np.column_stack((out * t * np.cos(angle), foot + up * t - 4.905 * t**2, out * t * np.sin(angle)))
    return np.asarray(at + rng.normal(scale=0.015, size=at.shape) * (0.3 + t[:, None]))


def _ring(count: int, number: int, rng: np.random.Generator) -> Floats:
    """Drops of one of the four jets that bend inwards from the basin's rim."""
    turn = 0.5 * np.pi * (number + 0.5)
    speed, t = 4.3, rng.uniform(0.0, 0.86, count)
    reach = 1.9 - 1.7 * t + rng.normal(scale=0.03, size=count) * (0.5 + 2.0 * t)
    side = rng.normal(scale=0.05, size=count) * (0.3 + 2.0 * t)
    height = 0.4 + speed * t - 4.905 * t**2 + rng.normal(scale=0.02, size=count)
    x = reach * np.cos(turn) - side * np.sin(turn)
    return np.column_stack((x, height, reach * np.sin(turn) + side * np.cos(turn)))
