"""Two small samples as binary glTF, for the browser: glass shells round opaque cores, and a shelf of bottles.

They are committed as `deploy/client/web/samples/*.glb`; `python -m renderer.samples.glb` writes them again.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.samples.author import Colour
from renderer.samples.glass import PALETTE
from renderer.samples.shapes import Polygons, box, disc, lathe, rounded, sphere

HOME = Path(__file__).resolve().parents[2] / "deploy/client/web/samples"

Vec3 = tuple[float, float, float]

_FLOAT, _UINT16 = 5126, 5123
_VERTICES, _INDICES = 34962, 34963
_DIGITS = 4
"""Of positions in metres and of normals: the last bits of a sine are the machine's own, and must not be in the file."""


class GlbAuthor:
    """A scene in one .glb file; y is up, metres."""

    def __init__(self) -> None:
        self._binary = bytearray()
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._nodes: list[dict[str, Any]] = []
        self._shown: dict[tuple[str, int], int] = {}
        self._shapes: dict[str, dict[str, Any]] = {}

    def material(self, name: str, colour: Colour, opacity: float = 1.0) -> int:
        """A look: linear RGB, and opacity; below 1 it is blended."""
        self._materials.append(
            {
                "name": name,
                "pbrMetallicRoughness": {"baseColorFactor": [*colour, opacity], "metallicFactor": 0.0},
                "alphaMode": "BLEND" if opacity < 1.0 else "OPAQUE",
                "doubleSided": True,
            }
        )
        return len(self._materials) - 1

    def shape(self, name: str, polygons: Polygons) -> None:
        """Geometry that is placed by its name."""
        points, normals, triangles = _triangulated(polygons)
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        self._shapes[name] = {
            "attributes": {"POSITION": self._rows(points, bounds), "NORMAL": self._rows(normals, {})},
            "indices": self._accessor(triangles.astype("<u2"), _INDICES, _UINT16, "SCALAR", {}),
        }

    def place(self, shape: str, material: int, at: Vec3 = (0.0, 0.0, 0.0), scale: float = 1.0) -> None:
        """Shows a shape with a look."""
        if (shape, material) not in self._shown:
            self._meshes.append({"primitives": [{**self._shapes[shape], "material": material}]})
            self._shown[shape, material] = len(self._meshes) - 1
        node: dict[str, Any] = {"mesh": self._shown[shape, material]}
        node["translation"] = [round(x, _DIGITS) for x in at]
        node["scale"] = [round(scale, _DIGITS)] * 3
        self._nodes.append(node)

    def content(self) -> bytes:
        """The file (glTF 2.0, section 4.4)."""
        described = {
            "asset": {"version": "2.0", "generator": "Diaphane"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self._nodes)))}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": self._materials,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._binary)}],
        }
        text = json.dumps(described, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = [struct.pack("<I4s", len(text), b"JSON") + text]
        chunks.append(struct.pack("<I4s", len(self._binary), b"BIN\0") + bytes(self._binary))
        size = 12 + sum(map(len, chunks))
        return struct.pack("<4sII", b"glTF", 2, size) + b"".join(chunks)

    def _rows(self, rows: NDArray[np.float32], more: dict[str, Any]) -> int:
        return self._accessor(rows.astype("<f4"), _VERTICES, _FLOAT, "VEC3", more)

    def _accessor(self, array: NDArray[Any], target: int, component: int, kind: str, more: dict[str, Any]) -> int:
        content = array.tobytes()
        self._views.append({"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(content), "target": target})
        self._binary += content + b"\0" * (-len(content) % 4)
        number = len(self._views) - 1
        self._accessors.append({"bufferView": number, "componentType": component, "count": len(array), "type": kind})
        self._accessors[-1].update(more)
        return number


def shells() -> bytes:
    """Concentric glass spheres round opaque cores, on a dark plate."""
    author = GlbAuthor()
    author.shape("sphere", sphere(1.0, 14, 28))
    author.shape("plate", disc(0.48, 0.02))
    author.place("plate", author.material("Plate", (0.05, 0.05, 0.06)), (0.0, -0.011, 0.0))
    core = author.material("Core", (0.9, 0.7, 0.25))
    opacities = (0.3, 0.18, 0.4, 0.25, 0.35, 0.5, 0.22, 0.1)
    glass = [author.material(f"Glass{i}", PALETTE[i], opacity) for i, opacity in enumerate(opacities)]
    clusters = [((0.0, 0.19, 0.0), 0.18, 9)]
    for i in range(8):
        angle = 2.0 * np.pi * (i + 0.25) / 8.0
        radius = 0.085 + 0.012 * (i % 3)
        centre = 0.33 * float(np.cos(angle)), radius, 0.33 * float(np.sin(angle))
        clusters.append((centre, radius, 3 + i % 4))
    for number, (centre, radius, count) in enumerate(clusters):
        author.place("sphere", core, centre, 0.2 * radius)
        for shell in range(count):
            size = radius * (0.35 + 0.65 * (shell + 1) / count)
            author.place("sphere", glass[(number + 3 * shell) % len(glass)], centre, size)
    return author.content()


def shelf() -> bytes:
    """Rows of bottles with drinks in them; the glass has an outside and an inside."""
    author = GlbAuthor()
    author.shape("board", box((1.1, 0.03, 0.5)))
    author.place("board", author.material("Wood", (0.32, 0.17, 0.08)), (0.0, -0.016, 0.0))
    tall = [(0.0, 0.0), (0.036, 0.002), (0.04, 0.02), (0.04, 0.17), (0.034, 0.21), (0.015, 0.245), (0.014, 0.3)]
    low = [(0.0, 0.0), (0.045, 0.004), (0.06, 0.05), (0.052, 0.1), (0.02, 0.14), (0.016, 0.2), (0.02, 0.21)]
    for kind, (profile, level) in enumerate(((tall, 0.16), (low, 0.09))):
        curve = rounded(profile, 3)
        author.shape(f"outside{kind}", lathe(curve, 18))
        author.shape(f"inside{kind}", lathe([(0.86 * r, h + 0.004) for r, h in curve], 18))
        drink = [(0.8 * r, h + 0.006) for r, h in curve if h < level]
        author.shape(f"drink{kind}", lathe([*drink, (0.0, drink[-1][1])], 18))
    clear = [
        author.material(f"Glass{i}", PALETTE[(3 * i + 4) % 8], opacity) for i, opacity in enumerate((0.16, 0.28, 0.38))
    ]
    drinks = [author.material(f"Drink{i}", PALETTE[i], 0.45) for i in range(5)]
    for row in range(3):
        for column in range(7):
            number = 7 * row + column
            kind = (number + row) % 2
            at = (-0.45 + 0.15 * column + 0.02 * (row % 2), 0.0, -0.16 + 0.16 * row)
            for part, looks in ((f"outside{kind}", clear), (f"inside{kind}", clear), (f"drink{kind}", drinks)):
                author.place(part, looks[number % len(looks)], at, 0.9 + 0.1 * ((2 * number) % 3))
    return author.content()


SAMPLES = {"shells.glb": shells, "shelf.glb": shelf}


def _triangulated(polygons: Polygons) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Points and normals, float32 [V, 3], and corners, int64 [3 T]; faces of a mesh that is not smooth share none."""
    points, faces = polygons.points, polygons.faces
    if not polygons.smooth:
        points, faces = points[faces.ravel()], np.arange(faces.size).reshape(faces.shape)
    fan: Sequence[tuple[int, int, int]] = [(0, i, i + 1) for i in range(1, faces.shape[1] - 1)]
    triangles = np.concatenate([faces[:, corners] for corners in fan])
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    triangles, area = (rows[np.linalg.norm(area, axis=1) > 1e-12] for rows in (triangles, area))
    normals = np.zeros_like(points)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], area)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.tile((0.0, 1.0, 0.0), (len(points), 1)), where=length > 0.0)
    # + 0.0 makes no zero a negative one.
    kept = [(np.round(rows, _DIGITS) + 0.0).astype(np.float32) for rows in (points, normals)]
    return kept[0], kept[1], triangles.ravel()


if __name__ == "__main__":
    for _name, _make in SAMPLES.items():
        (HOME / _name).write_bytes(_make())
