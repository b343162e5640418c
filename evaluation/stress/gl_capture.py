"""The capture against geometry in float64: which fragments there are, how deep, in which colour, in which order."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.findings import Finding, compared
from evaluation.stress.gl_bounds import BOUNDS
from evaluation.stress.gl_cases import Case, Scenery
from renderer.capture import capture
from renderer.techniques.ordered import Ordered, capture_ordered
from renderer.tile_range import tile_grid, tile_ranges
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.tail import RANGE_TILE

Floats = NDArray[np.float64]

_EDGE = 1.0 / 64.0
"""Pixels from an edge within which a rasteriser, which snaps corners to 1/256 of a pixel, may decide either way."""
_DEPTH_EDGE = 1e-4
"""The same for depths near a clipping plane or an opaque surface, relative."""
_CHUNK = 2048
"""Polygons at a time."""


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays through pixel centres meet polygons, sorted by pixel, then polygon.

    Attributes:
        key: int64 [N], pixel * polygons + polygon.
        depth: float64 [N], metres.
        sure: bool [N], whether no rounding can decide otherwise.
    """

    key: NDArray[np.int64]
    depth: Floats
    sure: NDArray[np.bool_]


class Geometry:
    """The polygons of a scenery in view space, float64, and rays through its pixel centres.

    Args:
        scenery: In perspective, without lens shift.
        spacing: Pixels between rays, each of which is in the middle of so many: as many of them as it takes for tiles
            of `RANGE_TILE` to cover the picture. 1: pixels, as many as there are.
    """

    def __init__(self, scenery: Scenery, spacing: int = 1) -> None:
        scene, view = scenery.scene, scenery.view
        width, height = scenery.size
        columns, rows = tile_grid(width, height) if spacing > 1 else (width, height)
        rays = RANGE_TILE // spacing if spacing > 1 else 1
        to_view = view.world_to_view()
        world = scene.positions.astype(np.float64).reshape(-1, scenery.corners, 3)
        self.corners = world @ to_view[:3, :3].T + to_view[:3, 3]
        self.normal = scene.normals[:: scenery.corners].astype(np.float64) @ to_view[:3, :3].T
        self.up = to_view[:3, :3] @ np.array(scene.up)
        self.rgba = scene.colours[:: scenery.corners]
        self.near, self.far = view.clip_range(scene.bounds)
        half = np.tan(np.radians(view.fov) / 2.0)
        self.step = 2.0 * half / height * spacing  # from ray to ray
        x = (2.0 * spacing * (np.arange(columns * rays) + 0.5) / width - 1.0) * half * width / height
        y = (1.0 - 2.0 * spacing * (np.arange(rows * rays) + 0.5) / height) * half
        grid = np.meshgrid(x, y)
        self.rays = np.stack([grid[0].ravel(), grid[1].ravel(), -np.ones(len(x) * len(y))], axis=1)
        self.mixed = scene.batches[0].layer == "mixed"

    def hits(self) -> Hits:
        """Every polygon that a ray meets between the planes of the camera, opaque and hidden ones included."""
        parts = [self._hits(first) for first in range(0, len(self.corners), _CHUNK)]
        key, depth, sure = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.argsort(key)
        return Hits(key[order], depth[order], sure[order])

    def _hits(self, first: int) -> tuple[NDArray[np.int64], Floats, NDArray[np.bool_]]:
        # An edge and the eye span a plane; a ray is inside where it is on one side of all of them (Olano and Greer,
        # Triangle Scan Conversion using 2D Homogeneous Coordinates, 1997). Scaled by the edges' own size against
        # underflow.
        corners = self.corners[first : first + _CHUNK]
        unit = corners / np.abs(corners).max(axis=(1, 2), keepdims=True)
        edge = np.cross(unit, np.roll(unit, -1, axis=1))
        normal = np.cross(unit[:, 1] - unit[:, 0], unit[:, 2] - unit[:, 0])
        offset = (normal * unit[:, 0]).sum(axis=1)
        side = np.einsum("pc,qec->qep", self.rays, edge) * np.sign(offset)[:, None, None]
        slope = self.step * np.hypot(edge[:, :, 0], edge[:, :, 1])
        distance = (side / slope[:, :, None]).min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = offset[:, None] / (normal @ self.rays.T) * np.abs(corners).max(axis=(1, 2))[:, None]
            planes = np.minimum(depth / self.near - 1.0, 1.0 - depth / self.far)
        near_edge = (np.abs(distance) < _EDGE) | (np.abs(planes) < _DEPTH_EDGE)
        met = (distance > -_EDGE) & (planes > -_DEPTH_EDGE) & (depth > 0.0)
        polygon, pixel = np.nonzero(met)
        return pixel * len(self.corners) + polygon + first, depth[met], ~near_edge[met]

    def seen(self) -> Hits:
        """Those that are fragments: transparent, and in front of what is opaque."""
        found = self.hits()
        if not self.mixed:
            return found
        pixel, polygon = np.divmod(found.key, len(self.corners))
        alpha = self.rgba[polygon, 3]
        wall = np.full(len(self.rays), np.inf)
        np.minimum.at(wall, pixel[alpha == 255], found.depth[alpha == 255])
        kept = (alpha > 0) & (alpha < 255) & (found.depth < wall[pixel] * (1.0 + _DEPTH_EDGE))
        sure = found.sure & (found.depth < wall[pixel] * (1.0 - _DEPTH_EDGE))
        return Hits(found.key[kept], found.depth[kept], sure[kept])

    def condition(self, key: NDArray[np.int64], depth: Floats) -> Floats:
        """float64 [N], by how much each polygon amplifies roundings of its plane in the depth that is interpolated.

        Args:
            key: int64 [N], pixel x number of polygons + polygon of each hit.
            depth: float64 [N], view-space distance of each hit, metres.
        """
        pixel, polygon = np.divmod(key, len(self.corners))
        terms = self.normal[polygon] * self.rays[pixel]
        grazing = np.abs(terms).sum(axis=1) / np.maximum(np.abs(terms.sum(axis=1)), 1e-300)
        return np.asarray(grazing * np.maximum(np.abs(self.corners[polygon]).max(axis=(1, 2)) / depth, 1.0))

    def levels(self, key: NDArray[np.int64]) -> Floats:
        """float64 [N, 3], what `common/surface.glsl` stores of each hit, in levels before they are rounded.

        Args:
            key: int64 [N], pixel x number of polygons + polygon of each hit.
        """
        pixel, polygon = np.divmod(key, len(self.corners))
        eye = _unit(-self.rays[pixel])
        normal = self.normal[polygon]
        normal = _unit(normal * np.where((normal * eye).sum(axis=1) < 0.0, -1.0, 1.0)[:, None])
        light = _unit(np.array([[-0.5, 0.8, 0.9]]))
        diffuse = np.maximum((normal * light).sum(axis=1), 0.0)
        sky = 0.5 + 0.5 * normal @ self.up
        highlight = np.maximum((normal * _unit(light + eye)).sum(axis=1), 0.0) ** 32
        linear = decode_gamma2(self.rgba[polygon, :3]) * (0.25 + 0.3 * sky + 0.6 * diffuse)[:, None]
        return np.asarray(255.0 * np.sqrt(np.clip(linear + 0.25 * highlight[:, None], 0.0, 1.0)))


