"""Which materials a prim and its face subsets are bound to."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdGeom, UsdShade

from renderer.usd.stage import canonical_path


def bindings(prim: Usd.Prim) -> list[tuple[Sdf.Path | None, UsdGeom.Subset | None]]:
    """The path of the prim's own material, or None, with None; then those of its `materialBind` face subsets."""
    bound: list[tuple[Sdf.Path | None, UsdGeom.Subset | None]] = [(_bound_material(prim), None)]
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        bound.append((_bound_material(subset.GetPrim()), subset))
    return bound


def _bound_material(prim: Usd.Prim) -> Sdf.Path | None:
    """Path of the material that a prim is bound to, also if there is none at that path; None if it is unbound.

    A binding for previews goes before one for all purposes, and that before one for full renders. Inside native
    instances it is the prototype's path, so that all instances share the material.
    """
    api = UsdShade.MaterialBindingAPI(prim)
    for purpose in (UsdShade.Tokens.preview, UsdShade.Tokens.full):
        material, _ = api.ComputeBoundMaterial(purpose)
        if material:
            return canonical_path(material.GetPrim())
    while prim and not prim.IsPseudoRoot():
        for purpose in (UsdShade.Tokens.preview, UsdShade.Tokens.allPurpose, UsdShade.Tokens.full):
            targets = UsdShade.MaterialBindingAPI(prim).GetDirectBindingRel(purpose).GetTargets()
            if targets:
                return targets[0]
        prim = prim.GetParent()
    return None
