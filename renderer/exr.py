"""Pictures as OpenEXR: scene-referred linear Rec. 709, with what made them in the header."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from renderer.exr_header import REC709, ZIP_LINES, Attribute, is_complete
from schemas.problem import Problem
from schemas.scene import SceneArrays
from schemas.view import View


def write_exr(
    path: Path,
    linear: NDArray[np.floating],
    attributes: Mapping[str, Attribute] | None = None,
    full: bool = False,
    planes: Mapping[str, NDArray[np.float32]] | None = None,
) -> None:
    """Write a picture, ZIP-compressed.

    Args:
        path: The file.
        linear: [H, W, 3] linear RGB, row 0 at the top.
        attributes: Further attributes of the header.
        full: 32-bit channels; else half floats, whose steps are below an 8-bit one of sRGB.
        planes: Further channels by name, float32 [H, W]: 32-bit whatever the colours are.

    Raises:
        OSError: The file is not complete.
    """
    header = {
        **(attributes or {}),
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC709,
    }
    pixels = np.ascontiguousarray(linear, dtype=np.float32 if full else np.float16)
    try:
        with OpenEXR.File(header, {"RGB": pixels, **(planes or {})}) as file:
            file.write(str(path))
    except RuntimeError as error:
        raise OSError(errno.EIO, str(error), str(path)) from error
    # Where the disk is full the library often says nothing.
    if not is_complete(path.read_bytes(), -(-len(pixels) // ZIP_LINES)):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def read_exr(path: Path) -> NDArray[np.float32]:
    """Linear RGB of a picture, float32 [H, W, 3].

    Raises:
        Problem: It is no flat OpenEXR picture with R, G and B.
    """
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
        return np.stack([channels[name] for name in "RGB"], axis=2).astype(np.float32)
    except (RuntimeError, KeyError, TypeError, ValueError) as error:
        raise Problem(f"{path} is no OpenEXR picture with R, G and B.", "Export it again.") from error


def camera_attributes(view: View, scene: SceneArrays, width: int, height: int) -> dict[str, Attribute]:
    """The camera in the standard attributes `worldToCamera` and `worldToNDC`, as other renderers write them.

    World is the stage: its units and axes. Camera space is left-handed, in metres, z ahead. NDC has (0, 0) in the upper
    left corner of the picture and (1, 1) in the lower right one.

    Args:
        view: The camera.
        scene: What it sees: origin and scale.
        width: Pixels per row.
        height: Rows.
    """
    to_scene = np.diag([scene.metres_per_unit] * 3 + [1.0])
    to_scene[:3, 3] = -scene.origin
    to_view = view.world_to_view() @ to_scene
    projection = view.projection(width / height, *view.clip_range(scene.bounds))
    to_picture = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
    return {
        "worldToCamera": (np.diag([1.0, 1.0, -1.0, 1.0]) @ to_view).T.astype(np.float32),
        "worldToNDC": (to_picture @ projection @ to_view).T.astype(np.float32),
    }
