"""The manifest of a bundle: what its predictor reads, which tail it was trained for, and what was proven of it.

A bundle is a folder with `manifest.json` and the files that it lists by hash. The predictor says of each depth bin of a
pixel from which price per fragment on it is in the core (METHOD.md section 4).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError, field_validator, model_validator

from schemas.problem import ExitCode, Problem
from schemas.tail import BINNED_TAILS, MOST_BINS, TAILS, MetricName, TailName

FormatName = Literal["diaphane-bundle/2"]
FORMAT: Final = "diaphane-bundle/2"
MANIFEST: Final = "manifest.json"
WEIGHTS: Final = "weights.safetensors"
ONNX: Final = "model.onnx"
GLSL: Final = "predict.glsl"
GLSL_HALF: Final = "predict_half.glsl"
UBO: Final = "predict_ubo.glsl"
UBO_DATA: Final = "predict_ubo.bin"
UBO_HALF: Final = "predict_ubo_half.glsl"
UBO_HALF_DATA: Final = "predict_ubo_half.bin"
WGSL: Final = "predict.wgsl"
WGSL_HALF: Final = "predict_half.wgsl"
HLSL: Final = "predict.hlsl"

CARD: Final = "model_card.md"
"""What people should know before they use the bundle; it comes last, with what was measured."""

HALF_FILES: Final = (GLSL_HALF, UBO_HALF, UBO_HALF_DATA, WGSL_HALF)
"""The forms in float16: all of them, or none where the network does not bear that precision."""

SHADERS: Final = (GLSL, UBO, WGSL, HLSL, GLSL_HALF, UBO_HALF, WGSL_HALF)
"""The files that are source of a shader."""

FILES: Final = (WEIGHTS, ONNX, GLSL, UBO, UBO_DATA, WGSL, HLSL, *HALF_FILES)
"""What a bundle holds beside its manifest and its card."""

HeadName = Literal["bin-gains", "importance"]
OutputName = str


def gain_outputs(bins: int) -> tuple[OutputName, ...]:
    """What a network of the head `bin-gains` answers for a tail of so many bins."""
    return (*(f"gain_{b}" for b in range(bins)), "prior")


HEADS: Final[dict[HeadName, tuple[tuple[OutputName, ...], ...]]] = {
    "bin-gains": tuple(gain_outputs(bins) for bins in sorted({TAILS[name].bins for name in BINNED_TAILS})),
    "importance": (("importance",),),
}
"""What a network of each head may answer.

`gain_b`: by how much the log gain of each fragment of depth bin b is above `prior` times what the tail tells of it
(`renderer.allocation.prices`). `importance`: DHOIT's share of a pixel, which Eq. 3 turns into k.
"""


ActivationName = Literal["identity", "softplus", "sigmoid"]
ACTIVATIONS: Final[dict[OutputName, ActivationName]] = {
    **dict.fromkeys(gain_outputs(MOST_BINS), "identity"),
    "prior": "softplus",
    "importance": "sigmoid",
}
"""What makes an output of the last layer's number."""

FEATURE_LIMIT: Final = 4.0
"""Normalised features are clamped to this, either way: beyond it no training data says what a network would answer."""

MAX_MANIFEST_BYTES: Final = 1 << 20
MAX_FILE_BYTES: Final = 64 << 20

_STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FeatureSpec(BaseModel):
    """One input of the network, normalised as `clamp((x - mean) / std, -FEATURE_LIMIT, FEATURE_LIMIT)`."""

    model_config = _STRICT

    name: str
    mean: float
    std: float = Field(gt=0.0)


class LayerSpec(BaseModel):
    """One float32 tensor of `weights.safetensors`; `layout` names its axes, as in `out,in`."""

    model_config = _STRICT

    name: str
    shape: tuple[int, ...]
    layout: str


class TailSpec(BaseModel):
    """The tail whose error curves the predictor was trained on; it must be rendered with the same.

    Attributes:
        name: Its name.
        g: The density tail's constant.
    """

    model_config = _STRICT

    name: TailName
    g: float = Field(ge=0.0)


class FileSpec(BaseModel):
    """Size and content hash of a file of the bundle."""

    model_config = _STRICT

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    bytes: int = Field(ge=0, le=MAX_FILE_BYTES)


