"""Surfaces that transmit light, as the loader reads them: in every form that people author them in."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from attacks import glbs, make
from pxr import Sdf, UsdGeom
from support.cards import Card, out, put, save

from renderer.convert import stage_file
from renderer.convert_meshes import convert_meshes
from renderer.gltf_materials import document_of
from renderer.inspection import inspect_scene
from renderer.scene import load_scene
from renderer.usd.glass import at_normal
from schemas.colour import encode_gamma2
from schemas.scene import Batch, SceneArrays

TRANSMISSION = "KHR_materials_transmission"
WHITE = (255, 255, 255)


def gamma2(*linear: float) -> tuple[int, ...]:
    return tuple(encode_gamma2(np.array(linear)).tolist())


def only(scene: SceneArrays) -> Batch:
    (batch,) = scene.batches
    return batch


def why(folder: Path) -> str:
    return inspect_scene(folder / "card.usda").materials["/Looks/M"].why


def materialx(folder: Path, kind: str, **inputs: object) -> Card:
    """A card whose surface is a MaterialX node."""
    card = Card(folder)
    card.material.GetSurfaceOutput().ClearSources()
    shader = card.shader("X", f"ND_{kind}_surfaceshader", **inputs)
    card.material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.ConnectableAPI(), "out")
    return card


def test_reflectance_at_normal_incidence() -> None:
    assert at_normal(1.5) == pytest.approx(0.04)
    assert at_normal(1.0) == 0.0
    assert at_normal(0.0) == 1.0, "glTF's metal"
    assert at_normal(1.0 / 1.5) == pytest.approx(at_normal(1.5)), "the same from inside"


def test_opacity_0_is_glass_of_its_index_and_not_of_its_colour(tmp_path: Path) -> None:
    card = Card(tmp_path)
    for key, value in {"opacity": 0.0, "ior": 2.0, "diffuseColor": (1.0, 0.0, 0.0)}.items():
        put(card.surface, key, value)
    scene = card.load()
    assert (only(scene).layer, only(scene).reflectance) == ("transparent", pytest.approx((1.0 / 9.0, 1.0)))
    assert set(map(tuple, scene.colours.tolist())) == {(*WHITE, 0)}
    assert why(tmp_path) == "glass: opacity 0, ior 2, drawn with Fresnel alpha .11 to 1"
    assert scene.warnings == ()


def test_the_specular_workflow_says_what_is_reflected(tmp_path: Path) -> None:
    card = Card(tmp_path)
    for key, value in {"opacity": 0.0, "useSpecularWorkflow": 1, "specularColor": (0.2, 0.3, 0.4)}.items():
        put(card.surface, key, value)
    assert only(card.load()).reflectance == pytest.approx((0.3, 1.0))
    assert "specular 0.3" in why(tmp_path)


def test_an_opacity_texture_that_is_0_everywhere_is_said_to_show_nothing(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(9, 9, 9, 0)] * 2])
    card = Card(tmp_path)
    put(card.surface, "opacity", out(card.texture("T", "a.png"), "a"))
    card.square("/Other")
    assert any("its opacity is 0, nothing of it is drawn: /Card" in line for line in card.load().warnings)


@pytest.mark.parametrize("inputs", [{"opacityMode": "presence"}, {"opacityThreshold": 0.5}])
def test_where_opacity_is_presence_there_is_nothing_and_that_is_said(tmp_path: Path, inputs: dict[str, object]) -> None:
    card = Card(tmp_path)
    card.square("/Other", depth=1.0)
    for key, value in {"opacity": 0.0, **inputs}.items():
        put(card.surface, key, value)
    scene = card.load()
    assert scene.triangles == 2
    assert "its opacity is 0, nothing of it is drawn: /Card" in scene.warnings


def test_read_plainly_or_with_one_alpha_nothing_is_glass(tmp_path: Path) -> None:
    card = Card(tmp_path)
    card.square("/Other", depth=1.0)
    put(card.surface, "opacity", 0.0)
    plain = card.load(glass="plain")
    assert plain.triangles == 2
    assert any("nothing of it is drawn" in line for line in plain.warnings)
    every = card.load(alpha=0.33)
    assert set(every.colours[:, 3].tolist()) == {84}
    assert all(batch.reflectance is None for batch in every.batches)


@pytest.mark.parametrize(
    ("kind", "inputs", "reflectance", "rgba"),
    [
        ("standard_surface", {"transmission": 1.0, "specular_IOR": 2.0}, (1 / 9, 1.0), (*WHITE, 0)),
        ("standard_surface", {"transmission": 1.0, "specular": 0.5}, (0.02, 0.5), (*WHITE, 0)),
        (
            "standard_surface",
            {"transmission": 0.8, "transmission_color": (0.25, 1.0, 0.0)},
            (0.04, 1.0),
            (*gamma2(0.25, 1.0, 0.0), 51),
        ),
        ("standard_surface", {"transmission": 0.2, "base": 1.0}, (0.04, 1.0), (*gamma2(0.8, 0.8, 0.8), 204)),
        (
            "open_pbr_surface",
            {"transmission_weight": 1.0, "transmission_color": (1.0, 0.5, 0.5), "specular_ior": 2.0},
            (1 / 9, 1.0),
            (*gamma2(1.0, 0.5, 0.5), 0),
        ),
        ("open_pbr_surface", {"transmission_weight": 1.0, "specular_weight": 0.5}, (0.02, 1.0), (*WHITE, 0)),
        (
            "gltf_pbr",
            {"transmission": 1.0, "base_color": (0.5, 1.0, 1.0), "attenuation_color": (1.0, 0.5, 1.0)},
            (0.04, 1.0),
            (*gamma2(0.5, 0.5, 1.0), 0),
        ),
        ("gltf_pbr", {"transmission": 1.0, "specular": 0.5, "ior": 2.0}, (1 / 18, 0.5), (*WHITE, 0)),
        (
            # Half of the way at each of two surfaces: .25 ** (2 / (2 * 1)).
            "gltf_pbr",
            {
                "transmission": 1.0,
                "attenuation_color": (0.25, 1.0, 1.0),
                "attenuation_distance": 1.0,
                "thickness": 2.0,
            },
            (0.04, 1.0),
            (*gamma2(0.25, 1.0, 1.0), 0),
        ),
    ],
)
def test_transmission_of_materialx(
    tmp_path: Path, kind: str, inputs: dict[str, object], reflectance: tuple[float, float], rgba: tuple[int, ...]
) -> None:
    scene = materialx(tmp_path, kind, **inputs).load()
    assert only(scene).reflectance == pytest.approx(reflectance)
    assert only(scene).layer == "transparent"
    np.testing.assert_allclose(scene.colours[0].astype(int), rgba, atol=1)
    assert scene.warnings == ()


def test_what_transmits_the_smaller_part_has_its_base_colour_and_its_tints_transmittance(
    tmp_path: Path,
) -> None:
    inputs = {"transmission": 0.25, "base": 0.0, "transmission_color": (1.0, 0.5, 0.0)}
    scene = materialx(tmp_path, "standard_surface", **inputs).load()
    assert only(scene).transmittance == pytest.approx(0.5)
    assert scene.colours[0].tolist() == [0, 0, 0, 191]
    # 1 - 0.96 * 0.25 * 0.5
    assert why(tmp_path) == "glass: transmission 0.25, ior 1.5, drawn with Fresnel alpha .88 to 1"


def test_glass_with_an_opacity_keeps_both(tmp_path: Path) -> None:
    scene = materialx(tmp_path, "standard_surface", transmission=1.0, opacity=(0.5, 0.5, 0.5)).load()
    assert (only(scene).presence, only(scene).layer, scene.colours[0, 3]) == (0.5, "transparent", 0)
    assert why(tmp_path).endswith("alpha .04 to 1, times opacity 0.5")


def test_textures_of_transmission_and_of_presence_differ(tmp_path: Path) -> None:
    save(tmp_path / "a.png", [[(0, 0, 0, 255), (255, 0, 0, 255)]])
    body = materialx(tmp_path, "standard_surface")
    image = body.shader("I", "ND_image_float")
    put(image, "file", Sdf.AssetPath("a.png"))
    put(body.shader("X", "ND_standard_surface_surfaceshader"), "transmission", out(image, "o"))
    batch = only(body.load())
    assert (batch.opacity_scale, batch.opacity_bias, batch.has_presence_texture) == (-1.0, 1.0, False)
    assert batch.layer == "mixed"
    there = materialx(tmp_path, "gltf_pbr", transmission=0.6, alpha_mode=1, alpha_cutoff=0.25)
    image = there.shader("I", "ND_image_float")
    put(image, "file", Sdf.AssetPath("a.png"))
    put(there.shader("X", "ND_gltf_pbr_surfaceshader"), "alpha", out(image, "o"))
    scene = there.load()
    batch = only(scene)
    assert (batch.has_presence_texture, batch.opacity_threshold, batch.layer) == (True, 0.25, "mixed")
    assert scene.colours[0, 3] == 102, "what is not transmitted"
    fact = inspect_scene(tmp_path / "card.usda").materials["/Looks/M"]
    assert fact.kind == "transparent"
    assert "opacity from a.png, channel r, cut out below 0.25" in fact.why


def test_glass_that_glows_is_drawn_without_and_that_is_said(tmp_path: Path) -> None:
    scene = materialx(tmp_path, "gltf_pbr", transmission=1.0, emissive=(1.0, 0.5, 0.0)).load()
    assert scene.colours[0].tolist() == [*WHITE, 0]
    assert any("emission of glass is left out" in line for line in scene.warnings)


def khr(**more: object) -> glbs.Document:
    document = glbs.document()
    document["materials"][0] = {
        "name": "pane",
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]},
        "extensions": {
            TRANSMISSION: {"transmissionFactor": 1, **more},
            "KHR_materials_ior": {"ior": 2.0},
            "KHR_materials_volume": {
                "thicknessFactor": 2.0,
                "attenuationDistance": 1.0,
                "attenuationColor": [1, 0.25, 1],
            },
            "KHR_materials_clearcoat": {"clearcoatFactor": 1},
        },
    }
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    document["cameras"] = [{}]
    return document


def both_ways(folder: Path, data: bytes) -> tuple[SceneArrays, SceneArrays]:
    """A .glb as uploads are converted, and as one's own files are."""
    (folder / "a.glb").write_bytes(data)
    convert_meshes(folder / "a.glb", folder / "own.usdc")
    return load_scene(stage_file(folder, "a.glb", folder / "cache")), load_scene(folder / "own.usdc")


