"""Small USD stages as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schemas.scene import SceneArrays

TRIANGLE = """
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
"""


def stage(folder: Path, body: str, header: str = "metersPerUnit = 1", name: str = "scene.usda") -> Path:
    """Writes a stage; statements may end with " }" or " )" on the same line, which the format itself forbids."""
    body = body.replace(" }", "\n}").replace(" )", "\n)").replace("; ", "\n")
    file = folder / name
    file.write_text(f"#usda 1.0\n(\n{header}\n)\n{body}")
    return file


def triangle(name: str = "Tri", extra: str = "", points: str = "") -> str:
    body = TRIANGLE if not points else TRIANGLE.replace("(0, 0, 0), (1, 0, 0), (0, 1, 0)", points)
    return f'def Mesh "{name}"\n{{{body}\n{extra}\n}}\n'


def world(scene: SceneArrays) -> np.ndarray:
    """Corner positions in stage space, metres, [T, 3, 3]."""
    return scene.positions[scene.indices.reshape(-1, 3)].astype(np.float64) + scene.origin