class ParityReport(BaseModel):
    """Largest differences between torch and the other forms of the network on real inputs.

    All are relative to max(1, |value|), but `float16`.

    Attributes:
        count: Rows of features compared.
        tolerance: What was allowed in float32.
        torch_onnx: torch against onnxruntime.
        torch_glsl: torch against `predict.glsl` run by the driver below.
        torch_ubo: torch against `predict_ubo.glsl`.
        half_tolerance: What was allowed with weights in float16 and arithmetic in float32; of a log gain of 16, half a
            rank.
        half: The files of which that is true, run by the driver below -> difference.
        float16: With hidden layers computed in float16 too, every product and sum rounded. Relative to the scale of the
            output, the largest |value| that it takes on these inputs, or 1: float16 has 11 bits, and the terms whose
            sum is a small value are of that scale. None where it was not measured.
        float16_tolerance: What was allowed of that.
        driver: GL renderer and version.
    """

    model_config = _STRICT

    count: int = Field(gt=0)
    tolerance: float = Field(gt=0.0)
    torch_onnx: float = Field(ge=0.0)
    torch_glsl: float = Field(ge=0.0)
    torch_ubo: float = Field(ge=0.0)
    half_tolerance: float = Field(default=4e-3, gt=0.0)
    half: dict[str, float] = {}
    float16: float | None = None
    float16_tolerance: float = Field(default=1e-2, gt=0.0)
    driver: str

    @property
    def worst(self) -> float:
        """The largest difference in float32."""
        return max(self.torch_onnx, self.torch_glsl, self.torch_ubo)

    @property
    def half_holds(self) -> bool:
        """Whether the network bears float16: a bundle has its files in it only then."""
        stored = max(self.half.values(), default=0.0)
        return stored <= self.half_tolerance and (self.float16 or 0.0) <= self.float16_tolerance


class SelfTest(BaseModel):
    """Rows with which anyone can check what their compiler made of a form.

    Attributes:
        features: [R, F], real inputs of the network.
        outputs: [R, outputs], the answers, from float64.
        sums: [S, 4 * texels], raw sums of pixels (`renderer.features.SUMS`).
        derived: [S, F], their features, from the same expressions.
        tolerance: File -> largest difference of an output, relative to `output_scale`.
        feature_tolerance: Largest difference of a feature, relative to max(1, |value|).
        output_scale: [outputs], the largest |value| of each on the inputs that parity was measured on, at least 1.
    """

    model_config = _STRICT

    features: tuple[tuple[float, ...], ...]
    outputs: tuple[tuple[float, ...], ...]
    sums: tuple[tuple[float, ...], ...]
    derived: tuple[tuple[float, ...], ...]
    tolerance: dict[str, float]
    feature_tolerance: float = Field(gt=0.0)
    output_scale: tuple[float, ...]


class OnnxSpec(BaseModel):
    """What `model.onnx` needs: operator set and version of the file format."""

    model_config = _STRICT

    opset: int = Field(gt=0)
    ir_version: int = Field(gt=0)


class Provenance(BaseModel):
    """Where a bundle comes from.

    Attributes:
        scenes: Name of each training scene -> content hash.
        holdout: The same for the scenes that were only evaluated on.
        licences: Name of a scene of either -> its licence and whom to name for it, as the scene states them; a scene
            without an entry states none.
        code_version: Hash of the sources that made it.
        seed: Seed of the training.
        machine: Processor and platform in words.
        settings: Everything else that went in (training configuration, views, budgets).
    """

    model_config = _STRICT

    scenes: dict[str, str]
    holdout: dict[str, str] = {}
    licences: dict[str, str] = {}
    code_version: str
    seed: int
    machine: str
    settings: dict[str, JsonValue] = {}

    @property
    def known_licences(self) -> dict[str, str]:
        """Content hash of a scene -> its licence, of those that state one."""
        scenes = {**self.holdout, **self.scenes}
        return {scenes[name]: licence for name, licence in self.licences.items() if name in scenes and licence}


