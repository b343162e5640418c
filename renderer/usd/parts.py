"""From a shape and its materials to parts: indexed triangles with final colours, one draw style each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

from renderer.usd.attributes import SurfaceAttributes, target_of
from renderer.usd.bindings import bindings
from renderer.usd.materials import DISPLAY, MaterialTable
from renderer.usd.shape import Shape, integers
from renderer.usd.surfaces import Surface
from renderer.usd.topology import area_vectors
from renderer.usd.weld import weld
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
        more_uvs: float32 [V, 4], as SceneArrays.more_uvs, where the style reads them.
        surface: What decided all that.
        material: What it is bound to, supported or not; None if it is unbound.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    colours: NDArray[np.uint8]
    triangles: NDArray[np.uint32]
    style: Batch
    more_uvs: NDArray[np.float32] | None = None
    surface: Surface = DISPLAY
    material: Sdf.Path | None = None


def build_parts(prim: Usd.Prim, shape: Shape, table: MaterialTable, alpha: float | None) -> list[Part]:
    """The parts of one prim.

    Args:
        prim: Where the shape comes from.
        shape: Its geometry.
        table: The stage's materials.
        alpha: Opacity that replaces every constant one, or None.
    """
    parts: list[Part] = []
    for material, surface, faces in _surfaces(prim, shape, table):
        attributes = SurfaceAttributes(shape, surface, alpha, table)
        made = _PartBuilder(shape, surface, attributes, table).parts(faces)
        parts.extend(replace(part, surface=surface, material=material) for part in made)
    return parts


def _surfaces(prim: Usd.Prim, shape: Shape, table: MaterialTable) -> Iterator[tuple[Sdf.Path | None, Surface, Mask]]:
    """Each material and surface with the mask of its triangles; where subsets overlap the last one wins."""
    face_owner = np.zeros(shape.elements, dtype=np.int64)
    bound = bindings(prim)
    for owner, (_, subset) in enumerate(bound):
        faces = None if subset is None else subset.GetIndicesAttr().Get(table.time)
        if faces is not None:
            wanted = integers(faces)
            there = (wanted >= 0) & (wanted < len(face_owner))
            if subset is not None and not there.all():
                table.log.add(f"{np.count_nonzero(~there)} of its faces do not exist; ignored", subset.GetPath())
            face_owner[wanted[there]] = owner
    owner_of_triangle = face_owner[shape.element_of_triangle]
    for owner, (path, _) in enumerate(bound):
        mask = owner_of_triangle == owner
        if np.any(mask):
            yield path, _surface_of(path, prim, shape, table), mask


def _surface_of(path: Sdf.Path | None, prim: Usd.Prim, shape: Shape, table: MaterialTable) -> Surface:
    surface = table.surface(prim.GetStage(), path) if path is not None else None
    if surface is None:
        if path is None and shape.primvars.read("displayColor", 3) is None:
            table.log.add("no material and no display colour, grey is used", prim.GetPath())
        return DISPLAY
    return surface


class _PartBuilder:
    """Turns the triangles of one surface into parts."""

    def __init__(self, shape: Shape, surface: Surface, attributes: SurfaceAttributes, table: MaterialTable) -> None:
        self._shape = shape
        self._surface = surface
        self._attributes = attributes
        self._textures, self._log = table.textures, table.log
        every = (attributes.colour, shape.normals, *attributes.uv_sets)
        self._corner = any(a.domain in ("uniform", "corner") for a in every)

    def parts(self, mask: Mask) -> Iterator[Part]:
        """One part for each layer among the triangles of `mask`."""
        topology, of = self._shape.topology, self._attributes
        corners = topology.triangles[mask]
        triangles = corners if self._corner else topology.corners[corners]
        place = topology.corners if self._corner else np.arange(topology.points)
        positions = self._shape.points[place]
        triangles = triangles[~degenerate(positions, triangles)]
        colours = topology.spread(of.colour, target_of(self._corner))
        alpha = colours[:, 3][triangles]
        if of.glass is not None:
            found = list(layers_of_glass(alpha, of.opacity.sampler is not None, of.glass.presence))
        else:
            cut_out = of.solid if of.threshold > 0.0 else None
            found = list(layers(alpha, of.opacity.sampler is not None, cut_out))
        if len(triangles) and not any(np.any(kept) for _, kept in found):
            self._log.add("its opacity is 0, nothing of it is drawn", self._shape.primvars.prim.GetPath())
        for layer, kept in found:
            if np.any(kept):
                yield self._part(positions, colours, triangles[kept], layer)

    def _part(
        self,
        positions: NDArray[np.float64],
        colours: NDArray[np.float32],
        triangles: NDArray[np.int64],
        layer: Layer,
    ) -> Part:
        used = np.zeros(len(positions), dtype=bool)
        used[triangles] = True
        rows = slice(None) if used.all() else used
        spread, target = self._shape.topology.spread, target_of(self._corner)
        uvs = [spread(uv, target)[rows] for uv in self._attributes.uv_sets]
        columns: list[NDArray[Any]] = [
            positions[rows],
            spread(self._shape.normals, target)[rows],
            uvs[0] if uvs else np.zeros((int(used.sum()), 2), dtype=np.float32),
            colours[rows].astype(np.uint8),
        ]
        if len(uvs) > 1:
            columns.append(np.concatenate((uvs[1], uvs[-1]), axis=1))
        if isinstance(rows, np.ndarray):
            triangles = (np.cumsum(used) - 1)[triangles]
        if self._corner:
            kept, number = weld(columns)
            columns = [column[kept] for column in columns]
            triangles = number[triangles]
        return Part(
            positions=columns[0],
            normals=columns[1],
            uvs=columns[2],
            colours=columns[3],
            triangles=triangles.astype(np.uint32),
            style=self._style(layer),
            more_uvs=columns[4] if len(uvs) > 1 else None,
        )

    def _style(self, layer: Layer) -> Batch:
        of, textures = self._attributes, self._textures
        style = Batch(first=0, count=0, layer=layer)
        if of.threshold > 0.0:
            style = replace(style, opacity_threshold=of.threshold, cut_out_alpha=of.solid)
        if of.glass is not None:
            style = replace(
                style,
                reflectance=of.glass.reflectance,
                transmittance=of.glass.transmittance,
                presence=of.glass.presence,
                has_presence_texture=of.glass.has_presence,
            )
        colour, opacity, emission = self._surface.colour, of.opacity, self._surface.emission
        if colour.sampler is not None:
            style = replace(
                style,
                colour_texture=textures.colour(colour.sampler.file, colour.sampler.wrap, colour.channel),
                colour_scale=colour.scale,
                colour_bias=colour.plus((*of.glow, 0.0)).bias,
                colour_uv=of.set_of(colour.sampler),
            )
        if opacity.sampler is not None:
            channel = opacity.number_channel
            style = replace(
                style,
                opacity_texture=textures.opacity(opacity.sampler.file, opacity.sampler.wrap, channel),
                opacity_channel=channel,
                opacity_scale=opacity.number_scale,
                opacity_bias=opacity.number_bias,
                opacity_uv=of.set_of(opacity.sampler),
            )
        if emission.sampler is not None:
            style = replace(
                style,
                emission_texture=textures.colour(emission.sampler.file, emission.sampler.wrap, emission.channel),
                emission_scale=emission.scale,
                emission_bias=emission.bias,
                emission_uv=of.set_of(emission.sampler),
            )
        return style


def degenerate(positions: NDArray[np.float64], triangles: NDArray[np.int64]) -> Mask:
    """Which triangles have no area, bool [T].

    Args:
        positions: float64 [P, 3], points in any one unit.
        triangles: int64 [T, 3], indices of points.
    """
    return np.asarray(~np.any(area_vectors(positions, triangles), axis=1))


def layers(alpha: NDArray[np.floating], textured: bool, cut_out: float | None) -> Iterator[tuple[Layer, Mask]]:
    """Masks of the triangles of each layer; triangles that show nothing are in none.

    Args:
        alpha: Stored alpha of the corners, 0..255 [T, 3].
        textured: Whether a texture gives the opacity.
        cut_out: Alpha of the fragments that a threshold leaves, where fragments must be tested; else None.
    """
    low, high = alpha.min(axis=1, initial=255.0), alpha.max(axis=1, initial=0.0)
    if cut_out is not None:
        # What a cut-out leaves of an opaque surface is opaque: no transparent pass needs to see it.
        yield "opaque" if cut_out >= 1.0 else "mixed", high > 0
        return
    if textured:
        yield "mixed", high > 0
        return
    yield "opaque", low == 255
    yield "transparent", (low > 0) & (high < 255)
    # Interpolation between opaque or invisible corners and others makes fragments of every kind.
    yield "mixed", ~((low == 255) | (high == 0) | ((low > 0) & (high < 255)))


def layers_of_glass(body: NDArray[np.floating], textured: bool, presence: float) -> Iterator[tuple[Layer, Mask]]:
    """The same for glass, which a share of 0 that does not go through leaves visible.

    Args:
        body: Stored share of light that is not transmitted, of the corners, 0..255 [T, 3].
        textured: Whether a texture gives the presence, or that share.
        presence: Opacity of all of it.
    """
    there = round(255.0 * presence)
    if textured or there < 255:
        yield "mixed" if textured else "transparent", np.full(len(body), there > 0)
        return
    low, high = body.min(axis=1, initial=255.0), body.max(axis=1, initial=0.0)
    yield "opaque", low == 255
    yield "transparent", high < 255
    yield "mixed", (low < 255) & (high == 255)
