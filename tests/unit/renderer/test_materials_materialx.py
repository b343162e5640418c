"""MaterialX surfaces: documents that a stage refers to, and nodes that are in the stage itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, UsdShade
from support.cards import Card, Types, bind, put, save

from renderer.usd.coordinates import place2d, tiling, transform2d
from renderer.usd.materialx import referenced_files
from renderer.usd.networks import category_of
from schemas.colour import encode_gamma2
from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.scene import SceneArrays

DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709" %s>
  %s
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="s"/></surfacematerial>
</materialx>"""


def field(name: str, kind: str, value: str, **more: str) -> str:
    extra = "".join(f' {key}="{text}"' for key, text in more.items())
    return f'<input name="{name}" type="{kind}" value="{value}"{extra}/>'


def surface(kind: str, *fields: str) -> str:
    return f'<{kind} name="s" type="surfaceshader">{"".join(fields)}</{kind}>'


def load(
    folder: Path, body: str, attributes: str = "", alpha: float | None = None, glass: GlassReading = DEFAULT_GLASS
) -> SceneArrays:
    """A card bound to material M of a document with that body."""
    (folder / "m.mtlx").write_text(DOCUMENT % (attributes, body))
    card = Card(folder)
    card.stage.RemovePrim("/Looks")
    looks = card.stage.DefinePrim("/Looks", "Scope")
    looks.GetReferences().AddReference("./m.mtlx", "/MaterialX/Materials")
    return card.load(alpha, glass)


def rgba(*linear: float) -> list[int]:
    return [*encode_gamma2(np.array(linear[:3])).tolist(), round(255 * linear[3])]


@pytest.mark.parametrize(
    ("kind", "fields", "wanted"),
    [
        ("standard_surface", [], (0.8, 0.8, 0.8, 1.0)),
        ("standard_surface", [field("base", "float", "0.5")], (0.4, 0.4, 0.4, 1.0)),
        ("standard_surface", [field("opacity", "color3", "0.4, 0.4, 0.4")], (0.8, 0.8, 0.8, 0.4)),
        (
            "standard_surface",
            [field("transmission", "float", "1"), field("transmission_color", "color3", "0.25, 1, 0")],
            (0.25, 1.0, 0.0, 0.25),
        ),
        ("standard_surface", [field("transmission", "float", "0.4")], (0.8, 0.8, 0.8, 0.7)),
        (
            "standard_surface",
            [field("emission", "float", "0.1"), field("emission_color", "color3", "1, 0, 0")],
            (0.9, 0.8, 0.8, 1.0),
        ),
        (
            "open_pbr_surface",
            [field("base_color", "color3", "0.1, 0.2, 0.3"), field("geometry_opacity", "float", "0.6")],
            (0.1, 0.2, 0.3, 0.6),
        ),
        ("open_pbr_surface", [field("transmission_weight", "float", "1")], (1.0, 1.0, 1.0, 0.25)),
        ("gltf_pbr", [field("alpha", "float", "0.4")], (1.0, 1.0, 1.0, 1.0)),
        ("gltf_pbr", [field("alpha", "float", "0.4"), field("alpha_mode", "integer", "2")], (1.0, 1.0, 1.0, 0.4)),
        ("gltf_pbr", [field("alpha", "float", "0.6"), field("alpha_mode", "integer", "1")], (1.0, 1.0, 1.0, 1.0)),
        ("gltf_pbr", [field("transmission", "float", "1")], (1.0, 1.0, 1.0, 0.25)),
        (
            "gltf_pbr",
            [field("base_color", "color3", "0, 0, 0"), field("emissive", "color3", "0, 0.5, 0")],
            (0, 0.5, 0, 1),
        ),
        (
            "UsdPreviewSurface",
            [field("diffuseColor", "color3", "0.5, 0.25, 0"), field("opacity", "float", "0.2")],
            (0.5, 0.25, 0.0, 0.2),
        ),
    ],
)
def test_surfaces_of_a_document(tmp_path: Path, kind: str, fields: list[str], wanted: tuple[float, ...]) -> None:
    scene = load(tmp_path, surface(kind, *fields), glass="plain")
    np.testing.assert_allclose(scene.colours[0].astype(int), rgba(*wanted), atol=1)
    assert scene.warnings == ()


