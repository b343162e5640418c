"""The manifest of a bundle: what its predictor reads, which tail it was trained for, and what was proven of it.

A bundle is a folder with `manifest.json` and the files that it lists by hash. The predictor gives `a` and `b` per
pixel; the renderer keeps `k = clamp(floor(1.5 + (a - log lambda) / b), k_min, n)` fragments (METHOD.md section 4).
"""

from __future__ import annotations

import hashlib
import math
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError, field_validator, model_validator

from schemas.problem import ExitCode, Problem
from schemas.tail import MetricName, TailName

FORMAT: Final = "diaphane-bundle/1"
MANIFEST: Final = "manifest.json"
WEIGHTS: Final = "weights.safetensors"
ONNX: Final = "model.onnx"
GLSL: Final = "predict.glsl"
FILES: Final = (WEIGHTS, ONNX, GLSL)

GAIN_FLOOR: Final = 0.02
"""`b = softplus(.) + GAIN_FLOOR`: log gain lost per fragment is at least this, so that 1 / b stays finite."""

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
    """The tail whose error curves the predictor was trained on; it must be rendered with the same."""

    model_config = _STRICT

    name: TailName
    g: float = Field(ge=0.0)


class FileSpec(BaseModel):
    """Size and content hash of a file of the bundle."""

    model_config = _STRICT

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    bytes: int = Field(ge=0, le=MAX_FILE_BYTES)


class ParityReport(BaseModel):
    """Largest differences between the forms of the network, relative to max(1, |value|), on real inputs.

    Attributes:
        count: Rows of features compared.
        tolerance: What was allowed.
        torch_onnx: torch against onnxruntime.
        torch_glsl: torch against `predict.glsl` run by the driver below.
        driver: GL renderer and version.
    """

    model_config = _STRICT

    count: int = Field(gt=0)
    tolerance: float = Field(gt=0.0)
    torch_onnx: float = Field(ge=0.0)
    torch_glsl: float = Field(ge=0.0)
    driver: str


class Provenance(BaseModel):
    """Where a bundle comes from.

    Attributes:
        scenes: Name of each training scene -> content hash.
        holdout: The same for the scenes that were only evaluated on.
        code_version: Hash of the sources that made it.
        seed: Seed of the training.
        machine: Processor and platform in words.
        settings: Everything else that went in (training configuration, views, budgets).
    """

    model_config = _STRICT

    scenes: dict[str, str]
    holdout: dict[str, str] = {}
    code_version: str
    seed: int
    machine: str
    settings: dict[str, JsonValue] = {}


class Manifest(BaseModel):
    """`manifest.json`.

    Attributes:
        format: Version of this schema.
        name: Name of the bundle.
        head: How the outputs are read; `gain-curve` gives (a, b).
        features: Inputs of the network, in order.
        hidden: Units of each hidden layer (ReLU).
        layers: Tensors of `weights.safetensors`.
        tail: Tail of the allocation.
        metric: Where the error was measured.
        k_min: Fewest core fragments of an occupied pixel where the budget covers that, else 0.
        files: File name -> size and hash.
        parity: Agreement of torch, ONNX and GLSL.
        provenance: Where it comes from.
        evaluation: What was measured on held-out scenes.
    """

    model_config = _STRICT

    format: Literal["diaphane-bundle/1"] = FORMAT
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    head: Literal["gain-curve"] = "gain-curve"
    features: tuple[FeatureSpec, ...] = Field(min_length=1, max_length=256)
    hidden: tuple[int, ...] = Field(max_length=8)
    layers: tuple[LayerSpec, ...]
    tail: TailSpec
    metric: MetricName
    k_min: int = Field(ge=0, le=1)
    files: dict[str, FileSpec]
    parity: ParityReport
    provenance: Provenance
    evaluation: dict[str, JsonValue]

    @field_validator("files")
    @classmethod
    def _exactly_our_files(cls, files: dict[str, FileSpec]) -> dict[str, FileSpec]:
        if set(files) != set(FILES):
            raise ValueError(f"the files must be {', '.join(FILES)}")
        return files

    @model_validator(mode="after")
    def _layers_fit(self) -> Manifest:
        names = self.feature_names
        if len(set(names)) != len(names):
            raise ValueError("a feature is listed twice")
        if self.layers != layer_specs(len(names), self.hidden):
            raise ValueError("the layers do not follow from the features and the hidden units")
        return self

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple(feature.name for feature in self.features)

    @property
    def weight_count(self) -> int:
        """Number of trained weights."""
        return sum(math.prod(layer.shape) for layer in self.layers)


def layer_specs(inputs: int, hidden: tuple[int, ...]) -> tuple[LayerSpec, ...]:
    """Tensors of a gain-curve network with `inputs` features and the given hidden units; it has 2 outputs."""
    sizes = (inputs, *hidden, 2)
    specs: list[LayerSpec] = []
    for i, (fan_in, fan_out) in enumerate(pairwise(sizes)):
        specs.append(LayerSpec(name=f"layer{i}.weight", shape=(fan_out, fan_in), layout="out,in"))
        specs.append(LayerSpec(name=f"layer{i}.bias", shape=(fan_out,), layout="out"))
    return tuple(specs)


def file_spec(path: Path) -> FileSpec:
    """Size and hash of a file."""
    content = path.read_bytes()
    return FileSpec(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))


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
