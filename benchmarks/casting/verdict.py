"""Whether the fragments of a pixel are those that its ray allows, and if they differ from the plain ray cast, why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from benchmarks.casting.coverage import AT_CLIP, AT_EDGE
from benchmarks.casting.intervals import Floats, Intervals
from benchmarks.casting.opacity import OPAQUE, TRANSPARENT, Kinds
from benchmarks.casting.rays import Camera, Hits
from schemas.fragments import FragmentDump

Mask = NDArray[np.bool_]

REASONS = ("edge", "clip plane", "texture", "depth tie", "coincident", "embree", "unexplained")
"""Why a pixel's fragments differ from a ray cast.

edge: the ray is so near an edge of a triangle that rounding its corners, to 1/256 pixel above all, decides.
clip plane: the same, where the near or far plane cuts the triangle.
texture: the texels under the fragment are on both sides of nothing, transparent or opaque.
depth tie: an opaque and a transparent surface are nearer to each other than a step of the 24-bit depth buffer.
coincident: the exact ray agrees with the renderer; trimesh, which finds the next hit by starting anew a step behind the
last one, leaps over a surface that is nearer to it than that.
embree: the exact ray agrees with the renderer; embree's float32 ray goes through another triangle, or between two.
"""

_FACED = 10.0
"""A surface is seen from the edge if its depth doubles within this many pixels."""
_DEPTH_STEP = 4.0 * 2.0**-24
"""Window depths nearer than this may compare either way: four roundings of a 24-bit buffer."""


@dataclass(slots=True)
class Tally:
    """What was compared and how it went. All but `error` and `unexplained` count pixels or fragments.

    Attributes:
        pixels: Rays.
        fragments: Transparent fragments of the renderer at those pixels.
        exact: Those that the exact rays find there.
        embree: Those that embree's rays find there.
        equal: Pixels where exact rays and renderer agree in number and in every depth.
        equal_embree: Pixels where embree and renderer do.
        reasons: Pixels where exact rays and renderer differ, by reason.
        reasons_embree: Pixels where embree and renderer differ, by reason.
        opaque: Pixels with an opaque surface, by the exact rays.
        opaque_equal: Pixels whose opaque surface, or its absence, is that of the exact rays, to a depth buffer's step.
        error: Greatest relative difference of depth among fragments of surfaces that are not seen from the edge.
        unexplained: Pixels that nothing above explains, in words.
    """

    pixels: int = 0
    fragments: int = 0
    exact: int = 0
    embree: int = 0
    equal: int = 0
    equal_embree: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    reasons_embree: Counter[str] = field(default_factory=Counter)
    opaque: int = 0
    opaque_equal: int = 0
    error: float = 0.0
    unexplained: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Adds what another comparison found."""
        error = max(self.error, other.error)
        for item in fields(self):
            setattr(self, item.name, getattr(self, item.name) + getattr(other, item.name))
        self.error = error


def judge(
    dump: FragmentDump,
    walls: NDArray[np.float32],
    camera: Camera,
    pixels: NDArray[np.int64],
    hits: Hits,
    kinds: Kinds,
    met: Mask,
    strays: Collection[int],
    step: float,
) -> Tally:
    """Compares the fragments of a dump with the rays of some pixels.

    Args:
        dump: The renderer's fragments.
        walls: float32 [P], distance of the opaque surface of every pixel, infinite where there is none.
        camera: Of the same view and size.
        pixels: int64 [S], as given to `cast`.
        hits: From `cast`.
        kinds: From `opacity.classify`.
        met: bool [H], whether embree found this hit too.
        strays: Rays on which embree found what is no hit.
        step: `Embree.step`.
    """
    tally = Tally(pixels=len(pixels))
    order = np.argsort(hits.sample, kind="stable")
    ends = np.searchsorted(hits.sample[order], np.arange(len(pixels) + 1))
    for sample, pixel in enumerate(pixels.tolist()):
        rows = order[ends[sample] : ends[sample + 1]]
        ray = _Ray(hits, kinds, rows, camera)
        depths = dump.depth[dump.offsets[pixel] : dump.offsets[pixel + 1]].astype(np.float64)
        where = f"pixel ({pixel % camera.width}, {pixel // camera.width})"
        _judge_fragments(tally, ray, depths, met[rows], sample in strays, step, where)
        _judge_wall(tally, ray, float(walls[pixel]), where)
    return tally


