"""A stage as it is loaded here, without light: the same scene with normals that no light reaches."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.judging.seen import Seen
from labeller.curves import composite
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.opaque_depth import opaque_depth
from schemas.fragments import FragmentDump
from schemas.scene import Batch, SceneArrays
from schemas.view import View

UNLIT = 0.25 + 0.3 * 0.5
"""What `common/surface.glsl` multiplies the albedo by where the normal is zero: the constant, and half of the sky."""


def unlit(scene: SceneArrays) -> SceneArrays:
    """The scene with normals of zero: every surface shows `UNLIT` times its albedo."""
    return replace(scene, normals=np.zeros_like(scene.normals))


def solid(scene: SceneArrays) -> SceneArrays:
    """The scene's shapes alone: all triangles opaque, without textures."""
    colours = scene.colours.copy()
    colours[:, 3] = 255
    batches = tuple(Batch(batch.first, batch.count, "opaque") for batch in scene.batches)
    return replace(unlit(scene), colours=colours, batches=batches)


def shown(ctx: moderngl.Context, scene: SceneArrays, view: View, size: tuple[int, int]) -> Seen:
    """A view of a scene made by `unlit` or `solid`."""
    frame = Frame(GpuScene(ctx, scene), view, *size, (0.0, 0.0, 0.0))
    dump = capture(frame).dump
    depth = opaque_depth(frame)
    colour = composite(dump, dump.counts).astype(np.float64) / UNLIT
    alpha = np.where(np.isfinite(depth), 1.0, 1.0 - _transmittance(dump))
    width, height = size
    rgba = np.concatenate([colour, alpha[:, None]], axis=1).reshape(height, width, 4).astype(np.float32)
    return Seen(rgba, (depth / scene.metres_per_unit).reshape(height, width).astype(np.float32))


def _transmittance(dump: FragmentDump) -> NDArray[np.float64]:
    through = np.zeros(dump.total + 1)
    np.cumsum(np.log1p(dump.rgba[:, 3] / -255.0), out=through[1:])
    return np.asarray(np.exp(through[dump.offsets[1:]] - through[dump.offsets[:-1]]))
