"""Textures as the shaders sample them against plain float64 sampling."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import moderngl
import numpy as np
import pytest
from support import sampling

from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from schemas.scene import Batch, SceneArrays, Texture, Wrap
from schemas.view import View

WRAPS: tuple[Wrap, ...] = ("repeat", "clamp", "mirror", "black")
SIDE = 8
"""Texels a side of the textures."""
LOW, HIGH = -1.5, 2.5
"""Texture coordinates at the card's edges, both ways."""
UNITS = int(HIGH - LOW)


def texture(wrap: tuple[Wrap, Wrap] = ("repeat", "repeat"), srgb: bool = False, seed: int = 3) -> Texture:
    pixels = np.random.default_rng(seed).integers(0, 256, (SIDE, SIDE, 4)).astype(np.uint8)
    return Texture("noise", pixels, srgb, wrap)


def card(
    batch: Batch, textures: tuple[Texture, ...], vertex: int = 255, more_uvs: np.ndarray | None = None
) -> SceneArrays:
    """A square of two units that faces +z and has texture coordinates LOW..HIGH."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float32)
    return SceneArrays(
        name="card",
        positions=positions,
        normals=np.tile(np.array([[0, 0, 1]], dtype=np.float32), (4, 1)),
        uvs=(0.5 * (positions[:, :2] + 1.0) * UNITS + LOW).astype(np.float32),
        colours=np.tile(np.array([[255, 255, 255, vertex]], dtype=np.uint8), (4, 1)),
        indices=np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32),
        batches=(replace(batch, first=0, count=6),),
        textures=textures,
        origin=np.zeros(3),
        bounds=np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
        more_uvs=more_uvs,
    )


def frame_of(gl: moderngl.Context, scene: SceneArrays, pixels: int) -> Frame:
    """A picture of the card and nothing else, `pixels` a side."""
    view = View(name="front", eye=(0, 0, 2), target=(0, 0, 0), up=(0, 1, 0), ortho_height=2.0)
    return Frame(GpuScene(gl, scene), view, pixels, pixels)


def coordinates(pixels: int) -> list[tuple[float, float]]:
    """Texture coordinates at the pixels' centres, row 0 at the top."""
    places = [LOW + UNITS * (i + 0.5) / pixels for i in range(pixels)]
    return [(u, v) for v, u in product(reversed(places), places)]


def alphas(frame: Frame) -> np.ndarray:
    """Alpha of the transparent fragment of each pixel, 0..255; 0 where there is none."""
    dump = capture(frame).dump
    found = np.zeros(frame.pixels, dtype=int)
    counts = np.diff(dump.offsets)
    assert counts.max() <= 1
    found[counts == 1] = dump.rgba[:, 3]
    return found


def colours(frame: Frame) -> np.ndarray:
    """Stored colours of an opaque picture, 0..255 [P, 3]."""
    return np.frombuffer(frame.background.read(), dtype=np.uint8).reshape(-1, 4)[:, :3].astype(int)


def stored(albedo: np.ndarray) -> np.ndarray:
    """What the shading of a surface that faces an orthographic eye makes of linear colours, 0..255."""
    light = np.array([-0.5, 0.8, 0.9]) / np.linalg.norm([-0.5, 0.8, 0.9])
    half = light + np.array([0.0, 0.0, 1.0])
    highlight = (half[2] / np.linalg.norm(half)) ** 32
    lit = albedo * (0.25 + 0.3 * 0.5 + 0.6 * light[2]) + 0.25 * highlight
    return np.sqrt(np.clip(lit, 0.0, 1.0)) * 255.0


MIXED = Batch(0, 0, "mixed", opacity_texture=0, opacity_channel=1)
COLOURED = Batch(0, 0, "opaque", colour_texture=0)


@pytest.mark.parametrize("wrap", list(product(WRAPS, WRAPS)), ids="-".join)
def test_every_pair_of_wrap_modes_at_texel_centres(gl: moderngl.Context, wrap: tuple[Wrap, Wrap]) -> None:
    """One pixel is one texel, so the value is a texel's, or zero."""
    image = texture(wrap)
    side = SIDE * UNITS
    found = alphas(frame_of(gl, card(MIXED, (image,), vertex=254), side))
    wanted = [round(254 * sampling.alpha(MIXED, image, u, v, 1.0)) for u, v in coordinates(side)]
    np.testing.assert_allclose(found, wanted, atol=1)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("zoom", [2, 5])
def test_between_texels_and_across_edges(gl: moderngl.Context, wrap: Wrap, zoom: int) -> None:
    """Magnified: bilinear also between the last texel and what the wrap mode puts beside it."""
    image = texture((wrap, wrap))
    side = SIDE * UNITS * zoom
    found = alphas(frame_of(gl, card(MIXED, (image,), vertex=254), side))
    wanted = [254 * sampling.alpha(MIXED, image, u, v, 1.0) for u, v in coordinates(side)]
    # Texture units interpolate with 8 bits of fraction.
    np.testing.assert_allclose(found, wanted, atol=2.5)