class _Ray:
    """The hits of one ray: coverage, kind and depth test, each with three outcomes, yes, no and maybe."""

    def __init__(self, hits: Hits, kinds: Kinds, rows: NDArray[np.int64], camera: Camera) -> None:
        self.depth, self.slope, self.inside = hits.depth[rows], hits.slope[rows], hits.inside[rows]
        self.span = Intervals(hits.low[rows], hits.high[rows])
        self.likely = kinds.likely[rows]
        doubt, possible = hits.doubt[rows], kinds.possible[rows]
        mixed = (possible & (possible - 1)) > 0
        self._own = np.select([doubt == AT_EDGE, doubt == AT_CLIP, mixed], REASONS[:3], "").astype("<U16")
        self.blocks = (self._own == "") & (possible == OPAQUE)
        self.may_block = (possible & OPAQUE) > 0
        gap = _depth_step(camera, self.span.high)
        self.stored = Intervals(self.span.low - gap, self.span.high + gap)
        self.wall = float(self.stored.high[self.blocks].min(initial=np.inf))
        self.may = ((possible & TRANSPARENT) > 0) & (self.stored.low <= self.wall)
        self.reasons = self._own.copy()
        for row in np.flatnonzero(self.may & (self._own == "")):
            self.reasons[row] = self._why_hidden(int(row))
        self.must = self.may & (self.reasons == "")

    def _why_hidden(self, row: int) -> str:
        """Why it is not sure that no opaque surface is in front of a certain hit; "" if it is."""
        before = self.may_block & (self.stored.low <= self.stored.high[row])
        reasons = self._own[before]
        return "" if not len(reasons) else str(max(reasons)) or "depth tie"

    def plain(self, met: Mask) -> Mask:
        """The transparent ones of the hits that a caster met, in front of the first opaque one."""
        return np.asarray(met & (self.likely == TRANSPARENT) & (self.depth < self.plain_wall(met)))

    def plain_wall(self, met: Mask) -> float:
        """Depth of the first opaque hit that a caster met; infinite where there is none."""
        return float(self.depth[met & (self.likely == OPAQUE)].min(initial=np.inf))

    def reason(self, depths: Floats, plain: Mask) -> str:
        """The one reason that alone turns the plain cast into the fragments, else the first of those that do so."""
        if not (self.span.of(self.may).holds_all(depths) and self.span.of(self.must).all_held(depths)):
            return "unexplained"
        present = [reason for reason in REASONS if np.any(self.reasons[self.may] == reason)]
        for reason in present:
            unsure = self.may & (self.reasons == reason)
            sure = plain & ~unsure
            if self.span.of(sure | unsure).holds_all(depths) and self.span.of(sure).all_held(depths):
                return reason
        return present[0]


def _depth_step(camera: Camera, depth: Floats) -> Floats:
    """How far apart surfaces at these depths must be for the depth buffer to tell them apart, metres."""
    span = camera.far - camera.near
    # Window depth is far / (far - near) * (1 - near / depth) with perspective: the inverse of its derivative.
    return _DEPTH_STEP * span * (np.ones_like(depth) if camera.orthographic else depth**2 / (camera.near * camera.far))


def _judge_fragments(tally: Tally, ray: _Ray, depths: Floats, met: Mask, stray: bool, step: float, where: str) -> None:
    exact, embree = ray.plain(ray.inside), ray.plain(met)
    same = ray.span.of(exact).equal(depths)
    reason = "" if same else ray.reason(depths, exact)
    tally.fragments += len(depths)
    tally.exact += int(exact.sum())
    tally.embree += int(embree.sum())
    tally.equal += same
    if same:
        tally.error = max(tally.error, _depth_error(ray, depths, exact))
    else:
        tally.reasons[reason] += 1
    if ray.span.of(embree).equal(depths) and not stray:
        tally.equal_embree += 1
    else:
        tally.reasons_embree[reason or _embree_reason(ray, met, step)] += 1
    if reason == "unexplained":
        listed, must = (", ".join(f"{d:.6g}" for d in some[:12]) for some in (depths, np.sort(ray.depth[ray.must])))
        maybe = int((ray.may & ~ray.must).sum())
        sure = int(ray.must.sum())
        tally.unexplained.append(f"{where}: {len(depths)} fragments [{listed}], {sure} sure [{must}], {maybe} possible")


def _judge_wall(tally: Tally, ray: _Ray, wall: float, where: str) -> None:
    plain = ray.plain_wall(ray.inside)
    tally.opaque += bool(np.isfinite(plain))
    at = (ray.stored.low <= wall) & (wall <= ray.stored.high)
    if not np.isfinite(wall):
        tally.opaque_equal += not np.isfinite(plain)
        wrong = bool(np.any(ray.blocks))
    else:
        tally.opaque_equal += bool(np.any(at & (ray.depth == plain)))
        wrong = wall > ray.wall or not np.any(at & ray.may_block)
    if wrong:
        tally.unexplained.append(f"{where}: opaque surface at {wall:.6g}, by the ray at {plain:.6g}")


def _depth_error(ray: _Ray, depths: Floats, rows: Mask) -> float:
    order = np.argsort(ray.depth[rows], kind="stable")
    exact = ray.depth[rows][order]
    faced = ray.slope[rows][order] * _FACED < exact
    return float(np.max(np.abs(depths - exact)[faced] / exact[faced], initial=0.0))


def _embree_reason(ray: _Ray, met: Mask, step: float) -> str:
    """Why embree's hits differ where the exact ones agree with the renderer."""
    every = ray.depth[ray.inside]
    lost = ray.depth[ray.inside & ~met]
    near = (np.abs(lost[:, None] - every[None]) <= step).sum(axis=1) > 1
    return "coincident" if len(lost) and np.all(near) else "embree"
