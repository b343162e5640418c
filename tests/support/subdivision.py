"""One level of subdivision in plain Python, point by point: the slow twin of renderer/usd/refine.py."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, pi

import numpy as np

Vector = np.ndarray
Edge = tuple[int, int]


@dataclass
class Mesh:
    """A mesh with sharpnesses; edges are (low, high)."""

    points: list[Vector]
    faces: list[list[int]]
    edges: dict[Edge, float] = field(default_factory=dict)
    corners: dict[int, float] = field(default_factory=dict)


def edge(a: int, b: int) -> Edge:
    return (min(a, b), max(a, b))


def edges_of(mesh: Mesh) -> dict[Edge, list[int]]:
    """Every edge, sorted, with its faces."""
    found: dict[Edge, list[int]] = {}
    for number, face in enumerate(mesh.faces):
        for i, a in enumerate(face):
            found.setdefault(edge(a, face[(i + 1) % len(face)]), []).append(number)
    return dict(sorted(found.items()))


def with_boundaries(mesh: Mesh, boundary: str) -> Mesh:
    """The mesh with its borders infinitely sharp, as `interpolateBoundary` asks."""
    all_edges = edges_of(mesh)
    edges = {e: (inf if len(f) != 2 else mesh.edges.get(e, 0.0)) for e, f in all_edges.items()}
    corners = dict(mesh.corners)
    for point in range(len(mesh.points)):
        around = [e for e in all_edges if point in e]
        faces = [f for f in mesh.faces if point in f]
        border = any(edges[e] == inf and len(all_edges[e]) != 2 for e in around)
        if not faces or len(around) - len(faces) not in (0, 1):
            corners[point] = inf
        if boundary == "edgeAndCorner" and border and len(faces) == 1:
            corners[point] = inf
    return Mesh(mesh.points, mesh.faces, edges, corners)


def level(mesh: Mesh, scheme: str) -> Mesh:
    """The next level: points of points, then of edges in order, then of faces."""
    all_edges = edges_of(mesh)
    centres = [sum(mesh.points[p] for p in f) / len(f) for f in mesh.faces]
    smooth = scheme != "bilinear"
    vertex = [
        _vertex(mesh, all_edges, centres, p, scheme) if smooth else mesh.points[p] for p in range(len(mesh.points))
    ]
    middle = {e: _edge(mesh, e, faces, centres, scheme) for e, faces in all_edges.items()}
    number = {e: len(vertex) + i for i, e in enumerate(middle)}
    points = vertex + list(middle.values())
    faces: list[list[int]] = []
    if scheme == "loop":
        for a, b, c in mesh.faces:
            ab, bc, ca = number[edge(a, b)], number[edge(b, c)], number[edge(c, a)]
            faces += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    else:
        first = len(points)
        points += centres
        for i, face in enumerate(mesh.faces):
            for j, p in enumerate(face):
                after, before = edge(p, face[(j + 1) % len(face)]), edge(face[j - 1], p)
                faces.append([p, number[after], first + i, number[before]])
    halves = {edge(end, number[e]): max(s - 1.0, 0.0) for e, s in mesh.edges.items() for end in e}
    return Mesh(points, faces, halves, {p: max(s - 1.0, 0.0) for p, s in mesh.corners.items()})


def _edge(mesh: Mesh, e: Edge, faces: list[int], centres: list[Vector], scheme: str) -> Vector:
    a, b = mesh.points[e[0]], mesh.points[e[1]]
    sharpness = 1.0 if scheme == "bilinear" else min(mesh.edges.get(e, 0.0), 1.0)
    if sharpness == 1.0:
        return (a + b) / 2
    if scheme == "loop":
        opposite = [mesh.points[p] for f in faces for p in mesh.faces[f] if p not in e]
        soft = (3 * a + 3 * b + opposite[0] + opposite[1]) / 8
    else:
        soft = (a + b + centres[faces[0]] + centres[faces[1]]) / 4
    return (1 - sharpness) * soft + sharpness * (a + b) / 2


def _vertex(mesh: Mesh, all_edges: dict[Edge, list[int]], centres: list[Vector], p: int, scheme: str) -> Vector:
    around = [e for e in all_edges if p in e]

    def sharp(shift: float) -> tuple[str, list[Edge]]:
        on = [e for e in around if mesh.edges.get(e, 0.0) - shift > 0.0]
        if mesh.corners.get(p, 0.0) - shift > 0.0 or len(on) > 2:
            return "corner", on
        return ("crease" if len(on) == 2 else "smooth"), on

    def moved(rule: str, on: list[Edge]) -> Vector:
        here = mesh.points[p]
        others = [mesh.points[a if b == p else b] for a, b in (around if rule == "smooth" else on)]
        if rule == "corner":
            return here
        if rule == "crease":
            return 0.75 * here + 0.125 * (others[0] + others[1])
        n = len(around)
        if scheme == "loop":
            beta = (5 / 8 - (3 / 8 + cos(2 * pi / n) / 4) ** 2) / n
            return (1 - n * beta) * here + beta * sum(others)
        faces = [centres[i] for i, f in enumerate(mesh.faces) if p in f]
        middles = [(here + other) / 2 for other in others]
        return (sum(faces) / n + 2 * sum(middles) / n + (n - 3) * here) / n

    now, soon = sharp(0.0), sharp(1.0)
    if now[0] == soon[0]:
        return moved(*now)
    ending = [s for s in [*(mesh.edges.get(e, 0.0) for e in around), mesh.corners.get(p, 0.0)] if 0.0 < s <= 1.0]
    share = min(sum(ending) / len(ending), 1.0) if ending else 0.0
    return share * moved(*now) + (1 - share) * moved(*soon)
