"""What `kbuffer-deep` does in GLSL before it allots: features of depth bins and of sums, and the network of them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from evaluation.stress.features import FRONTS, KEPT, SPREADS, in_steps
from evaluation.stress.findings import Finding, Options, compared
from evaluation.stress.gl_bins import Judge, counted_bins
from evaluation.stress.gl_bounds import bound_of
from evaluation.stress.gl_cases import Case, thinned
from evaluation.stress.predictors import Rows, feature_cases, predicted64
from evaluation.stress.twins import features64, network64, sums64
from renderer.features import FEATURES, SUMS, derive
from renderer.techniques import KBufferDeep
from schemas.bundle import GLSL, MANIFEST, ParityReport, Provenance, TailSpec, file_spec, gain_outputs, load_manifest
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, DENSITY_G, TAILS, TailName
from trainer.bundle import Description, write_bundle
from trainer.export_shader import shader_source
from trainer.glsl_network import glsl_outputs
from trainer.self_test import pixel_sums
from trainer.weights import Weights

_PLAIN: Final = [i for i in range(len(FEATURES)) if i not in SPREADS + FRONTS]
"""Features that are neither a root of a difference nor what is kept of bins."""


@dataclass(frozen=True, slots=True)
class Networks:
    """Bundles of one network, for every tail that a bundle can have.

    Attributes:
        weights: The network.
        bundles: Tail -> folder.
        overflowing: A bundle of another network for the default tail, whose shader answers numbers that are too large
            for float32, or NaN.
    """

    weights: Weights
    bundles: Mapping[TailName, Path]
    overflowing: Path


def random_networks(folder: Path, weights: Weights, driver: str) -> Networks:
    """Bundles of a network. Its forms are not compared here: that is what the suites do."""
    bundles, overflowing = {tail: folder / tail for tail in BINNED_TAILS}, folder / "overflowing"
    for tail, path in bundles.items():
        _bundle(path, narrowed(weights, tail), tail, driver)
    narrow = narrowed(weights, DEFAULT_TAIL)
    _bundle(overflowing, narrow, DEFAULT_TAIL, driver)
    (overflowing / GLSL).write_text(shader_source(overflowed(narrow)), encoding="utf-8")
    manifest = load_manifest(bundles[DEFAULT_TAIL])
    manifest = manifest.model_copy(update={"files": {**manifest.files, GLSL: file_spec(overflowing / GLSL)}})
    (overflowing / MANIFEST).write_text(manifest.model_dump_json(), encoding="utf-8")
    return Networks(weights, bundles, overflowing)


def narrowed(weights: Weights, tail: TailName) -> Weights:
    """A network that answers for the bins of a tail, and no others."""
    outputs, (weight, bias) = gain_outputs(TAILS[tail].bins), weights.layers[-1]
    rows = [weights.outputs.index(name) for name in outputs]
    return replace(weights, layers=(*weights.layers[:-1], (weight[rows], bias[rows])), outputs=outputs)


def overflowed(weights: Weights) -> Weights:
    """A network of finite weights whose sums overflow: it answers infinity of either sign, and NaN."""
    weight, bias = weights.layers[-1]
    largest = np.copysign(np.float32(3e38), weight)
    return replace(weights, layers=(*weights.layers[:-1], (largest, bias)))


def _bundle(folder: Path, weights: Weights, tail: TailName, driver: str) -> None:
    description = Description(
        name="stress",
        tail=TailSpec(name=tail, g=DENSITY_G),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="stress"),
        evaluation={},
    )
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver=driver)
    write_bundle(folder, weights, description, derive(pixel_sums()), lambda: parity)


def rows(case: Case, networks: Networks, driver: str) -> Iterator[Finding]:
    """Features and outputs of the pixels that a case compares and that have fragments, for every tail of a bundle."""
    judge = Judge.of(case, driver)
    dump = thinned(case.dump, judge.pixels)
    for tail, bundle in networks.bundles.items():
        truth = sums64(dump, tail)[judge.pixels]
        # Fragments are what the counts of the bins, which have an end, say.
        truth[:, SUMS.index("n")] = counted_bins(case, judge.pixels, tail).sum(axis=1)
        yield from _features(judge, narrowed(networks.weights, tail), KBufferDeep(bundle), tail, truth)


def _features(
    judge: Judge, weights: Weights, technique: KBufferDeep, tail: TailName, truth: NDArray[np.float64]
) -> Iterator[Finding]:
    """Features of the bins and of sums; then what a network makes of them."""
    frame, listed = judge.case.frame, judge.pixels.astype(np.uint32)
    expected, features = features64(truth), technique.features(frame, listed)
    for key, columns in (("features", _PLAIN), ("features.spread", SPREADS)):
        names = [f"{tail}, {FEATURES[i]}" for i in columns]
        yield judge.row(key, features[:, columns], expected[:, columns], names)
    names = [f"{tail}, {name}" for name in KEPT]
    yield judge.row("features.kept", in_steps(features, tail), in_steps(expected, tail), names)
    yield from _outputs(judge, weights, technique.predict(frame, listed), features, expected)


def _outputs(
    judge: Judge,
    weights: Weights,
    predicted: Rows,
    features: Rows,
    expected: NDArray[np.float64],
) -> Iterator[Finding]:
    """The network of the features that the GPU has, and of those that it should have."""
    names = list(weights.outputs)
    yield judge.row("predict.glsl", predicted, predicted64(weights, features), names)
    ideal = network64(weights.mean, weights.std, weights.layers, expected)
    yield judge.row("predict.features", predicted, ideal, names)


def feature_rows(
    ctx: moderngl.Context, options: Options, made: Mapping[str, Weights], real: Rows, driver: str
) -> Iterator[Finding]:
    """Networks in GLSL on features that no picture has.

    Args:
        ctx: The context.
        options: The seed.
        made: Networks by name.
        real: float32 [R, F], features of pixels.
        driver: For the paths.
    """
    bound, rng = bound_of("predict.glsl", deep=False), np.random.default_rng(options.seed)
    for name, weights in made.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / GLSL
            path.write_text(shader_source(weights), encoding="utf-8")
            for case, inputs in feature_cases(rng, weights, real).items():
                found, truth = glsl_outputs(path, inputs, ctx, len(weights.outputs)), predicted64(weights, inputs)
                row = compared(
                    f"predict.glsl · {driver}",
                    "adverse features",
                    found,
                    truth,
                    bound.value,
                    bound.measure,
                    bound.floor,
                )
                yield replace(row, where=f"{name}, {case}, {row.where}")
