"""The network as ONNX, written node by node: no exporter, no external data, any number of pixels."""

from __future__ import annotations

from itertools import groupby
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
    """Serialised model: input `features` float32 [pixels, F] (raw), output `answers` float32 [pixels, outputs].

    The normalisation is not folded into the first layer: with a feature of small spread that would cancel in float32.
    """
    names = weights.outputs
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
    runs = [(function, len(list(same))) for function, same in groupby(ACTIVATIONS[name] for name in names)]
    parts = [f"raw_{function}" for function, _ in runs] if len(runs) > 1 else [current]
    if len(runs) > 1:
        sizes = constant("sizes", np.array([count for _, count in runs], np.int64))
        nodes.append(helper.make_node("Split", [current, sizes], parts, axis=1))
    for i, (function, _) in enumerate(runs):
        if function != "identity":
            nodes.append(helper.make_node(function.capitalize(), [parts[i]], [function]))
            parts[i] = function
    nodes.append(helper.make_node("Concat", parts, ["answers"], axis=1))
    graph = helper.make_graph(
        nodes,
        weights.head,
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["pixels", len(weights.features)])],
        [helper.make_tensor_value_info("answers", TensorProto.FLOAT, ["pixels", len(names)])],
        constants,
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, producer_name="diaphane"
    )
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())
