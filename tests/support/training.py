"""Synthetic training data: the rows of random dumps, as the labeller would write them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labeller.curves import error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from renderer.depth_bins import bin_counts
from renderer.features import FEATURES, derive, gather
from schemas.bundle import (
    GLSL,
    HEADS,
    MANIFEST,
    FeatureSpec,
    HeadName,
    ParityReport,
    Provenance,
    TailSpec,
    file_spec,
    gain_outputs,
    layer_specs,
    load_manifest,
)
from schemas.tail import DEFAULT_TAIL, TAILS, TailName
from support.bundles import make_bundle
from support.dumps import random_dump
from trainer.bundle import Description, write_bundle
from trainer.dataset import ViewData, make_view
from trainer.export_shader import shader_source
from trainer.paper import with_paper_inputs
from trainer.prune import pruned
from trainer.weights import Layer, Weights


def random_view(asset: str, seed: int, size: int = 40, max_n: int = 12, alpha: float | None = None) -> ViewData:
    """Every pixel of a random dump with fragments; scored at 1/4 and 1/2 of its fragments."""
    dump = random_dump(size, size, max_n, seed, alpha)
    curves = whole_bins(dump, error_curves(dump))
    hulls = lower_hulls(curves)
    budgets = [dump.total // 4, dump.total // 2]
    prices = [math.log(found.lam or 1e-9) for found in allocate_curves(dump, curves, budgets, "optimal", hulls)]
    rows = np.flatnonzero(dump.counts)
    sizes = np.diff(hulls.offsets)[rows]
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    vertices = np.arange(offsets[-1]) + np.repeat(hulls.offsets[rows] - offsets[:-1], sizes)
    return make_view(
        asset,
        features=derive(gather(dump, DEFAULT_TAIL))[rows],
        n=dump.counts[rows].astype(np.int32),
        tail=DEFAULT_TAIL,
        bin_counts=bin_counts(dump, DEFAULT_TAIL)[rows, : TAILS[DEFAULT_TAIL].bins],
        hull=(offsets, hulls.k[vertices], hulls.error[vertices]),
        price_range=(min(prices) - 1.0, max(prices) + 1.0),
        anchors=prices,
        sampled_pixels=float(dump.pixels),
    )


def random_paper_view(asset: str, seed: int, size: int = 40, max_n: int = 12) -> ViewData:
    """`random_view` with what DHOIT's network reads."""
    dump = random_dump(size, size, max_n, seed)
    pixel = np.flatnonzero(dump.counts)
    return with_paper_inputs(random_view(asset, seed, size, max_n), dump, pixel, [dump.total // 4, dump.total // 2])


def random_weights(
    seed: int,
    features: tuple[str, ...] = FEATURES,
    hidden: tuple[int, ...] = (8, 6),
    head: HeadName = "bin-gains",
    tail: TailName = DEFAULT_TAIL,
) -> Weights:
    """A network whose outputs have the size that trained ones have.

    It is small: a software driver compiles a network of the default size for many seconds.
    """
    rng = np.random.default_rng(seed)
    outputs = gain_outputs(TAILS[tail].bins) if head == "bin-gains" else HEADS[head][0]
    sizes = (len(features), *hidden, len(outputs))
    layers: list[Layer] = [
        (
            rng.normal(0.0, 1.5 / math.sqrt(fan_in), (fan_out, fan_in)).astype(np.float32),
            rng.normal(0.0, 0.3, fan_out).astype(np.float32),
        )
        for fan_in, fan_out in pairwise(sizes)
    ]
    if head == "bin-gains":
        layers[-1][1][:-1] -= 4.0
    mean = rng.normal(0.0, 0.5, len(features)).astype(np.float32)
    std = rng.uniform(0.05, 1.0, len(features)).astype(np.float32)
    return Weights(features, mean, std, tuple(layers), head, outputs)


def export_random(folder: Path, network: Weights, features: NDArray[np.float32], tail: TailName = DEFAULT_TAIL) -> None:
    """A bundle of a network in a folder; its forms are not compared, for which all of them would be compiled."""
    description = Description(
        name="random",
        tail=TailSpec(name=tail, g=0.75),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="test"),
        evaluation={},
    )
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    write_bundle(folder, pruned(network), description, features, lambda: parity)


def write_unproven(folder: Path, network: Weights) -> Path:
    """A bundle of which manifest and GLSL alone are the network's, in a new folder: nothing is compared, it is fast."""
    manifest = load_manifest(make_bundle(folder))
    (folder / GLSL).write_text(shader_source(network), encoding="utf-8")
    update = {
        "features": tuple(FeatureSpec(name=name, mean=0.0, std=1.0) for name in network.features),
        "hidden": network.hidden,
        "layers": layer_specs(len(network.features), network.hidden, len(network.outputs)),
        "files": {**manifest.files, GLSL: file_spec(folder / GLSL)},
    }
    (folder / MANIFEST).write_text(manifest.model_copy(update=update).model_dump_json(), encoding="utf-8")
    return folder


def export_overflowing(folder: Path, network: Weights, features: NDArray[np.float32]) -> None:
    """A bundle of a network whose shader has sums that overflow: it answers infinity of either sign, and NaN."""
    export_random(folder, network, features)
    manifest = load_manifest(folder)
    weight, bias = network.layers[-1]
    largest = np.copysign(np.float32(3e38), weight)
    overflowed = replace(network, layers=(*network.layers[:-1], (largest, bias)))
    (folder / GLSL).write_text(shader_source(overflowed), encoding="utf-8")
    manifest = manifest.model_copy(update={"files": {**manifest.files, GLSL: file_spec(folder / GLSL)}})
    (folder / MANIFEST).write_text(manifest.model_dump_json(), encoding="utf-8")


def real_features(rows: int, seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """float32 [rows, features], features of the pixels of a random dump that have fragments."""
    side = math.ceil(math.sqrt(1.2 * rows)) + 1
    dump = random_dump(side, side, 10, seed)
    return derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0][:rows]