def test_a_cut_out_of_gltf_hides_what_is_below_its_threshold(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(1, 2, 3, 4), (5, 6, 7, 200)]])
    image = f'<image name="i" type="color4">{field("file", "filename", "a.png")}</image>'
    alpha = '<extract name="e" type="float"><input name="in" type="color4" nodename="i"/>'
    alpha += f"{field('index', 'integer', '3')}</extract>"
    cut = '<input name="alpha" type="float" nodename="e"/>'
    cut += field("alpha_mode", "integer", "1") + field("alpha_cutoff", "float", "0.75")
    (batch,) = load(tmp_path, image + alpha + surface("gltf_pbr", cut)).batches
    assert (batch.layer, batch.opacity_channel, batch.opacity_threshold) == ("opaque", 3, 0.75)


def test_images_in_node_graphs_have_a_prefix_a_colour_space_wrap_modes_and_tiling(tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    save(tmp_path / "tex" / "a.png", [[(1, 2, 3, 4), (5, 6, 7, 200)]])
    graph = f"""
    <nodegraph name="G" fileprefix="tex/">
      <input name="file" type="filename" value="a.png" colorspace="srgb_texture"/>
      <tiledimage name="t" type="color3">
        <input name="file" type="filename" interfacename="file"/>
        {field("uvtiling", "vector2", "2, 3")}{field("uvoffset", "vector2", "0.5, 0")}</tiledimage>
      <image name="i" type="color3">
        {field("file", "filename", "a.png")}{field("uaddressmode", "string", "mirror")}
        {field("vaddressmode", "string", "constant")}</image>
      <multiply name="m" type="color3">
        <input name="in1" type="color3" nodename="i"/>{field("in2", "color3", "0.5, 0.5, 0.25")}</multiply>
      <output name="o" type="color3" nodename="t"/>
      <output name="p" type="color3" nodename="m"/>
    </nodegraph>"""
    colour = '<input name="base_color" type="color3" nodegraph="G" output="{}"/>'
    tiled = load(tmp_path, graph + surface("standard_surface", colour.format("o")))
    assert [(t.name, t.srgb, t.wrap) for t in tiled.textures] == [("a.png", True, ("repeat", "repeat"))]
    corner = np.isclose(tiled.positions[:, :2], 0.5).all(axis=1)
    np.testing.assert_allclose(tiled.uvs[corner], [[1.5, 3.0]])
    plain = load(tmp_path, graph + surface("standard_surface", colour.format("p")))
    assert [(t.srgb, t.wrap) for t in plain.textures] == [(False, ("mirror", "black"))]
    np.testing.assert_allclose(plain.batches[0].colour_scale[:3], (0.5, 0.5, 0.25))
    assert [file.name for file in referenced_files(tmp_path / "m.mtlx")] == ["a.png", "a.png"]
    assert all(file.is_file() for file in referenced_files(tmp_path / "m.mtlx"))


def test_a_missing_image_is_its_default_and_named(tmp_path: Path) -> None:
    image = '<image name="i" type="color3">' + field("file", "filename", "gone.png")
    image += field("default", "color3", "0.25, 0, 1") + "</image>"
    scene = load(tmp_path, image + surface("standard_surface", '<input name="base_color" type="color3" nodename="i"/>'))
    np.testing.assert_array_equal(scene.colours[0], [128, 0, 255, 255])
    assert any("(gone.png)" in w for w in scene.warnings)


def test_textured_transmission_is_an_opacity_where_glass_is_read_plainly(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(0, 0, 0, 255), (255, 0, 0, 255)]])
    image = '<image name="i" type="float">' + field("file", "filename", "a.png", colorspace="raw") + "</image>"
    glass = '<input name="transmission" type="float" nodename="i"/>'
    (batch,) = load(tmp_path, image + surface("standard_surface", glass), glass="plain").batches
    assert batch.layer == "mixed"
    assert (batch.opacity_scale, batch.opacity_bias) == (-0.75, 1.0)


@pytest.mark.parametrize("text", ["<materialx>", DOCUMENT % ("", '<surface_unlit name="s" type="surfaceshader"/>')])
def test_damaged_documents_and_unknown_surfaces_are_named(tmp_path: Path, text: str) -> None:
    load(tmp_path, surface("standard_surface"))
    (tmp_path / "m.mtlx").write_text(text)
    from renderer.scene import load_scene

    scene = load_scene(tmp_path / "card.usda")
    assert any("/Looks/M" in w and "display colour" in w for w in scene.warnings)


def test_a_material_may_itself_refer_to_the_document(tmp_path: Path) -> None:
    body = surface("standard_surface", field("base_color", "color3", "0.25, 0, 1"))
    (tmp_path / "m.mtlx").write_text(DOCUMENT % ("", body))
    card = Card(tmp_path)
    here = card.stage.DefinePrim("/Looks/Mine", "Material")
    here.GetReferences().AddReference("./m.mtlx", "/MaterialX/Materials/M")
    bind(card.mesh, UsdShade.Material(here))
    np.testing.assert_array_equal(card.load().colours[0], [128, 0, 255, 255])


