"""Textures: files of every kind, colour spaces, channels, coordinates, UDIM tiles, what is missing."""

from __future__ import annotations

import io
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from pxr import Sdf, UsdGeom, UsdUtils
from support.cards import Card, Types, out, save

from renderer.scene import load_scene
from renderer.usd import textures
from renderer.usd.textures import TextureUnreadable, decode_image
from schemas.colour import srgb_to_linear
from schemas.limits import LIMITS

RED, CLEAR = (200, 10, 20, 255), (0, 0, 0, 0)


def encoded(pixels: object, mode: str, kind: str, **options: object) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.array(pixels, dtype=np.uint8), "RGBA").convert(mode).save(stream, kind, **options)
    return stream.getvalue()


def png16(rows: np.ndarray) -> bytes:
    """A PNG of 16 bits and three channels, which Pillow reads but does not write."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return len(body).to_bytes(4, "big") + name + body + zlib.crc32(name + body).to_bytes(4, "big")

    height, width = rows.shape[:2]
    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([16, 2, 0, 0, 0])
    body = b"".join(b"\0" + row.astype(">u2").tobytes() for row in rows)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("mode", "kind", "pixel", "srgb", "has_alpha"),
    [
        ("RGB", "PNG", (200, 10, 20, 255), True, False),
        ("RGBA", "PNG", (200, 10, 20, 128), True, True),
        ("P", "PNG", (200, 10, 20, 128), True, True),
        ("L", "PNG", (68, 68, 68, 255), False, False),
        ("LA", "PNG", (68, 68, 68, 128), False, True),
        ("RGB", "JPEG", (200, 10, 20, 255), True, False),
        ("L", "JPEG", (68, 68, 68, 255), False, False),
        ("CMYK", "JPEG", (200, 10, 20, 255), True, False),
        ("RGB", "BMP", (200, 10, 20, 255), True, False),
    ],
)
def test_every_kind_of_image_becomes_rgba_and_only_8_bit_colour_is_srgb(
    mode: str, kind: str, pixel: tuple[int, ...], srgb: bool, has_alpha: bool
) -> None:
    image = decode_image(encoded([[(200, 10, 20, 128)] * 8] * 8, mode, kind))
    np.testing.assert_allclose(image.pixels[4, 4].astype(int), pixel, atol=3)
    assert (image.srgb, image.has_alpha) == (srgb, has_alpha)


def test_a_palette_may_have_a_transparent_colour() -> None:
    palette = Image.new("P", (2, 1))
    palette.putpalette([10, 20, 30, 40, 50, 60])
    palette.putdata([0, 1])
    stream = io.BytesIO()
    palette.save(stream, "PNG", transparency=1)
    image = decode_image(stream.getvalue())
    assert image.has_alpha
    np.testing.assert_array_equal(image.pixels[0], [[10, 20, 30, 255], [40, 50, 60, 0]])


def test_16_bit_colour_is_linear_unless_the_material_says_srgb() -> None:
    data = png16(np.array([[[0, 32768, 65535]]]))
    assert not decode_image(data).srgb
    assert decode_image(data, "sRGB").srgb
    np.testing.assert_array_equal(decode_image(data).pixels[0, 0], [0, 128, 255, 255])


def test_openexr_floats_are_linear_clipped_and_have_alpha(tmp_path: Path) -> None:
    pixels = np.zeros((2, 3, 4), dtype=np.float32)
    pixels[0] = (0.02, 0.5, 7.0, 0.25)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGBA": pixels}).write(str(tmp_path / "a.exr"))
    image = decode_image((tmp_path / "a.exr").read_bytes())
    assert (image.srgb, image.has_alpha) == (True, True)
    np.testing.assert_array_equal(image.pixels[0], 0, "row 0 is at the bottom")
    np.testing.assert_allclose(srgb_to_linear(image.pixels[1, 0, :3] / 255.0), [0.02, 0.5, 1.0], atol=5e-3)
    assert image.pixels[1, 0, 3] == 64


def test_a_grey_or_too_large_openexr_image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pixels = np.full((2, 3), 0.25, dtype=np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": pixels}).write(str(tmp_path / "y.exr"))
    data = (tmp_path / "y.exr").read_bytes()
    np.testing.assert_array_equal(decode_image(data).pixels[0, 0], [137, 137, 137, 255])
    monkeypatch.setattr(textures, "LIMITS", replace(LIMITS, texture_pixels=5))
    with pytest.raises(TextureUnreadable):
        decode_image(data)


@pytest.mark.parametrize("data", [b"", b"#?RADIANCE\n\n", b"\x76\x2f\x31\x01damaged", b"\xff\xd8\xff\xe0cut"])
def test_damaged_and_unknown_files_are_unreadable(data: bytes) -> None:
    with pytest.raises(TextureUnreadable):
        decode_image(data)


@pytest.mark.parametrize(
    ("authored", "wrap"),
    [
        ("repeat", "repeat"),
        ("clamp", "clamp"),
        ("mirror", "mirror"),
        ("black", "black"),
        ("useMetadata", "black"),
        (None, "black"),
    ],
)
def test_wrap_modes_of_s_and_t_are_separate(tmp_path: Path, authored: str | None, wrap: str) -> None:
    save(tmp_path / "a.png", [[RED]])
    card = Card(tmp_path)
    modes = {"wrapS": authored} if authored else {}
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(
        out(card.texture("T", "./a.png", wrapT="clamp", **modes), "rgb")
    )
    assert card.load().textures[0].wrap == (wrap, "clamp")


@pytest.mark.parametrize(("space", "srgb"), [("auto", True), ("sRGB", True), ("raw", False), (None, True)])
def test_source_colour_spaces(tmp_path: Path, space: str | None, srgb: bool) -> None:
    save(tmp_path / "a.png", [[RED]])
    card = Card(tmp_path)
    given = {"sourceColorSpace": space} if space else {}
    texture = card.texture("T", "./a.png", scale=(1.0, 0.5, 0.25, 2.0), bias=(0.0, 0.1, 0.2, 0.3), **given)
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, "rgb"))
    scene = card.load()
    assert scene.textures[0].srgb is srgb
    np.testing.assert_allclose(scene.batches[0].colour_scale, (1.0, 0.5, 0.25, 2.0))
    np.testing.assert_allclose(scene.batches[0].colour_bias, (0.0, 0.1, 0.2, 0.3), rtol=1e-6)


def test_one_channel_can_be_a_colour(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(1, 2, 3, 4)]])
    card = Card(tmp_path)
    for channel, value, srgb in (("g", 2, True), ("a", 4, False)):
        texture = card.texture("T", "./a.png", scale=(9.0, 0.5, 9.0, 0.5))
        card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, channel))
        scene = card.load()
        np.testing.assert_array_equal(scene.textures[0].pixels[0, 0, :3], [value] * 3)
        assert scene.textures[0].srgb is srgb
        assert scene.batches[0].colour_scale[:3] == (0.5, 0.5, 0.5)


def test_emission_may_be_a_texture_with_coordinates_of_its_own(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[RED, CLEAR]])
    card = Card(tmp_path)
    reader = card.shader("R", "UsdPrimvarReader_float2", varname="st")
    moved = card.shader("X", "UsdTransform2d", translation=(0.5, 0.25), scale=(2.0, 1.0))
    moved.CreateInput("in", Types.Float2).ConnectToSource(reader.CreateOutput("result", Types.Float2))
    glow = card.texture("G", "./a.png", scale=(0.5, 0.5, 0.5, 1.0), wrapS="repeat", wrapT="repeat")
    glow.CreateInput("st", Types.Float2).ConnectToSource(moved.CreateOutput("result", Types.Float2))
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(card.texture("T", "./a.png"), "rgb"))
    card.surface.CreateInput("emissiveColor", Types.Color3f).ConnectToSource(out(glow, "rgb"))
    scene = card.load()
    (batch,) = scene.batches
    assert (batch.colour_uv, batch.emission_uv, batch.emission_scale[0]) == (0, 1, 0.5)
    assert scene.textures[batch.emission_texture].wrap == ("repeat", "repeat")
    assert scene.more_uvs is not None
    np.testing.assert_allclose(scene.more_uvs[:, :2], scene.uvs * (2.0, 1.0) + (0.5, 0.25))
    assert scene.warnings == ()


def test_three_kinds_of_coordinates_survive_instancing(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[RED, CLEAR]])
    card = Card(tmp_path)
    for role, output, name in (("diffuseColor", "rgb", "st"), ("opacity", "a", "uv1"), ("emissiveColor", "rgb", "uv2")):
        reader = card.shader(f"R{name}", "UsdPrimvarReader_float2", varname=name)
        texture = card.texture(f"T{name}", "./a.png")
        texture.CreateInput("st", Types.Float2).ConnectToSource(reader.CreateOutput("result", Types.Float2))
        kind = Types.Float if role == "opacity" else Types.Color3f
        card.surface.CreateInput(role, kind).ConnectToSource(out(texture, output))
    first = [(0.1, 0.2)] * 3 + [(0.3, 0.4)]
    card.primvar(card.mesh, "uv1", Types.TexCoord2fArray, first, "faceVarying")
    card.primvar(card.mesh, "uv2", Types.TexCoord2fArray, [(0.5, 0.6)], "constant")
    scene = card.load()
    (batch,) = scene.batches
    assert (batch.colour_uv, batch.opacity_uv, batch.emission_uv) == (0, 1, 2)
    assert scene.more_uvs is not None
    np.testing.assert_allclose(sorted(map(tuple, scene.more_uvs[:, :2])), sorted(first), rtol=1e-6)
    np.testing.assert_allclose(scene.more_uvs[:, 2:], [(0.5, 0.6)] * 4, rtol=1e-6)


def test_further_coordinates_are_zero_where_a_batch_reads_none(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[RED, CLEAR]])
    card = Card(tmp_path)
    card.square("/Other", 1.0)
    card.primvar(card.mesh, "uv1", Types.TexCoord2fArray, [(0.5, 0.5)], "constant")
    reader = card.shader("R", "UsdPrimvarReader_float2", varname="uv1")
    second = card.texture("O", "./a.png")
    second.CreateInput("st", Types.Float2).ConnectToSource(reader.CreateOutput("result", Types.Float2))
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(card.texture("T", "./a.png"), "rgb"))
    card.surface.CreateInput("opacity", Types.Float).ConnectToSource(out(second, "a"))
    scene = card.load()
    assert scene.more_uvs is not None
    other = scene.positions[:, 2] == scene.positions[:, 2].max()
    assert not scene.more_uvs[other].any()
    np.testing.assert_array_equal(scene.more_uvs[~other], [(0.5,) * 4] * 4)


def test_missing_coordinates_are_those_there_are_or_the_readers_fallback(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[RED, CLEAR]])
    card = Card(tmp_path)
    texture = card.texture("T", "./a.png")
    reader = card.shader("R", "UsdPrimvarReader_float2", varname="map1")
    texture.CreateInput("st", Types.Float2).ConnectToSource(reader.CreateOutput("result", Types.Float2))
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, "rgb"))
    scene = card.load()
    assert len(np.unique(scene.uvs, axis=0)) == 4
    assert any("'st' is used" in line and "/Card" in line for line in scene.warnings)
    reader.CreateInput("fallback", Types.Float2).Set((0.25, 0.75))
    np.testing.assert_array_equal(card.load().uvs, [(0.25, 0.75)] * 4)


def test_coordinates_that_are_not_connected_are_st_or_else_one_texel(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[RED, RED], [CLEAR, RED]])
    card = Card(tmp_path)
    texture = card.texture("T", "./a.png", connected=False)
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, "rgb"))
    scene = card.load()
    assert len(np.unique(scene.uvs, axis=0)) == 4
    assert any("not connected" in line and "/Looks/M/T" in line for line in scene.warnings)
    UsdGeom.PrimvarsAPI(card.mesh).RemovePrimvar("st")
    np.testing.assert_array_equal(card.load().uvs, [(0.25, 0.25)] * 4)
    texture.CreateInput("st", Types.Float2).Set((1.0, 0.5))
    np.testing.assert_array_equal(card.load().uvs, [(0.75, 0.75)] * 4)


def test_a_missing_texture_is_its_fallback_which_a_primvar_may_give(tmp_path: Path) -> None:
    card = Card(tmp_path)
    texture = card.texture("T", "./none.png")
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, "rgb"))
    card.surface.CreateInput("opacity", Types.Float).ConnectToSource(out(texture, "a"))
    scene = card.load()
    assert any("none.png" in line and "/Looks/M/T" in line for line in scene.warnings)
    # The surface's own defaults, so that a missing file hides nothing: sqrt(0.18) * 255 is 108.
    np.testing.assert_array_equal(scene.colours[0], [108, 108, 108, 255])
    reader = card.shader("R", "UsdPrimvarReader_float4", varname="tint")
    texture.CreateInput("fallback", Types.Float4).ConnectToSource(reader.CreateOutput("result", Types.Float4))
    card.primvar(card.mesh, "tint", Types.Float4Array, [(1.0, 0.0, 0.25, 0.4)], "constant")
    np.testing.assert_array_equal(card.load().colours[0], [255, 0, 128, 102])


def test_udim_tiles_become_one_image_also_inside_a_package(tmp_path: Path) -> None:
    for number, value in ((1002, 50), (1003, 100), (1012, 150)):
        save(tmp_path / f"t.{number}.png", [[(value, 0, 0, 255)] * 4] * 4)
    card = Card(tmp_path)
    texture = card.texture("T", "./t.<UDIM>.png")
    card.surface.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out(texture, "rgb"))
    card.primvar(card.mesh, "st", Types.TexCoord2fArray, [(1, 0), (3, 0), (3, 2), (1, 2)], "vertex")
    scene = card.load()
    (image,) = scene.textures
    np.testing.assert_array_equal(image.pixels[::4, ::4, 0], [[50, 100], [150, 0]])
    np.testing.assert_array_equal(image.pixels[7, 7], 0, "a missing tile is transparent black")
    assert image.wrap == ("black", "black")
    corner = np.isclose(scene.positions[:, :2], 0.5).all(axis=1)
    np.testing.assert_allclose(scene.uvs[corner], [[1.0, 1.0]])
    package = tmp_path / "card.usdz"
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "card.usda")), str(package))
    np.testing.assert_array_equal(load_scene(package).textures[0].pixels, image.pixels)
