"""The depth buffer in metres against the surfaces that are really there."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.opaque_depth import opaque_depth
from schemas.view import View

HALF = 0.3
"""Half the side of the opaque cube around the origin of `shells`."""


@pytest.mark.parametrize(
    "view", [VIEW, VIEW.model_copy(update={"ortho_height": 1.5}), VIEW.model_copy(update={"near": 1.0, "far": 5.4})]
)
def test_points_at_the_opaque_depth_lie_on_the_cube(gl: moderngl.Context, view: View) -> None:
    frame = Frame(GpuScene(gl, shells()), view, *SIZE)
    depth = opaque_depth(frame).astype(np.float64).reshape(SIZE[1], SIZE[0])
    on_cube = np.isfinite(depth)
    assert 50 < on_cube.sum() < depth.size // 2
    y, x = np.nonzero(on_cube)
    projection = view.projection(SIZE[0] / SIZE[1], 1.0, 2.0)
    distance = depth[y, x]
    scale = distance if view.ortho_height is None else 1.0
    seen = np.stack(
        (
            (2.0 * (x + 0.5) / SIZE[0] - 1.0) / projection[0, 0] * scale,
            (1.0 - 2.0 * (y + 0.5) / SIZE[1]) / projection[1, 1] * scale,
            -distance,
            np.ones(len(x)),
        )
    )
    points = (np.linalg.inv(view.world_to_view()) @ seen)[:3]
    # The card at z = 1.2 has solid texels too; what is not on the cube is on the card.
    to_cube = np.abs(np.abs(points).max(axis=0) - HALF)
    to_card = np.abs(np.abs(points[2] - 1.2) - 0.005)
    error = np.minimum(to_cube, to_card)
    # Rasterisers place edges on a grid of 1/256 of a pixel: there a point is a little beside its surface.
    assert error.max() < 1e-3
    assert (error < 2e-6).mean() > 0.99
    assert (to_cube < 2e-6).any()
