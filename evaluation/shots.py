"""One picture by one technique: a frame, or the mean of as many as a pixel has samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.antialias import sample_views
from renderer.aovs import AovName, aovs, mean_aovs
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.techniques import Budget, Technique
from renderer.techniques.skips import HIDDEN_FRAGMENTS
from schemas.view import View

RGB = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Subject:
    """What pictures are taken of.

    Attributes:
        gpu: The scene.
        view: The camera.
        size: Width and height, pixels.
        background: Linear RGB where nothing opaque is.
        samples: Of a pixel (`renderer.antialias`).
        aovs: Planes to make beside the picture.
    """

    gpu: GpuScene
    view: View
    size: tuple[int, int]
    background: RGB
    samples: int = 1
    aovs: tuple[AovName, ...] = ()


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture and what it cost. Fragments, milliseconds and skips are sums over the samples; bytes are of one frame.

    Attributes:
        linear: float32 [H, W, 3], linear RGB, row 0 at the top: the mean of the samples.
        fragments: N.
        captured: Fragments that were kept apart.
        k: Least and greatest k of a pixel that has fragments.
        passes: Milliseconds of each pass.
        pool_bytes: As `Rendered` has it, of the frame that has most.
        pixel_bytes: The same.
        total_bytes: The same.
        skips: What was not needed -> how often.
        aovs: Planes, float32 [H, W] (`renderer.aovs`).
    """

    linear: NDArray[np.float32]
    fragments: int
    captured: int
    k: tuple[int, int]
    passes: Mapping[str, float]
    pool_bytes: int
    pixel_bytes: int
    total_bytes: int
    skips: Mapping[str, int]
    aovs: Mapping[AovName, NDArray[np.float32]]


def shoot(subject: Subject, techniques: Sequence[Technique], budget: Budget) -> Shot:
    """A picture.

    Args:
        subject: Of what.
        techniques: By what, one for each sample: the same, unless it remembers what it saw.
        budget: Of each sample's frame.
    """
    views = sample_views(subject.view, subject.size[1], subject.samples)
    shots = [_frame(subject, view, each, budget) for view, each in zip(views, techniques, strict=True)]
    if len(shots) == 1:
        return shots[0]
    total = np.zeros(shots[0].linear.shape, dtype=np.float64)
    passes, skips = dict[str, float](), dict[str, int]()
    for shot in shots:
        total += shot.linear
        for name, milliseconds in shot.passes.items():
            passes[name] = passes.get(name, 0.0) + milliseconds
        for what, count in shot.skips.items():
            skips[what] = skips.get(what, 0) + count
    largest = max(shots, key=lambda shot: shot.total_bytes)
    return Shot(
        linear=(total / len(shots)).astype(np.float32),
        fragments=sum(shot.fragments for shot in shots),
        captured=sum(shot.captured for shot in shots),
        k=(min((shot.k[0] for shot in shots if shot.fragments), default=0), max(shot.k[1] for shot in shots)),
        passes=passes,
        pool_bytes=largest.pool_bytes,
        pixel_bytes=largest.pixel_bytes,
        total_bytes=largest.total_bytes,
        skips=skips,
        aovs=mean_aovs([shot.aovs for shot in shots]),
    )


def _frame(subject: Subject, view: View, each: Technique, budget: Budget) -> Shot:
    frame = Frame(subject.gpu, view, *subject.size, subject.background)
    rendered = each.render(frame, budget)
    n = frame.count()
    k = rendered.k[n > 0]
    skips = {**rendered.skips, HIDDEN_FRAGMENTS: hidden_fragments(frame)}
    return Shot(
        linear=rendered.linear,
        fragments=int(n.sum(dtype=np.int64)),
        captured=rendered.captured,
        k=(int(k.min(initial=np.iinfo(np.int32).max)), int(k.max())) if len(k) else (0, 0),
        passes=dict(rendered.passes),
        pool_bytes=rendered.pool_bytes,
        pixel_bytes=rendered.pixel_bytes,
        total_bytes=rendered.total_bytes,
        skips={what: count for what, count in skips.items() if count},
        aovs=aovs(frame, rendered, subject.aovs),
    )
