"""torch = ONNX = GLSL = numpy on 1e5 inputs from fragments, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import onnx
import pytest
from support.training import random_weights, real_features

from renderer.features import FEATURES
from renderer.onnx_network import OnnxNetwork
from schemas.bundle import FEATURE_LIMIT, GLSL, GLSL_HALF, HEADS, ONNX, UBO_HALF, HeadName, gain_outputs
from schemas.problem import Problem
from schemas.tail import DEFAULT_TAIL, TAILS
from trainer.export_forms import float_forms, half_forms
from trainer.export_onnx import OPSET, onnx_model
from trainer.export_shader import shader_source
from trainer.glsl_network import CHUNK, glsl_outputs
from trainer.parity import check, torch_outputs
from trainer.weights import Weights

GAINS = gain_outputs(TAILS[DEFAULT_TAIL].bins)


def write(folder: Path, weights: Weights) -> Path:
    for name, content in {**float_forms(weights), **half_forms(weights)}.items():
        (folder / name).write_bytes(content)
    return folder


@pytest.mark.parametrize(
    ("features", "hidden"),
    [(FEATURES[:26], (32, 16)), (FEATURES[::3], (16,)), (("luma_std",), ()), (FEATURES[::-1], (8, 8, 8))],
)
def test_all_forms_agree(
    gl: moderngl.Context, tmp_path: Path, features: tuple[str, ...], hidden: tuple[int, ...]
) -> None:
    weights = random_weights(1 + len(hidden), features, hidden)
    inputs = real_features(100_000, 1)
    report = check(weights, write(tmp_path, weights), inputs, gl)
    assert report.count == 100_000
    assert 0.0 < report.worst <= 1e-5
    assert set(report.half) == {GLSL_HALF, UBO_HALF}
    assert max(report.half.values()) <= report.half_tolerance
    assert report.half_holds
    truth = torch_outputs(weights, inputs[:, weights.columns])
    in_numpy = weights.run(inputs)
    assert (np.abs(in_numpy - truth) / np.maximum(1.0, np.abs(truth))).max() <= 1e-5


@pytest.mark.parametrize("head", list(HEADS))
def test_every_head_agrees(gl: moderngl.Context, tmp_path: Path, head: HeadName) -> None:
    weights = random_weights(2, FEATURES[:5], (6, 5), head)
    report = check(weights, write(tmp_path, weights), real_features(2000, 1), gl)
    assert report.worst <= 1e-5
    assert report.half_holds
    answers = OnnxNetwork(tmp_path / ONNX).run(np.zeros((3, 5), np.float32))
    assert answers.shape == (3, len(weights.outputs))


def test_float16_that_overflows_is_a_number_that_json_has(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(2, FEATURES[:5], (6,))
    weights.layers[0][0][:] *= np.float32(3e4)
    weights.layers[1][0][:] /= np.float32(3e4)
    report = check(weights, write(tmp_path, weights), real_features(2000, 1), gl)
    assert report.float16 == 1e30
    assert not report.half_holds


def test_any_number_of_rows_works(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(0, FEATURES[:3], (4,))
    write(tmp_path, weights)
    for rows in (1, 63, 65, CHUNK + 1):
        inputs = np.random.default_rng(rows).normal(size=(rows, 3)).astype(np.float32)
        truth = torch_outputs(weights, inputs)
        np.testing.assert_allclose(OnnxNetwork(tmp_path / ONNX).run(inputs), truth, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(
            glsl_outputs(tmp_path / GLSL, inputs, gl, len(weights.outputs)), truth, rtol=1e-5, atol=1e-5
        )


def test_softplus_neither_overflows_nor_vanishes(gl: moderngl.Context, tmp_path: Path) -> None:
    # Normalised inputs are clamped, so the spread of the feature and the weight make the large values.
    matrix = np.zeros((len(GAINS), 1), np.float32)
    matrix[-1] = 1000.0
    layer = (matrix, np.zeros(len(GAINS), np.float32))
    mean, std = np.zeros(1, np.float32), np.full(1, 1000.0, np.float32)
    weights = Weights(("log_n",), mean, std, (layer,), "bin-gains", GAINS)
    write(tmp_path, weights)
    inputs = np.array([[-200.0], [-20.0], [0.0], [20.0], [3000.0]], np.float32)
    for outputs in (OnnxNetwork(tmp_path / ONNX).run(inputs), glsl_outputs(tmp_path / GLSL, inputs, gl, len(GAINS))):
        np.testing.assert_allclose(outputs[:, -1], [0.0, 0.0, np.log(2.0), 20.0, 3000.0], rtol=1e-5, atol=1e-7)


def test_inputs_beyond_the_training_data_are_clamped_alike(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(4, FEATURES[:3], (8,))
    write(tmp_path, weights)
    far = (weights.mean + 50.0 * weights.std * np.array([[1.0, -1.0, 1.0]])).astype(np.float32)
    edge = (weights.mean + FEATURE_LIMIT * weights.std * np.array([[1.0, -1.0, 1.0]])).astype(np.float32)
    expected = torch_outputs(weights, edge)
    for outputs in (
        torch_outputs(weights, far),
        OnnxNetwork(tmp_path / ONNX).run(far),
        glsl_outputs(tmp_path / GLSL, far, gl, len(weights.outputs)),
    ):
        np.testing.assert_allclose(outputs, expected, rtol=1e-5, atol=1e-5)


def test_features_of_hardly_any_spread_keep_parity(gl: moderngl.Context, tmp_path: Path) -> None:
    weights = random_weights(5, FEATURES[:3], (8,))
    narrow = replace(weights, mean=np.full(3, 0.33, np.float32), std=np.full(3, 1e-4, np.float32))
    write(tmp_path, narrow)
    inputs = (0.33 + np.random.default_rng(0).normal(0.0, 1e-4, (5000, 3))).astype(np.float32)
    truth = torch_outputs(narrow, inputs)
    np.testing.assert_allclose(OnnxNetwork(tmp_path / ONNX).run(inputs), truth, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        glsl_outputs(tmp_path / GLSL, inputs, gl, len(weights.outputs)), truth, rtol=1e-5, atol=1e-5
    )


def test_the_onnx_file_is_as_promised() -> None:
    model = onnx.load_from_string(onnx_model(random_weights(0)))
    assert [opset.version for opset in model.opset_import] == [OPSET]
    assert model.graph.input[0].type.tensor_type.shape.dim[0].dim_param == "pixels"
    (output,) = model.graph.output
    assert output.name == "answers"
    assert [dim.dim_param or dim.dim_value for dim in output.type.tensor_type.shape.dim] == ["pixels", len(GAINS)]
    assert all(tensor.data_location == onnx.TensorProto.DEFAULT for tensor in model.graph.initializer)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_not_finite_have_no_glsl(value: float) -> None:
    weights = random_weights(0)
    weights.layers[1][0][0, 0] = value
    with pytest.raises(ValueError, match="not finite"):
        shader_source(weights)


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
    (tmp_path / GLSL).write_text("#define DIAPHANE_FEATURES 26\nDiaphaneAnswer diaphane_predict(")
    with pytest.raises(Problem, match="does not compile"):
        check(weights, tmp_path, real_features(100, 3), gl)
