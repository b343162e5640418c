"""Materials: constants, textures, cut-outs, subsets, fallbacks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.stages import stage

from renderer.scene import LoadOptions, load_scene
from renderer.usd.textures import MAX_SIDE, TextureUnreadable, decode_image
from schemas.colour import encode_gamma2
from schemas.scene import SceneArrays

MESH = """
def Mesh "Card" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7]
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (0,0,1), (1,0,1), (1,1,1), (0,1,1)]
    texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1),(0,0),(1,0),(1,1),(0,1)] ( interpolation = "vertex" )
    uniform token subdivisionScheme = "none"
    rel material:binding = </Looks/M>
    %s
}
"""

LOOK = """
def Scope "Looks" {
    def Material "M" {
        %s
        token outputs:surface.connect = </Looks/M/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            %s
            token outputs:surface
        }
        %s
    }
    %s
}
"""

TEXTURE = """
def Shader "T" {
    uniform token info:id = "UsdUVTexture"
    asset inputs:file = @%s@
    token inputs:wrapS = "repeat"
    token inputs:wrapT = "mirror"
    %s
    float2 inputs:st.connect = </Looks/M/X.outputs:result>
    float3 outputs:rgb
    float outputs:a
    float outputs:r
}
def Shader "X" {
    uniform token info:id = "UsdTransform2d"
    float2 inputs:in.connect = </Looks/M/R.outputs:result>
    float2 inputs:scale = (2, 1)
    float inputs:rotation = 90
    float2 inputs:translation = (0.5, 0)
    float2 outputs:result
}
def Shader "R" {
    uniform token info:id = "UsdPrimvarReader_float2"
    string inputs:varname.connect = </Looks/M.inputs:uvName>
    float2 outputs:result
}
"""
INTERFACE = 'string inputs:uvName = "st"'
COLOUR = "color3f inputs:diffuseColor.connect = </Looks/M/T.outputs:rgb>"
OPACITY = "float inputs:opacity.connect = </Looks/M/T.outputs:a>"


def load(
    folder: Path, inputs: str, nodes: str = "", mesh: str = "", looks: str = "", alpha: float | None = None
) -> SceneArrays:
    file = stage(folder, MESH % mesh + LOOK % (INTERFACE, inputs, nodes, looks))
    return load_scene(file, LoadOptions(alpha=alpha))


def image(folder: Path, mode: str = "RGBA", name: str = "a.png") -> str:
    """Four pixels; alphas 0, 85, 170, 255 where there is an alpha."""
    pixels = np.array([[[10, 20, 30, 0], [40, 50, 60, 85]], [[70, 80, 90, 170], [100, 110, 120, 255]]], dtype=np.uint8)
    Image.fromarray(pixels, "RGBA").convert(mode).save(folder / name)
    return f"./{name}"


def test_constants_are_baked_and_emission_is_added_and_clamped(tmp_path: Path) -> None:
    inputs = """
    color3f inputs:diffuseColor = (0.25, 0.5, 0.9)
    color3f inputs:emissiveColor = (0.1, 0, 0.5)
    float inputs:opacity = 0.4
    """
    scene = load(tmp_path, inputs)
    np.testing.assert_array_equal(scene.colours[0], [*encode_gamma2(np.array([0.35, 0.5, 1.0])), 102])
    assert [b.layer for b in scene.batches] == ["transparent"]


def test_alpha_replaces_constant_opacity_and_its_absence_keeps_it(tmp_path: Path) -> None:
    assert set(load(tmp_path, "float inputs:opacity = 0.4", alpha=0.2).colours[:, 3]) == {51}
    assert set(load(tmp_path, "", alpha=0.2).colours[:, 3]) == {51}
    assert load(tmp_path, "").is_opaque


def test_constants_come_through_material_interfaces_and_primvar_readers(tmp_path: Path) -> None:
    inputs = "float inputs:opacity.connect = </Looks/M/F.outputs:result>"
    nodes = """
    def Shader "F" {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "fade"
        float outputs:result
    }
    """
    mesh = 'float[] primvars:fade = [0.2, 0.6] ( interpolation = "uniform" )'
    assert set(load(tmp_path, inputs, nodes, mesh).colours[:, 3]) == {51, 153}
    file = stage(
        tmp_path,
        MESH % "" + LOOK % ("float inputs:o = 0.6", "float inputs:opacity.connect = </Looks/M.inputs:o>", "", ""),
    )
    assert set(load_scene(file).colours[:, 3]) == {153}


def test_a_texture_gives_colour_and_opacity_and_coordinates_are_transformed(tmp_path: Path) -> None:
    scene = load(tmp_path, COLOUR + "\n" + OPACITY, TEXTURE % (image(tmp_path), "float4 inputs:scale = (1, 1, 1, 0.5)"))
    (batch,) = scene.batches
    assert (batch.layer, batch.colour_texture, batch.opacity_texture) == ("mixed", 0, 0)
    assert (batch.opacity_channel, batch.opacity_scale, batch.opacity_threshold) == (3, 0.5, 0.0)
    (texture,) = scene.textures
    assert texture.srgb
    assert texture.wrap == ("repeat", "mirror")
    np.testing.assert_array_equal(texture.pixels[0, 0], [70, 80, 90, 170], "row 0 is at the bottom")
    # in * scale, then a quarter turn, then moved: (1, 0) -> (2, 0) -> (0, 2) -> (0.5, 2).
    corner = np.isclose(scene.positions[:, 0], 0.5) & np.isclose(scene.positions[:, 1], -0.5)
    np.testing.assert_allclose(scene.uvs[corner], [[0.5, 2.0]] * corner.sum(), atol=1e-6)
    assert set(scene.colours.ravel()) == {255}


def test_cut_outs_keep_their_shape_with_and_without_alpha(tmp_path: Path) -> None:
    inputs = OPACITY + "\nfloat inputs:opacityThreshold = 0.5"
    for alpha, left, layer in ((None, 1.0, "opaque"), (0.2, 0.2, "mixed")):
        scene = load(tmp_path, inputs, TEXTURE % (image(tmp_path), ""), alpha=alpha)
        (batch,) = scene.batches
        assert (batch.opacity_threshold, batch.cut_out_alpha, batch.layer) == (0.5, left, layer)
        assert set(scene.colours[:, 3]) == {255}


@pytest.mark.parametrize(("opacity", "kept"), [(0.6, 4), (0.4, 0)])
def test_a_constant_opacity_is_cut_at_the_threshold_too(tmp_path: Path, opacity: float, kept: int) -> None:
    body = MESH.replace("Card", "Other").replace("</Looks/M>", "</Looks/None>") % ""
    inputs = f"float inputs:opacity = {opacity}\nfloat inputs:opacityThreshold = 0.5"
    scene = load_scene(stage(tmp_path, MESH % "" + body + LOOK % ("", inputs, "", "")))
    assert scene.triangles == 4 + kept
    assert scene.is_opaque


def test_an_image_without_alpha_is_opaque(tmp_path: Path) -> None:
    scene = load(tmp_path, COLOUR + "\n" + OPACITY, TEXTURE % (image(tmp_path, "RGB"), ""))
    assert scene.is_opaque
    assert scene.batches[0].opacity_texture == -1


def test_a_colour_channel_as_opacity_is_linear_when_the_sampler_reads_it(tmp_path: Path) -> None:
    inputs = "float inputs:opacity.connect = </Looks/M/T.outputs:r>"
    scene = load(tmp_path, inputs, TEXTURE % (image(tmp_path), ""))
    texture = scene.textures[scene.batches[0].opacity_texture]
    assert not texture.srgb
    assert scene.batches[0].opacity_channel == 0
    # sRGB 100/255 is 0.1274 in linear light.
    assert texture.pixels[0, 1, 0] == round(0.1274 * 255)


def test_subsets_have_their_own_materials_and_the_rest_keeps_the_meshs(tmp_path: Path) -> None:
    subset = """
    uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
    def GeomSubset "Second" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Looks/N>
    }
    """
    second = LOOK % ("", "float inputs:opacity = 0.5", "", "")
    second = second[second.index("def Material") : second.rindex("}")].replace("/M/", "/N/").replace('"M"', '"N"')
    scene = load(tmp_path, "float inputs:opacity = 1", "", subset, second)
    assert {b.layer: b.count for b in scene.batches} == {"opaque": 6, "transparent": 6}
    depth = scene.positions[scene.indices, 2] + scene.origin[2]
    np.testing.assert_allclose(depth, [0] * 6 + [1] * 6)


def test_unsupported_and_missing_materials_fall_back_to_display_colour_with_a_warning(tmp_path: Path) -> None:
    mesh = "color3f[] primvars:displayColor = [(0, 1, 0)]"
    file = stage(
        tmp_path, MESH % mesh + (LOOK % ("", "", "", "")).replace("UsdPreviewSurface", "arnold:standard_surface")
    )
    scene = load_scene(file)
    np.testing.assert_array_equal(scene.colours[0], [0, 255, 0, 255])
    assert any("arnold:standard_surface" in w and "/Looks/M" in w for w in scene.warnings)
    missing = load_scene(stage(tmp_path, MESH % mesh))
    assert any("missing" in w and "/Looks/M" in w for w in missing.warnings)


@pytest.mark.parametrize("content", [None, b"not an image"])
def test_a_texture_that_cannot_be_read_is_a_warning_and_its_fallback_is_used(
    tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / "b.png").write_bytes(content)
    scene = load(tmp_path, COLOUR, TEXTURE % ("./b.png", "float4 inputs:fallback = (1, 0, 0, 1)"))
    np.testing.assert_array_equal(scene.colours[0], [255, 0, 0, 255])
    assert any("b.png" in w and "/Looks/M/T" in w for w in scene.warnings)
    assert scene.textures == ()


def test_one_batch_for_each_set_of_textures_and_layer(tmp_path: Path) -> None:
    picture = image(tmp_path)
    body = "".join(
        MESH.replace("Card", f"Card{i}") % f"double3 xformOp:translate = ({i}, 0, 0)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
        for i in range(5)
    )
    scene = load_scene(stage(tmp_path, body + LOOK % (INTERFACE, COLOUR, TEXTURE % (picture, ""), "")))
    assert len(scene.batches) == len(scene.textures) == 1
    assert scene.triangles == 20


def test_images_are_rgba_upside_down_and_not_larger_than_the_limit(tmp_path: Path) -> None:
    Image.new("L", (2 * MAX_SIDE, 4), 7).save(tmp_path / "wide.png")
    wide = decode_image((tmp_path / "wide.png").read_bytes())
    assert wide.pixels.shape == (2, MAX_SIDE, 4)
    assert not wide.srgb
    Image.fromarray(np.array([[0, 65535]], dtype=np.uint16)).save(tmp_path / "deep.png")
    np.testing.assert_array_equal(decode_image((tmp_path / "deep.png").read_bytes()).pixels[0, :, 0], [0, 255])
    with pytest.raises(TextureUnreadable):
        decode_image(b"\x89PNG\r\n\x1a\n")


MTLX = """<?xml version="1.0"?>
<materialx version="1.38">
  <nodegraph name="G">
    <image name="i" type="color3">
      <input name="file" type="filename" value="a.png"/></image>
    <output name="o" type="color3" nodename="i"/>
  </nodegraph>
  <standard_surface name="s" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="G" output="o"/>
  </standard_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="s"/></surfacematerial>
  <standard_surface name="t" type="surfaceshader">
    <input name="transmission" type="float" value="1"/>
    <input name="transmission_color" type="color3" value="0.25, 1, 0"/>
  </standard_surface>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="t"/></surfacematerial>
</materialx>"""


def test_materialx_documents_give_colour_and_see_through_glass(tmp_path: Path) -> None:
    image(tmp_path)
    (tmp_path / "m.mtlx").write_text(MTLX)
    looks = 'def Scope "Looks" ( references = @./m.mtlx@</MaterialX/Materials> ) {}'
    scene = load_scene(stage(tmp_path, MESH % "" + looks))
    assert scene.textures[scene.batches[0].colour_texture].name == "a.png"
    assert scene.warnings == ()
    glass = load_scene(stage(tmp_path, (MESH % "").replace("</Looks/M>", "</Looks/Glass>") + looks))
    # All of the light goes through, with that tint.
    np.testing.assert_array_equal(glass.colours[0], [128, 255, 0, 0])
    assert glass.batches[0].reflectance == pytest.approx((0.04, 1.0))
    broken = tmp_path / "m.mtlx"
    broken.write_text("<materialx>")
    assert any("/Looks/M" in w for w in load_scene(stage(tmp_path, MESH % "" + looks)).warnings)
