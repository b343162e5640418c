"""Opacity: constants, textures, primvars, interfaces, thresholds, display colours; and what `alpha` does to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pxr import Gf, UsdGeom, UsdShade
from support.cards import Card, Types, out, save

from renderer.usd.parts import layers
from schemas.colour import encode_gamma2

VARYING = [0.2, 0.4, 0.6, 0.8]
FADED = [[(10, 20, 30, 0), (40, 50, 60, 255)]]


def opacity_from(card: Card, output: UsdShade.Output) -> None:
    card.surface.CreateInput("opacity", Types.Float).ConnectToSource(output)


def reader(card: Card, **inputs: object) -> UsdShade.Output:
    return out(card.shader("R", "UsdPrimvarReader_float", varname="fade", **inputs), "result")


@pytest.mark.parametrize(("channel", "index"), [("r", 0), ("g", 1), ("b", 2), ("a", 3), ("rgb", 0)])
def test_any_channel_of_a_texture_may_be_the_opacity(tmp_path: Path, channel: str, index: int) -> None:
    save(tmp_path / "a.png", [[(10, 20, 30, 40), (50, 60, 70, 80)]])
    card = Card(tmp_path)
    texture = card.texture("T", "./a.png", scale=(0.1, 0.2, 0.3, 0.4), bias=(0.5, 0.6, 0.7, 0.8))
    opacity_from(card, out(texture, channel))
    (batch,) = card.load().batches
    assert (batch.layer, batch.opacity_channel) == ("mixed", index)
    assert batch.opacity_scale == pytest.approx(0.1 * (index + 1))
    assert batch.opacity_bias == pytest.approx(0.5 + 0.1 * index)


def test_opacity_has_its_own_texture_coordinates_and_transform(tmp_path: Path) -> None:
    save(tmp_path / "a.png", FADED)
    card = Card(tmp_path)
    turned = card.shader("X", "UsdTransform2d", rotation=90.0)
    texture = card.texture("O", "./a.png")
    texture.CreateInput("st", Types.Float2).ConnectToSource(turned.CreateOutput("result", Types.Float2))
    opacity_from(card, out(texture, "a"))
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(card.texture("T", "./a.png"), "rgb"))
    scene = card.load()
    (batch,) = scene.batches
    assert (batch.colour_uv, batch.opacity_uv) == (0, 1)
    assert scene.more_uvs is not None
    u, v = scene.uvs.T
    np.testing.assert_allclose(scene.more_uvs[:, :2], np.stack((-v, u), axis=1), atol=1e-6)
    assert scene.warnings == ()


def test_chained_transforms_apply_from_the_primvar_outwards(tmp_path: Path) -> None:
    save(tmp_path / "a.png", FADED)
    card = Card(tmp_path)
    inner = card.shader("X1", "UsdTransform2d", translation=(1.0, 0.0))
    outer = card.shader("X2", "UsdTransform2d", scale=(2.0, 3.0))
    outer.CreateInput("in", Types.Float2).ConnectToSource(inner.CreateOutput("result", Types.Float2))
    texture = card.texture("T", "./a.png")
    texture.CreateInput("st", Types.Float2).ConnectToSource(outer.CreateOutput("result", Types.Float2))
    opacity_from(card, out(texture, "a"))
    scene = card.load()
    corner = np.isclose(scene.positions[:, :2], [0.5, 0.5]).all(axis=1)
    np.testing.assert_allclose(scene.uvs[corner], [[(1 + 1) * 2, 1 * 3]])


@pytest.mark.parametrize(
    ("where", "values", "stored"),
    [
        ("constant", [0.2], {51}),
        ("uniform", [0.4], {102}),
        ("vertex", VARYING, {51, 102, 153, 204}),
        ("varying", VARYING, {51, 102, 153, 204}),
        ("faceVarying", VARYING, {51, 102, 153, 204}),
    ],
)
def test_primvars_at_every_interpolation(tmp_path: Path, where: str, values: list[float], stored: set[int]) -> None:
    card = Card(tmp_path)
    opacity_from(card, reader(card))
    card.primvar(card.mesh, "fade", Types.FloatArray, values, where)
    scene = card.load()
    assert set(scene.colours[:, 3].tolist()) == stored
    assert [b.layer for b in scene.batches] == ["transparent"]
    assert set(card.load(alpha=0.2).colours[:, 3].tolist()) == {51}


def test_indexed_and_inherited_primvars(tmp_path: Path) -> None:
    card = Card(tmp_path)
    opacity_from(card, reader(card))
    indexed = UsdGeom.PrimvarsAPI(card.mesh).CreatePrimvar("fade", Types.FloatArray, "vertex")
    indexed.Set([0.2, 0.6])
    indexed.SetIndices([0, 0, 1, 1])
    assert sorted(card.load().colours[:, 3].tolist()) == [51, 51, 153, 153]
    UsdGeom.PrimvarsAPI(card.mesh).RemovePrimvar("fade")
    group = UsdGeom.Xform.Define(card.stage, "/Group")
    UsdGeom.PrimvarsAPI(group).CreatePrimvar("fade", Types.Float, "constant").Set(0.4)
    inner = card.square("/Group/Card")
    UsdShade.MaterialBindingAPI.Apply(inner.GetPrim()).Bind(card.material)
    card.stage.RemovePrim("/Card")
    assert set(card.load().colours[:, 3].tolist()) == {102}


def test_a_missing_primvar_is_the_readers_fallback_or_opaque(tmp_path: Path) -> None:
    card = Card(tmp_path)
    opacity_from(card, reader(card, fallback=0.4))
    assert set(card.load().colours[:, 3].tolist()) == {102}
    card.stage.GetPrimAtPath("/Looks/M/R").GetAttribute("inputs:fallback").Clear()
    assert card.load().is_opaque


def test_interfaces_reach_through_node_graphs(tmp_path: Path) -> None:
    card = Card(tmp_path)
    given = card.material.CreateInput("o", Types.Float)
    given.Set(0.6)
    opacity_from(card, given)
    assert set(card.load().colours[:, 3].tolist()) == {153}
    graph = UsdShade.NodeGraph.Define(card.stage, "/Looks/M/G")
    inner = UsdShade.Shader.Define(card.stage, "/Looks/M/G/R")
    inner.CreateIdAttr("UsdPrimvarReader_float")
    inner.CreateInput("varname", Types.String).ConnectToSource(graph.CreateInput("name", Types.String))
    graph.CreateInput("name", Types.String).Set("fade")
    graph.CreateOutput("o", Types.Float).ConnectToSource(inner.CreateOutput("result", Types.Float))
    opacity_from(card, graph.GetOutput("o"))
    card.primvar(card.mesh, "fade", Types.FloatArray, [0.2], "constant")
    assert set(card.load().colours[:, 3].tolist()) == {51}


@pytest.mark.parametrize("mode", ["transparent", "presence"])
def test_opacity_modes_blend_alike(tmp_path: Path, mode: str) -> None:
    card = Card(tmp_path)
    card.surface.CreateInput("opacityMode", Types.Token).Set(mode)
    card.surface.CreateInput("opacity", Types.Float).Set(0.4)
    scene = card.load()
    assert set(scene.colours[:, 3].tolist()) == {102}
    assert scene.warnings == ()


@pytest.mark.parametrize(("alpha", "left", "layer"), [(None, 1.0, "opaque"), (0.2, 0.2, "mixed")])
def test_an_interpolated_primvar_is_cut_by_the_fragment(
    tmp_path: Path, alpha: float | None, left: float, layer: str
) -> None:
    card = Card(tmp_path)
    opacity_from(card, reader(card))
    card.surface.CreateInput("opacityThreshold", Types.Float).Set(0.5)
    card.primvar(card.mesh, "fade", Types.FloatArray, VARYING, "vertex")
    (batch,) = card.load(alpha).batches
    assert (batch.opacity_threshold, batch.cut_out_alpha, batch.layer) == (0.5, left, layer)
    assert not batch.is_plain
    card.primvar(card.mesh, "fade", Types.FloatArray, [0.5, 0.6, 0.7, 0.8], "vertex")
    scene = card.load(alpha)
    assert scene.batches[0].is_plain, "all of it is kept"
    assert set(scene.colours[:, 3].tolist()) == {round(255 * left)}


@pytest.mark.parametrize(
    ("mode", "wrap", "st", "layer"),
    [
        ("RGBA", "black", 1.0, "opaque"),
        ("RGBA", "black", 2.0, "mixed"),
        ("RGBA", "repeat", 2.0, "opaque"),
        ("RGB", "black", 2.0, "opaque"),
    ],
)
def test_a_solid_image_is_opaque_unless_black_around_it_shows(
    tmp_path: Path, mode: str, wrap: str, st: float, layer: str
) -> None:
    save(tmp_path / "a.png", [[(10, 20, 30, 255)] * 2], mode)
    card = Card(tmp_path)
    opacity_from(card, out(card.texture("T", "./a.png", wrapS=wrap, wrapT="repeat"), "a"))
    card.primvar(card.mesh, "st", Types.TexCoord2fArray, [(0, 0), (st, 0), (st, 1), (0, 1)], "vertex")
    assert [b.layer for b in card.load().batches] == [layer]


def test_alpha_multiplies_what_a_texture_gives(tmp_path: Path) -> None:
    save(tmp_path / "a.png", FADED)
    card = Card(tmp_path)
    opacity_from(card, out(card.texture("T", "./a.png"), "a"))
    for alpha, stored in ((None, 255), (0.2, 51)):
        scene = card.load(alpha)
        assert set(scene.colours[:, 3].tolist()) == {stored}
        assert [(b.layer, b.opacity_texture) for b in scene.batches] == [("mixed", 0)]


@pytest.mark.parametrize(
    ("where", "rows"), [("constant", 1), ("uniform", 6), ("vertex", 8), ("varying", 8), ("faceVarying", 24)]
)
def test_display_colours_of_gprims_at_every_interpolation(tmp_path: Path, where: str, rows: int) -> None:
    card = Card(tmp_path)
    card.stage.RemovePrim("/Card")
    cube = UsdGeom.Cube.Define(card.stage, "/Cube")
    colours = np.linspace(0.1, 0.9, rows)
    cube.CreateDisplayColorPrimvar(where).Set([Gf.Vec3f(float(c), 0.5, 0.25) for c in colours])
    cube.CreateDisplayOpacityPrimvar("constant").Set([0.4])
    scene = card.load()
    assert set(scene.colours[:, 0].tolist()) == set(encode_gamma2(colours.astype(np.float32)).tolist())
    assert set(scene.colours[:, 3].tolist()) == {102}
    assert scene.warnings == ()


def test_display_opacity_is_inherited_and_may_differ_in_interpolation_from_the_colour(tmp_path: Path) -> None:
    card = Card(tmp_path)
    card.stage.RemovePrim("/Card")
    group = UsdGeom.Xform.Define(card.stage, "/Group")
    UsdGeom.PrimvarsAPI(group).CreatePrimvar("displayOpacity", Types.FloatArray, "constant").Set([0.6])
    inner = card.square("/Group/Card")
    inner.CreateDisplayColorPrimvar("vertex").Set([(0, 0, 0), (0, 0, 0), (1, 1, 1), (1, 1, 1)])
    scene = card.load()
    assert sorted(map(tuple, scene.colours.tolist())) == [(0, 0, 0, 153)] * 2 + [(255, 255, 255, 153)] * 2
    inner.CreateDisplayOpacityPrimvar("uniform").Set([0.2])
    assert set(card.load().colours[:, 3].tolist()) == {51}


def test_what_cannot_drive_an_input_is_named(tmp_path: Path) -> None:
    card = Card(tmp_path)
    opacity_from(card, out(card.shader("N", "MyNoise"), "o"))
    card.surface.CreateInput("opacityThreshold", Types.Float).ConnectToSource(out(card.shader("Q", "MyNoise"), "o"))
    scene = card.load()
    assert scene.is_opaque
    assert any("MyNoise cannot drive opacity, " in w and "/Looks/M/N" in w for w in scene.warnings)
    assert any("MyNoise cannot drive opacityThreshold" in w and "/Looks/M/Q" in w for w in scene.warnings)


@given(
    alpha=st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=1, max_size=8),
    textured=st.booleans(),
    cut_out=st.sampled_from([None, 1.0, 0.5]),
)
def test_every_triangle_that_shows_something_is_in_exactly_one_layer(
    alpha: list[tuple[int, int, int]], textured: bool, cut_out: float | None
) -> None:
    corners = np.array(alpha, dtype=float)
    found = dict(layers(corners, textured, cut_out))
    together = np.sum(list(found.values()), axis=0)
    np.testing.assert_array_equal(together, (corners.max(axis=1) > 0).astype(int))
    if not textured and cut_out is None:
        assert (corners[found["opaque"]] == 255).all()
        assert ((corners[found["transparent"]] > 0) & (corners[found["transparent"]] < 255)).all()
