"""Triangulation and welding for any polygons."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from renderer.usd.topology import triangulate
from renderer.usd.weld import weld


@given(st.lists(st.integers(0, 9), min_size=1, max_size=30), st.booleans(), st.data())
def test_fans_cover_regular_polygons_once(counts: list[int], left_handed: bool, data: st.DataObject) -> None:
    holes = np.array(sorted(data.draw(st.sets(st.integers(0, len(counts) - 1)))), dtype=np.int64)
    points = [(np.cos(2 * np.pi * i / c), np.sin(2 * np.pi * i / c)) for c in counts for i in range(c)]
    place = np.array(points, dtype=np.float64).reshape(-1, 2)
    sizes = np.array(counts, dtype=np.int64)
    mesh = triangulate(len(place), sizes, np.arange(len(place)), left_handed=left_handed, holes=holes)
    a, b, c = (place[mesh.corners[mesh.triangles[:, i]]] for i in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    drawn = np.bincount(mesh.face_of_triangle, area, minlength=len(counts))
    wanted = np.array([0.5 * n * np.sin(2 * np.pi / n) if n > 2 else 0.0 for n in counts])
    wanted[holes] = 0.0
    np.testing.assert_allclose(drawn, -wanted if left_handed else wanted, atol=1e-12)


@given(st.lists(st.floats(0.2, 3.0), min_size=3, max_size=14), st.integers(0, 2**32 - 1), st.booleans())
def test_concave_polygons_are_cut_without_overlap(radii: list[float], seed: int, left_handed: bool) -> None:
    """Star-shaped polygons in any plane: the triangles wind like the polygon and their areas sum to its area."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(len(radii)) + rng.uniform(0.0, 0.9, len(radii))) / len(radii)
    flat = np.stack((np.cos(angle), np.sin(angle), np.zeros(len(radii))), axis=1) * np.array(radii)[:, None]
    turned = flat[:, :1] * np.roll(flat[:, 1:2], -1, axis=0) - flat[:, 1:2] * np.roll(flat[:, :1], -1, axis=0)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    basis *= np.sign(np.linalg.det(basis))
    places = np.concatenate((rng.normal(size=(4, 3)), flat @ basis.T + rng.normal(size=3)))
    counts = np.array([4, len(radii)])
    mesh = triangulate(len(places), counts, np.arange(len(places)), left_handed=left_handed, places=places)
    corners = places[mesh.corners[mesh.triangles[mesh.face_of_triangle == 1]]]
    along = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ basis[:, 2]
    along *= -1.0 if left_handed else 1.0
    assert len(along) == len(radii) - 2
    np.testing.assert_allclose(along.sum(), turned.sum(), rtol=1e-9)
    if turned.min() > 0.0:
        # The centre sees every corner, so that the polygon is simple.
        assert along.min() > -1e-5 * abs(turned.sum())


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=60))
def test_weld_keeps_every_distinct_row_once(rows: list[tuple[int, int]]) -> None:
    columns = (np.array(rows, dtype=np.float32)[:, :1], np.array(rows, dtype=np.uint32)[:, 1:])
    kept, number = weld(columns)
    assert [rows[i] for i in kept] == list(dict.fromkeys(rows))
    assert [rows[kept[i]] for i in number] == rows
