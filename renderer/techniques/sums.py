"""What the techniques that blend all fragments into sums share: the mean they resolve to, accounts."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from renderer.frame import Clock, Frame
from renderer.programs import Defines
from renderer.screen import read_linear, resolve_screen
from renderer.techniques.base import Rendered
from renderer.techniques.skips import frame_skips

# Storage bindings of a pixel's depth range, in every shader of these techniques.
_NEAREST, _FARTHEST = 1, 2


def draw_in_range(frame: Frame, fragment: str, targets: list[moderngl.Texture], defines: Defines) -> None:
    """Draw the transparent layers with a shader that reads the depth range of each pixel.

    Args:
        frame: The view.
        fragment: Shader file.
        targets: What it adds to.
        defines: Its defines.
    """
    _, nearest, farthest = frame.depth_range()
    nearest.bind_to_storage_buffer(_NEAREST)
    farthest.bind_to_storage_buffer(_FARTHEST)
    frame.draw_transparent(fragment, frame.target(targets), defines)


def resolve_mean(
    frame: Frame, colours: moderngl.Texture, depths: moderngl.Texture, depth_unit: float = 1.0
) -> moderngl.Texture:
    """`(1 - T) sum w C / sum w + T C_bg` with `T = exp(-optical depth)`; RGBA32F, linear.

    Args:
        frame: The view.
        colours: `sum w C` and `sum w`.
        depths: `sum -ln(1-a)`, in a unit.
        depth_unit: The unit.
    """
    textures, defines = [frame.background, colours, depths], {"DEPTH_UNIT": depth_unit}
    return resolve_screen(frame, "common/weighted_mean.frag", textures, defines)


def rendered(
    frame: Frame,
    image: moderngl.Texture,
    shared: Mapping[str, float],
    clock: Clock,
    pixel_bytes: int,
    pool_bytes: int = 0,
    early_bytes: int = 0,
) -> Rendered:
    """The finished picture of a technique that keeps no fragment apart.

    Args:
        frame: The view.
        image: RGBA32F, linear.
        shared: Milliseconds of the shared passes that were used.
        clock: Its own passes.
        pixel_bytes: As `Rendered` has it.
        pool_bytes: As `Rendered` has it.
        early_bytes: As `Rendered` has it.
    """
    return Rendered(
        linear=read_linear(frame, image),
        k=np.zeros(frame.pixels, dtype=np.int32),
        passes={**shared, **clock.passes},
        captured=0,
        pool_bytes=pool_bytes,
        pixel_bytes=pixel_bytes,
        early_bytes=early_bytes,
        skips=frame_skips(frame),
    )
