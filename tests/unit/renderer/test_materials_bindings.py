"""Which material a face has: purposes, collections, strength, subsets, missing materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, Vt
from support.cards import Card, Types, bind


def look(card: Card, name: str, red: float) -> UsdShade.Material:
    """A material whose stored red is round(255 * sqrt(red))."""
    material = UsdShade.Material.Define(card.stage, f"/Looks/{name}")
    shader = UsdShade.Shader.Define(card.stage, f"/Looks/{name}/S")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Types.Color3f).Set((red, 0.0, 0.0))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def reds(card: Card) -> list[int]:
    return sorted(set(card.load().colours[:, 0].tolist()))


def test_a_preview_binding_goes_before_all_purposes_and_that_before_full(tmp_path: Path) -> None:
    card = Card(tmp_path)
    api = UsdShade.MaterialBindingAPI(card.mesh)
    api.UnbindAllBindings()
    for purpose, red, stored in (("full", 0.04, 51), ("allPurpose", 0.16, 102), ("preview", 0.36, 153)):
        token = getattr(UsdShade.Tokens, purpose)
        api.Bind(look(card, purpose, red), materialPurpose=token)
        assert reds(card) == [stored]


@pytest.mark.parametrize(("strength", "stored"), [("weakerThanDescendants", 51), ("strongerThanDescendants", 102)])
def test_an_ancestors_binding_may_be_stronger(tmp_path: Path, strength: str, stored: int) -> None:
    card = Card(tmp_path)
    card.stage.RemovePrim("/Card")
    group = UsdGeom.Xform.Define(card.stage, "/Group")
    bind(card.square("/Group/Card"), look(card, "Own", 0.04))
    api = UsdShade.MaterialBindingAPI.Apply(group.GetPrim())
    api.Bind(look(card, "Theirs", 0.16), bindingStrength=getattr(UsdShade.Tokens, strength))
    assert reds(card) == [stored]


def test_collections_bind_their_members(tmp_path: Path) -> None:
    card = Card(tmp_path)
    card.stage.RemovePrim("/Card")
    group = UsdGeom.Xform.Define(card.stage, "/Group")
    card.square("/Group/In")
    card.square("/Group/Out", 1.0)
    members = Usd.CollectionAPI.Apply(group.GetPrim(), "some")
    members.CreateIncludesRel().AddTarget("/Group/In")
    api = UsdShade.MaterialBindingAPI.Apply(group.GetPrim())
    api.Bind(look(card, "All", 0.04))
    api.Bind(members, look(card, "Some", 0.16))
    scene = card.load()
    inside = scene.positions[:, 2] < 0
    assert set(scene.colours[inside, 0].tolist()) == {102}
    assert set(scene.colours[~inside, 0].tolist()) == {51}


def faces(card: Card) -> UsdGeom.Mesh:
    """Four triangles in a row instead of the square."""
    card.stage.RemovePrim("/Card")
    mesh = UsdGeom.Mesh.Define(card.stage, "/Row")
    points = [(float(i // 2 + (i % 2) * 0.5), float(i % 2), 0.0) for i in range(6)]
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([3] * 4)
    mesh.CreateFaceVertexIndicesAttr([0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5])
    mesh.CreateSubdivisionSchemeAttr("none")
    bind(mesh, look(card, "Rest", 0.04))
    return mesh


def subset(card: Card, mesh: UsdGeom.Mesh, name: str, indices: list[int], red: float | None) -> None:
    made = UsdGeom.Subset.CreateGeomSubset(mesh, name, "face", Vt.IntArray(indices), "materialBind")
    if red is not None:
        UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(look(card, name, red))


def by_face(card: Card) -> list[int]:
    """Stored red of each face, left to right."""
    scene = card.load()
    corners = scene.indices.reshape(-1, 3)
    order = np.argsort(scene.positions[corners][:, :, 0].mean(axis=1))
    return scene.colours[corners[order, 0], 0].tolist()


def test_subsets_paint_their_faces_and_faces_that_do_not_exist_are_named(tmp_path: Path) -> None:
    card = Card(tmp_path)
    mesh = faces(card)
    subset(card, mesh, "Second", [1], 0.16)
    subset(card, mesh, "Last", [3, 4, -1], 0.36)
    assert by_face(card) == [51, 102, 51, 153]
    assert [w for w in card.load().warnings if "2 of its faces do not exist" in w and "/Row/Last" in w]


def test_subsets_of_other_families_and_unbound_ones_leave_the_meshs_material(tmp_path: Path) -> None:
    card = Card(tmp_path)
    mesh = faces(card)
    other = UsdGeom.Subset.CreateGeomSubset(mesh, "Other", "face", Vt.IntArray([0]), "anything")
    UsdShade.MaterialBindingAPI.Apply(other.GetPrim()).Bind(look(card, "Other", 0.36))
    subset(card, mesh, "Unbound", [1], None)
    assert by_face(card) == [51] * 4


def test_a_missing_material_is_named_for_any_purpose(tmp_path: Path) -> None:
    card = Card(tmp_path)
    api = UsdShade.MaterialBindingAPI(card.mesh)
    api.UnbindAllBindings()
    card.mesh.GetPrim().CreateRelationship("material:binding:full").SetTargets(["/Looks/Gone"])
    card.mesh.CreateDisplayColorAttr([(0.0, 1.0, 0.0)])
    scene = card.load()
    np.testing.assert_array_equal(scene.colours[0], [0, 255, 0, 255])
    assert any("missing" in w and "/Looks/Gone" in w for w in scene.warnings)


def test_a_material_without_a_surface_is_named(tmp_path: Path) -> None:
    card = Card(tmp_path)
    bind(card.mesh, UsdShade.Material.Define(card.stage, "/Looks/Empty"))
    scene = card.load()
    assert any("no surface" in w and "/Looks/Empty" in w for w in scene.warnings)
    assert set(scene.colours[:, 3].tolist()) == {255}
