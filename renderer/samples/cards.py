"""Sample scenes of textured cards: hair, foliage, smoke."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import StageAuthor
from renderer.samples.images import leaf, puff, strands
from renderer.samples.shapes import (
    Floats,
    Polygons,
    bent_cards,
    disc,
    grid_faces,
    grid_st,
    joined,
    lathe,
    rounded,
    sphere,
    tube,
    unit,
)


def _lock(
    root: Floats, out: Floats, length: float, width: float, curl: float, phase: float, steps: int = 10
) -> Polygons:
    """A strip that grows from a root outwards, bends down and curls."""
    t = np.linspace(0.0, 1.0, steps)[:, None]
    side = unit(np.cross(out, np.array([0.0, 1.0, 0.0])) + 1e-6)
    wave = curl * t * (np.sin(7.0 * t + phase) * side + 0.5 * np.cos(6.0 * t + phase) * out)
    path = (
        root + out * length * 0.45 * np.sqrt(t) * (1.0 - 0.35 * t) - np.array([0.0, 1.0, 0.0]) * length * t**1.6 + wave
    )
    half = 0.5 * width * (1.0 - 0.5 * t) * side
    points = np.stack((path - half, path + half), axis=1).reshape(-1, 3)
    st = grid_st(steps, 2)
    st[:, 1] = 1.0 - st[:, 1]
    return Polygons(points, grid_faces(steps, 2), st)


def bust(author: StageAuthor) -> None:
    """An opaque head with neck and shoulders, looking along +z; the scalp is an ellipsoid round the origin."""
    skin = author.material("Skin", (0.68, 0.42, 0.30))
    author.mesh("Bust/Head", sphere(0.1, 32, 48).moved(scale=(0.92, 1.22, 1.0)), skin)
    neck = rounded([(0.05, -0.26), (0.045, -0.16), (0.05, -0.06)])
    author.mesh("Bust/Neck", lathe(neck, 32), skin)
    shoulders = rounded([(0.0, -0.36), (0.19, -0.36), (0.17, -0.29), (0.07, -0.24), (0.05, -0.22)])
    cloth = author.material("Cloth", (0.08, 0.12, 0.25))
    author.mesh("Bust/Shoulders", lathe(shoulders, 48).moved(scale=(1.0, 1.0, 0.6)), cloth)


def hair_cards(folder: Path) -> Path:
    """A head with a thousand locks of hair, each a strip with strands in its opacity texture."""
    author = StageAuthor(folder / "hair_cards.usdc")
    rng = np.random.default_rng(3)
    bust(author)
    shades = ((0.36, 0.20, 0.09), (0.62, 0.38, 0.16), (0.24, 0.12, 0.07))
    for layer, shade in enumerate(shades):
        material = author.textured(f"Hair{layer}", author.image(f"hair{layer}.png", strands(shade, layer)))
        locks: list[Polygons] = []
        while len(locks) < 330:
            out = unit(rng.normal(size=3))
            # No hair on the face, which looks along +z.
            if out[1] < -0.15 or (out[2] > 0.45 and out[1] < 0.55):
                continue
            root = out * np.array([0.092, 0.122, 0.1]) * (1.0 + 0.012 * layer)
            length = float(rng.uniform(0.16, 0.3)) * (0.8 + 0.2 * layer)
            width, curl = float(rng.uniform(0.014, 0.026)), float(rng.uniform(0.0, 0.035))
            locks.append(_lock(root, out, length, width, curl, float(rng.uniform(0, 6.3))))
        author.mesh(f"Hair/Layer{layer}", joined(locks), material)
    author.camera("Back", (-0.35, 0.12, -0.75), (0.0, -0.07, 0.0), 38.0)
    author.camera("Side", (0.8, 0.05, 0.15), (0.0, -0.07, 0.0), 38.0)
    author.camera("Front", (0.2, 0.1, 0.8), (0.0, -0.06, 0.0), 38.0)
    return author.save()


def foliage(folder: Path) -> Path:
    """Three young trees and grass: soft translucent leaves, and cut-out grass with an opacity threshold."""
    author = StageAuthor(folder / "foliage.usdc")
    rng = np.random.default_rng(8)
    author.mesh("Ground", disc(3.4, 0.15), author.material("Ground", (0.22, 0.15, 0.08)))
    bark = author.material("Bark", (0.20, 0.12, 0.07))
    greens = ((0.25, 0.62, 0.15), (0.55, 0.72, 0.15), (0.85, 0.50, 0.12))
    for tree, (x, z) in enumerate(((-1.3, -0.4), (1.2, -0.7), (0.1, 0.9))):
        height = float(rng.uniform(1.5, 2.1))
        foot = np.array([x, 0.0, z])
        t = np.linspace(0.0, 1.0, 14)[:, None]
        lean = rng.uniform(-0.25, 0.25, 3) * np.array([1, 0, 1])
        trunk = foot + np.array([0.0, height, 0.0]) * t + lean * t**2
        author.mesh(f"Tree{tree}/Trunk", tube(trunk, 0.07 * (1.15 - t[:, 0]), 12), bark)
        branches, tips = [], []
        for _ in range(26):
            start = trunk[int(rng.integers(5, 14))]
            out = unit(rng.normal(size=3) + np.array([0.0, 0.5, 0.0]))
            u = np.linspace(0.0, 1.0, 7)[:, None]
            line = start + out * float(rng.uniform(0.4, 0.85)) * u - np.array([0.0, 0.12, 0.0]) * u**2
            branches.append(tube(line, 0.022 * (1.1 - u[:, 0]), 6))
            tips.append(line[2:])
        author.mesh(f"Tree{tree}/Branches", joined(branches), bark)
        picture = author.image(f"leaf{tree}.png", leaf(greens[tree], (0.6, 0.7, 0.5)[tree], tree))
        roots = np.concatenate(tips)[rng.integers(0, 26 * 5, 1500)]
        facing = unit(rng.normal(size=(1500, 3)))
        hang = unit(rng.normal(size=(1500, 3)) * 0.8 + np.array([0.0, -0.5, 0.0]))
        roots = roots + rng.normal(scale=0.06, size=(1500, 3))
        leaves = bent_cards(roots, facing, hang, rng.uniform(0.11, 0.2, 1500), 0.75, 0.5)
        author.mesh(f"Tree{tree}/Leaves", leaves, author.textured(f"Leaf{tree}", picture))
    angle, reach = rng.uniform(0, 2 * np.pi, 1800), 3.3 * np.sqrt(rng.uniform(0, 1, 1800))
    place = np.column_stack((reach * np.cos(angle), np.zeros(1800), reach * np.sin(angle)))
    facing = unit(rng.normal(size=(1800, 3)) * np.array([1.0, 0.15, 1.0]))
    grass = bent_cards(place, facing, np.tile([[0.0, 1.0, 0.0]], (1800, 1)), rng.uniform(0.12, 0.3, 1800), 0.3, 0.6)
    blade = author.textured("Grass", author.image("grass.png", leaf((0.35, 0.55, 0.12), 1.0, 9)), threshold=0.4)
    author.mesh("Grass", grass, blade)
    author.camera("Front", (0.6, 1.5, 5.0), (0.0, 1.05, 0.0), 40.0)
    author.camera("Side", (-4.3, 0.8, 1.8), (0.0, 1.0, 0.0), 40.0)
    author.camera("Within", (1.7, 1.5, 2.2), (-0.3, 1.3, -0.4), 50.0)
    return author.save()


def smoke_cards(folder: Path) -> Path:
    """A camp fire whose smoke is made of 390 soft cards, with a translucent tent beside it."""
    author = StageAuthor(folder / "smoke_cards.usdc")
    rng = np.random.default_rng(21)
    author.mesh("Ground", disc(2.6, 0.1), author.material("Ground", (0.16, 0.13, 0.10)))
    wood = author.material("Wood", (0.22, 0.12, 0.06))
    stone = author.material("Stone", (0.32, 0.31, 0.30))
    for i in range(7):
        turn = 2.0 * np.pi * i / 7.0
        ends = np.array(
            [[0.42 * np.cos(turn), 0.03, 0.42 * np.sin(turn)], [0.05 * np.cos(turn), 0.32, 0.05 * np.sin(turn)]]
        )
        author.mesh(f"Fire/Log{i}", tube(np.linspace(ends[0], ends[1], 8), 0.045, 16), wood)
    for i in range(16):
        turn = 2.0 * np.pi * i / 16.0
        pebble = sphere(0.09, 12, 20).moved(scale=(1.0, 0.7, 1.1), by=(0.6 * np.cos(turn), 0.03, 0.6 * np.sin(turn)))
        author.mesh(f"Fire/Stone{i}", pebble, stone)
    for i, (r, opacity, colour) in enumerate(
        ((0.24, 0.25, (0.9, 0.2, 0.02)), (0.17, 0.35, (1.0, 0.5, 0.05)), (0.1, 0.5, (1.0, 0.85, 0.3)))
    ):
        flame = rounded(
            [(0.0, 0.05), (r, 0.18), (0.55 * r, 0.45 - 0.06 * i), (0.12 * r, 0.72 - 0.14 * i), (0.0, 0.8 - 0.16 * i)]
        )
        author.mesh(
            f"Fire/Flame{i}", lathe(flame, 36), author.material(f"Flame{i}", colour, opacity, (0.3, 0.12, 0.02))
        )
    tent = [
        author.material(f"Tent{i}", c, o)
        for i, (c, o) in enumerate((((0.75, 0.35, 0.12), 0.45), ((0.9, 0.8, 0.6), 0.3)))
    ]
    for i, scale in enumerate((1.0, 0.9)):
        dome = lathe(rounded([(0.85, 0.0), (0.78, 0.4), (0.5, 0.75), (0.0, 0.9)], 10), 48)
        author.mesh(f"Tent/Skin{i}", dome.moved(scale=scale, by=(-1.45, 0.0, -0.7)), tent[i])
    for kind, (shade, seed) in enumerate((((0.55, 0.55, 0.58), 1), ((0.8, 0.78, 0.76), 2), ((0.3, 0.3, 0.33), 3))):
        count = 130
        rise = rng.uniform(0.0, 1.0, count) ** 0.8
        wide = 0.08 + 0.55 * rise
        swirl = 5.0 * rise + rng.uniform(0, 2 * np.pi, count)
        centre = np.column_stack(
            (
                0.7 * rise**1.5 + wide * np.cos(swirl) * rng.uniform(0, 0.8, count),
                0.5 + 2.3 * rise,
                wide * np.sin(swirl) * rng.uniform(0, 0.8, count),
            )
        )
        facing = unit(rng.normal(size=(count, 3)) * np.array([1.0, 0.3, 1.0]))
        size = rng.uniform(0.3, 0.5, count) * (0.6 + 1.1 * rise)
        puffs = bent_cards(centre, facing, unit(rng.normal(size=(count, 3))), size, 1.0, 0.1)
        author.mesh(
            f"Smoke/Kind{kind}",
            puffs,
            author.textured(f"Smoke{kind}", author.image(f"smoke{kind}.png", puff(shade, seed))),
        )
    author.camera("Front", (0.4, 1.1, 5.2), (0.0, 1.25, 0.0), 40.0)
    author.camera("Side", (-3.6, 1.9, 2.6), (0.1, 1.15, 0.0), 42.0)
    author.camera("Near", (1.6, 0.9, 2.0), (0.0, 1.1, 0.0), 52.0)
    return author.save()
