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


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=60))
def test_weld_keeps_every_distinct_row_once(rows: list[tuple[int, int]]) -> None:
    columns = (np.array(rows, dtype=np.float32)[:, :1], np.array(rows, dtype=np.uint32)[:, 1:])
    kept, number = weld(columns)
    assert [rows[i] for i in kept] == list(dict.fromkeys(rows))
    assert [rows[kept[i]] for i in number] == rows