def rows(case: Case, driver: str) -> Iterator[Finding]:
    """What the capture made of a scenery."""
    geometry, found = Geometry(case.scenery), capture_ordered(case.frame)
    truth = geometry.seen()
    pixel = np.repeat(np.arange(case.frame.pixels), np.diff(found.offsets))
    key = pixel * len(geometry.corners) + found.rank // (case.scenery.corners - 2)
    yield _membership(case, truth, key, driver)
    at = np.minimum(np.searchsorted(truth.key, key), max(len(truth.key) - 1, 0))
    known = truth.key[at] == key if len(truth.key) else np.zeros(len(key), dtype=bool)
    key, pixel, depth = key[known], pixel[known], truth.depth[at[known]]

    def row(name: str, values: NDArray[np.number], expected: NDArray[np.number]) -> Finding:
        bound = BOUNDS[f"capture.{name}"]

        def where(index: tuple[int, ...]) -> str:
            return case.place(int(pixel[index[0]]))

        path = f"capture.{name} · {driver}"
        return compared(path, case.name, values, expected, bound.value, bound.measure, bound.floor, where)

    amplified = (found.depth[known] / depth - 1.0) / geometry.condition(key, depth)
    yield row("depth", 1.0 + amplified, np.ones(len(depth)))
    rgba = found.packed[known].astype("<u4").view(np.uint8).reshape(-1, 4)
    yield row("colour", rgba[:, :3], geometry.levels(key))
    yield row("alpha", rgba[:, 3], geometry.rgba[key % len(geometry.corners), 3])
    yield _bits(case, found, driver)


def digest(dump: FragmentDump) -> str:
    """sha256 of all arrays of a dump: drivers that follow the same rules agree on every bit."""
    hasher = hashlib.sha256()
    ranges = tile_ranges(dump)
    for array in (dump.offsets, dump.rgba, dump.depth, dump.background, dump.facing, ranges):
        hasher.update(np.ascontiguousarray(array).tobytes())
    return hasher.hexdigest()


def _membership(case: Case, truth: Hits, key: NDArray[np.int64], driver: str) -> Finding:
    """How many fragments are missing, are there twice, or should not be there."""
    missing = np.setdiff1d(truth.key[truth.sure], key)
    extra = np.setdiff1d(key, truth.key)
    twice = len(key) - len(np.unique(key))
    wrong = len(missing) + len(extra) + twice
    polygons = len(case.scenery.scene.positions) // case.scenery.corners
    where = f"{case.scenery.name}, {len(key):,} fragments"
    if wrong:
        first = int(np.concatenate([missing, extra, key])[0]) // polygons
        where = f"{len(missing)} missing, {len(extra)} extra, {twice} twice, {case.place(first)}"
    return _count("fragments", case, driver, wrong, len(key), where)


def _bits(case: Case, found: Ordered, driver: str) -> Finding:
    """In how many words a second capture, and one made in another way and sorted here, differ."""
    dump, again = case.dump, capture(case.frame).dump
    pixel = np.repeat(np.arange(case.frame.pixels), np.diff(found.offsets))
    order = np.lexsort((found.packed, found.depth, pixel))
    wrong = 0
    if np.array_equal(found.offsets, dump.offsets) and digest(again) == digest(dump):
        words = np.ascontiguousarray(dump.rgba).view("<u4")[:, 0] if dump.total else found.packed
        wrong += int(np.count_nonzero(words != found.packed[order]))
        wrong += int(np.count_nonzero(dump.depth.view(np.uint32) != found.depth[order].view(np.uint32)))
    else:
        wrong = max(dump.total, 1)
    return _count("bits", case, driver, wrong, dump.total, f"{case.scenery.name}, {dump.total:,} fragments")


def _count(name: str, case: Case, driver: str, wrong: int, of: int, where: str) -> Finding:
    bound = BOUNDS[f"capture.{name}"]
    share = wrong / max(of, 1)
    return Finding(f"capture.{name} · {driver}", case.name, float(wrong), share, where, bound.value, bound.measure)


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
