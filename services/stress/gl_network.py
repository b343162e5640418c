"""What `kbuffer-deep` does in GLSL before it allots: sums by blending, depth bins, features of them, the network."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.features import BINNED, FEATURES, SUMS, derive, texels_of
from renderer.frame import ALL_TEXELS, NEAREST, Frame, Gathered, front_bytes
from renderer.techniques import KBufferDeep
from schemas.bundle import GLSL, MANIFEST, ParityReport, Provenance, TailSpec, file_spec, load_manifest
from schemas.tail import DEFAULT_TAIL, DENSITY_BINS, SHARE_LEVELS, TailName
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

_BLENDED: Final = [i for i, name in enumerate(SUMS) if name not in ("z_min", "z_max") and i < 4 * NEAREST]
_OPTICAL: Final = SUMS.index("optical_depth")
_SPREADS: Final = [i for i, name in enumerate(FEATURES) if "_std" in name]
_FRONTS: Final = [i for i, name in enumerate(FEATURES) if name.startswith("front_")]
_OTHERS: Final = [i for i in range(len(FEATURES)) if i not in _SPREADS + _FRONTS]
_HALF: Final = [i for i in _OTHERS if texels_of([FEATURES[i]], binned=True) & frozenset(range(NEAREST))]
"""Features of sums that are half floats beside depth bins."""
_WHOLE: Final = [i for i in _OTHERS if i not in _HALF]


@dataclass(frozen=True, slots=True)
class Networks:
    """Bundles of one network, for the tails that a predictor may have read sums for.

    Attributes:
        weights: The network.
        plain: Of the tail `density`: sums are float32.
        binned: Of the default tail: it reads depth bins, and beside them half-float sums.
        overflowing: A bundle of another network, with a shader whose answers are too large for float32, or NaN.
    """

    weights: Weights
    plain: Path
    binned: Path
    overflowing: Path


def random_networks(folder: Path, weights: Weights, driver: str) -> Networks:
    """Bundles of a network. Its forms are not compared here: that is what the suites do."""
    plain, binned, overflowing = (folder / name for name in ("plain", "binned", "overflowing"))
    _bundle(plain, weights, "density", driver)
    _bundle(binned, weights, DEFAULT_TAIL, driver)
    _bundle(overflowing, weights, "density", driver)
    (overflowing / GLSL).write_text(shader_source(overflowed(weights)), encoding="utf-8")
    manifest = load_manifest(plain)
    manifest = manifest.model_copy(update={"files": {**manifest.files, GLSL: file_spec(overflowing / GLSL)}})
    (overflowing / MANIFEST).write_text(manifest.model_dump_json(), encoding="utf-8")
    return Networks(weights, plain, binned, overflowing)


def overflowed(weights: Weights) -> Weights:
    """A network of finite weights whose sums overflow: it answers infinity of either sign, and NaN."""
    weight, bias = weights.layers[-1]
    largest = np.copysign(np.float32(3e38), weight)
    return replace(weights, layers=(*weights.layers[:-1], (largest, bias)))


def _bundle(folder: Path, weights: Weights, tail: TailName, driver: str) -> None:
    description = Description(
        name="stress",
        tail=TailSpec(name=tail, g=0.75),
        metric="display",
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="stress"),
        evaluation={},
    )
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, driver=driver)
    write_bundle(folder, weights, description, derive(pixel_sums()), lambda: parity)


@dataclass(frozen=True, slots=True)
class _Judge:
    """Rows of the pixels that a case compares and that have fragments."""

    case: Case
    pixels: NDArray[np.int64]
    driver: str

    @classmethod
    def of(cls, case: Case, driver: str) -> _Judge:
        return cls(case, case.pixels[case.dump.counts[case.pixels] > 0], driver)

    def row(
        self,
        key: str,
        found: NDArray[np.floating],
        truth: NDArray[np.floating],
        names: Sequence[str],
        path: str = "",
        amplified: NDArray[np.floating] | float = 1.0,
    ) -> Finding:
        """One row for [pixels, names]; errors are divided by what a pixel amplifies them by."""
        bound = bound_of(key, self.case.scenery.deep)

        def where(index: tuple[int, ...]) -> str:
            return f"{names[index[1]]}, {self.case.place(int(self.pixels[index[0]]))}"

        expected = np.asarray(truth, np.float64)
        made = expected + (found - expected) / amplified
        name = f"{path or key} · {self.driver}"
        return compared(name, self.case.name, made, expected, bound.value, bound.measure, bound.floor, where)


def rows(case: Case, networks: Networks, driver: str) -> Iterator[Finding]:
    """Sums, depth bins, features and outputs of the pixels that a case compares and that have fragments."""
    judge = _Judge.of(case, driver)
    dump = thinned(case.dump, judge.pixels)
    yield from _plain(judge, networks, sums64(dump)[judge.pixels])
    for tail, bins in DENSITY_BINS.items():
        truth = sums64(dump, bins)[judge.pixels]
        yield from _bins(judge, bins, truth)
        if tail == DEFAULT_TAIL:
            yield from _binned(judge, networks, bins, truth)


def _plain(judge: _Judge, networks: Networks, truth: NDArray[np.float64]) -> Iterator[Finding]:
    """Sums in float32, and all that is made of them."""
    frame, technique = judge.case.frame, KBufferDeep(networks.plain)
    listed, expected = judge.pixels.astype(np.uint32), features64(truth)
    sums = gathered_sums(frame, frame.gather("gather"))[judge.pixels]
    features = technique.features(frame, listed)
    yield judge.row("gather", sums[:, _BLENDED], truth[:, _BLENDED], _named(SUMS, _BLENDED))
    for key, columns in (("features", _OTHERS), ("features.spread", _SPREADS)):
        yield judge.row(key, features[:, columns], expected[:, columns], _named(FEATURES, columns))
    yield from _outputs(judge, networks.weights, technique.predict(frame, listed), features, expected)


def _bins(judge: _Judge, bins: int, truth: NDArray[np.float64]) -> Iterator[Finding]:
    """What is kept of the depth bins: the optical depth, and its shares in front of them, in whole steps."""
    frame = judge.case.frame
    front = frame.gather("gather", frozenset(), bins).front
    assert front is not None, "there are bins"
    width = front_bytes(bins) // 4
    words = np.frombuffer(front.read(4 * width * frame.pixels), np.uint32).reshape(-1, width)[judge.pixels]
    optical = words[:, :1].copy().view(np.float32)
    yield judge.row("bins.optical depth", optical, truth[:, [_OPTICAL]], [f"{bins} bins"])
    b = np.arange(bins - 1)
    found = words[:, 1 + b // 8] >> (4 * (b % 8)).astype(np.uint32) & 15
    shares = truth[:, 4 * BINNED - 1 + 16 // bins * (b + 1)]
    names = [f"bin {i + 1} of {bins}" for i in b]
    yield judge.row("bins.shares", found.astype(np.float64), np.rint(SHARE_LEVELS * shares), names)


def _binned(judge: _Judge, networks: Networks, bins: int, truth: NDArray[np.float64]) -> Iterator[Finding]:
    """Sums in half floats, what is made of them, and the features of the bins."""
    frame, technique = judge.case.frame, KBufferDeep(networks.binned)
    listed, expected = judge.pixels.astype(np.uint32), features64(truth)
    # As many roundings as fragments, each of what is there and of what is added.
    amplified = truth[:, :1] + 2.0
    sums = gathered_sums(frame, frame.gather("gather", ALL_TEXELS, bins))[judge.pixels]
    features = technique.features(frame, listed)
    half = _named(SUMS, _BLENDED)
    yield judge.row("gather.half", sums[:, _BLENDED], truth[:, _BLENDED], half, amplified=amplified)
    for key, columns, path, times in (
        ("features", _WHOLE, "features.whole", 1.0),
        ("features.half", _HALF, "", amplified),
        ("features.half spread", _SPREADS, "", np.sqrt(amplified)),
    ):
        names = _named(FEATURES, columns)
        yield judge.row(key, features[:, columns], expected[:, columns], names, path, times)
    found, steps = (np.rint(SHARE_LEVELS * values[:, _FRONTS].astype(np.float64)) for values in (features, expected))
    yield judge.row("features.front", found, steps, _named(FEATURES, _FRONTS))
    yield from _outputs(judge, networks.weights, technique.predict(frame, listed), features, expected, ".half")


def _outputs(
    judge: _Judge,
    weights: Weights,
    predicted: Rows,
    features: Rows,
    expected: NDArray[np.float64],
    suffix: str = "",
) -> Iterator[Finding]:
    """The network of the features that the GPU has, and of those that it should have."""
    names = ["a", "b"]
    yield judge.row("predict.glsl", predicted, predicted64(weights, features), names, f"predict.glsl{suffix}")
    ideal = network64(weights.mean, weights.std, weights.layers, expected)
    yield judge.row("predict.features", predicted, ideal, names, f"predict.features{suffix}")


def _named(names: Sequence[str], columns: Sequence[int]) -> list[str]:
    return [names[i] for i in columns]


def feature_rows(
    ctx: moderngl.Context, options: Options, made: Mapping[str, Weights], real: Rows, driver: str
) -> Iterator[Finding]:
    """Networks in GLSL on features that no picture has.

    Args:
        ctx: The context.
        options: The seed.
        made: Networks by name.
        real: float32 [R, 41], features of pixels.
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
    read = [
        np.frombuffer(texture.read(), dtype=f"<{texture.dtype}").reshape(frame.pixels, 4).astype(np.float32)
        for texture in gathered.sums
    ]
    return np.concatenate(read, axis=1)
