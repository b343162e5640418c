"""Sample scenes of built things: a voxel town, an engine of instanced parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.samples.author import StageAuthor
from renderer.samples.shapes import Polygons, box, joined, lathe, tube, voxel_faces

GROUND, WALL, ROOF, GLASS, WATER, LEAVES, TOWER, LAMP = range(1, 9)


def voxel_town(folder: Path) -> Path:
    """A town of cubes: houses with glass fronts, glass towers, trees, a river; z up, cubes of 50 centimetres."""
    author = StageAuthor(folder / "voxel_town.usdc", up="Z", metres=0.5)
    rng = np.random.default_rng(17)
    cells = _town(rng)
    looks = {
        GROUND: author.material("Ground", (0.25, 0.36, 0.14)),
        WALL: author.material("Wall", (0.72, 0.62, 0.48)),
        ROOF: author.material("Roof", (0.55, 0.16, 0.10), 0.55),
        GLASS: author.material("Glass", (0.45, 0.72, 0.85), 0.25),
        WATER: author.material("Water", (0.06, 0.28, 0.55), 0.5),
        LEAVES: author.material("Leaves", (0.16, 0.50, 0.12), 0.4),
        TOWER: author.material("Tower", (0.30, 0.60, 0.62), 0.18),
        LAMP: author.material("Lamp", (0.95, 0.80, 0.35), 0.7, (0.2, 0.15, 0.02)),
    }
    opaque = (cells == GROUND) | (cells == WALL)
    centre = (-0.5 * cells.shape[0], -0.5 * cells.shape[1], -2.0)
    for kind, material in looks.items():
        # Leaves and towers keep the faces between their own cubes: that is what makes such worlds deep.
        hidden_by = opaque if kind in (LEAVES, TOWER) else opaque | (cells == kind)
        name = str(material.GetPrim().GetName())
        author.mesh(f"Town/{name}", voxel_faces(cells == kind, hidden_by).moved(by=centre), material)
    author.camera("Front", (8.0, -58.0, 30.0), (0.0, 0.0, 4.0), 38.0)
    author.camera("Street", (-38.0, -20.0, 7.0), (4.0, 0.0, 6.0), 46.0)
    author.camera("Above", (36.0, 34.0, 46.0), (0.0, 0.0, 2.0), 42.0)
    return author.save()


def _town(rng: np.random.Generator) -> NDArray[np.int64]:
    """Kinds of cubes [48, 48, 26], 0 for air."""
    cells = np.zeros((48, 48, 26), dtype=np.int64)
    cells[:, :, :2] = GROUND
    for x in range(48):
        middle = int(24 + 5 * np.sin(x / 7.0))
        cells[x, middle - 2 : middle + 3, 1] = WATER
    for lot_x in range(6):
        for lot_y in range(6):
            x, y = 8 * lot_x + 1, 8 * lot_y + 1
            if np.any(cells[x : x + 6, y : y + 6, 1] == WATER):
                continue
            (_house, _tower, _tree)[int(rng.choice(3, p=(0.5, 0.2, 0.3)))](cells, x, y, rng)
    return cells


def _house(cells: NDArray[np.int64], x: int, y: int, rng: np.random.Generator) -> None:
    height = int(rng.integers(4, 8))
    cells[x : x + 6, y : y + 6, 2 : 2 + height] = WALL
    cells[x + 1 : x + 5, y + 1 : y + 5, 2 : 2 + height] = 0
    for z in range(3, 2 + height, 3):
        for side in (slice(x + 1, x + 3), slice(x + 4, x + 5)):
            cells[side, [y, y + 5], z : z + 2] = GLASS
        cells[[x, x + 5], y + 1 : y + 5, z : z + 2] = GLASS
    cells[x + 3, y + 3, 2 + height // 2] = LAMP
    for step in range(3):
        cells[x + step : x + 6 - step, y : y + 6, 2 + height + step] = ROOF


def _tower(cells: NDArray[np.int64], x: int, y: int, rng: np.random.Generator) -> None:
    height = int(rng.integers(13, 23))
    for z in range(2, 2 + height):
        cells[x : x + 5, y : y + 5, z] = TOWER
        cells[x + 1 : x + 4, y + 1 : y + 4, z] = WALL if (z - 2) % 5 == 0 else 0
    cells[x + 2, y + 2, 2 : 2 + height] = LAMP


def _tree(cells: NDArray[np.int64], x: int, y: int, rng: np.random.Generator) -> None:
    top = int(rng.integers(6, 9))
    i, j, k = np.meshgrid(np.arange(6), np.arange(6), np.arange(26), indexing="ij")
    crown = (i - 2.5) ** 2 + (j - 2.5) ** 2 + (k - top) ** 2 < 8.5 + rng.uniform(-2, 2, i.shape)
    cells[x : x + 6, y : y + 6][crown & (k > 3)] = LEAVES
    cells[x + 2, y + 2, 2:top] = WALL


def _gear(radius: float, width: float, teeth: int) -> Polygons:
    """A toothed wheel round the y axis."""
    angle = 2.0 * np.pi * np.arange(4 * teeth) / (4 * teeth)
    outer = radius * np.where(np.arange(4 * teeth) % 4 < 2, 1.0, 0.86)
    rings = [(0.3 * radius, 0.5), (0.3 * radius, -0.5), (1.0, -0.5), (1.0, 0.5), (0.3 * radius, 0.5)]
    points = []
    for r, h in rings:
        distance = outer if r == 1.0 else np.full_like(outer, r)
        points.append(
            np.column_stack((distance * np.cos(-angle), np.full_like(angle, h * width), distance * np.sin(-angle)))
        )
    count = 4 * teeth
    c = np.arange(count)
    n = (c + 1) % count
    faces = [
        np.column_stack((i * count + c, i * count + n, (i + 1) * count + n, (i + 1) * count + c)) for i in range(4)
    ]
    return Polygons(np.concatenate(points), np.concatenate(faces), smooth=False)


def engine(folder: Path) -> Path:
    """A four-cylinder engine: translucent housings, native instances of its cylinders, 420 instanced bolts."""
    author = StageAuthor(folder / "engine.usda", metres=0.1)
    rng = np.random.default_rng(2)
    steel = author.material("Steel", (0.55, 0.57, 0.6), 0.55)
    brass = author.material("Brass", (0.75, 0.55, 0.2), 0.6)
    red = author.material("Housing", (0.62, 0.10, 0.08), 0.22)
    blue = author.material("Jacket", (0.15, 0.35, 0.7), 0.18)
    dark = author.material("Iron", (0.12, 0.12, 0.13), 0.7)
    author.mesh("Stand", box((9.0, 0.3, 5.0)).moved(by=(0, -2.9, 0)), author.material("Stand", (0.3, 0.3, 0.32)))
    author.mesh("Block", box((7.4, 2.2, 3.0)).moved(by=(0, -1.1, 0)), red)
    author.mesh("BlockInside", box((7.0, 1.9, 2.7)).moved(by=(0, -1.1, 0)), red)
    author.mesh("Sump", box((6.6, 0.6, 2.2)).moved(by=(0, -2.45, 0)), dark)
    author.prototypes("Parts")
    cylinder = "Parts/Cylinder"
    jacket = [(0.72, 0.0), (0.72, 2.0), (0.62, 2.0), (0.62, 0.0), (0.72, 0.0)]
    author.mesh(f"{cylinder}/Jacket", lathe(jacket, 32), blue)
    fins = [lathe([(0.73, y), (1.0, y), (1.0, y + 0.06), (0.73, y + 0.06)], 32) for y in np.arange(0.2, 2.0, 0.22)]
    author.mesh(f"{cylinder}/Fins", joined(fins), steel)
    author.mesh(f"{cylinder}/Head", lathe([(0.0, 2.05), (0.9, 2.05), (0.9, 2.3), (0.5, 2.5), (0.0, 2.5)], 32), red)
    piston = [(0.0, 0.0), (0.58, 0.0), (0.58, 0.5), (0.52, 0.55), (0.0, 0.55)]
    author.mesh("Parts/Piston/Crown", lathe(piston, 32), steel)
    author.mesh("Parts/Piston/Rod", tube(np.linspace([0, 0.1, 0], [0, -1.6, 0], 6), 0.12, 16), brass)
    author.mesh("Parts/Piston/Spring", tube(_helix(0.4, 1.2, 7, 150), 0.045, 8).moved(by=(0, 0.6, 0)), brass)
    author.mesh("Parts/Gear/Wheel", _gear(1.0, 0.3, 18), brass)
    for i in range(4):
        x = -2.7 + 1.8 * i
        author.instance(f"Cylinder{i}", cylinder, (x, 0.0, 0.0))
        author.instance(f"Piston{i}", "Parts/Piston", (x, 0.35 + 0.45 * (-1.0) ** (i // 2 + i), 0.0), turn=40.0 * i)
    shaft = [(0.28, -3.9), (0.28, 4.3)]
    author.mesh("Shaft", lathe(shaft, 24).turned(2, 90.0).moved(by=(0, -1.1, 0)), dark)
    for i, (x, size) in enumerate(((3.95, 1.1), (3.95, 0.6), (-3.95, 1.4))):
        gear = _gear(size, 0.3, int(16 * size)).turned(2, 90.0).moved(by=(x, -1.1 + (1.6 if i == 1 else 0.0), 0.0))
        author.mesh(f"Gear{i}", gear, brass if i else steel)
    for i, side in enumerate((-1.0, 1.0)):
        for j in range(4):
            x = -2.7 + 1.8 * j
            bow = np.array(
                [
                    [x, 2.2, 0.3 * side],
                    [x, 2.5, 1.2 * side],
                    [x, 1.6, 1.9 * side],
                    [0.5 * x, 0.3, 2.1 * side],
                    [0.2 * x, -0.8, 2.2 * side],
                ]
            )
            author.mesh(
                f"Pipe{i}{j}",
                tube(_smooth(bow, 10), 0.2, 16),
                author.material(f"Pipe{i}{j}", (0.45, 0.3 + 0.05 * j, 0.22 + 0.1 * i), 0.35),
            )
    bolts = ["Parts/BoltLong", "Parts/BoltShort"]
    for path, length in zip(bolts, (0.3, 0.16), strict=True):
        author.mesh(f"{path}/Head", lathe([(0.0, 0.0), (0.1, 0.0), (0.1, 0.08), (0.0, 0.08)], 6), steel)
        author.mesh(f"{path}/Thread", lathe([(0.05, -length), (0.05, 0.0)], 10), brass)
    at, turns = _bolt_places()
    which = rng.integers(0, 2, len(at))
    author.scatter("Bolts", bolts, which, at, turns, rng.uniform(0.8, 1.1, len(at)))
    author.camera("Front", (3.5, 3.2, 11.5), (0.0, -0.2, 0.0), 38.0)
    author.camera("Side", (-10.5, 1.8, 4.0), (0.0, -0.2, 0.0), 36.0)
    author.camera("Above", (5.0, 9.5, 6.0), (0.0, -0.4, 0.0), 38.0)
    return author.save()


def _helix(radius: float, height: float, turns: int, steps: int) -> NDArray[np.float64]:
    t = np.linspace(0.0, 1.0, steps)
    return np.column_stack((radius * np.cos(2 * np.pi * turns * t), height * t, radius * np.sin(2 * np.pi * turns * t)))


def _smooth(points: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """A Bezier curve with these control points (de Casteljau)."""
    t = np.linspace(0.0, 1.0, 4 * steps)[:, None, None]
    level = np.broadcast_to(points[None], (len(t), *points.shape))
    while level.shape[1] > 1:
        level = (1.0 - t) * level[:, :-1] + t * level[:, 1:]
    return np.asarray(level[:, 0])


def _bolt_places() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows of bolts along the block's edges and rings on the heads; positions [M, 3] and quaternions [M, 4]."""
    at, turns = [], []
    half = float(np.sqrt(0.5))
    for side in (-1.0, 1.0):
        for x in np.linspace(-3.5, 3.5, 36):
            for y in (-0.2, -1.1, -2.0):
                at.append((x, y, 1.5 * side))
                turns.append((half, half * side, 0.0, 0.0))
    for i in range(4):
        for angle in 2.0 * np.pi * np.arange(51) / 51:
            at.append((-2.7 + 1.8 * i + 0.82 * np.cos(angle), 2.3, 0.82 * np.sin(angle)))
            turns.append((1.0, 0.0, 0.0, 0.0))
    return np.array(at), np.array(turns)
