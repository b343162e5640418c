"""The network as a shader: one self-contained text with the features that it reads and its weights as constants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT, OutputName
from trainer.dialects import GLSL, Dialect, literal
from trainer.weights import Layer, Weights

_FUNCTIONS: Final = {
    "identity": "{x}",
    "softplus": "max({x}, 0.0) + log(1.0 + exp(-abs({x})))",
    "sigmoid": "1.0 / (1.0 + exp(clamp(-{x}, -30.0, 30.0)))",
}
"""Those of `ACTIVATIONS`, without overflow, in words that all languages share."""


def shader_source(weights: Weights, dialect: Dialect = GLSL) -> str:
    """`diaphane_features` for the model's features and `diaphane_predict` of those, in float32.

    Only names from `renderer.features` and float literals enter the text. The weights are unrolled literals:
    on llvmpipe constants are 2.3 times as fast as a buffer, and a GPU's compiler turns them into immediates.

    Returns:
        Text for any stage; GLSL 4.50 without a `#version` line.

    Raises:
        ValueError: A weight is not finite.
    """
    inputs = [f"f{i}" for i in range(len(weights.features))]
    body = _constants(dialect, inputs, normalised(weights))
    for i, layer in enumerate(weights.layers[:-1]):
        hidden = [f"h{i}_{j}" for j in range(len(layer[1]))]
        body += _constants(dialect, hidden, [f"max(0.0, {terms})" for terms in _dense(layer, inputs)])
        inputs = hidden
    body += _constants(dialect, weights.outputs, _dense(weights.layers[-1], inputs))
    return framed(weights, dialect, body)


def half_source(weights: Weights, dialect: Dialect = GLSL) -> str:
    """The same with the weights of hidden layers in float16, four units at a time; the last layer stays float32.

    WGSL computes the hidden layers in f16, GLSL in float unless DIAPHANE_FLOAT16 is defined. Normalisation is float32:
    raw features have too large a range.

    Raises:
        ValueError: A weight is not finite, or too large for float16.
    """
    rows = normalised(weights)
    inputs = [f"n{i}" for i in range(0, len(rows), 4)]
    quads = [f"{dialect.vector.format(n=4)}({', '.join(quad)})" for quad in _quads(rows, "0.0")]
    four = dialect.half_vector
    body = [_half(dialect, name, f"{four}({quad})") for name, quad in zip(inputs, quads, strict=True)]
    for i, (weight, bias) in enumerate(weights.layers[:-1]):
        rounded(bias)  # in f16 where the type of the quad is
        hidden = []
        for j in range(0, len(bias), 4):
            columns = [_half_quad(dialect, rounded(column)) for column in weight[j : j + 4].T]
            terms = [f"{column} * {inputs[k // 4]}.{'xyzw'[k % 4]}" for k, column in enumerate(columns)]
            total = " + ".join([_half_quad(dialect, bias[j : j + 4]), *terms])
            hidden.append(f"h{i}_{j}")
            body.append(_half(dialect, hidden[-1], f"max({four}(0.0), {total})"))
        inputs = hidden
    weight, bias = weights.layers[-1]
    vector = dialect.vector.format(n=4)
    for name, row, offset in zip(weights.outputs, weight, bias, strict=True):
        quads = [f"{vector}({', '.join(quad)})" for quad in _quads([literal(w) for w in row], "0.0")]
        dots = [f"dot({quad}, {vector}({x}))" for quad, x in zip(quads, inputs, strict=True)]
        body += _constants(dialect, [name], [" + ".join([literal(offset), *dots])])
    prelude = "\n".join([*dialect.half_prelude, "", ""])
    return prelude + framed(weights, dialect, body)


def framed(weights: Weights, dialect: Dialect, body: Sequence[str]) -> str:
    """The features, and the function of the network: lines that give its raw outputs, then their activations."""
    answers = ", ".join(activated(name) for name in weights.outputs)
    return "\n".join(
        [
            dialect.features(weights.features),
            dialect.outputs.format(n=len(weights.outputs)),
            "",
            f"// x: features. Returns {', '.join(weights.outputs)}.",
            dialect.predict,
            *(f"    {line}" for line in body),
            f"    {dialect.answer.format(values=answers)}",
            "}",
            "",
        ]
    )


def activated(name: OutputName) -> str:
    """The expression of an output whose raw value bears its name."""
    return _FUNCTIONS[ACTIVATIONS[name]].format(x=name)


def normalised(weights: Weights) -> list[str]:
    """One expression per input, of `x[i]`."""
    limit = literal(np.float32(FEATURE_LIMIT))
    return [
        f"clamp((x[{i}] - {literal(mean)}) / {literal(std)}, -{limit}, {limit})"
        for i, (mean, std) in enumerate(zip(weights.mean, weights.std, strict=True))
    ]


def rounded(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Float32 numbers that float16 holds, the nearest ones.

    Args:
        values: float32 of any shape.

    Raises:
        ValueError: One is not finite, or too large for float16.
    """
    with np.errstate(over="ignore"):
        halves = values.astype(np.float16).astype(np.float32)
    if not np.isfinite(halves).all():
        raise ValueError("a weight is not finite, or too large for float16")
    return np.asarray(halves)


def _constants(dialect: Dialect, names: Sequence[str], values: Sequence[str]) -> list[str]:
    return [dialect.constant.format(name=name, value=value) for name, value in zip(names, values, strict=True)]


def _half(dialect: Dialect, name: str, value: str) -> str:
    return dialect.half_constant.format(name=name, value=value)


def _half_quad(dialect: Dialect, values: NDArray[np.float32]) -> str:
    """Up to four numbers, padded with zeros."""
    (quad,) = _quads([literal(value) for value in values], "0.0")
    return f"{dialect.half_vector}({', '.join(quad)})"


def _quads(texts: Sequence[str], padding: str) -> list[list[str]]:
    padded = [*texts, *[padding] * (-len(texts) % 4)]
    return [padded[i : i + 4] for i in range(0, len(padded), 4)]


def _dense(layer: Layer, inputs: Sequence[str]) -> list[str]:
    """One expression per output."""
    return [
        " + ".join([literal(offset), *(f"{literal(w)} * {name}" for w, name in zip(row, inputs, strict=True))])
        for row, offset in zip(*layer, strict=True)
    ]
