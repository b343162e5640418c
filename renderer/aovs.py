"""What a pixel has beside its colour: depth, fragments, those kept apart, coverage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from renderer.opaque_depth import opaque_depth
from renderer.techniques.base import Rendered

AovName = Literal["depth", "n", "k", "alpha"]

CHANNELS: Final[Mapping[AovName, str]] = {"depth": "depth.Z", "n": "n.V", "k": "k.V", "alpha": "alpha.A"}
"""Channel of a picture file that holds each: a layer with one channel."""


def aovs(frame: Frame, rendered: Rendered, names: Sequence[AovName]) -> dict[AovName, NDArray[np.float32]]:
    """Planes of a frame, float32 [H, W] each, row 0 at the top.

    - `depth`: metres along the view axis to the nearest surface, transparent or opaque; infinite where there is none.
    - `n`: fragments in front of the opaque surface.
    - `k`: those of them that the technique kept apart.
    - `alpha`: coverage, 1 - prod(1 - a) over the fragments, and 1 where an opaque surface is. It is exact whatever the
      technique, because the order of fragments does not count.

    Args:
        frame: The frame, rendered.
        rendered: What a technique made of it.
        names: Which.
    """
    made: dict[AovName, Callable[[], NDArray[np.floating] | NDArray[np.integer]]] = {
        "depth": lambda: _depth(frame),
        "n": frame.count,
        "k": lambda: rendered.k,
        "alpha": lambda: _alpha(frame),
    }
    return {name: made[name]().astype(np.float32).reshape(frame.height, frame.width) for name in names}


def mean_aovs(samples: Sequence[Mapping[AovName, NDArray[np.float32]]]) -> dict[AovName, NDArray[np.float32]]:
    """Planes of the samples of an antialiased picture as one: means, and of depths the nearest.

    Args:
        samples: Of each sample, float32 [H, W] by name, as `aovs` has them: depth in metres, the others without a unit.

    Returns:
        float32 [H, W] by name.
    """
    found: dict[AovName, NDArray[np.float32]] = {}
    for name in samples[0]:
        planes = np.stack([sample[name] for sample in samples])
        merged = planes.min(axis=0) if name == "depth" else planes.mean(axis=0, dtype=np.float64)
        found[name] = merged.astype(np.float32)
    return found


def _depth(frame: Frame) -> NDArray[np.float32]:
    _, nearest, _ = frame.depth_range()
    transparent = np.frombuffer(nearest.read(4 * frame.pixels), dtype=np.float32)
    return np.minimum(np.where(frame.count() > 0, transparent, np.inf), opaque_depth(frame))


def _alpha(frame: Frame) -> NDArray[np.float64]:
    sums = np.frombuffer(frame.gather_density().read(), dtype=np.float32).reshape(-1, 4)
    optical_depth = sums[:, 3].astype(np.float64)
    return np.where(np.isfinite(opaque_depth(frame)), 1.0, -np.expm1(-optical_depth))
