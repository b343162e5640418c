"""Bundles that are valid in form, with weights that nobody trained: for tests of what moves and guards bundles."""

from __future__ import annotations

from pathlib import Path

from schemas.bundle import (
    FILES,
    MANIFEST,
    FeatureSpec,
    Manifest,
    OnnxSpec,
    ParityReport,
    Provenance,
    SelfTest,
    TailSpec,
    file_spec,
    gain_outputs,
    layer_specs,
)
from schemas.tail import DEFAULT_TAIL, TAILS

TOLERANCE = 1e-4


def make_bundle(
    folder: Path,
    weights: str = "a",
    *,
    parity: float = 1e-6,
    scenes: dict[str, str] | None = None,
    licences: dict[str, str] | None = None,
) -> Path:
    """Writes a bundle into a new folder.

    Args:
        folder: Created.
        weights: Content of its weights; bundles with the same weights are the same bundle.
        parity: Difference between torch and GLSL; `TOLERANCE` is allowed.
        scenes: Training scenes by name and hash.
        licences: Their licences by name.
    """
    folder.mkdir(parents=True)
    for name in FILES:
        (folder / name).write_text(f"{name} {weights}")
    outputs = gain_outputs(TAILS[DEFAULT_TAIL].bins)
    manifest = Manifest(
        name="glass",
        outputs=outputs,
        features=(FeatureSpec(name="count", mean=0.0, std=1.0),),
        hidden=(4,),
        layers=layer_specs(1, (4,), len(outputs)),
        tail=TailSpec(name=DEFAULT_TAIL, g=0.75),
        metric="display",
        files={name: file_spec(folder / name) for name in FILES},
        onnx=OnnxSpec(opset=17, ir_version=8),
        self_test=SelfTest(
            features=(),
            outputs=(),
            sums=(),
            derived=(),
            tolerance={},
            feature_tolerance=1e-4,
            output_scale=(1.0,) * len(outputs),
        ),
        parity=ParityReport(
            count=10, tolerance=TOLERANCE, torch_onnx=1e-7, torch_glsl=parity, torch_ubo=0.0, driver="llvmpipe"
        ),
        provenance=Provenance(
            scenes=scenes or {"bottles": "0" * 64},
            licences=licences or {},
            code_version="v1",
            seed=0,
            machine="a machine",
        ),
        evaluation={"views": 2},
    )
    (folder / MANIFEST).write_text(manifest.model_dump_json(indent=2))
    return folder
