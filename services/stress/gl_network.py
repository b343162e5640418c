"""What `kbuffer-deep` does in GLSL before it allots: sums by blending, features of them, the network."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.features import FEATURES, SUMS, derive
from renderer.frame import Frame, Gathered
from renderer.techniques import KBufferDeep
from schemas.bundle import GLSL, ParityReport, Provenance, TailSpec
from services.stress.findings import Finding, Options, compared
from services.stress.gl_bounds import bound_of
from services.stress.gl_cases import Case, thinned
from services.stress.predictors import Rows, feature_cases, predicted64
from services.stress.twins import features64, network64, sums64
from trainer.bundle import Description, write_bundle
from trainer.export_shader import shader_source
from trainer.glsl_network import glsl_outputs
from trainer.self_test import pixel_sums
from trainer.weights import Weights

_SUMMED = [i for i, name in enumerate(SUMS) if name not in ("z_min", "z_max", "unused") and i < SUMS.index("nearest_r")]
_SPREADS = [i for i, name in enumerate(FEATURES) if "_std" in name]
_OTHERS = [i for i in range(len(FEATURES)) if i not in _SPREADS]


def random_bundle(folder: Path, weights: Weights, driver: str) -> Path:
    """A bundle of a network. Its forms are not compared here: that is what the suites do."""
    description = Description(
        name="stress",
        tail=TailSpec(name="density", g=0.75),
        metric="display",
        k_min=1,
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="stress"),
        evaluation={},
    )
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, driver=driver)
    write_bundle(folder, weights, description, derive(pixel_sums()), lambda: parity)
    return folder


def rows(case: Case, weights: Weights, bundle: Path, driver: str) -> Iterator[Finding]:
    """Sums, features and outputs of the pixels that a case compares and that have fragments."""
    pixels = case.pixels[case.dump.counts[case.pixels] > 0]
    truth = sums64(thinned(case.dump, pixels))[pixels]
    features_truth = features64(truth)
    technique = KBufferDeep(bundle)
    listed = pixels.astype(np.uint32)
    sums = gathered_sums(case.frame, case.frame.gather("gather"))[pixels]
    features = technique.features(case.frame, listed)
    predicted = technique.predict(case.frame, listed)

    def row(key: str, found: NDArray[np.floating], expected: NDArray[np.float64], names: list[str]) -> Finding:
        bound = bound_of(key, case.scenery.deep)

        def where(index: tuple[int, ...]) -> str:
            return f"{names[index[1]]}, {case.place(int(pixels[index[0]]))}"

        path = f"{key} · {driver}"
        return compared(path, case.name, found, expected, bound.value, bound.measure, bound.floor, where)

    yield row("gather", sums[:, _SUMMED], truth[:, _SUMMED], [SUMS[i] for i in _SUMMED])
    for key, columns in (("features", _OTHERS), ("features.spread", _SPREADS)):
        yield row(key, features[:, columns], features_truth[:, columns], [FEATURES[i] for i in columns])
    outputs = ["a", "b"]
    yield row("predict.glsl", predicted, predicted64(weights, features), outputs)
    ideal = network64(weights.mean, weights.std, weights.layers, features_truth)
    yield row("predict.features", predicted, ideal, outputs)


def feature_rows(
    ctx: moderngl.Context, options: Options, made: Mapping[str, Weights], real: Rows, driver: str
) -> Iterator[Finding]:
    """Networks in GLSL on features that no picture has.

    Args:
        ctx: The context.
        options: The seed.
        made: Networks by name.
        real: float32 [R, 26], features of pixels.
        driver: For the paths.
    """
    bound, rng = bound_of("predict.glsl", deep=False), np.random.default_rng(options.seed)
    for name, weights in made.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / GLSL
            path.write_text(shader_source(weights), encoding="utf-8")
            for case, inputs in feature_cases(rng, weights, real).items():
                found, truth = glsl_outputs(path, inputs, ctx), predicted64(weights, inputs)
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


def gathered_sums(frame: Frame, gathered: Gathered) -> NDArray[np.float32]:
    """float32 [P, 20], the blended texels of `renderer.features.SUMS`; columns that no texel holds are 0 or more."""
    read = [np.frombuffer(texture.read(), dtype=np.float32).reshape(frame.pixels, 4) for texture in gathered.sums]
    return np.concatenate(read, axis=1)
