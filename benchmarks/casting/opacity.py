"""What the fragment of a hit may be: nothing, transparent or opaque, by its corners' alpha and the texels under it.

How a GL implementation picks mip levels is its own affair, but a filtered texel is always a convex combination of the
texels under the fragment's footprint. So the least and the greatest texel there bound the opacity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.casting.coverage import CERTAIN
from benchmarks.casting.rays import Hits
from schemas.scene import Batch, SceneArrays

Floats = NDArray[np.float64]

NOTHING, TRANSPARENT, OPAQUE = 1, 2, 4
"""Bits: what the fragment of a hit may be."""

_REACH = 3.0
"""Footprint in texels for each texel that the coordinate moves from pixel to pixel: the coarser of two mip levels has
texels up to twice that size, its bilinear filter reaches one and a half of them."""
_MARGIN = 1.5 / 255.0
"""How far interpolated alpha and 8-bit samples may be off."""
_REPEAT, _CLAMP, _MIRROR, _BLACK = range(4)
_WRAPS = {"repeat": _REPEAT, "clamp": _CLAMP, "mirror": _MIRROR, "black": _BLACK}


@dataclass(frozen=True, slots=True)
class Kinds:
    """What fragments may be.

    Attributes:
        possible: uint8 [H], bits NOTHING, TRANSPARENT, OPAQUE.
        likely: uint8 [H], the one bit that an exact renderer would give.
    """

    possible: NDArray[np.uint8]
    likely: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Range:
    """Least, greatest and likely value, float64 [n] each."""

    low: Floats
    high: Floats
    middle: Floats


def classify(scene: SceneArrays, hits: Hits) -> Kinds:
    """What the fragment of every hit may be."""
    possible = np.zeros(len(hits.sample), dtype=np.uint8)
    likely = np.zeros_like(possible)
    for batch in scene.batches:
        first = batch.first // 3
        rows = np.flatnonzero((hits.triangle >= first) & (hits.triangle < first + batch.count // 3))
        if batch.reflectance is not None:
            presence, body = _glass(scene, batch, hits, rows)
            solid = _Range(*(getattr(presence, end) * getattr(body, end) for end in ("low", "high", "middle")))
            possible[rows] = _bits_of_glass(presence.low, presence.high, solid.low, solid.high)
            likely[rows] = _bits_of_glass(presence.middle, presence.middle, solid.middle, solid.middle)
            continue
        alpha = _alpha(scene, batch, hits, rows)
        possible[rows] = _bits(batch, 255.0 * alpha.low, 255.0 * alpha.high)
        likely[rows] = _bits(batch, 255.0 * alpha.middle, 255.0 * alpha.middle)
    return Kinds(possible, likely)


def _bits(batch: Batch, low: Floats, high: Floats) -> NDArray[np.uint8]:
    """`schemas.scene.Batch.layer` in words: what a fragment whose alpha, 0..255, is between these is."""
    if batch.layer == "transparent":
        return np.full(len(low), TRANSPARENT, np.uint8)
    solid = OPAQUE * (high >= 254.5)
    # The opaque pass keeps alpha 255 only.
    if batch.layer == "opaque":
        return np.asarray(solid | NOTHING * (low < 254.5), dtype=np.uint8)
    between = TRANSPARENT * ((high >= 0.5) & (low < 254.5))
    return np.asarray(solid | between | NOTHING * (low < 0.5), dtype=np.uint8)


def _bits_of_glass(low: Floats, high: Floats, least_solid: Floats, most_solid: Floats) -> NDArray[np.uint8]:
    """What a fragment of glass is (`renderer.reference.glass`): transparent, whatever it reflects, where there is any.

    Args:
        low: Least presence, 0..1.
        high: Greatest.
        least_solid: Least product of presence and the share of light that is not transmitted.
        most_solid: Greatest.
    """
    between = TRANSPARENT * ((255.0 * high >= 0.5) & (255.0 * least_solid < 254.5))
    opaque = OPAQUE * (255.0 * most_solid >= 254.5)
    return np.asarray(between | opaque | NOTHING * (255.0 * low < 0.5), dtype=np.uint8)


def _glass(scene: SceneArrays, batch: Batch, hits: Hits, rows: NDArray[np.int64]) -> tuple[_Range, _Range]:
    """Presence of glass, and the share of light that it does not transmit, as ranges."""
    body = _corner_alpha(scene, hits, rows)
    presence = _Range(*(np.full(len(rows), batch.presence) for _ in range(3)))
    if batch.opacity_texture < 0:
        return presence, body
    found = _sampled(scene, batch, hits, rows)
    if not batch.has_presence_texture:
        return presence, _Range(body.low * found.low, body.high * found.high, body.middle * found.middle)
    if batch.opacity_threshold > 0.0:
        kept = ((end >= batch.opacity_threshold).astype(np.float64) for end in (found.low, found.high, found.middle))
        return _Range(*kept), body
    return _Range(*(batch.presence * end for end in (found.low, found.high, found.middle))), body


def _alpha(scene: SceneArrays, batch: Batch, hits: Hits, rows: NDArray[np.int64]) -> _Range:
    """`stored_surface` of the shaders, in float64 and as a range."""
    corners = _corner_alpha(scene, hits, rows)
    opacity = _sampled(scene, batch, hits, rows) if batch.opacity_texture >= 0 else corners
    if batch.opacity_threshold > 0.0:
        cut, left = batch.opacity_threshold, batch.cut_out_alpha
        bounds = (opacity.low >= cut, opacity.high >= cut, opacity.middle >= cut)
        return _Range(*(np.where(kept, left, 0.0) for kept in bounds))
    if batch.opacity_texture < 0:
        return corners
    return _Range(corners.low * opacity.low, corners.high * opacity.high, corners.middle * opacity.middle)


def _corner_alpha(scene: SceneArrays, hits: Hits, rows: NDArray[np.int64]) -> _Range:
    """The interpolated alpha of the corners, 0..1."""
    alpha = scene.colours[:, 3][scene.indices.reshape(-1, 3)[hits.triangle[rows]]] / 255.0
    least, most = alpha.min(axis=1), alpha.max(axis=1)
    middle = np.clip((alpha * hits.weights[rows]).sum(axis=1), least, most)
    # Near an edge the rasteriser extrapolates from corners it has moved: anything between the corners is possible.
    wide = hits.doubt[rows] != CERTAIN
    low, high = (np.where(wide, end, middle + slack) for end, slack in ((least, -_MARGIN), (most, _MARGIN)))
    return _Range(np.maximum(low, least), np.minimum(high, most), middle)


def _sampled(scene: SceneArrays, batch: Batch, hits: Hits, rows: NDArray[np.int64]) -> _Range:
    """What the opacity texture can give, 0..1."""
    texture = scene.textures[batch.opacity_texture]
    uvs = _coordinates(scene, batch)[scene.indices.reshape(-1, 3)[hits.triangle[rows]]].astype(np.float64)
    place = np.einsum("nk,nkc->nc", hits.weights[rows], uvs)
    size = np.array(texture.pixels.shape[1::-1], dtype=np.float64)
    with np.errstate(invalid="ignore"):
        moves = [np.einsum("nk,nkc->nc", w[rows], uvs) * size for w in (hits.weights_x, hits.weights_y)]
        speed = np.linalg.norm(moves, axis=2).max(axis=0)
    reach = np.where(np.isfinite(speed), _REACH * speed + 2.0, np.inf)
    channel = np.ascontiguousarray(texture.pixels[:, :, batch.opacity_channel])
    wraps = np.array([_WRAPS[wrap] for wrap in texture.wrap])
    found = _footprint(channel, wraps, place * size, reach) / 255.0
    # A footprint of one value is sampled as that value; anything between texels is rounded.
    found += np.where(found[:, :1] == found[:, 1:], 0.0, _MARGIN) * np.array([-1.0, 1.0])
    middle = _trilinear(channel.astype(np.float64), wraps, place, speed) / 255.0
    ends, middle = (np.clip(v * batch.opacity_scale + batch.opacity_bias, 0.0, 1.0) for v in (found, middle))
    return _Range(ends.min(axis=1), ends.max(axis=1), middle)


def _coordinates(scene: SceneArrays, batch: Batch) -> NDArray[np.float32]:
    if batch.opacity_uv == 0:
        return scene.uvs
    assert scene.more_uvs is not None, "a batch reads further texture coordinates"
    return scene.more_uvs[:, :2] if batch.opacity_uv == 1 else scene.more_uvs[:, 2:]


@numba.njit(cache=True)
def _footprint(channel: NDArray[np.uint8], wraps: NDArray[np.int64], places: Floats, reach: Floats) -> Floats:
    """Least and greatest texel within `reach` of each place, 0..255, float64 [n, 2]; row 0 is at the bottom."""
    height, width = channel.shape
    out = np.empty((len(places), 2))
    for n in range(len(places)):
        x, y, far = places[n, 0], places[n, 1], reach[n]
        if not (np.isfinite(x) and np.isfinite(y)):
            x, y, far = 0.0, 0.0, np.inf
        far = min(far, 1.0 * max(width, height))  # every texel, and the border
        out[n, 0], out[n, 1] = 255.0, 0.0
        for row in range(int(np.floor(y - far)), int(np.floor(y + far)) + 1):
            for column in range(int(np.floor(x - far)), int(np.floor(x + far)) + 1):
                value = _texel(channel, wraps, column, row)
                out[n, 0], out[n, 1] = min(out[n, 0], value), max(out[n, 1], value)
    return out


def _trilinear(channel: Floats, wraps: NDArray[np.int64], places: Floats, speed: Floats) -> Floats:
    """What GL's mip-mapped sampling is meant to give, 0..255: OpenGL 4.5, 8.14; box-filtered levels.

    Args:
        channel: float64 [h, w].
        wraps: int64 [2].
        places: float64 [n, 2], texture coordinates.
        speed: float64 [n], texels from pixel to pixel.
    """
    last = int(np.log2(max(channel.shape)))
    known = np.isfinite(speed) & np.all(np.isfinite(places), axis=1)
    level = np.clip(np.log2(np.where(known, np.maximum(speed, 1.0), 1.0)), 0.0, last)
    places = np.where(known[:, None], places, 0.5)
    value = np.zeros(len(places))
    for number in range(last + 1):
        share = np.maximum(1.0 - np.abs(level - number), 0.0)
        rows = np.flatnonzero(share)
        value[rows] += share[rows] * _bilinear(channel, wraps, places[rows] * channel.shape[::-1])
        channel = _halved(_halved(channel).T).T.copy()
    return value


def _halved(rows: Floats) -> Floats:
    """Half as many rows: the mean of pairs, or linear sampling where their number is odd."""
    if len(rows) == 1:
        return rows
    half = len(rows) // 2
    at = (np.arange(half) + 0.5) * len(rows) / half - 0.5
    first = np.floor(at).astype(np.int64)
    share = (at - first)[:, None]
    return np.asarray((1.0 - share) * rows[first] + share * rows[np.minimum(first + 1, len(rows) - 1)])


@numba.njit(cache=True)
def _bilinear(channel: Floats, wraps: NDArray[np.int64], places: Floats) -> Floats:
    """Values between texel centres; places in texels."""
    out = np.zeros(len(places))
    for n in range(len(places)):
        x, y = places[n, 0] - 0.5, places[n, 1] - 0.5
        left, below = int(np.floor(x)), int(np.floor(y))
        for row in range(2):
            for column in range(2):
                share = (x - left if column else 1.0 - x + left) * (y - below if row else 1.0 - y + below)
                out[n] += share * _texel(channel, wraps, left + column, below + row)
    return out


@numba.njit(cache=True)
def _texel(channel: NDArray[Any], wraps: NDArray[np.int64], column: int, row: int) -> float:
    """A texel under wrap modes, 0..255; row 0 is at the bottom."""
    height, width = channel.shape
    if (wraps[0] == _BLACK and not 0 <= column < width) or (wraps[1] == _BLACK and not 0 <= row < height):
        return 0.0
    return float(channel[_wrapped(row, height, wraps[1]), _wrapped(column, width, wraps[0])])


@numba.njit(cache=True)
def _wrapped(index: int, size: int, wrap: int) -> int:
    if wrap == _REPEAT:
        return index % size
    if wrap == _MIRROR:
        turned = index % (2 * size)
        return turned if turned < size else 2 * size - 1 - turned
    return min(max(index, 0), size - 1)
