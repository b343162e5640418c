"""Bundles on disk: written only if every form of the network agrees, read only if every hash and shape is right."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue
from safetensors import SafetensorError
from safetensors.numpy import load, save

from renderer.features import FEATURES
from schemas.bundle import (
    FILES,
    HALF_FILES,
    MANIFEST,
    WEIGHTS,
    FeatureSpec,
    Manifest,
    OnnxSpec,
    ParityReport,
    Provenance,
    TailSpec,
    file_spec,
    layer_specs,
    load_manifest,
)
from schemas.problem import ExitCode, Problem
from schemas.tail import MetricName
from trainer.export_forms import float_forms, half_forms
from trainer.export_onnx import IR_VERSION, OPSET
from trainer.prune import pruned
from trainer.self_test import self_test
from trainer.weights import Weights


@dataclass(frozen=True)
class Bundle:
    """A bundle whose content was verified.

    Attributes:
        manifest: Its manifest.
        weights: Its network, for inference in numpy.
    """

    manifest: Manifest
    weights: Weights


@dataclass(frozen=True)
class Description:
    """What a manifest says beside the network.

    Attributes:
        name: Name of the bundle.
        tail: Tail that the error curves were made with.
        metric: Where their error was measured.
        provenance: Where the bundle comes from.
        evaluation: What was measured on held-out scenes.
    """

    name: str
    tail: TailSpec
    metric: MetricName
    provenance: Provenance
    evaluation: dict[str, JsonValue]


def export_bundle(
    folder: Path,
    weights: Weights,
    description: Description,
    features: NDArray[np.float32],
    ctx: moderngl.Context,
) -> Manifest:
    """Write a bundle; the manifest comes last, so a folder without one is not a bundle.

    Args:
        folder: Empty or not yet there.
        weights: The trained network; what it does not use is left out.
        description: What the manifest says beside it.
        features: float32 [R, C], real inputs on which torch, ONNX and GLSL must agree; 1e5 rows or all there are.
        ctx: The GL context that runs the GLSL form.

    Raises:
        Problem: The forms do not agree.
    """
    from trainer.parity import check  # torch and onnxruntime take seconds to import; reading a bundle needs neither

    weights = pruned(weights)
    return write_bundle(folder, weights, description, features, lambda: check(weights, folder, features, ctx))


def write_bundle(
    folder: Path,
    weights: Weights,
    description: Description,
    features: NDArray[np.float32],
    compared: Callable[[], ParityReport],
) -> Manifest:
    """Write a bundle's files; the manifest comes last.

    Args:
        folder: Empty or not yet there.
        weights: The network.
        description: What the manifest says beside it.
        features: float32 [R, C], real inputs; the rows of the self-test are among them.
        compared: Says how far the forms differ; called when they are in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    specs = layer_specs(len(weights.features), weights.hidden, len(weights.outputs))
    arrays = [array for layer in weights.layers for array in layer]
    tensors = {spec.name: np.ascontiguousarray(array) for spec, array in zip(specs, arrays, strict=True)}
    _write(folder / WEIGHTS, save(tensors, metadata={"head": weights.head}))
    for name, content in {**float_forms(weights), **_half_forms(weights)}.items():
        _write(folder / name, content)
    parity = compared()
    if not parity.half_holds:
        for name in HALF_FILES:
            (folder / name).unlink()
    files = {name: file_spec(folder / name) for name in FILES if (folder / name).is_file()}
    manifest = Manifest(
        name=description.name,
        head=weights.head,
        outputs=weights.outputs,
        features=tuple(
            FeatureSpec(name=name, mean=float(mean), std=float(std))
            for name, mean, std in zip(weights.features, weights.mean, weights.std, strict=True)
        ),
        hidden=weights.hidden,
        layers=specs,
        tail=description.tail,
        metric=description.metric,
        files=files,
        onnx=OnnxSpec(opset=OPSET, ir_version=IR_VERSION),
        self_test=self_test(weights, features, files),
        parity=parity,
        provenance=description.provenance,
        evaluation=description.evaluation,
    )
    _write(folder / MANIFEST, (manifest.model_dump_json(indent=2) + "\n").encode())
    return manifest


def load_bundle(folder: Path) -> Bundle:
    """Read a bundle.

    Raises:
        Problem: It is no bundle, a file was changed, or its tensors are not those of the manifest, finite float32.
    """
    manifest = load_manifest(folder)
    unknown = sorted(set(manifest.feature_names) - set(FEATURES))
    if unknown:
        raise _unusable(folder, f"it reads features that this version does not compute: {', '.join(unknown)}")
    try:
        tensors = load((folder / WEIGHTS).read_bytes())
    except SafetensorError as reason:
        raise _unusable(folder, f"{WEIGHTS} cannot be read: {reason}") from reason
    if set(tensors) != {spec.name for spec in manifest.layers}:
        raise _unusable(folder, f"{WEIGHTS} does not hold the tensors of the manifest")
    for spec in manifest.layers:
        tensor = tensors[spec.name]
        if tensor.shape != spec.shape or tensor.dtype != np.float32 or not np.isfinite(tensor).all():
            raise _unusable(folder, f"{spec.name} is not finite float32 {list(spec.shape)}")
    layers = tuple((tensors[f"layer{i}.weight"], tensors[f"layer{i}.bias"]) for i in range(len(manifest.hidden) + 1))
    mean = np.array([feature.mean for feature in manifest.features], dtype=np.float32)
    std = np.array([feature.std for feature in manifest.features], dtype=np.float32)
    return Bundle(manifest, Weights(manifest.feature_names, mean, std, layers, manifest.head, manifest.outputs))


def _half_forms(weights: Weights) -> dict[str, bytes]:
    try:
        return half_forms(weights)
    except ValueError:  # too large for float16: `float_forms` has refused what is not finite
        return {}


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _unusable(folder: Path, what: str) -> Problem:
    return Problem(
        f"The bundle {folder} cannot be used: {what}.",
        "Fetch or build it again, or update diaphane.",
        ExitCode.CHECK_FAILED,
    )
