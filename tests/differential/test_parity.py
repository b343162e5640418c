"""torch = ONNX = GLSL = numpy on 1e5 inputs from fragments, and what is refused."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import onnx
import pytest
from support.training import random_weights, real_features

from renderer.features import FEATURES
from renderer.onnx_network import OnnxNetwork
from schemas.bundle import FEATURE_LIMIT, GLSL, ONNX
from schemas.problem import Problem
from trainer.export_glsl import glsl_source
from trainer.export_onnx import OPSET, onnx_model
from trainer.glsl_network import CHUNK, glsl_outputs
from trainer.parity import check, torch_outputs
from trainer.weights import Weights


def write(folder: Path, weights: Weights) -> Path:
    (folder / ONNX).write_bytes(onnx_model(weights))
    (folder / GLSL).write_text(glsl_source(weights))
    return folder


@pytest.mark.parametrize(
    ("features", "hidden"),
    [(FEATURES, (32, 16)), (FEATURES[::3], (16,)), (("depth_std",), ()), (FEATURES[::-1], (8, 8, 8))],
)
def test_all_forms_agree(
    gl: moderngl.Context, tmp_path: Path, features: tuple[str, ...], hidden: tuple[int, ...]
) -> None:
    weights = random_weights(len(hidden), features, hidden)
    inputs = real_features(100_000, 1)
    report = check(weights, write(tmp_path, weights), inputs, gl)
    assert report.count == 100_000
    assert max(report.torch_onnx, report.torch_glsl) <= 1e-5
    truth = torch_outputs(weights, inputs[:, weights.columns])
    in_numpy = np.stack(weights.predict(inputs), axis=1)
    assert (np.abs(in_numpy - truth) / np.maximum(1.0, np.abs(truth))).max() <= 1e-5


def test_any_number_of_rows_works(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(0, FEATURES[:3], (4,))
    write(tmp_path, weights)
    for rows in (1, 63, 65, CHUNK + 1):
        inputs = np.random.default_rng(rows).normal(size=(rows, 3)).astype(np.float32)
        truth = torch_outputs(weights, inputs)
        np.testing.assert_allclose(OnnxNetwork(tmp_path / ONNX).run(inputs), truth, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(glsl_outputs(tmp_path / GLSL, inputs, gl), truth, rtol=1e-5, atol=1e-5)


def test_softplus_neither_overflows_nor_vanishes(gl: moderngl.Context, tmp_path: Path) -> None:
    # Normalised inputs are clamped, so the spread of the feature and the weight make the large values.
    layer = (np.array([[0.0], [1000.0]], np.float32), np.zeros(2, np.float32))
    weights = Weights(("log_n",), np.zeros(1, np.float32), np.full(1, 1000.0, np.float32), (layer,))
    write(tmp_path, weights)
    inputs = np.array([[-200.0], [-20.0], [0.0], [20.0], [3000.0]], np.float32)
    for outputs in (OnnxNetwork(tmp_path / ONNX).run(inputs), glsl_outputs(tmp_path / GLSL, inputs, gl)):
        np.testing.assert_allclose(outputs[:, 1], [0.02, 0.02, np.log(2.0) + 0.02, 20.02, 3000.02], rtol=1e-5)


def test_inputs_beyond_the_training_data_are_clamped_alike(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(4, FEATURES[:3], (8,))
    write(tmp_path, weights)
    far = (weights.mean + 50.0 * weights.std * np.array([[1.0, -1.0, 1.0]])).astype(np.float32)
    edge = (weights.mean + FEATURE_LIMIT * weights.std * np.array([[1.0, -1.0, 1.0]])).astype(np.float32)
    expected = torch_outputs(weights, edge)
    for outputs in (
        torch_outputs(weights, far),
        OnnxNetwork(tmp_path / ONNX).run(far),
        glsl_outputs(tmp_path / GLSL, far, gl),
    ):
        np.testing.assert_allclose(outputs, expected, rtol=1e-5, atol=1e-5)


def test_features_of_hardly_any_spread_keep_parity(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(5, FEATURES[:3], (8,))
    narrow = Weights(weights.features, np.full(3, 0.33, np.float32), np.full(3, 1e-4, np.float32), weights.layers)
    write(tmp_path, narrow)
    inputs = (0.33 + np.random.default_rng(0).normal(0.0, 1e-4, (5000, 3))).astype(np.float32)
    truth = torch_outputs(narrow, inputs)
    np.testing.assert_allclose(OnnxNetwork(tmp_path / ONNX).run(inputs), truth, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(glsl_outputs(tmp_path / GLSL, inputs, gl), truth, rtol=1e-5, atol=1e-5)


def test_the_onnx_file_is_as_promised() -> None:
    model = onnx.load_from_string(onnx_model(random_weights(0)))
    assert [opset.version for opset in model.opset_import] == [OPSET]
    assert model.graph.input[0].type.tensor_type.shape.dim[0].dim_param == "pixels"
    assert [output.name for output in model.graph.output] == ["a", "b"]
    assert all(tensor.data_location == onnx.TensorProto.DEFAULT for tensor in model.graph.initializer)


def test_glsl_literals_are_exact() -> None:
    values = np.array([1.0, -1.0, 1e-8, 16777216.0, 0.1, -3.4e38, 1e-38], np.float32)
    layer = (np.stack([values, values]), np.zeros(2, np.float32))
    names = FEATURES[: len(values)]
    weights = Weights(names, np.zeros(len(values), np.float32), np.ones(len(values), np.float32), (layer,))
    line = next(line for line in glsl_source(weights).splitlines() if "float a =" in line)
    written = [term.split(" * ")[0].strip("()") for term in line.removesuffix(";").split(" = ")[1].split(" + ")[1:]]
    np.testing.assert_array_equal(np.array(written, np.float64).astype(np.float32), values)
    assert all("." in text and "e" in text for text in written), "a literal without either would be an int"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_not_finite_have_no_glsl(value: float) -> None:
    weights = random_weights(0)
    weights.layers[1][0][0, 0] = value
    with pytest.raises(ValueError, match="not finite"):
        glsl_source(weights)


def test_a_difference_is_refused(ctx: moderngl.Context, tmp_path: Path) -> None:
    weights, inputs = random_weights(0), real_features(1000, 3)
    write(tmp_path, random_weights(1))
    with pytest.raises(Problem, match="differ"):
        check(weights, tmp_path, inputs, ctx)


def test_inputs_that_are_not_finite_are_refused(ctx: moderngl.Context, tmp_path: Path) -> None:
    weights, inputs = random_weights(0), real_features(1000, 3)
    inputs[7, 3] = np.nan
    with pytest.raises(Problem, match="a feature is not finite"):
        check(weights, write(tmp_path, weights), inputs, ctx)


def test_glsl_that_does_not_compile_is_refused(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(0)
    write(tmp_path, weights)
    (tmp_path / GLSL).write_text("#define DIAPHANE_FEATURES 26\nvec2 diaphane_predict(")
    with pytest.raises(Problem, match="does not compile"):
        check(weights, tmp_path, real_features(100, 3), gl)