class Manifest(BaseModel):
    """`manifest.json`.

    Attributes:
        format: Version of this schema.
        name: Name of the bundle.
        head: How the outputs are read.
        outputs: What the network answers, in this order; the one of `HEADS[head]` that the tail's bins ask for.
        features: Inputs of the network, in order.
        hidden: Units of each hidden layer (ReLU).
        layers: Tensors of `weights.safetensors`.
        tail: Tail of the allocation, with depth bins: what is predicted is how many of them are the core.
        metric: Where the error was measured.
        files: File name -> size and hash.
        onnx: What `model.onnx` needs.
        self_test: Rows to check a compiled form with.
        parity: Agreement of torch, ONNX and GLSL.
        provenance: Where it comes from.
        evaluation: What was measured on held-out scenes.
    """

    model_config = _STRICT

    format: FormatName = FORMAT
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    head: HeadName = "bin-gains"
    outputs: tuple[OutputName, ...]
    features: tuple[FeatureSpec, ...] = Field(min_length=1, max_length=256)
    hidden: tuple[int, ...] = Field(max_length=8)
    layers: tuple[LayerSpec, ...]
    tail: TailSpec
    metric: MetricName
    files: dict[str, FileSpec]
    onnx: OnnxSpec
    self_test: SelfTest
    parity: ParityReport
    provenance: Provenance
    evaluation: dict[str, JsonValue]

    @field_validator("tail")
    @classmethod
    def _has_bins(cls, tail: TailSpec) -> TailSpec:
        if tail.name not in BINNED_TAILS:
            raise ValueError(f"the tail {tail.name} has no depth bins; one of {', '.join(BINNED_TAILS)} has")
        return tail

    @model_validator(mode="after")
    def _exactly_our_files(self) -> Manifest:
        if set(self.files) - {CARD} not in (set(FILES), set(FILES) - set(HALF_FILES)):
            raise ValueError(f"the files must be {', '.join(FILES)}, with or without those in float16 and {CARD}")
        return self

    @model_validator(mode="after")
    def _layers_fit(self) -> Manifest:
        names = self.feature_names
        if len(set(names)) != len(names):
            raise ValueError("a feature is listed twice")
        answered = gain_outputs(TAILS[self.tail.name].bins) if self.head == "bin-gains" else ("importance",)
        if self.outputs != answered:
            raise ValueError(f"a network of the head {self.head} does not answer {', '.join(self.outputs)}")
        if self.layers != layer_specs(len(names), self.hidden, len(self.outputs)):
            raise ValueError("the layers do not follow from the features, the hidden units and the outputs")
        return self

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple(feature.name for feature in self.features)

    @property
    def weight_count(self) -> int:
        """Number of trained weights."""
        return sum(math.prod(layer.shape) for layer in self.layers)


def layer_specs(inputs: int, hidden: tuple[int, ...], outputs: int) -> tuple[LayerSpec, ...]:
    """Tensors of a network with `inputs` features, the given hidden units and `outputs` numbers in its answer."""
    sizes = (inputs, *hidden, outputs)
    specs: list[LayerSpec] = []
    for i, (fan_in, fan_out) in enumerate(pairwise(sizes)):
        specs.append(LayerSpec(name=f"layer{i}.weight", shape=(fan_out, fan_in), layout="out,in"))
        specs.append(LayerSpec(name=f"layer{i}.bias", shape=(fan_out,), layout="out"))
    return tuple(specs)


def file_spec(path: Path) -> FileSpec:
    """Size and hash of a file."""
    content = path.read_bytes()
    return FileSpec(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))


def network_digest(files: Mapping[str, str]) -> str:
    """Hex sha256 that names the network of a bundle, whatever its manifest and its card say.

    Args:
        files: Name -> hex sha256 of the bundle's files.
    """
    named = {name: sha256 for name, sha256 in files.items() if name not in (MANIFEST, CARD)}
    return hashlib.sha256("".join(f"{sha256}  {name}\n" for name, sha256 in sorted(named.items())).encode()).hexdigest()


def write_card(folder: Path, text: str) -> Manifest:
    """Gives a bundle its model card, or another one, and lists it in the manifest, which is written last.

    Args:
        folder: The bundle.
        text: Markdown.

    Raises:
        Problem: As `load_manifest`.
    """
    manifest = load_manifest(folder)
    (folder / CARD).write_text(text, encoding="utf-8")
    manifest = manifest.model_copy(update={"files": {**manifest.files, CARD: file_spec(folder / CARD)}})
    (folder / MANIFEST).write_text(manifest.model_dump_json(indent=2) + "\n", encoding="utf-8")
    return manifest


def load_manifest(folder: Path) -> Manifest:
    """Read a bundle's manifest and verify its files.

    Args:
        folder: The bundle.

    Returns:
        The manifest; every file that it lists exists with that size and hash.

    Raises:
        Problem: There is no bundle, its manifest is not valid, or a file is missing or was changed.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise Problem(
            f"{folder} is not a bundle: it has no {MANIFEST}.",
            "Give the folder that `diaphane build` or the registry wrote.",
            ExitCode.NOT_FOUND,
        )
    if path.stat().st_size > MAX_MANIFEST_BYTES:
        raise _damaged(folder, f"{MANIFEST} is larger than {MAX_MANIFEST_BYTES} bytes")
    try:
        manifest = Manifest.model_validate_json(path.read_bytes())
    except ValidationError as reason:
        first = reason.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or MANIFEST
        raise _damaged(folder, f"{where}: {first['msg']}") from reason
    for name, expected in manifest.files.items():
        file = folder / name
        if not file.is_file():
            raise _damaged(folder, f"{name} is missing")
        if file.stat().st_size != expected.bytes or file_spec(file) != expected:
            raise _damaged(folder, f"{name} is not the file that the manifest lists (size or sha256 differ)")
    return manifest


def _damaged(folder: Path, what: str) -> Problem:
    return Problem(
        f"The bundle {folder} cannot be used: {what}.",
        "Fetch or build it again; do not edit its files.",
        ExitCode.CHECK_FAILED,
    )
