"""A bundle to time where none was trained."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import moderngl
import numpy as np

from renderer.context import describe
from renderer.features import FEATURES
from schemas.bundle import Provenance, TailSpec
from trainer.bundle import Description, export_bundle
from trainer.weights import Weights

HIDDEN = (32, 16)
"""Units of the trainer's default network."""


@contextmanager
def random_bundle(ctx: moderngl.Context) -> Iterator[Path]:
    """A bundle of the usual shape with random weights: as fast as a trained one, but its pictures mean nothing."""
    rng = np.random.default_rng(3)
    sizes = (len(FEATURES), *HIDDEN, 2)
    layers = [
        (
            rng.normal(0.0, 1.5 / math.sqrt(fan_in), (fan_out, fan_in)).astype(np.float32),
            rng.normal(0.0, 0.3, fan_out).astype(np.float32),
        )
        for fan_in, fan_out in pairwise(sizes)
    ]
    layers[-1][1][0] = -8.0
    mean, std = np.zeros(len(FEATURES), dtype=np.float32), np.ones(len(FEATURES), dtype=np.float32)
    weights = Weights(FEATURES, mean, std, tuple(layers))
    description = Description(
        name="random",
        tail=TailSpec(name="density", g=0.75),
        metric="display",
        k_min=1,
        provenance=Provenance(scenes={}, code_version="0", seed=3, machine=describe(ctx)),
        evaluation={},
    )
    with tempfile.TemporaryDirectory() as folder:
        rows = rng.normal(0.0, 1.0, (10_000, len(FEATURES))).astype(np.float32)
        export_bundle(Path(folder), weights, description, rows, ctx)
        yield Path(folder)
