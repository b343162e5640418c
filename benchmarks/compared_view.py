"""A view of the size and depth of the thesis's pictures in a service's store, for timing the page Compare."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.pictures import counts_map, stem, write_png
from labeller.allocation import RULES, Allocation
from renderer.dump import write_dump
from schemas.fragments import FragmentDump
from schemas.measurement import Measurement
from services.service import Service
from stages.allocations import write_allocations
from stages.store import Address

SIZE = (1430, 960)
MEAN = 9
"""Fragments of a pixel."""
_VIEW = "compared"
_TECHNIQUES = ("kbuffer", "kbuffer-importance")


def make(service: Service, digest: str) -> str:
    """Stores fragments, allocations and pictures of noise; nothing compresses worse.

    Args:
        service: The service.
        digest: Of the scene that they are of.

    Returns:
        Query of the page that compares its two sides.
    """
    rng, store = np.random.default_rng(0), service.storage.store
    pixels = SIZE[0] * SIZE[1]
    n = rng.poisson(MEAN, pixels)
    render = Address("render", "benchmark", (digest,))
    with store.put(render) as folder:
        write_dump(folder, _dump(rng, n))
    label = Address("label", "benchmark", (render.key,))
    with store.put(label) as folder:
        k = [np.minimum(rng.integers(0, 3, pixels), n).astype(np.int32) for _ in RULES]
        made = {
            rule: [Allocation(rule, pixels, each, int(each.sum()), 0.0)] for rule, each in zip(RULES, k, strict=True)
        }
        write_allocations(folder, made)
    evaluate = Address("evaluate", "benchmark", (render.key, label.key), {"tail": "density-16", "g": 0.75})
    with store.put(evaluate) as folder:
        for technique in _TECHNIQUES:
            _pictures(folder / stem(technique, 1.0), rng, k[0])
    found = [_measurement(technique, int(n.sum())) for technique in _TECHNIQUES]
    service.measured.record(evaluate.artifact, found, {"bottles": digest}, None, None)
    return f"view={_VIEW}&a=kbuffer%3A1&b=kbuffer-importance%3A1"


def _dump(rng: np.random.Generator, n: NDArray[np.int64]) -> FragmentDump:
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(n)])
    total = int(offsets[-1])
    rgba = rng.integers(1, 255, (total, 4), dtype=np.uint8)
    order = np.arange(total) - np.repeat(offsets[:-1], n)
    depth = (1.0 + 0.01 * order + 0.009 * rng.random(total)).astype(np.float32)
    background = rng.integers(0, 256, (len(n), 3), dtype=np.uint8)
    return FragmentDump(*SIZE, offsets, rgba, depth, background, (n > 0).astype(np.uint8))


def _pictures(base: Path, rng: np.random.Generator, k: NDArray[np.int32]) -> None:
    write_png(base.with_name(f"{base.name}.png"), rng.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
    write_png(base.with_name(f"{base.name}.k.png"), counts_map(k).reshape(SIZE[1], SIZE[0]))


def _measurement(technique: str, total: int) -> Measurement:
    width, height = SIZE
    return Measurement(
        scene="bottles",
        view=_VIEW,
        technique=technique,
        budget=width * height,
        budget_factor=1.0,
        width=width,
        height=height,
        alpha=None,
        tail="density-16",
        mse=1e-4,
        k_max=2,
        total_fragments=total,
    )
