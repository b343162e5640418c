"""Materials as surfaces: what drives colour, emission and opacity."""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Sdf, Usd, UsdShade

from renderer.usd import materialx
from renderer.usd.drivers import Driver
from renderer.usd.glass import GLASSES
from renderer.usd.networks import Network, category_of
from renderer.usd.stage import WarningLog, is_inside
from renderer.usd.surfaces import SURFACES, Surface
from renderer.usd.textures import TextureTable
from schemas.glass import GlassReading

GREY = (0.7, 0.7, 0.7, 1.0)
"""Linear RGB of what has neither a material nor a display colour."""

DISPLAY = Surface(
    colour=Driver(primvar="displayColor", missing=GREY),
    opacity=Driver(primvar="displayOpacity"),
)
"""A prim without a material: its display colour and opacity."""

MATERIALX = "mtlx"
"""Render context of surfaces that are MaterialX nodes."""


@dataclass
class MaterialTable:
    """Surfaces of a stage's materials at one time, each read once.

    Attributes:
        time: The time to read at.
        textures: Gets the images.
        log: Gets a line for everything that is not supported.
        glass: How surfaces that transmit light are read.
    """

    time: Usd.TimeCode
    textures: TextureTable
    log: WarningLog
    glass: GlassReading
    _surfaces: dict[Sdf.Path, Surface | None] = field(default_factory=dict)
    _documents: dict[str, Usd.Stage | None] = field(default_factory=dict)

    def surface(self, stage: Usd.Stage, path: Sdf.Path) -> Surface | None:
        """The surface of the material at a path; None, with a warning, if it has none that is supported."""
        if path not in self._surfaces:
            material = UsdShade.Material(stage.GetPrimAtPath(path))
            shaders = _surface_shaders(material) if material else []
            self._surfaces[path] = self._read(shaders, path) if shaders else self._read_document(stage, path)
        return self._surfaces[path]

    def _read(self, shaders: list[UsdShade.Shader], path: Sdf.Path) -> Surface | None:
        """The surface of the first shader of a kind that is known."""
        for shader in shaders:
            kind = category_of(shader)
            if kind in SURFACES:
                network = Network(self.time, self.textures, self.log)
                pane = GLASSES[kind](network, shader) if self.glass == "fresnel" else None
                return pane or SURFACES[kind](network, shader)
        kind = shaders[0].GetShaderId() or "shader without an id"
        self.log.add(f"material not supported (its surface is a {kind}), display colour used", path)
        return None

    def _read_document(self, stage: Usd.Stage, path: Sdf.Path) -> Surface | None:
        """The surface of a material that is only in a MaterialX document which it or an ancestor refers to."""
        found = materialx.referenced_material(stage, path)
        if found is not None:
            document, name = found
            if str(document) not in self._documents:
                there = is_inside(self.textures.home, str(document))
                self._documents[str(document)] = materialx.document_stage(document) if there else None
            opened = self._documents[str(document)]
            material = materialx.material_named(opened, name) if opened is not None else None
            shaders = _surface_shaders(material) if material else []
            if shaders:
                return self._read(shaders, path)
        if stage.GetPrimAtPath(path) and found is None:
            self.log.add("material not supported (it has no surface), display colour used", path)
        else:
            self.log.add("the bound material is missing or not supported, display colour used", path)
        return None


def _surface_shaders(material: UsdShade.Material) -> list[UsdShade.Shader]:
    """The shaders of the universal surface and of MaterialX's, as far as there are any."""
    # Without a surface of its own a context gives the universal one again.
    found = [material.ComputeSurfaceSource(context)[0] for context in ("", MATERIALX)]
    shaders: list[UsdShade.Shader] = []
    for shader in found:
        if shader and all(shader.GetPath() != other.GetPath() for other in shaders):
            shaders.append(shader)
    return shaders
