"""What the three shading languages share, and what is refused because they do not."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.training import random_weights

from renderer.features import FEATURES, FEATURES_GLSL, features_glsl
from trainer.dialects import GLSL, HLSL, WGSL, common, literal
from trainer.export_shader import half_source, shader_source


@pytest.mark.parametrize("name", FEATURES)
def test_every_feature_is_spelled_alike_in_all_languages(name: str) -> None:
    assert common(FEATURES_GLSL[name]) == FEATURES_GLSL[name]
    for dialect in (GLSL, HLSL, WGSL):
        assert FEATURES_GLSL[name] in dialect.features([name])


@pytest.mark.parametrize(
    "expression",
    [
        *("s[0].x > 0.5 ? 1.0 : 0.0", "mix(s[0].x, 1.0, 0.5)", "vec2(1.0, 2.0).x", "s[0].xy", "s[0]", "1.0f"),
        *("float(1)", "s[0].x; discard", "gl_FragCoord.x", "x[0]", "s[0].x * unknown", "s[0].x & 1"),
    ],
)
def test_what_the_languages_do_not_share_is_refused(expression: str) -> None:
    with pytest.raises(ValueError, match="not the same in GLSL, HLSL and WGSL"):
        common(expression)


def test_glsl_has_the_features_of_the_renderer() -> None:
    assert GLSL.features(FEATURES) == features_glsl()


def test_hlsl_and_wgsl_have_no_type_of_another_language() -> None:
    weights = random_weights(0, FEATURES, (5,))
    assert not re.search(r"\bvec[234]f?\b|\blet\b|\bfn\b", shader_source(weights, HLSL))
    for text in (shader_source(weights, WGSL), half_source(weights, WGSL)):
        assert not re.search(r"\b(float[234]?|vec[234])\b|#define", text)


def test_literals_are_exact_and_floats() -> None:
    for value in np.array([1.0, -1.0, 1e-8, 16777216.0, 0.1, -3.4e38, 1e-38], np.float32):
        text = literal(value).strip("()")
        assert np.float32(text) == value
        assert "." in text
        assert "e" in text


def test_weights_of_the_float16_form_are_what_float16_holds() -> None:
    weights = random_weights(3, FEATURES[:5], (4, 4))
    text = half_source(weights, WGSL)
    quads = re.findall(r"vec4h\(([^()]*(?:\([^()]*\)[^()]*)*)\) \* ", text)
    values = np.array([[part.strip("() ") for part in quad.split(",")] for quad in quads], np.float32)
    assert values.shape == (9, 4)
    np.testing.assert_array_equal(values.astype(np.float16).astype(np.float32), values)
    expected = np.concatenate([weight.T for weight, _ in weights.layers[:-1]])
    np.testing.assert_array_equal(values, expected.astype(np.float16))


def test_a_weight_too_large_for_float16_is_refused() -> None:
    for array in (0, 1):
        weights = random_weights(0, FEATURES[:3], (4,))
        weights.layers[0][array].flat[0] = 7e4
        with pytest.raises(ValueError, match="too large for float16"):
            half_source(weights)
