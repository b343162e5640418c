"""Scenes whose numbers are not finite: no pass may ever see them, so loading has to refuse them, and say why."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from evaluation.stress.findings import Finding
from evaluation.stress.gl_bounds import BOUNDS
from renderer.scene import load_scene
from schemas.problem import Problem

_HEAD = '#usda 1.0\n(\n    defaultPrim = "World"\n    metersPerUnit = 1\n    upAxis = "Y"\n)\ndef Xform "World"\n{\n'
_FACES = "int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n"
_GOOD = "(0, 0, 0), (1, 0, 0), (0, 1, 0)"

PRIMS = {
    "a mesh's points": 'def Mesh "M" {{\n' + _FACES + "point3f[] points = [(0, 0, {bad}), (1, 0, 0), (0, 1, 0)]\n}}\n",
    "points": 'def Points "P" {{\n point3f[] points = [(0, {bad}, 0), (1, 0, 0)]\n float[] widths = [1, 1]\n}}\n',
    "a curve's points": (
        'def BasisCurves "C" {{\n uniform token type = "linear"\n int[] curveVertexCounts = [2]\n'
        " point3f[] points = [(0, 0, 0), ({bad}, 1, 0)]\n float[] widths = [.1]\n}}\n"
    ),
    "a transform": (
        'def Mesh "M" {{\n' + _FACES + f"point3f[] points = [{_GOOD}]\n"
        ' double3 xformOp:translate = ({bad}, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
    ),
    "an instancer's positions": (
        'def PointInstancer "I" {{\n rel prototypes = [</World/I/M>]\n int[] protoIndices = [0, 0]\n'
        " point3f[] positions = [(0, 0, 0), (0, {bad}, 0)]\n"
        '    def Mesh "M" {{\n' + _FACES + f"point3f[] points = [{_GOOD}]\n" + "}}\n}}\n"
    ),
}
"""Parts of a stage, each with a place for a number."""


def rows() -> Iterator[Finding]:
    """How many of the stages with a bad number were not refused with a `Problem`; and that the good one is not."""
    bound = BOUNDS["refused.scenes"]
    with tempfile.TemporaryDirectory() as folder:
        for bad in ("nan", "inf", "-inf"):
            wrong = [name for name, prim in PRIMS.items() if not _refused(Path(folder), prim.format(bad=bad))]
            wrong += [f"{name}, though 1" for name, prim in PRIMS.items() if _refused(Path(folder), prim.format(bad=1))]
            count, where = float(len(wrong)), ", ".join(wrong) or "nowhere"
            yield Finding("refused.scenes", f"{bad} in a stage", count, count, where, bound.value, bound.measure)


def _refused(folder: Path, prim: str) -> bool:
    # Each at a path of its own: a layer that is still open is not read again.
    path = folder / f"{len(list(folder.iterdir()))}.usda"
    path.write_text(f"{_HEAD}{prim}}}\n", encoding="utf-8")
    try:
        load_scene(path)
    except Problem as problem:
        return bool(problem.title and problem.remedy)
    return False
