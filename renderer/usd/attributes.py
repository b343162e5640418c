"""What a surface's drivers are on one shape: vertex colours, texture coordinates, and the opacity that is left."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.drivers import Driver, Sampler, Vec3, number
from renderer.usd.materials import MaterialTable
from renderer.usd.shape import Shape
from renderer.usd.surfaces import Glass, Surface
from renderer.usd.topology import Attribute, Domain
from schemas.colour import encode_gamma2

UvKey = tuple[str, tuple[Vec3, Vec3], tuple[float, float] | None]
"""What makes a sampler's texture coordinates differ from another's: primvar, transform, what stands in for it."""


class SurfaceAttributes:
    """One surface on one shape.

    Args:
        shape: The geometry.
        surface: Its material.
        alpha: Opacity that replaces every constant one, or None.
        table: Gets the images and the warnings.

    Attributes:
        opacity: What drives the opacity; without a texture that is the same everywhere.
        threshold: Of a cut-out whose fragments must be tested; else 0.
        glass: What makes it glass, or None.
        colour: Stored RGBA, 0..255 as float32 rows; a texture multiplies it.
        uv_sets: Texture coordinates, transformed: one for each kind that the samplers read, at most three.
    """

    def __init__(self, shape: Shape, surface: Surface, alpha: float | None, table: MaterialTable) -> None:
        self._shape = shape
        self._table = table
        self._surface = surface
        self._alpha = alpha
        self._uvs: dict[UvKey, Attribute] = {}
        self.threshold = max(surface.threshold, 0.0)
        self.opacity = self._settled(surface.opacity)
        self.glass = surface.glass
        if self.glass is not None and self.glass.has_presence and self.opacity.is_constant:
            self._settle_presence(self.glass)
        self.colour = self._colour_attribute()
        samplers = [driver.sampler for driver in (surface.colour, self.opacity, surface.emission) if driver.sampler]
        self._keys = list(dict.fromkeys(uv_key(sampler) for sampler in samplers))
        for sampler in samplers:
            self._coordinates(sampler)
        self.uv_sets = [self._uvs[key] for key in self._keys]

    @property
    def solid(self) -> float:
        """Opacity of what is not transparent by itself."""
        return 1.0 if self._alpha is None else self._alpha

    @property
    def glow(self) -> Vec3:
        """Linear RGB of an emission that is constant."""
        emission = self._surface.emission
        if emission.primvar is not None:
            self._table.log.add("emission from a primvar is left out", self._shape.primvars.prim.GetPath())
        return emission.rgb if emission.is_constant else (0.0, 0.0, 0.0)

    def set_of(self, sampler: Sampler) -> int:
        """Which of `uv_sets` a sampler reads."""
        return self._keys.index(uv_key(sampler))

    def _settled(self, opacity: Driver) -> Driver:
        """The opacity, without its texture where that is the same everywhere: most often for want of an alpha."""
        if opacity.sampler is None:
            return opacity
        image = self._table.textures.load(opacity.sampler.file)
        low, high = self._table.textures.channel_range(opacity.sampler.file, opacity.number_channel)
        if (opacity.number_channel < 3 or image.has_alpha) and self._reaches_border(opacity.sampler):
            low, high = min(low, 0.0), max(high, 0.0)
        ends = [min(max(opacity.number_scale * x + opacity.number_bias, 0.0), 1.0) for x in (low, high)]
        return number(ends[0]) if ends[0] == ends[1] else opacity

    def _settle_presence(self, glass: Glass) -> None:
        """Of glass whose presence comes from a texture that is the same everywhere."""
        there = self.opacity.number_bias
        if self.threshold > 0.0:
            there, self.threshold = float(there >= self.threshold), 0.0
        self.glass = replace(glass, presence=there, has_presence=False)
        self.opacity = number(glass.body)

    def _reaches_border(self, sampler: Sampler) -> bool:
        """Whether texture coordinates leave the image where black is around it."""
        values = self._coordinates(sampler).values
        outside = np.any((values < 0.0) | (values > 1.0), axis=0)
        return any(wrap == "black" and out for wrap, out in zip(sampler.wrap, outside.tolist(), strict=True))

    def _colour_attribute(self) -> Attribute:
        """Stored RGBA, 0..255 as float32 rows, in the finest domain of colour and opacity."""
        rgb = self._rgb()
        alpha = self._stored_alpha()
        order = ("constant", "vertex", "uniform", "corner")
        domain = max(rgb.domain, alpha.domain, key=order.index)
        if {rgb.domain, alpha.domain} == {"vertex", "uniform"}:
            domain = "corner"
        if domain in ("vertex", "corner"):
            spread = self._shape.topology.spread
            target = target_of(domain == "corner")
            return Attribute(np.concatenate((spread(rgb, target), spread(alpha, target)), axis=1), domain)
        rows = max(len(rgb.values), len(alpha.values))
        parts = [np.broadcast_to(a.values, (rows, a.values.shape[1])) for a in (rgb, alpha)]
        return Attribute(np.concatenate(parts, axis=1), domain)

    def _rgb(self) -> Attribute:
        """Stored colour, the emission added; where a texture gives the colour, what it multiplies."""
        surface = self._surface
        if surface.colour.sampler is not None:
            return Attribute(np.full((1, 3), 255.0, dtype=np.float32), "constant")
        colour = self._values(surface.colour, 3)
        linear = colour.values + np.array(self.glow)
        return Attribute(encode_gamma2(linear).astype(np.float32), colour.domain)

    def _values(self, driver: Driver, width: int) -> Attribute:
        """A constant or a primvar as rows of `width` linear numbers, clamped to [0,1]."""
        channel = driver.number_channel if width == 1 else driver.channel
        pick = slice(0, 3) if channel is None else slice(channel, channel + 1)
        found = self._primvar(driver.primvar, channel) if driver.primvar else None
        if found is None:
            found = Attribute(np.array([driver.missing[pick]], dtype=np.float32), "constant")
        scale = np.array(driver.scale[:width]) if driver.primvar else 0.0
        values = found.values.astype(np.float64) * scale + np.array(driver.bias[:width])
        return Attribute(np.clip(values, 0.0, 1.0).astype(np.float32), found.domain)

    def _primvar(self, name: str, channel: int | None) -> Attribute | None:
        """The colour of a primvar, a number repeated, or one channel of it as a column."""
        primvars = self._shape.primvars
        width = primvar_width(primvars.prim, name)
        found = primvars.read(name, width) if width != 2 or channel is not None else None
        if found is None:
            return None
        last = found.values.shape[1] - 1
        rows = found.values[:, :3] if channel is None else found.values[:, min(channel, last), None]
        return Attribute(rows, found.domain)

    def _stored_alpha(self) -> Attribute:
        """Stored alpha; where a texture gives the opacity, what it multiplies."""
        if self.glass is not None and self.opacity.sampler is not None:
            return _stored(np.array([[self.glass.body if self.glass.has_presence else 1.0]]), "constant")
        if self.opacity.sampler is not None:
            return _stored(np.array([[1.0 if self.threshold > 0.0 else self.solid]]), "constant")
        found = self._values(self.opacity, 1)
        if self.threshold > 0.0:
            return self._cut(found)
        if self._alpha is not None:
            return _stored(np.array([[self._alpha]]), "constant")
        return _stored(found.values, found.domain)

    def _cut(self, opacity: Attribute) -> Attribute:
        """Stored alpha of a cut-out without a texture; only where it is interpolated must fragments be tested."""
        kept = opacity.values >= self.threshold
        if opacity.domain in ("vertex", "corner") and np.any(kept) and not np.all(kept):
            return _stored(opacity.values, opacity.domain)
        self.threshold = 0.0
        return _stored(np.where(kept, self.solid, 0.0), opacity.domain)

    def _coordinates(self, sampler: Sampler) -> Attribute:
        """Texture coordinates of a sampler, transformed."""
        key = uv_key(sampler)
        if key not in self._uvs:
            found = self._uv_primvar(sampler)
            matrix = np.array(sampler.transform)
            moved = found.values.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
            self._uvs[key] = Attribute(moved.astype(np.float32), found.domain)
        return self._uvs[key]

    def _uv_primvar(self, sampler: Sampler) -> Attribute:
        """The primvar that a sampler names, or what stands in for it."""
        primvars = self._shape.primvars
        found = primvars.read(sampler.uv, 2)
        if found is None and sampler.missing_uv is not None:
            return Attribute(np.array([sampler.missing_uv], dtype=np.float32), "constant")
        if found is None:
            other = primvars.texture_coordinates()
            instead = f"'{other}' is used" if other else "the texture's centre is used"
            path = primvars.prim.GetPath()
            self._table.log.add(f"there are no texture coordinates '{sampler.uv}', {instead}", path)
            found = primvars.read(other, 2) if other else None
        return Attribute(np.full((1, 2), 0.5, dtype=np.float32), "constant") if found is None else found


def uv_key(sampler: Sampler) -> UvKey:
    """What a sampler's texture coordinates are made of."""
    return sampler.uv, sampler.transform, sampler.missing_uv


def primvar_width(prim: Usd.Prim, name: str) -> int:
    """Numbers in one value of a primvar, its own or an inherited one; 3 where it is absent or no number."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    value = primvar.GetTypeName().scalarType.defaultValue if primvar else None
    if isinstance(value, (int, float)):
        return 1
    return len(value) if value is not None and hasattr(value, "__len__") and not isinstance(value, str) else 3


def target_of(corner: bool) -> Literal["vertex", "corner"]:
    """Where attributes go: to the corners if any of them needs that."""
    return "corner" if corner else "vertex"


def _stored(opacity: NDArray[np.floating], domain: Domain) -> Attribute:
    stored = np.floor(np.clip(opacity, 0.0, 1.0) * 255.0 + 0.5)
    return Attribute(stored.astype(np.float32), domain)
