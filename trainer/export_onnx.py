"""The network as ONNX, written node by node: no exporter, no external data, any number of pixels."""

from __future__ import annotations

from typing import Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT
from trainer.weights import Weights

OPSET: Final = 17
IR_VERSION: Final = 8
"""What onnxruntime 1.13 (2022) and every later one reads."""


def onnx_model(weights: Weights) -> bytes:
    """Serialised model: input `features` float32 [pixels, F] (raw), outputs float32 [pixels] each.

    The normalisation is not folded into the first layer: with a feature of small spread that would cancel in float32.
    """
    nodes: list[onnx.NodeProto] = []
    constants: list[onnx.TensorProto] = []

    def constant(name: str, value: NDArray[np.generic]) -> str:
        constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    low, high = (
        constant(name, np.array(sign * FEATURE_LIMIT, dtype=np.float32)) for name, sign in (("low", -1), ("high", 1))
    )
    nodes += [
        helper.make_node("Sub", ["features", constant("mean", weights.mean)], ["centred"]),
        helper.make_node("Div", ["centred", constant("std", weights.std)], ["scaled"]),
        helper.make_node("Clip", ["scaled", low, high], ["normalised"]),
    ]
    current = "normalised"
    last = len(weights.layers) - 1
    for i, (weight, bias) in enumerate(weights.layers):
        inputs = [current, constant(f"layer{i}.weight", weight), constant(f"layer{i}.bias", bias)]
        nodes.append(helper.make_node("Gemm", inputs, [f"dense{i}"], transB=1))
        current = f"dense{i}"
        if i < last:
            nodes.append(helper.make_node("Relu", [current], [f"hidden{i}"]))
            current = f"hidden{i}"
    axis = constant("axis", np.array([1], dtype=np.int64))
    columns = [f"{name}_raw" for name in weights.outputs]
    nodes.append(
        helper.make_node("Split", [current, constant("sizes", np.ones(len(columns), np.int64))], columns, axis=1)
    )
    for name, column in zip(weights.outputs, columns, strict=True):
        function, scale, offset = ACTIVATIONS[name]
        if function != "identity":
            nodes.append(helper.make_node(function.capitalize(), [column], [f"{name}_{function}"]))
            column = f"{name}_{function}"
        for operator, factor, neutral in (("Mul", scale, 1.0), ("Add", offset, 0.0)):
            if factor != neutral:
                value = constant(f"{name}_{operator.lower()}_by", np.array([factor], np.float32))
                nodes.append(helper.make_node(operator, [column, value], [f"{name}_{operator.lower()}"]))
                column = f"{name}_{operator.lower()}"
        nodes.append(helper.make_node("Squeeze", [column, axis], [name]))
    graph = helper.make_graph(
        nodes,
        weights.head,
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["pixels", len(weights.features)])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["pixels"]) for name in weights.outputs],
        constants,
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, producer_name="diaphane"
    )
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())
