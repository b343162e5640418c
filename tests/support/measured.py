"""Measurements and pictures made up for tests of summaries and reports."""

from __future__ import annotations

import numpy as np

from evaluation.report import Picture, PictureSet
from schemas.measurement import Measurement

EXAMPLE_MSE = {"kbuffer": 4e-4, "kbuffer-importance": 1e-4, "kbuffer-deep": 2e-5, "kbuffer-optimal": 1e-5}


def measurement(technique: str = "kbuffer-deep", mse: float | None = 2e-5, **changes: object) -> Measurement:
    fields: dict[str, object] = {
        "scene": "bottles",
        "view": "front",
        "technique": technique,
        "budget": 1000,
        "budget_factor": 1.0,
        "width": 40,
        "height": 25,
        "alpha": None,
        "tail": "density",
        "mse": mse,
        "flip": 0.01,
        "total_fragments": 5000,
        "pool_bytes": 8000,
        "total_bytes": 48000,
        "total_ms": 20.0,
    }
    return Measurement.model_validate({**fields, **changes})


def example(scene: str = "bottles") -> list[Measurement]:
    """All techniques at two budgets; the error halves with the doubled budget."""
    return [
        measurement(technique, mse / factor, scene=scene, budget_factor=factor, total_ms=10.0 * factor)
        for factor in (1.0, 2.0)
        for technique, mse in EXAMPLE_MSE.items()
    ]


def picture_set(scene: str = "bottles", height: int = 24, width: int = 36) -> PictureSet:
    rng = np.random.default_rng(7)
    exact = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    pictures = {
        technique: Picture(
            image=np.clip(exact.astype(np.int64) + rng.integers(-9, 10, exact.shape), 0, 255).astype(np.uint8),
            flip=rng.random((height, width), dtype=np.float32),
            k=rng.integers(0, 9, (height, width)) if technique != "weighted-average" else None,
        )
        for technique in ("kbuffer-deep", "kbuffer", "weighted-average")
    }
    return PictureSet(scene, "front", 1.0, exact, pictures)