@pytest.mark.parametrize("wrap", WRAPS)
def test_a_smaller_picture_reads_the_next_mipmap_level_also_at_folds(gl: moderngl.Context, wrap: Wrap) -> None:
    image = texture((wrap, wrap))
    side = SIDE * UNITS // 2
    found = alphas(frame_of(gl, card(MIXED, (image,), vertex=254), side))
    halved = image.pixels.reshape(SIDE // 2, 2, SIDE // 2, 2, 4).mean(axis=(1, 3))
    level = replace(image, pixels=halved)
    wanted = [254 * sampling.alpha(MIXED, level, u, v, 1.0) for u, v in coordinates(side)]
    np.testing.assert_allclose(found, wanted, atol=2.5)


@pytest.mark.parametrize("srgb", [False, True])
@pytest.mark.parametrize("wrap", ["repeat", "black"])
@pytest.mark.parametrize("zoom", [1, 3])
def test_colours_are_decoded_then_filtered_scaled_and_offset(
    gl: moderngl.Context, wrap: Wrap, srgb: bool, zoom: int
) -> None:
    scale, bias = (1.5, 0.5, -1.0, 1.0), (-0.2, 0.3, 1.0, 0.0)
    image = texture((wrap, wrap), srgb)
    batch = replace(COLOURED, colour_scale=scale, colour_bias=bias)
    side = SIDE * UNITS * zoom
    found = colours(frame_of(gl, card(batch, (image,)), side))
    albedo = [sampling.colour(image, u, v, np.array(scale), np.array(bias)) for u, v in coordinates(side)]
    # Texture units decode sRGB about to 8 bits and interpolate with 8 bits of fraction.
    np.testing.assert_allclose(found, stored(np.array(albedo)), atol=2.0 if srgb or zoom > 1 else 1.0)


@pytest.mark.parametrize("left", [1.0, 0.4])
def test_thresholds_keep_exactly_what_is_not_below_them(gl: moderngl.Context, left: float) -> None:
    image = texture(("mirror", "black"))
    # A texel's own value is the threshold: it stays.
    threshold = float(np.median(image.pixels[..., 2])) // 1 / 255.0
    batch = Batch(0, 0, "mixed", opacity_texture=0, opacity_channel=2, opacity_threshold=threshold, cut_out_alpha=left)
    side = SIDE * UNITS
    frame = frame_of(gl, card(batch, (image,)), side)
    wanted = np.array([sampling.alpha(batch, image, u, v, 1.0) for u, v in coordinates(side)])
    assert 0 < np.count_nonzero(wanted) < wanted.size
    if left == 1.0:
        assert np.array_equal((colours(frame) < 255).any(axis=1), wanted == 1.0)
    else:
        assert np.array_equal(alphas(frame), np.round(255 * wanted))


def test_a_threshold_without_a_texture_tests_the_interpolated_alpha(gl: moderngl.Context) -> None:
    batch = Batch(0, 0, "opaque", opacity_threshold=0.5)
    scene = card(batch, ())
    scene.colours[:, 3] = [0, 255, 255, 0]
    covered = (colours(frame_of(gl, scene, 64)) < 255).any(axis=1).reshape(64, 64)
    assert covered[:, 32:].all()
    assert not covered[:, :32].any()


def test_colour_opacity_and_emission_have_coordinates_of_their_own(gl: moderngl.Context) -> None:
    images = (texture(seed=1), texture(("mirror", "mirror"), seed=2), texture(("black", "clamp"), seed=3))
    batch = Batch(
        *(0, 0, "mixed"),
        colour_texture=0,
        opacity_texture=1,
        opacity_channel=0,
        opacity_uv=1,
        opacity_threshold=0.3,
        emission_texture=2,
        emission_scale=(0.5, 0.5, 0.5, 1.0),
        emission_uv=2,
    )
    scene = card(batch, images)
    turned, moved = scene.uvs[:, ::-1] * (1, -1), scene.uvs + np.array([0.5, 1.0])
    side = SIDE * UNITS
    frame = frame_of(gl, replace(scene, more_uvs=np.concatenate((turned, moved), axis=1).astype(np.float32)), side)
    albedo, there = [], []
    for u, v in coordinates(side):
        base = sampling.colour(images[0], u, v, np.ones(4), np.zeros(4))
        glow = sampling.colour(images[2], u + 0.5, v + 1.0, np.full(4, 0.5), np.zeros(4))
        albedo.append(np.minimum(base + glow, 1.0))
        there.append(sampling.alpha(batch, images[1], v, -u, 1.0) > 0.0)
    kept = np.array(there)
    assert 0 < np.count_nonzero(kept) < kept.size
    np.testing.assert_allclose(colours(frame)[kept], stored(np.array(albedo))[kept], atol=1.0)
    assert (colours(frame)[~kept] == 255).all()
