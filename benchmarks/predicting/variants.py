"""The variants that are trained and scored: each is the default with one thing changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from benchmarks.predicting.augmentation import Augmentation
from benchmarks.predicting.inputs import BLOCKS, Inputs
from renderer.features import FEATURES, FEATURES_GLSL
from schemas.network import SIZES
from schemas.pixel_weights import PixelWeights
from schemas.tail import DEFAULT_TAIL, TailName
from trainer.config import Preset, TrainConfig

Part = Literal[
    "variants",
    "bundles",
    "sizes",
    "features",
    "losses",
    "seeds",
    "labels",
    "presets",
    "augmentation",
    "inputs",
    "tails",
]
Learned = Literal["factor", "exponents", "coverage"]
"""`factor`: the network also says what the exponents of a pixel's tail are multiplied with; of `density` that is g.
`exponents`, `coverage`: a second, small network corrects every fragment's exponent, or the tail's transmittance."""
Feedback = Literal["error", "colour"]
"""What a resolved pixel knows of its last core fragment: by how much the error fell (nobody knows that in a frame), or
by how much the colour changed."""

DEFAULT: Final[TailName] = DEFAULT_TAIL
SPARE: Final[TailName] = "density-8"
"""The tail with columns to spare (`benchmarks.predicting.inputs`)."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A predictor.

    Attributes:
        name: Of the row in the tables.
        part: Of the benchmark.
        tail: That frames use.
        config: How it is trained.
        labels: Tail of the curves that it learns from; None: that of the frames.
        inputs: What it reads of a pixel's neighbourhood or view.
        augmentation: Views that are trained on as well; None: none.
        teacher: The variant whose answers it learns, trained on the same views; empty: none.
        teaching: Share of the loss that is the teacher's.
        feedback: What corrects its curves after a first frame; None: nothing.
        turns: How often.
        learned: What is learned of the tail itself; None: nothing.
        weights: What the errors count that it learns from.
        base: The variant that it is compared with; empty: none.
    """

    name: str
    part: Part
    tail: TailName = DEFAULT
    config: TrainConfig = field(default_factory=TrainConfig)
    labels: TailName | None = None
    inputs: Inputs = "plain"
    augmentation: Augmentation | None = None
    teacher: str = ""
    teaching: float = 0.0
    feedback: Feedback | None = None
    turns: int = 0
    learned: Learned | None = None
    weights: PixelWeights = "none"
    base: str = DEFAULT

    @property
    def taught(self) -> TailName:
        """Tail of the curves that it learns from."""
        return self.labels or self.tail


MINIMAL: Final = ("log_n", "optical_depth", "alpha_nearest", *(f"rgb_nearest_{c}" for c in "rgb"))
"""Features that cost no texel of sums where depth bins are gathered."""

_HOLDS: Final = (
    "alpha; nor 2, which needs it",
    "rgb mean, depth mean; nor 3 and 4, which need it",
    "rgb weighted by alpha, depth spread",
    "rgb spread",
    "covariance of rgb and depth",
)
"""What the texels of sums are for; without means there are no spreads."""

_FRONT: Final = tuple(name for name in FEATURES if name.startswith("front_"))
_HIDDEN: Final[dict[str, tuple[int, ...]]] = {
    "linear": (),
    "8": (8,),
    "16-8": (16, 8),
    "64-32": (64, 32),
    "128-64": (128, 64),
}


def variants() -> dict[str, Variant]:
    """All of them, in the order of the tables, those that others are compared with first."""
    return {variant.name: variant for variant in _variants()}


def without_texel(texel: int) -> tuple[str, ...]:
    """The features that do not read a texel of `renderer.features.SUMS`."""
    return tuple(name for name in FEATURES if f"s[{texel}]." not in _read(name))


def _read(name: str) -> str:
    """A feature's expression without what the count pass and the depth bins know anyway."""
    expression = FEATURES_GLSL[name]
    for known in ("s[0].x", "s[0].w", "s[3].w", "s[4].w"):
        expression = expression.replace(known, "")
    return expression


