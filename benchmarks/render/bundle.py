"""A bundle to time where none was trained."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import moderngl
import numpy as np

from evaluation.stress.predictors import random_layers
from renderer.context import describe
from renderer.features import FEATURES
from schemas.bundle import Provenance, TailSpec, gain_outputs
from schemas.tail import DEFAULT_TAIL, DENSITY_G, TAILS
from trainer.bundle import Description, export_bundle
from trainer.weights import Weights

HIDDEN = (32,)
"""Units of the trainer's default network."""


@contextmanager
def random_bundle(ctx: moderngl.Context) -> Iterator[Path]:
    """A bundle of the usual shape with random weights: as fast as a trained one, but its pictures mean nothing."""
    rng = np.random.default_rng(3)
    outputs = gain_outputs(TAILS[DEFAULT_TAIL].bins)
    layers = random_layers(rng, HIDDEN, len(outputs))
    mean, std = np.zeros(len(FEATURES), dtype=np.float32), np.ones(len(FEATURES), dtype=np.float32)
    weights = Weights(FEATURES, mean, std, layers, "bin-gains", outputs)
    description = Description(
        name="random",
        tail=TailSpec(name=DEFAULT_TAIL, g=DENSITY_G),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=3, machine=describe(ctx)),
        evaluation={},
    )
    with tempfile.TemporaryDirectory() as folder:
        rows = rng.normal(0.0, 1.0, (10_000, len(FEATURES))).astype(np.float32)
        export_bundle(Path(folder), weights, description, rows, ctx)
        yield Path(folder)
