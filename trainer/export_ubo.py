"""The network as GLSL with its weights in a buffer: another network of the same shape needs no new shader.

The buffer is an array of 16-byte words, the same in std140 and std430, little-endian:

    inputs      Q words of four means, Q words of four spreads; Q = ceil(F / 4), padded with mean 0 and spread 1
    each layer  ceil(out / 4) words of four biases; then for each four outputs, for each four inputs, a 4 x 4 matrix,
                column by column (a column is the weights of one input for the four outputs); padded with zeros

All numbers are float32; in the float16 form a hidden layer's matrix is 16 halves, two words, and the biases, the
inputs and the last layer stay float32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.bundle import FEATURE_LIMIT
from trainer.dialects import GLSL, literal
from trainer.export_shader import framed, rounded
from trainer.weights import Weights

Block = NDArray[np.uint32]
"""[words, 4]."""


def ubo_source(weights: Weights, *, half: bool = False) -> str:
    """`predict_ubo.glsl`, or with `half` `predict_ubo_half.glsl`.

    Returns:
        GLSL 4.50 without a `#version` line, for any stage; `ubo_data` is what its buffer holds.
    """
    quads = _quads(len(weights.features))
    limit = literal(np.float32(FEATURE_LIMIT))
    fields = [f"x[{i}]" for i in range(len(weights.features))] + ["0.0"] * (-len(weights.features) % 4)
    rows = [f"vec4({', '.join(fields[i : i + 4])})" for i in range(0, len(fields), 4)]
    kind = "DIAPHANE_HALF4" if half else "vec4"
    body = [
        f"vec4 x4[{quads}] = vec4[{quads}]({', '.join(rows)});",
        f"{kind} n[{quads}];",
        f"for (int i = 0; i < {quads}; ++i) {{",
        f"    vec4 scaled = (x4[i] - diaphane_word(i)) / diaphane_word({quads} + i);",
        f"    n[i] = {kind}(clamp(scaled, -{limit}, {limit}));",
        "}",
    ]
    word, source = 2 * quads, "n"
    for number, (weight, _) in enumerate(weights.layers):
        last = number == len(weights.layers) - 1
        outputs, inputs = (_quads(size) for size in weight.shape)
        body += _layer(word, inputs, outputs, source, f"h{number}", halves=half and not last, last=last)
        word += outputs + outputs * inputs * (2 if half and not last else 4)
        source = f"h{number}"
    body += [f"float {name} = {source}[{i // 4}].{'xyzw'[i % 4]};" for i, name in enumerate(weights.outputs)]
    prelude = "\n".join([*(GLSL.half_prelude if half else ()), *_declaration(word, half)])
    return prelude + framed(weights, GLSL, body)


def ubo_data(weights: Weights, *, half: bool = False) -> bytes:
    """What the buffer of `ubo_source` holds.

    Raises:
        ValueError: A weight is not finite, or with `half` too large for float16.
    """
    blocks: list[Block] = [_words(_padded(weights.mean, 0.0)), _words(_padded(weights.std, 1.0))]
    for number, (weight, bias) in enumerate(weights.layers):
        outputs, inputs = (-(-size // 4) * 4 for size in weight.shape)
        matrix = np.zeros((outputs, inputs), dtype=np.float32)
        matrix[: weight.shape[0], : weight.shape[1]] = weight
        # [four outputs, four inputs, column, row]
        tiles = np.ascontiguousarray(matrix.reshape(outputs // 4, 4, inputs // 4, 4).transpose(0, 2, 3, 1))
        blocks.append(_words(_padded(bias, 0.0)))
        if half and number < len(weights.layers) - 1:
            blocks.append(rounded(tiles).astype("<f2").reshape(-1).view("<u4").reshape(-1, 4))
        else:
            blocks.append(_words(tiles.reshape(-1)))
    return np.concatenate(blocks).astype("<u4").tobytes()


def _declaration(words: int, half: bool) -> list[str]:
    kind, name = ("uvec4", "uintBitsToFloat(diaphane_weights[i])") if half else ("vec4", "diaphane_weights[i]")
    lines = [
        "// The block holds what the file of the same name that ends in .bin holds. Define DIAPHANE_BINDING to choose",
        "// its binding, and DIAPHANE_STORAGE to read a storage buffer: for a network of more than 64 KB.",
        "#ifndef DIAPHANE_BINDING",
        "#define DIAPHANE_BINDING 0",
        "#endif",
        "#ifdef DIAPHANE_STORAGE",
        f"layout(std430, binding = DIAPHANE_BINDING) readonly buffer DiaphaneWeights {{ {kind} diaphane_weights[]; }};",
        "#else",
        f"layout(std140, binding = DIAPHANE_BINDING) uniform DiaphaneWeights {{ {kind} diaphane_weights[{words}]; }};",
        "#endif",
        "",
        f"vec4 diaphane_word(int i) {{ return {name}; }}",
    ]
    if half:
        lines += [
            "DIAPHANE_HALF4 diaphane_halves(uvec2 u) {",
            "    return DIAPHANE_HALF4(vec4(unpackHalf2x16(u.x), unpackHalf2x16(u.y)));",
            "}",
        ]
    return [*lines, ""]


def _layer(word: int, inputs: int, outputs: int, source: str, target: str, *, halves: bool, last: bool) -> list[str]:
    """One dense layer whose words begin at `word`; `inputs` and `outputs` in fours.

    The bounds are constant and the arrays as long as the loops, so that compilers unroll them and need no arrays.
    """
    kind, step = ("DIAPHANE_HALF4", 2) if halves else ("vec4", 4)
    words = [f"diaphane_weights[k{f' + {i}' if i else ''}]" for i in range(step)]
    if halves:
        columns = [f"diaphane_halves({word}.{pair})" for word in words for pair in ("xy", "zw")]
    else:
        columns = [f"diaphane_word(k{f' + {i}' if i else ''})" for i in range(4)]
    products = [f"{column} * v.{c}" for column, c in zip(columns, "xyzw", strict=True)]
    return [
        f"{kind} {target}[{outputs}];",
        f"for (int o = 0; o < {outputs}; ++o) {{",
        f"    {kind} sum = {kind}(diaphane_word({word} + o));",
        f"    for (int i = 0; i < {inputs}; ++i) {{",
        f"        int k = {word + outputs} + {step} * ({inputs} * o + i);",
        f"        {kind} v = {kind}({source}[i]);",
        f"        sum += {' + '.join(products)};",
        "    }",
        f"    {target}[o] = {'sum' if last else f'max({kind}(0.0), sum)'};",
        "}",
    ]


def _quads(count: int) -> int:
    return -(-count // 4)


def _padded(values: NDArray[np.float32], padding: float) -> NDArray[np.float32]:
    return np.pad(values.astype(np.float32), (0, -len(values) % 4), constant_values=padding)


def _words(values: NDArray[np.float32]) -> Block:
    if not np.isfinite(values).all():
        raise ValueError("a weight is not finite")
    return values.astype("<f4").view("<u4").reshape(-1, 4)