def _variants() -> Iterator[Variant]:
    for tail in (DEFAULT, SPARE, "density"):
        yield Variant(tail, "variants", tail, base="")
    for size in SIZES:
        for tail in (DEFAULT, SPARE):
            yield Variant(f"{size}, {tail}", "bundles", tail, TrainConfig.sized(size), base=tail)
    yield from _sizes()
    yield from _features()
    losses: dict[str, dict[str, Any]] = {
        "500 steps": {"steps": 500},
        "4000 steps": {"steps": 4000},
        "views' weight 0": {"view_weight": 0.0},
        "views' weight 1": {"view_weight": 1.0},
        "hard views mined": {"mining": 0.5, "validate_every": 250},
        "noise on the features": {"feature_noise": 0.1},
        "early stopping": {"steps": 6000, "validate_every": 250, "patience": 3},
    }
    for name, changes in losses.items():
        yield Variant(name, "losses", config=TrainConfig(**changes))
    taught: dict[str, Any] = {
        "config": TrainConfig.sized("small"),
        "teacher": f"full, {DEFAULT}",
        "base": f"small, {DEFAULT}",
    }
    for tail in (DEFAULT, SPARE):
        yield Variant(f"weights of FLIP, {tail}", "losses", tail, weights="flip", base=tail)
    for name, teaching in {"distilled": 1.0, "distilled, half regret": 0.5}.items():
        yield Variant(name, "losses", teaching=teaching, **taught)
    for seed in (1, 2):
        yield Variant(f"seed {seed}", "seeds", config=TrainConfig(seed=seed))
    yield Variant("labels of density", "labels", labels="density", base="without depth bins")
    yield Variant("labels of density-8", "labels", labels="density-8")
    yield from _presets()
    augmentations: dict[str, Augmentation] = {
        "other opacities": "opacities",
        "colours permuted": "colours",
        "cuts": "cuts",
    }
    for name, augmentation in augmentations.items():
        yield Variant(name, "augmentation", augmentation=augmentation)
    trials: tuple[Inputs, ...] = ("neighbourhood", "view-means", "view-normalised")
    for inputs in trials:
        yield Variant(inputs, "inputs", SPARE, inputs=inputs, base=SPARE)
    for inputs in BLOCKS:
        for tail in (DEFAULT, SPARE):
            yield Variant(f"{inputs}, {tail}", "inputs", tail, inputs=inputs, base=tail)
    kinds: tuple[Feedback, ...] = ("colour", "error")
    for feedback in kinds:
        for turns in (1, 2):
            yield Variant(f"feedback of {feedback}, {turns}", "inputs", feedback=feedback, turns=turns)
    yield Variant("density, g from network", "tails", "density", learned="factor", base="density")
    yield Variant("density-16, factor from network", "tails", learned="factor")
    corrected: tuple[Learned, ...] = ("exponents", "coverage")
    for tail in (DEFAULT, SPARE):
        for learned in corrected:
            yield Variant(f"{tail}, learned {learned}", "tails", tail, learned=learned, base=tail)


def _sizes() -> Iterator[Variant]:
    for name, hidden in _HIDDEN.items():
        yield Variant(f"hidden {name}", "sizes", config=TrainConfig(hidden=hidden))
    for name, hidden in _HIDDEN.items():
        yield Variant(f"density-8, hidden {name}", "sizes", SPARE, TrainConfig(hidden=hidden), base=SPARE)


def _features() -> Iterator[Variant]:
    def of(name: str, features: tuple[str, ...], tail: TailName = DEFAULT, **changes: Any) -> Variant:
        return Variant(name, "features", tail, TrainConfig(features=features, **changes), base=tail)

    for texel, holds in enumerate(_HOLDS):
        yield of(f"without texel {texel} ({holds})", without_texel(texel))
    yield of("without the nearest fragment", without_texel(5))
    yield of("without the background", without_texel(6))
    yield of("without depth bins", tuple(name for name in FEATURES if name not in _FRONT))
    minimal = (*MINIMAL, *_FRONT)
    means = (*minimal, *(f"rgb_mean_{c}" for c in "rgb"), "depth_mean")
    spread = (*means, *(f"rgb_std_{c}" for c in "rgb"))
    free = (*minimal, "depth_extent", *(f"background_{c}" for c in "rgb"))
    none = tuple(name for name in free if "nearest" not in name)
    for tail in (DEFAULT, SPARE):
        short = tail.removeprefix("density-")
        yield of(f"minimal, {short} bins", minimal, tail)
        yield of(f"minimal and background, {short} bins", free, tail)
        yield of(f"minimal and texel 1, {short} bins", means, tail)
        yield of(f"minimal and texels 1, 3, {short} bins", spread, tail)
        yield of(f"no sums and no nearest, {short} bins", none, tail)
        yield of(f"minimal and background, hidden 8, {short} bins", free, tail, hidden=(8,))
        yield of(f"minimal and background, hidden 16-8, {short} bins", free, tail, hidden=(16, 8))
        yield of(f"minimal and texel 1, hidden 16-8, {short} bins", means, tail, hidden=(16, 8))


def _presets() -> Iterator[Variant]:
    presets: tuple[Preset, ...] = ("paper", "paper-repaired")
    tails: tuple[TailName, ...] = ("weighted-average", DEFAULT)
    for preset in presets:
        for tail in tails:
            yield Variant(f"{preset}, {tail}", "presets", tail, TrainConfig.of(preset))
