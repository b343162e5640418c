"""The loader against the second reader: the same triangles, gprims tessellated, nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from benchmarks.casting.matching import match
from benchmarks.casting.reading import Reading
from benchmarks.casting.surfaces import VOLUME, reach, tessellates, volume_ratio
from schemas.scene import SceneArrays

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the loader's triangles relate to the second reader's.

    Attributes:
        ours: Triangles of the loader.
        theirs: Triangles of meshes that the second reader found.
        degenerate: Further ones without area, which the loader drops.
        folded: Faces that the second reader leaves uncut, for want of one right way.
        fans: Triangles that their fans would have.
        cut: Triangles of the loader that they are cut into.
        gprims: Implicit surfaces that the second reader found.
        tessellated: Triangles of the loader on these.
        others: Prims that only the loader makes triangles of.
        beyond: Triangles of the loader inside the extents of such prims.
        missing: Triangles of the second reader that the loader does not have.
        extra: Triangles of the loader that nothing above accounts for.
        wrong: Gprims whose triangles do not enclose what they should, faces that are not cut right, in words.
    """

    ours: int
    theirs: int
    degenerate: int
    folded: int
    fans: int
    cut: int
    gprims: int
    tessellated: int
    others: int
    beyond: int
    missing: int
    extra: int
    wrong: tuple[str, ...]

    @property
    def triangles(self) -> int:
        """Fan triangles of all meshes, by the second reader."""
        return self.theirs + self.degenerate + self.fans

    @property
    def is_equal(self) -> bool:
        """Whether loader and second reader agree."""
        return not (self.missing or self.extra or self.wrong)


def compare(scene: SceneArrays, reading: Reading, time: Usd.TimeCode) -> Comparison:
    """Compares a loaded scene with what the second reader found in the same stage at `time`."""
    ours = scene.positions[scene.indices.reshape(-1, 3)].astype(np.float64)
    size = float(np.linalg.norm(scene.bounds[1] - scene.bounds[0]))
    left = match(ours, reading.triangles - scene.origin, size)
    rest = ours[left.ours] + scene.origin
    slack = 4.0 * 2.0**-24 * size  # rounding of a position, metres
    order = np.argsort(rest[:, 0, 0])
    rest = rest[order]
    cut, wrong = _cuts(rest, reading.folded, slack)
    on, wrong_gprims = _gprims(rest, reading, time, slack)
    other = ~(cut | on)
    inside = _within(rest[other], reading, time)
    return Comparison(
        ours=len(ours),
        theirs=len(reading.triangles),
        degenerate=reading.degenerate,
        folded=len(reading.folded),
        fans=sum(len(ring) - 2 for ring in reading.folded),
        cut=int(cut.sum()),
        gprims=len(reading.gprims),
        tessellated=int(on.sum()),
        others=len(reading.others),
        beyond=int(inside.sum()),
        missing=len(left.theirs),
        extra=int((~inside).sum()),
        wrong=tuple(wrong + wrong_gprims),
    )


def _near(rest: Floats, low: float, high: float) -> slice:
    """Rows of triangles, sorted by x of their first corner, that may lie between two x."""
    return slice(int(np.searchsorted(rest[:, 0, 0], low)), int(np.searchsorted(rest[:, 0, 0], high, side="right")))


def _cuts(rest: Floats, folded: list[Floats], slack: float) -> tuple[NDArray[np.bool_], list[str]]:
    """Triangles between corners of folded faces, and in words the faces that they do not tile.

    They tile a face if none is turned against it and their area vectors add up to its own, which by Stokes depends
    on its border alone.
    """
    taken, wrong = np.zeros(len(rest), dtype=bool), []
    for ring in folded:
        rows = _near(rest, ring[:, 0].min() - slack, ring[:, 0].max() + slack)
        apart = np.abs(rest[rows][:, :, None] - ring).max(axis=3).min(axis=2)
        own = np.all(apart <= slack, axis=1) & ~taken[rows]
        a, b, c = np.moveaxis(rest[rows][own], 1, 0)
        areas, whole = np.cross(b - a, c - a), np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
        rounding = 8.0 * slack * float(np.ptp(ring, axis=0).sum())
        # The loader calls a face folded from 1e-6 of its area on; a fan that it keeps may be turned by less.
        against = areas @ whole < -rounding * np.linalg.norm(whole) - 2e-6 * (whole @ whole)
        if np.any(against) or np.abs(areas.sum(axis=0) - whole).max() > rounding * len(ring):
            wrong.append(f"the face at {ring[0]} is not tiled")
        taken[rows] |= own
    return taken, wrong


def _gprims(rest: Floats, reading: Reading, time: Usd.TimeCode, slack: float) -> tuple[NDArray[np.bool_], list[str]]:
    """Triangles with all corners on a gprim, and in words the gprims that they do not enclose."""
    taken, wrong = np.zeros(len(rest), dtype=bool), []
    for prim, matrix in reading.gprims:
        far = reach(prim, time) * float(np.linalg.norm(matrix[:3, 0])) + slack
        rows = _near(rest, matrix[3, 0] - far, matrix[3, 0] + far)
        inverse = np.linalg.inv(matrix[:3, :3])
        local = (rest[rows] - matrix[3, :3]) @ inverse
        local = local[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0.0 else local
        on = tessellates(prim, time, local, slack * float(np.linalg.norm(inverse, 2)))
        taken[rows] |= on
        ratio = volume_ratio(prim, time, local[on])
        # Gprims that coincide share their triangles: each then encloses a whole multiple.
        copies = max(1, round(ratio))
        if not VOLUME[0] <= ratio / copies <= VOLUME[1]:
            wrong.append(f"{prim.GetPath()} encloses {ratio:.4f} of its volume")
    return taken, wrong


def _within(triangles: Floats, reading: Reading, time: Usd.TimeCode) -> NDArray[np.bool_]:
    """Which triangles lie in the bounds, by UsdGeom, of the prims that the second reader has no surface for."""
    inside = np.zeros(len(triangles), dtype=bool)
    for prim, matrix in reading.others:
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)
        if extent is None:
            continue
        low, high = np.array(extent, dtype=np.float64)
        local = (triangles - matrix[3, :3]) @ np.linalg.inv(matrix[:3, :3])
        slack = 1e-4 * float(np.linalg.norm(high - low))
        inside |= np.all((local >= low - slack) & (local <= high + slack), axis=(1, 2))
    return inside
