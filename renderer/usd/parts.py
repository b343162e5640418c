"""From a shape and its materials to parts: indexed triangles with final colours, one draw style each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from renderer.usd.materials import DISPLAY, MaterialTable, Sampler, Surface
from renderer.usd.meshes import Shape
from renderer.usd.topology import Attribute, Domain, Topology
from renderer.usd.weld import weld
from schemas.colour import encode_gamma2
from schemas.scene import Batch, Layer

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Part:
    """Triangles of one prim, in its own space, that share textures and layer.

    Attributes:
        positions: float64 [V, 3], stage units.
        normals: float32 [V, 3], unit length.
        uvs: float32 [V, 2].
        colours: uint8 [V, 4] (as SceneArrays.colours).
        triangles: uint32 [T, 3].
        style: Textures and layer; its range is not set.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    colours: NDArray[np.uint8]
    triangles: NDArray[np.uint32]
    style: Batch


def bindings(prim: Usd.Prim) -> list[tuple[Sdf.Path | None, UsdGeom.Subset | None]]:
    """The path of the prim's own material, or None, with None; then those of its `materialBind` face subsets."""
    bound: list[tuple[Sdf.Path | None, UsdGeom.Subset | None]] = [(_bound_material(prim), None)]
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        bound.append((_bound_material(subset.GetPrim()), subset))
    return bound


def _bound_material(prim: Usd.Prim) -> Sdf.Path | None:
    """Path of the material that a prim is bound to, also if there is none at that path; None if it is unbound.

    Inside native instances it is the prototype's path, so that all instances share the material.
    """
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.preview)
    if material:
        return canonical_path(material.GetPrim())
    while prim and not prim.IsPseudoRoot():
        targets = UsdShade.MaterialBindingAPI(prim).GetDirectBindingRel().GetTargets()
        if targets:
            return targets[0]
        prim = prim.GetParent()
    return None


