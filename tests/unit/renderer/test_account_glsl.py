"""What a shader's text becomes so that it tallies."""

from __future__ import annotations

import pytest

from renderer.account.glsl import UncountedError, tallied
from renderer.programs import SHADERS, expand

HEAD = """#version 450
struct Side { uint depth; uint taken; };
layout(std430, binding = 0) buffer Some { uint some[]; };
layout(std430, binding = 1) buffer Sides { Side side[]; };
layout(std430, binding = 2) buffer Words { uint used; uvec2 pair[]; };
layout(rgba16, binding = 0) uniform image2D picture;
layout(binding = 0) uniform sampler2D first;
layout(binding = 1) uniform sampler2D sums[2];
shared uint part[64];
"""


def body(text: str) -> str:
    """The statements of a main function as they are rewritten."""
    found = tallied(f"{HEAD}void main() {{ {text} }}", is_fragment=False).text
    return found.partition("void tallied_main() { ")[2].partition(" }\n")[0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("uint x = some[i];", "uint x = some[(tally_load(4u), i)];"),
        ("some[i + 1] = x;", "some[(tally_store(4u), i + 1)] = x;"),
        ("some[i] += x;", "some[(tally_change(4u), i)] += x;"),
        ("some[some[i]] = x;", "some[(tally_store(4u), some[(tally_load(4u), i)])] = x;"),
        ("if (side[p].depth == 0u) return;", "if (side[(tally_load(4u), p)].depth == 0u) return;"),
        ("Side one = side[p];", "Side one = side[(tally_load(8u), p)];"),
        ("pair[i].x = pair[j].y;", "pair[(tally_store(4u), i)].x = pair[(tally_load(4u), j)].y;"),
        ("uvec2 x = pair[i];", "uvec2 x = pair[(tally_load(8u), i)];"),
        ("atomicMin(some[i], x);", "atomicMin(some[(tally_atomic(4u), i)], x);"),
        ("atomicMin(side[p].depth, x);", "atomicMin(side[(tally_atomic(4u), p)].depth, x);"),
        ("atomicAdd(used, 1u);", "atomicAdd(used, (tally_atomic(4u), 1u));"),
        ("used = x + 1u;", "used = (tally_store(4u), x + 1u);"),
        ("if (used == 1u) return;", "if ((tally_load(4u), used) == 1u) return;"),
        ("atomicAdd(part[0], 1u);", "atomicAdd(part[0], 1u);"),
        ("uint used = 1u, y = used;", "uint used = 1u, y = used;"),
        ("uint y = 0u, used = y; y = used;", "uint y = 0u, used = y; y = used;"),
        ("x = cut.used;", "x = cut.used;"),
        ("vec4 x = texelFetch(sums[i], xy, 0);", "vec4 x = texelFetch(sums[i], (tally_fetch_0(), xy), 0);"),
        ("vec4 x = imageLoad(picture, xy);", "vec4 x = imageLoad(picture, (tally_load(8u), xy));"),
        ("imageStore(picture, at(x, y), c);", "imageStore(picture, (tally_store(8u), at(x, y)), c);"),
        ("if (x) discard;", "if (x) { tally_end(0u); discard; }"),
        ("x = y; /* some[i] */", "x = y;"),
    ],
)
def test_an_access_is_counted_where_it_is_evaluated__text(text: str, expected: str) -> None:
    assert body(text).strip() == expected


@pytest.mark.parametrize("text", ["used += 1u;", "f(some);", "vec4 x = texelFetch(given, xy, 0);"])
def test_what_is_not_known_is_refused__text(text: str) -> None:
    with pytest.raises(UncountedError):
        body(text)


def test_a_parameter_hides_a_buffers_member() -> None:
    text = f"{HEAD}void read(uint used, float z) {{ z = float(used); }} void main() {{ read(used, 1.0); }}"
    found = tallied(text, is_fragment=False).text
    assert "z = float(used);" in found
    assert "read((tally_load(4u), used), 1.0);" in found


def test_only_a_fragment_shader_asks_for_helper_invocations() -> None:
    assert "gl_HelperInvocation" in tallied(f"{HEAD}void main() {{}}", is_fragment=True).text
    assert "gl_HelperInvocation" not in tallied(f"{HEAD}void main() {{}}", is_fragment=False).text


def test_extensions_stay_before_everything_else() -> None:
    found = tallied("#version 450\n#extension GL_x : require\nvoid main() {}", is_fragment=True).text
    assert found.startswith("#version 450\n#extension GL_x : require\nlayout(std430, binding = 8)")


@pytest.mark.parametrize(
    "name", sorted(str(file.relative_to(SHADERS)) for file in SHADERS.rglob("*") if file.suffix in (".frag", ".comp"))
)
def test_every_shader_can_be_counted__name(name: str) -> None:
    text = expand(name, {}, {"bundle/predict.glsl": ""})
    assert "void tallied_main()" in tallied(text, is_fragment=name.endswith(".frag")).text