def nodes(card: Card, preview: bool) -> None:
    """A standard_surface in the stage: an image times a colour, through a node graph, with an opacity of 0.4."""
    if not preview:
        card.material.GetSurfaceOutput().ClearSources()
    graph = UsdShade.NodeGraph.Define(card.stage, "/Looks/M/G")
    given = graph.CreateInput("file", Types.Asset)
    given.Set(Sdf.AssetPath("./a.png"))
    image = card.shader("G/I", "ND_image_color3", texcoord=_out(card, "G/U", "ND_geompropvalue_vector2", geomprop="uv"))
    image.CreateInput("file", Types.Asset).ConnectToSource(given)
    product = card.shader(
        "G/P", "ND_multiply_color3", in1=image.CreateOutput("out", Types.Color3f), in2=(1.0, 0.5, 0.25)
    )
    graph.CreateOutput("c", Types.Color3f).ConnectToSource(product.CreateOutput("out", Types.Color3f))
    kind = "ND_standard_surface_surfaceshader"
    shader = card.shader("X", kind, base_color=graph.GetOutput("c"), opacity=(0.4, 0.4, 0.4))
    card.material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.ConnectableAPI(), "out")


def _out(card: Card, name: str, kind: str, **inputs: object) -> UsdShade.Output:
    shader = card.shader(name, kind)
    for key, value in inputs.items():
        put(shader, key, value)
    return shader.CreateOutput("out", Types.Float2)


def test_nodes_in_the_stage_are_read_where_there_is_no_preview_surface(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(1, 2, 3, 255)] * 2])
    card = Card(tmp_path)
    card.primvar(card.mesh, "uv", Types.TexCoord2fArray, [(0.5, 0.25)] * 4, "vertex")
    nodes(card, preview=False)
    scene = card.load()
    (batch,) = scene.batches
    np.testing.assert_allclose(batch.colour_scale[:3], (1.0, 0.5, 0.25))
    assert set(scene.colours[:, 3].tolist()) == {102}
    np.testing.assert_array_equal(scene.uvs, [(0.5, 0.25)] * 4)
    assert scene.warnings == ()
    card = Card(tmp_path)
    nodes(card, preview=True)
    assert card.load().textures == ()


@pytest.mark.parametrize(
    ("identifier", "category"),
    [
        ("ND_standard_surface_surfaceshader", "standard_surface"),
        ("ND_standard_surface_surfaceshader_100", "standard_surface"),
        ("ND_open_pbr_surface_surfaceshader", "open_pbr_surface"),
        ("ND_gltf_pbr_surfaceshader", "gltf_pbr"),
        ("ND_UsdPreviewSurface_surfaceshader", "UsdPreviewSurface"),
        ("ND_UsdUVTexture_23", "UsdUVTexture"),
        ("ND_image_color4", "image"),
        ("ND_multiply_color3FA", "multiply"),
        ("ND_convert_color4_color3", "convert"),
        ("ND_swizzle_color4_float", "swizzle"),
        ("ND_UsdPrimvarReader_vector2", "UsdPrimvarReader"),
        ("UsdPrimvarReader_float3", "UsdPrimvarReader"),
        ("ND_UsdTransform2d", "UsdTransform2d"),
        ("ND_place2d_vector2", "place2d"),
    ],
)
def test_the_kind_of_a_node(tmp_path: Path, identifier: str, category: str) -> None:
    assert category_of(Card(tmp_path).shader("N", identifier)) == category


def at(matrix: np.ndarray, u: float, v: float) -> np.ndarray:
    return (matrix @ (u, v, 1.0))[:2]


def test_transforms_of_coordinates_in_closed_form() -> None:
    np.testing.assert_allclose(at(transform2d((2, 3), 90.0, (0.5, 0.25)), 1, 1), (-3 + 0.5, 2 + 0.25), atol=1e-12)
    np.testing.assert_allclose(at(tiling((2, 4), (0.5, 1), (1, 1), (1, 2)), 1, 1), (1.5, 1.5))
    # About its pivot: halved by a scale of 2, a quarter turn clockwise, moved back.
    np.testing.assert_allclose(at(place2d((1, 1), (2, 2), 90.0, (0.25, 0), False), 3, 1), (1 - 0.25, 1 - 1), atol=1e-12)
    np.testing.assert_allclose(at(place2d((0, 0), (2, 2), 90.0, (1, 0), True), 3, 1), (0.5, -1.0), atol=1e-12)
    assert np.isfinite(place2d((0, 0), (0, 1), 0.0, (0, 0), False)).all()