def canonical_path(prim: Usd.Prim) -> Sdf.Path:
    """The prim's path, in its prototype if it is an instance proxy."""
    return (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()


def build_parts(prim: Usd.Prim, shape: Shape, table: MaterialTable, alpha: float | None) -> list[Part]:
    """The parts of one prim.

    Args:
        prim: Where the shape comes from.
        shape: Its geometry.
        table: The stage's materials.
        alpha: Opacity that replaces every constant one, or None.
    """
    parts: list[Part] = []
    for surface, faces in _surfaces(prim, shape, table):
        parts.extend(_SurfaceBuilder(shape, surface, alpha, table).parts(faces))
    return parts


def _surfaces(prim: Usd.Prim, shape: Shape, table: MaterialTable) -> Iterator[tuple[Surface, Mask]]:
    """Each surface with the mask of its triangles; where subsets overlap the last one wins."""
    face_owner = np.zeros(len(shape.topology.counts), dtype=np.int64)
    bound = bindings(prim)
    for number, (_, subset) in enumerate(bound):
        faces = None if subset is None else subset.GetIndicesAttr().Get(table.time)
        if faces is not None:
            wanted = np.asarray(faces, dtype=np.int64)
            face_owner[wanted[(wanted >= 0) & (wanted < len(face_owner))]] = number
    owner = face_owner[shape.topology.face_of_triangle]
    for number, (path, _) in enumerate(bound):
        mask = owner == number
        if np.any(mask):
            yield _surface_of(path, prim, shape, table), mask


def _surface_of(path: Sdf.Path | None, prim: Usd.Prim, shape: Shape, table: MaterialTable) -> Surface:
    surface = table.surface(prim.GetStage(), path) if path is not None else None
    if surface is None:
        if path is None and shape.primvars.read("displayColor", 3) is None:
            table.log.add("no material and no display colour, grey is used", prim.GetPath())
        return DISPLAY
    return surface


class _SurfaceBuilder:
    """Turns the triangles of one surface into parts."""

    def __init__(self, shape: Shape, surface: Surface, alpha: float | None, table: MaterialTable) -> None:
        self._shape = shape
        self._surface = surface
        self._alpha = alpha
        self._log = table.log
        self._colour = self._colour_attribute()
        self._uv = self._uv_attribute()

    def parts(self, mask: Mask) -> Iterator[Part]:
        """One part for each layer among the triangles of `mask`."""
        topology = self._shape.topology
        corner = any(a.domain in ("uniform", "corner") for a in (self._colour, self._uv, self._shape.normals))
        corners = topology.triangles[mask]
        triangles = corners if corner else topology.corners[corners]
        place = topology.corners if corner else np.arange(topology.points)
        positions = self._shape.points[place]
        triangles = triangles[~degenerate(positions, triangles)]
        target = _target(corner)
        colours = topology.spread(self._colour, target)
        textured, cut_out = self._surface.opacity_sampler is not None, self._surface.threshold > 0.0
        for layer, kept in layers(colours[:, 3][triangles], textured, cut_out):
            if np.any(kept):
                yield self._part(positions, colours, triangles[kept], topology, corner, layer)

    def _part(
        self,
        positions: NDArray[np.float64],
        colours: NDArray[np.float32],
        triangles: NDArray[np.int64],
        topology: Topology,
        corner: bool,
        layer: Layer,
    ) -> Part:
        used = np.zeros(len(positions), dtype=bool)
        used[triangles] = True
        target = _target(corner)
        columns = (
            positions[used],
            topology.spread(self._shape.normals, target)[used],
            topology.spread(self._uv, target)[used],
            colours[used].astype(np.uint8),
        )
        triangles = (np.cumsum(used) - 1)[triangles]
        if corner:
            kept, number = weld(columns)
            columns = (columns[0][kept], columns[1][kept], columns[2][kept], columns[3][kept])
            triangles = number[triangles]
        return Part(*columns, triangles.astype(np.uint32), self._style(layer))

    def _colour_attribute(self) -> Attribute:
        """Stored RGBA, 0..255 as float32 rows, in the finest domain of colour and opacity."""
        rgb = self._rgb()
        alpha = self._opacity()
        order = ("constant", "vertex", "uniform", "corner")
        domain = max(rgb.domain, alpha.domain, key=order.index)
        if {rgb.domain, alpha.domain} == {"vertex", "uniform"}:
            domain = "corner"
        if domain in ("vertex", "corner"):
            spread = self._shape.topology.spread
            target = _target(domain == "corner")
            return Attribute(np.concatenate((spread(rgb, target), spread(alpha, target)), axis=1), domain)
        rows = max(len(rgb.values), len(alpha.values))
        parts = [np.broadcast_to(a.values, (rows, a.values.shape[1])) for a in (rgb, alpha)]
        return Attribute(np.concatenate(parts, axis=1), domain)

    def _rgb(self) -> Attribute:
        surface = self._surface
        if surface.colour_sampler is not None:
            return Attribute(np.full((1, 3), 255.0, dtype=np.float32), "constant")
        found = self._shape.primvars.read(surface.colour_primvar, 3) if surface.colour_primvar else None
        if found is None:
            found = Attribute(np.array([surface.colour], dtype=np.float32), "constant")
        linear = np.clip(found.values, 0.0, 1.0) + np.array(surface.emission)
        return Attribute(encode_gamma2(linear).astype(np.float32), found.domain)

    def _opacity(self) -> Attribute:
        """Stored alpha; where a texture gives the opacity, what it multiplies."""
        surface = self._surface
        solid = 1.0 if self._alpha is None else self._alpha
        if surface.opacity_sampler is not None:
            return _stored(np.array([[solid]]), "constant")
        found = self._shape.primvars.read(surface.opacity_primvar, 1) if surface.opacity_primvar else None
        if found is None:
            found = Attribute(np.array([[surface.opacity]], dtype=np.float32), "constant")
        if surface.threshold > 0.0:
            return _stored(np.where(found.values < surface.threshold, 0.0, solid), found.domain)
        if self._alpha is not None:
            return _stored(np.array([[self._alpha]]), "constant")
        return _stored(found.values, found.domain)

    def _samplers(self) -> list[Sampler]:
        both = (self._surface.colour_sampler, self._surface.opacity_sampler)
        return [sampler for sampler in both if sampler is not None]

    def _uv_attribute(self) -> Attribute:
        samplers = self._samplers()
        if not samplers:
            return Attribute(np.zeros((1, 2), dtype=np.float32), "constant")
        first = samplers[0]
        prim = self._shape.primvars.prim
        if any((s.uv, s.uv_transform) != (first.uv, first.uv_transform) for s in samplers):
            self._log.add("opacity has texture coordinates of its own, the colour's are used", prim.GetPath())
        found = self._shape.primvars.read(first.uv, 2)
        if found is None:
            other = self._shape.primvars.texture_coordinates()
            instead = f"'{other}' is used" if other else "the texture's centre is used"
            self._log.add(f"there are no texture coordinates '{first.uv}', {instead}", prim.GetPath())
            found = self._shape.primvars.read(other, 2) if other else None
        if found is None:
            found = Attribute(np.full((1, 2), 0.5, dtype=np.float32), "constant")
        matrix = np.array(first.uv_transform)
        moved = found.values.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
        return Attribute(moved.astype(np.float32), found.domain)

    def _style(self, layer: Layer) -> Batch:
        style = Batch(first=0, count=0, layer=layer)
        colour, opacity = self._surface.colour_sampler, self._surface.opacity_sampler
        if colour is not None:
            glow = (*self._surface.emission, 0.0)
            bias = tuple(b + e for b, e in zip(colour.bias, glow, strict=True))
            style = replace(
                style,
                colour_texture=colour.texture,
                colour_scale=colour.scale,
                colour_bias=(bias[0], bias[1], bias[2], bias[3]),
            )
        if opacity is not None:
            style = replace(
                style,
                opacity_texture=opacity.texture,
                opacity_channel=opacity.channel,
                opacity_scale=opacity.scale[opacity.channel],
                opacity_bias=opacity.bias[opacity.channel],
                opacity_threshold=max(self._surface.threshold, 0.0),
            )
        return style


def _target(corner: bool) -> Literal["vertex", "corner"]:
    return "corner" if corner else "vertex"


def _stored(opacity: NDArray[np.floating], domain: Domain) -> Attribute:
    stored = np.floor(np.clip(opacity, 0.0, 1.0) * 255.0 + 0.5)
    return Attribute(stored.astype(np.float32), domain)


def degenerate(positions: NDArray[np.float64], triangles: NDArray[np.int64]) -> Mask:
    """Which triangles have no area, bool [T]."""
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    return np.asarray(~np.any(np.cross(b - a, c - a), axis=1))


def layers(alpha: NDArray[np.floating], textured: bool, cut_out: bool) -> Iterator[tuple[Layer, Mask]]:
    """Masks of the triangles of each layer; triangles that show nothing are in none.

    Args:
        alpha: Stored alpha of the corners, 0..255 [T, 3].
        textured: Whether a texture gives the opacity.
        cut_out: Whether that texture only decides, by a threshold, which fragments are there at all.
    """
    low, high = alpha.min(axis=1, initial=255.0), alpha.max(axis=1, initial=0.0)
    if textured and cut_out:
        # What a cut-out leaves of an opaque surface is opaque: no transparent pass needs to see it.
        yield "opaque", low == 255
        yield "mixed", (low < 255) & (high > 0)
        return
    if textured:
        yield "mixed", high > 0
        return
    yield "opaque", low == 255
    yield "transparent", (low > 0) & (high < 255)
    # Interpolation between opaque or invisible corners and others makes fragments of every kind.
    yield "mixed", ~((low == 255) | (high == 0) | ((low > 0) & (high < 255)))
