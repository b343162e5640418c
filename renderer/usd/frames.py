"""Frames along sampled curves that do not twist."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.usd.spline import Samples

Floats = NDArray[np.float64]


def tangents(samples: Samples, centres: Floats) -> Floats:
    """Unit direction of the curve at each sample, float64 [M, 3]: the mean of those to its neighbours.

    Args:
        samples: How samples follow each other.
        centres: float64 [M, 3].
    """
    a, b = samples.links.T
    step = centres[b] - centres[a]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    step = step / np.where(length > 0.0, length, 1.0)
    keys = np.concatenate((a, b))
    columns = [np.bincount(keys, np.tile(step[:, i], 2), minlength=len(centres)) for i in range(3)]
    total = np.stack(columns, axis=1)
    norm = np.linalg.norm(total, axis=1, keepdims=True)
    # Where a curve turns back on itself the way out is as good as any.
    out = np.zeros_like(centres)
    out[a] = step
    out[np.linalg.norm(out, axis=1) == 0.0] = (0.0, 0.0, 1.0)
    return np.where(norm > 1e-9, total / np.where(norm > 1e-9, norm, 1.0), out)


def transported(samples: Samples, centres: Floats, ahead: Floats) -> Floats:
    """Unit normals that turn round the curve as little as they can, float64 [M, 3].

    Rotation minimising frames by double reflection (Wang, Juettler, Zheng and Liu 2008, table I). Closed curves spread
    what is missing to a full turn evenly over all samples.

    Args:
        samples: Where curves begin.
        centres: float64 [M, 3].
        ahead: float64 [M, 3], unit tangents.
    """
    ends = np.append(samples.first[1:], len(centres))
    normal = np.empty_like(centres)
    _transport(samples.first, ends, centres, ahead, samples.spline.closed, normal)
    return normal


@njit(cache=True)
def _transport(
    first: NDArray[np.int64], ends: NDArray[np.int64], x: Floats, t: Floats, closed: bool, normal: Floats
) -> None:
    for curve in range(len(first)):
        begin, end = first[curve], ends[curve]
        normal[begin] = _across(t[begin])
        for i in range(begin, end - 1):
            normal[i + 1] = _reflected(x[i], x[i + 1], t[i], t[i + 1], normal[i])
        if closed:
            back = _reflected(x[end - 1], x[begin], t[end - 1], t[begin], normal[end - 1])
            side = np.cross(t[begin], normal[begin])
            twist = np.arctan2(_dot(back, side), _dot(back, normal[begin]))
            for i in range(begin, end):
                angle = -twist * (i - begin) / (end - begin)
                normal[i] = np.cos(angle) * normal[i] + np.sin(angle) * np.cross(t[i], normal[i])


@njit(cache=True)
def _across(tangent: Floats) -> Floats:
    axis = np.zeros(3)
    axis[np.argmin(np.abs(tangent))] = 1.0
    return np.asarray((axis - _dot(axis, tangent) * tangent) / np.sqrt(1.0 - _dot(axis, tangent) ** 2))


@njit(cache=True)
def _reflected(x0: Floats, x1: Floats, t0: Floats, t1: Floats, normal: Floats) -> Floats:
    v = x1 - x0
    c = _dot(v, v)
    if c > 0.0:
        normal = normal - (2.0 / c) * _dot(v, normal) * v
        t0 = t0 - (2.0 / c) * _dot(v, t0) * v
    w = t1 - t0
    c = _dot(w, w)
    if c > 0.0:
        normal = normal - (2.0 / c) * _dot(w, normal) * w
    # Rounding must not add up, nor pull the normal out of the plane across the curve.
    normal = normal - _dot(normal, t1) * t1
    size = _dot(normal, normal)
    return normal / np.sqrt(size) if size > 1e-18 else _across(t1)


@njit(cache=True)
def _dot(a: Floats, b: Floats) -> float:
    # numpy's own needs a BLAS inside compiled code.
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
