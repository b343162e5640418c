"""Temporal flicker: how much a technique's error changes while the camera moves a little.

`mean |(I_t - I_{t-1}) - (X_t - X_{t-1})|` over frames, pixels and channels of displayed values in [0,1], X exact. A
still error is not seen as flicker, and a change that the exact picture has too is none: the idea of dtSSD (Erofeev et
al. 2015, "Perceptually motivated benchmark for video matting", section 3), with the absolute difference. Beside it
`mean |k_t - k_{t-1}|` over the pixels that both frames have fragments in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.rounds import Run, shoot
from evaluation.bench.subject import Subject
from renderer.techniques import TECHNIQUES
from schemas.bench import CellKey
from schemas.colour import display8
from schemas.view import View

STEP = 0.1
"""Degrees of the camera's turn about its target from frame to frame: a few pixels of parallax at 1430x960."""


@dataclass(frozen=True, slots=True)
class Flicker:
    """What changed from frame to frame, without what changes in the exact picture.

    Attributes:
        colour: Mean absolute change of the error, displayed values in [0,1].
        k: Mean absolute change of k.
    """

    colour: float
    k: float


def camera_path(view: View, frames: int, step: float = STEP) -> list[View]:
    """A short orbit: the eye turns about the up axis through the target; the first view is the given one.

    Args:
        view: Where it begins.
        frames: Views of it.
        step: Degrees from one to the next.
    """
    eye, target, up = (np.array(v, dtype=np.float64) for v in (view.eye, view.target, view.up))
    axis = up / np.linalg.norm(up)
    arm = eye - target
    views = []
    for number in range(frames):
        angle = np.radians(step * number)
        # Rodrigues' rotation formula.
        turned = arm * np.cos(angle) + np.cross(axis, arm) * np.sin(angle) + axis * (axis @ arm) * (1 - np.cos(angle))
        x, y, z = (target + turned).tolist()
        views.append(view.model_copy(update={"eye": (x, y, z), "name": f"{view.name}+{number}"}))
    return views


def error_change(
    image: NDArray[np.uint8], before: NDArray[np.uint8], exact: NDArray[np.uint8], exact_before: NDArray[np.uint8]
) -> float:
    """`mean |(I_t - I_{t-1}) - (X_t - X_{t-1})|`, uint8 pictures of one size, in units of [0,1].

    Args:
        image: uint8 [H, W, 3], the picture I_t, sRGB.
        before: uint8 [H, W, 3], the picture I_{t-1} of the frame before.
        exact: uint8 [H, W, 3], the exact picture X_t.
        exact_before: uint8 [H, W, 3], the exact picture X_{t-1} of the frame before.
    """
    now = image.astype(np.int16) - exact
    then = before.astype(np.int16) - exact_before
    return float(np.abs(now - then).mean()) / 255.0


def k_change(k: NDArray[np.int32], before: NDArray[np.int32], occupied: NDArray[np.bool_]) -> float:
    """`mean |k_t - k_{t-1}|` over the pixels that both frames have fragments in, all [P]; 0 without any.

    Args:
        k: int32 [P], core fragments of each pixel.
        before: int32 [P], those of the frame before.
        occupied: bool [P], pixels with fragments in both frames.
    """
    changed = np.abs(k - before)[occupied]
    return float(changed.mean()) if len(changed) else 0.0


def measure_flicker(subject: Subject, runs: Sequence[Run], frames: int) -> Mapping[CellKey, Flicker]:
    """Flicker of every cell along a path through a view.

    Args:
        subject: The view that the path starts at.
        runs: Cells; exact techniques have none and are left out.
        frames: Of the path.
    """
    moving = [run for run in runs if TECHNIQUES[run.key.technique].family != "exact"]
    last: dict[CellKey, tuple[NDArray[np.uint8], NDArray[np.int32]]] = {}
    sums = {run.key: np.zeros(2) for run in moving}
    exact_before, occupied_before = subject.exact8, subject.dump.counts > 0
    for view in camera_path(subject.view, frames):
        here = Subject(subject.gpu, view, subject.size)
        both = occupied_before & (here.dump.counts > 0)
        for run in moving:
            rendered = shoot(here, run.technique, run.budget)[0]
            image = display8(rendered.linear)
            if run.key in last:
                image_before, k_before = last[run.key]
                sums[run.key] += (
                    error_change(image, image_before, here.exact8, exact_before),
                    k_change(rendered.k, k_before, both),
                )
            last[run.key] = image, rendered.k
        exact_before, occupied_before = here.exact8, here.dump.counts > 0
    return {key: Flicker(*(total / (frames - 1)).tolist()) for key, total in sums.items()}