def test_transmission_of_gltf_is_glass_on_every_way(tmp_path: Path) -> None:
    for scene in both_ways(tmp_path, glbs.glb(khr())):
        assert only(scene).reflectance == pytest.approx((1 / 9, 1.0))
        # One of the readers has 8 bits of the base colour.
        np.testing.assert_allclose(scene.colours[0].astype(int), (*gamma2(0.5, 0.25, 1.0), 0), atol=1)
        told = ("cameras are left out", "KHR_materials_clearcoat is left out", "KHR_lights_punctual is left out")
        assert scene.warnings == tuple(f"{line}: the converted file" for line in told)


@pytest.mark.parametrize("name", ["texture.glb", "texture-data.glb"])
def test_images_of_glass_in_gltf_are_sampled(tmp_path: Path, name: str) -> None:
    data = glbs.good(make.png())[name]
    document, start = document_of(data), 28 + struct.unpack_from("<I", data, 12)[0]
    material = document["materials"][0]
    material["extensions"] = {TRANSMISSION: {"transmissionFactor": 0.5, "transmissionTexture": {"index": 0}}}
    material["alphaMode"] = "OPAQUE"
    for scene in both_ways(tmp_path, glbs.glb(document, data[start:])):
        batch = only(scene)
        assert batch.colour_texture >= 0
        assert batch.reflectance == pytest.approx((0.04, 1.0))
        # Red is 128 in all of the image: 0.5 * 128 / 255 of the light goes through.
        assert set(scene.colours[:, 3].tolist()) == {(255 - 64)}


def test_what_a_picture_lacks_is_said_once_for_each_kind(tmp_path: Path) -> None:
    card = Card(tmp_path)
    for number, kind in enumerate(("DistantLight", "DomeLight", "SphereLight", "Volume", "GenerativeProcedural")):
        card.stage.DefinePrim(f"/P{number}", kind)
    card.stage.DefinePrim("/Splats", "ParticleField3DGaussianSplat")
    card.stage.DefinePrim("/Odd", "SomeRenderersOwn")
    proxy = UsdGeom.Cube.Define(card.stage, "/Proxy")
    proxy.CreatePurposeAttr("proxy")
    card.stage.DefinePrim("/Root", "SkelRoot")
    assert sorted(card.load().warnings) == [
        "GenerativeProcedural prims are not drawn: /P4",
        "ParticleField3DGaussianSplat prims are not drawn: /Splats",
        "Volume prims are not drawn: /P3",
        "lights are not used, every scene is lit alike: /P0 (and 2 more)",
        "prims of the unknown type SomeRenderersOwn are not drawn: /Odd",
    ]
