"""The shading languages that a network is written in: what differs between them, and the features in each.

`renderer.features.FEATURES_GLSL` is the one source of the features. Its expressions are kept to what GLSL, HLSL and
WGSL spell alike: arithmetic, components of the sums, and the functions of `COMMON`; `common` refuses anything else.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from renderer.features import FEATURES_GLSL, TEXELS, features_glsl

COMMON: Final = frozenset({"abs", "clamp", "exp", "exp2", "log", "log2", "max", "min", "pow", "sqrt"})
"""Functions that mean the same in all three languages."""

_TOKEN: Final = re.compile(
    r"\s+|(?P<sum>s\[\d+\]\.[xyzwrgba]\b)|(?P<name>[A-Za-z_]\w*)|\d+\.\d+(?:e[+-]?\d+)?|\d+e[+-]?\d+|[-+*/(),]"
)


@dataclass(frozen=True)
class Dialect:
    """A shading language.

    Attributes:
        name: As people write it.
        constant: A local constant, with `{name}` and `{value}`; a scalar of float32.
        vector: The type of a vector of float32, with `{n}`.
        half_constant: A local constant of `half_vector`.
        half_vector: The type of four numbers in float16; "" where there is no such form.
        half_prelude: Lines before all others of a form in float16.
        outputs: The lines that state how many numbers are answered, with `{n}`, and the type of an answer.
        predict: The head of the function of the network.
        answer: Its last line, with `{values}`.
    """

    name: str
    constant: str
    vector: str
    half_constant: str
    half_vector: str
    half_prelude: tuple[str, ...]
    outputs: str
    predict: str
    answer: str

    def features(self, names: Sequence[str]) -> str:
        """`diaphane_features`, from the raw sums of a pixel to the features `names`; all zeros where n = 0.

        Raises:
            KeyError: There is no such feature.
            ValueError: Its expression is not the same in all languages.
        """
        for name in names:
            common(FEATURES_GLSL[name])
        if self is WGSL:
            return _features_wgsl(names)
        return features_glsl(names).replace("vec4 s[", f"{self.vector.format(n=4)} s[")


GLSL: Final = Dialect(
    name="GLSL",
    constant="float {name} = {value};",
    vector="vec{n}",
    half_constant="DIAPHANE_HALF4 {name} = {value};",
    half_vector="DIAPHANE_HALF4",
    half_prelude=(
        "// Weights that float16 holds; arithmetic in float. Where float16_t is enabled",
        "// (GL_EXT_shader_explicit_arithmetic_types_float16 or GL_AMD_gpu_shader_half_float), define DIAPHANE_FLOAT16",
        "// before this text: the hidden layers are then computed in it.",
        "#ifdef DIAPHANE_FLOAT16",
        "#define DIAPHANE_HALF4 f16vec4",
        "#else",
        "#define DIAPHANE_HALF4 vec4",
        "#endif",
    ),
    outputs="#define DIAPHANE_OUTPUTS {n}\nstruct DiaphaneAnswer {{ float y[DIAPHANE_OUTPUTS]; }};",
    predict="DiaphaneAnswer diaphane_predict(in float x[DIAPHANE_FEATURES]) {",
    answer="return DiaphaneAnswer(float[DIAPHANE_OUTPUTS]({values}));",
)

HLSL: Final = Dialect(
    name="HLSL",
    constant="float {name} = {value};",
    vector="float{n}",
    half_constant="",
    half_vector="",
    half_prelude=(),
    outputs="#define DIAPHANE_OUTPUTS {n}\nstruct DiaphaneAnswer {{ float y[DIAPHANE_OUTPUTS]; }};",
    predict="DiaphaneAnswer diaphane_predict(in float x[DIAPHANE_FEATURES]) {",
    answer="DiaphaneAnswer answer = {{ {{ {values} }} }};\n    return answer;",
)

WGSL: Final = Dialect(
    name="WGSL",
    constant="let {name} = {value};",
    vector="vec{n}f",
    half_constant="let {name} = {value};",
    half_vector="vec4h",
    half_prelude=("enable f16;",),
    outputs="const DIAPHANE_OUTPUTS = {n};\nstruct DiaphaneAnswer {{ y: array<f32, DIAPHANE_OUTPUTS> }}",
    predict="fn diaphane_predict(x: array<f32, DIAPHANE_FEATURES>) -> DiaphaneAnswer {",
    # Not array<f32, ...>: an input may be called f32 there.
    answer="return DiaphaneAnswer(array({values}));",
)


def common(expression: str) -> str:
    """An expression of `FEATURES_GLSL`, if GLSL, HLSL and WGSL read it alike.

    Raises:
        ValueError: It has something that they do not share.
    """
    end = 0
    for token in _TOKEN.finditer(expression):
        if token.start() != end or (token["name"] and token["name"] not in COMMON | {"inv_d"}):
            break
        end = token.end()
    if end != len(expression):
        raise ValueError(f"not the same in GLSL, HLSL and WGSL from its character {end} on: {expression}")
    return expression


def literal(value: np.float32) -> str:
    """The shortest decimal that reads back as this float32, in brackets where it has a sign.

    Raises:
        ValueError: It is not finite.
    """
    if not np.isfinite(value):
        raise ValueError("a weight is not finite")
    text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
    return f"({text})" if text.startswith("-") else text


def _features_wgsl(names: Sequence[str]) -> str:
    values = [f"        {FEATURES_GLSL[name]},  // {name}" for name in names]
    return "\n".join(
        [
            "// s: raw sums of one pixel (colours stored gamma-2 / 255, depths in metres).",
            "// Returns features (logarithms natural unless log2); zero where n = 0.",
            f"const DIAPHANE_FEATURES = {len(names)};",
            "",
            f"fn diaphane_features(s: array<vec4f, {TEXELS}>) -> array<f32, DIAPHANE_FEATURES> {{",
            "    if (s[0].x < 0.5) {",
            "        return array<f32, DIAPHANE_FEATURES>();",
            "    }",
            "    let inv_d = 1.0 / s[0].y;",
            "    return array<f32, DIAPHANE_FEATURES>(",
            *values,
            "    );",
            "}",
            "",
        ]
    )
