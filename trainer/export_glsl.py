"""The network as GLSL: one self-contained text with the features that it reads and its weights as constants."""

from __future__ import annotations

import numpy as np

from renderer.features import features_glsl
from schemas.bundle import FEATURE_LIMIT, GAIN_FLOOR
from trainer.weights import Layer, Weights


def glsl_source(weights: Weights) -> str:
    """`predict.glsl`: `diaphane_features` for the model's features and `vec2 diaphane_predict(in float x[..])`.

    Only names from `renderer.features` and float literals enter the text. The weights are unrolled literals:
    on llvmpipe constants are 2.3 times as fast as a buffer, and a GPU's compiler turns them into immediates.

    Returns:
        GLSL 4.50 without a `#version` line, for any stage.

    Raises:
        ValueError: A weight is not finite.
    """
    body: list[str] = []
    inputs = [f"f{i}" for i in range(len(weights.features))]
    limit = _literal(np.float32(FEATURE_LIMIT))
    for i, (name, mean, std) in enumerate(zip(inputs, weights.mean, weights.std, strict=True)):
        body.append(f"    float {name} = clamp((x[{i}] - {_literal(mean)}) / {_literal(std)}, -{limit}, {limit});")
    for i, layer in enumerate(weights.layers[:-1]):
        outputs = [f"h{i}_{j}" for j in range(len(layer[1]))]
        for name, terms in zip(outputs, _dense(layer, inputs), strict=True):
            body.append(f"    float {name} = max(0.0, {terms});")
        inputs = outputs
    a, b = _dense(weights.layers[-1], inputs)
    body += [f"    float a = {a};", f"    float b = {b};"]
    return "\n".join(
        [
            features_glsl(weights.features),
            "// x: features. Returns (a, b): the log gain of core fragment k is a - b (k - 1).",
            "vec2 diaphane_predict(in float x[DIAPHANE_FEATURES]) {",
            *body,
            "    // softplus, without overflow",
            f"    return vec2(a, max(b, 0.0) + log(1.0 + exp(-abs(b))) + {_literal(np.float32(GAIN_FLOOR))});",
            "}",
            "",
        ]
    )


def _dense(layer: Layer, inputs: list[str]) -> list[str]:
    """One expression per output."""
    weight, bias = layer
    return [
        " + ".join([_literal(bias[j]), *(_product(w, name) for w, name in zip(weight[j], inputs, strict=True))])
        for j in range(len(bias))
    ]


def _product(weight: np.float32, name: str) -> str:
    return f"{_literal(weight)} * {name}"


def _literal(value: np.float32) -> str:
    """The shortest decimal that reads back as this float32, in brackets where it has a sign."""
    if not np.isfinite(value):
        raise ValueError("a weight is not finite")
    text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
    return f"({text})" if text.startswith("-") else text
