"""Bundles are written whole, and read only if nothing was changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from support.training import random_weights, real_features

from renderer.features import FEATURES, derive
from schemas.bundle import (
    FILES,
    GLSL,
    GLSL_HALF,
    HALF_FILES,
    MANIFEST,
    ONNX,
    SHADERS,
    WEIGHTS,
    Manifest,
    Provenance,
    TailSpec,
    file_spec,
    gain_outputs,
    load_manifest,
)
from schemas.problem import Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TAIL_NAMES, TailName
from trainer.bundle import Description, export_bundle, load_bundle
from trainer.export_forms import float_forms
from trainer.weights import Weights

NAMES = ("log_n", "optical_depth", "luma_std", "front_3")
DESCRIPTION = Description(
    name="glass",
    tail=TailSpec(name=DEFAULT_TAIL, g=0.75),
    metric="display",
    provenance=Provenance(scenes={"vase": "ab12"}, code_version="cd34", seed=0, machine="a test"),
    evaluation={"q": {"1": 0.5}},
)


@pytest.fixture
def folder(gl: moderngl.Context, tmp_path: Path) -> Path:
    export_bundle(tmp_path / "glass", random_weights(1, NAMES, (8,)), DESCRIPTION, real_features(500, 1), gl)
    return tmp_path / "glass"


def resigned(folder: Path, change: Callable[[dict[str, np.ndarray]], None]) -> None:
    """Change the tensors, and make the hashes right again."""
    tensors = load_file(folder / WEIGHTS)
    change(tensors)
    save_file(tensors, folder / WEIGHTS)
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["files"][WEIGHTS] = file_spec(folder / WEIGHTS).model_dump()
    (folder / MANIFEST).write_text(json.dumps(manifest))


def test_what_is_written_is_read_back(folder: Path) -> None:
    bundle, original = load_bundle(folder), random_weights(1, NAMES, (8,))
    assert bundle.manifest.name == "glass"
    assert bundle.manifest.feature_names == NAMES
    assert bundle.manifest.weight_count == 8 * 4 + 8 + 13 * 8 + 13
    assert bundle.manifest.parity.count == 500
    features = real_features(100, 2)
    np.testing.assert_array_equal(bundle.weights.run(features), original.run(features))


def test_the_bundle_holds_nothing_else(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {*FILES, MANIFEST}


def test_a_network_that_float16_does_not_bear_has_no_files_in_it(gl: moderngl.Context, tmp_path: Path) -> None:
    for factor in (3e4, 1e6):  # activations overflow; weights do
        weights = random_weights(1, NAMES, (8,))
        weights.layers[0][0][:] *= np.float32(factor)
        weights.layers[1][0][:] /= np.float32(factor)
        folder = tmp_path / str(factor)
        manifest = export_bundle(folder, weights, DESCRIPTION, real_features(500, 1), gl)
        assert set(manifest.files) == set(FILES) - set(HALF_FILES)
        assert {path.name for path in folder.iterdir()} == {*manifest.files, MANIFEST}
        assert GLSL_HALF not in manifest.self_test.tolerance
        assert load_manifest(folder) == manifest


def test_what_the_network_does_not_use_is_left_out(gl: moderngl.Context, tmp_path: Path) -> None:
    weights, features = random_weights(1, NAMES, (8,)), real_features(500, 1)
    weights.layers[0][0][:, 1] = 0.0
    weights.layers[0][1][3] = -1000.0
    manifest = export_bundle(tmp_path / "b", weights, DESCRIPTION, features, gl)
    assert manifest.feature_names == (NAMES[0], *NAMES[2:])
    assert manifest.hidden == (7,)
    np.testing.assert_allclose(load_bundle(tmp_path / "b").weights.run(features), weights.run(features), rtol=1e-6)


def test_the_self_test_is_of_real_inputs_and_right(folder: Path) -> None:
    weights, manifest = random_weights(1, NAMES, (8,)), load_manifest(folder)
    test, features = manifest.self_test, real_features(500, 1)
    assert len(test.features) == len(test.outputs) == 16
    rows = np.array(test.features, np.float32)
    assert all((features[:, weights.columns] == row).all(axis=1).any() for row in rows)
    everything = np.zeros((16, len(FEATURES)), np.float32)
    everything[:, weights.columns] = rows
    np.testing.assert_allclose(weights.run(everything), test.outputs, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(derive(np.array(test.sums, np.float32))[:, weights.columns], test.derived)
    assert len(set(test.sums)) == len(test.sums) == 8
    assert set(test.tolerance) == {ONNX, *SHADERS}
    assert test.output_scale == tuple(np.maximum(1.0, np.abs(weights.run(features)).max(axis=0)))


@pytest.mark.parametrize("tail", [name for name in TAIL_NAMES if name not in BINNED_TAILS])
def test_a_tail_without_bins_is_refused(folder: Path, tail: TailName) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["tail"]["name"] = tail
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Problem, match=f"tail {tail} has no depth bins; one of binned-8, .* has") as caught:
        load_manifest(folder)
    assert "build it again" in caught.value.remedy


def test_predict_glsl_computes_only_the_features_that_are_read(folder: Path) -> None:
    text = (folder / "predict.glsl").read_text()
    assert "#define DIAPHANE_FEATURES 4" in text
    assert "luma_mean" not in text


@pytest.mark.parametrize("name", FILES)
def test_a_changed_file_is_refused(folder: Path, name: str) -> None:
    content = bytearray((folder / name).read_bytes())
    content[len(content) // 2] ^= 1
    (folder / name).write_bytes(content)
    with pytest.raises(Problem, match=rf"{name} is not the file that the manifest lists"):
        load_manifest(folder)


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_refused(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(Problem, match=rf"{name} is missing"):
        load_manifest(folder)


def test_a_folder_without_manifest_is_no_bundle(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="is not a bundle"):
        load_manifest(tmp_path)


def _set(manifest: dict[str, object], key: str, value: object) -> None:
    manifest[key] = value


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: _set(m, "format", "diaphane-bundle/9"), "format"),
        (lambda m: _set(m, "name", "../evil"), "name"),
        (lambda m: _set(m, "extra", 1), "extra"),
        (lambda m: _set(m, "head", "pickle"), "head"),
        (lambda m: m["features"][0].update(std=0.0), "std"),
        (lambda m: m["features"][0].update(name="luma_std"), "listed twice"),
        (lambda m: m["layers"][0].update(shape=[8, 5]), "layers do not follow"),
        (lambda m: m["files"].update({"../model.onnx": m["files"]["model.onnx"]}), "the files must be"),
        (lambda m: m["files"].pop("model.onnx"), "the files must be"),
        (lambda m: m["files"].pop("predict_half.wgsl"), "the files must be"),
        (lambda m: _set(m, "format", "diaphane-bundle/1"), "format"),
        (lambda m: m.pop("self_test"), "self_test: Field required"),
        (lambda m: m.pop("onnx"), "onnx: Field required"),
        (lambda m: m.pop("outputs"), "outputs: Field required"),
        (lambda m: m["parity"].pop("torch_ubo"), "torch_ubo: Field required"),
        (lambda m: _set(m, "outputs", ["a", "b"]), "does not answer a, b"),
        (lambda m: _set(m, "outputs", list(gain_outputs(8))), "does not answer gain_0"),
        (lambda m: m["tail"].update(name="binned-8"), "does not answer gain_0"),
        (lambda m: _set(m, "head", "importance"), "does not answer gain_0"),
        (lambda m: m.update(head="importance", outputs=["importance"]), "layers do not follow"),
        (lambda m: m["files"]["model.onnx"].update(bytes=1 << 40), "bytes"),
    ],
)
def test_a_manifest_that_is_not_valid_is_refused(
    folder: Path, change: Callable[[dict[str, object]], None], message: str
) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    change(manifest)
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Problem, match=message):
        load_manifest(folder)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"null", b"\xff\xfe", b"{" * 5000, b" " * (1 << 20) + b"{}"])
def test_a_manifest_that_is_no_json_object_is_refused(folder: Path, content: bytes) -> None:
    (folder / MANIFEST).write_bytes(content)
    with pytest.raises(Problem, match="cannot be used"):
        load_manifest(folder)


def test_weights_that_are_not_finite_are_refused(folder: Path) -> None:
    resigned(folder, lambda tensors: tensors["layer0.bias"].__setitem__(0, np.nan))
    with pytest.raises(Problem, match=r"layer0\.bias is not finite"):
        load_bundle(folder)


def test_weights_of_another_shape_are_refused(folder: Path) -> None:
    resigned(folder, lambda tensors: tensors.update({"layer0.bias": np.zeros(9, np.float32)}))
    with pytest.raises(Problem, match=r"layer0\.bias is not finite float32 \[8\]"):
        load_bundle(folder)


def test_weights_with_another_tensor_are_refused(folder: Path) -> None:
    resigned(folder, lambda tensors: tensors.update(more=np.zeros(1, np.float32)))
    with pytest.raises(Problem, match="does not hold the tensors"):
        load_bundle(folder)


def test_features_of_the_future_are_refused(folder: Path) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["features"][0]["name"] = "moment_9"
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(Problem, match="moment_9"):
        load_bundle(folder)


def test_no_bundle_is_left_when_the_forms_differ(
    gl: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trainer.bundle.float_forms", _off_by_little)
    with pytest.raises(Problem, match="differ"):
        export_bundle(tmp_path / "b", random_weights(1, NAMES, (8,)), DESCRIPTION, real_features(500, 1), gl)
    with pytest.raises(Problem, match="is not a bundle"):
        load_manifest(tmp_path / "b")


def _off_by_little(weights: Weights) -> dict[str, bytes]:
    forms = float_forms(weights)
    return {**forms, GLSL: forms[GLSL].replace(b"](gain_0,", b"](gain_0 + 1e-3,")}


def test_manifest_survives_its_own_json(folder: Path) -> None:
    manifest = load_manifest(folder)
    assert Manifest.model_validate_json(manifest.model_dump_json()) == manifest
