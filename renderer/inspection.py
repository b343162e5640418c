"""What is in a scene file, what of it is drawn, and what is transparent and why."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade

from renderer.scene import LoadOptions, load_scene, metres_per_unit
from renderer.scene_report import CameraFact, Kind, MaterialFact, PrimCount, SceneReport, VariantFact
from renderer.timecodes import is_animated
from renderer.usd.cameras import read_cameras
from renderer.usd.digest import dependencies
from renderer.usd.drivers import Driver
from renderer.usd.instances import DRAWN_PURPOSES, Draw
from renderer.usd.parts import Part
from renderer.usd.stage import WarningLog, canonical_path, open_stage, stage_time, usd_diagnostics, usd_reason
from renderer.usd.surfaces import Glass, Surface
from schemas.problem import Problem
from schemas.scene import SceneArrays

ROUND = 6
"""Digits of measured lengths."""
MAX_NESTING = 64
"""Instances inside instances."""


class _Finds:
    """Notes what the loader draws; see `renderer.scene.Watch`."""

    def __init__(self, alpha: float | None) -> None:
        self.alpha = alpha
        self.stage: Usd.Stage | None = None
        self.shapes: set[int] = set()
        self.drawn: set[Sdf.Path] = set()
        self.instances = 0
        self.triangles: Counter[str] = Counter()
        self.materials: dict[str, MaterialFact] = {}

    def _name(self, part: Part) -> str:
        assert self.stage is not None, "something was drawn"
        return _readable(self.stage, part.material) if part.material else "unbound"

    def __call__(self, draw: Draw, parts: Sequence[Part]) -> None:
        self.stage = draw.prim.GetStage()  # paths in prototypes are those of this stage only
        if not parts:
            return
        self.drawn.add(canonical_path(draw.prim))
        self.shapes.add(id(parts))
        self.instances += len(draw.matrices)
        for name in {self._name(part) for part in parts}:
            self.materials.setdefault(name, MaterialFact()).prims += 1
        for part in parts:
            kind = _kind(part)
            count = len(part.triangles) * len(draw.matrices)
            self.triangles[kind] += count
            fact = self.materials[self._name(part)]
            fact.triangles += count
            fact.textured |= bool(part.style.textures)
            if (fact.kind != "transparent" and kind != "opaque") or fact.kind == "unused":
                fact.kind = kind
            if kind != "opaque" and not fact.why:
                fact.why = _why(part.surface, self.alpha)


_AS_AUTHORED: Final = LoadOptions()


def _readable(stage: Usd.Stage, path: Sdf.Path) -> str:
    """A path in a prototype as one in the first of its instances; others as they are."""
    for _ in range(MAX_NESTING):
        root = path.GetPrefixes()[0] if path != Sdf.Path.absoluteRootPath else path
        prototype = stage.GetPrimAtPath(root)
        if not prototype or not prototype.IsPrototype():
            break
        instances = prototype.GetInstances()
        if not instances:
            break
        path = path.ReplacePrefix(root, instances[0].GetPath())
    return str(path)


def inspect_scene(path: Path, options: LoadOptions = _AS_AUTHORED) -> SceneReport:
    """Read a scene as it would be rendered, and everything else in it.

    Args:
        path: A .usd, .usda, .usdc or .usdz file.
        options: As for rendering.

    Raises:
        Problem: It is missing or is not USD. That it has nothing to draw is part of the report.
    """
    finds = _Finds(options.alpha)
    log = WarningLog()
    scene, problem = None, None
    try:
        with usd_diagnostics(log):
            try:
                scene = load_scene(path, options, finds)
            except Problem as raised:
                problem = raised
            stage = finds.stage or open_stage(path, options.variants)
            report = _report(stage, path, options, finds.drawn)
    except Tf.ErrorException as error:
        raise Problem(f"{path} cannot be read as USD: {usd_reason(error)}.", "Check it with usdchecker.") from error
    report.problem = problem
    _add_finds(report, finds)
    if scene is None:
        report.warnings = log.lines()
    else:
        _add_scene(report, scene)
    return report


def _report(stage: Usd.Stage, path: Path, options: LoadOptions, drawn: set[Sdf.Path]) -> SceneReport:
    """All that the stage itself says."""
    census = _Census(stage_time(stage, options.time), drawn)
    for root in (stage.GetPseudoRoot(), *stage.GetPrototypes()):
        for prim in Usd.PrimRange.AllPrims(root):
            census.count(prim)
    codes = (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond())
    ranged = stage.HasAuthoredTimeCodeRange() and all(math.isfinite(code) for code in codes)
    missing = () if path.suffix.lower() == ".usdz" else dependencies(path)
    return SceneReport(
        file=str(path),
        up_axis=str(UsdGeom.GetStageUpAxis(stage)),
        metres_per_unit=metres_per_unit(stage, WarningLog()),
        time_codes=codes if ranged else None,
        animated=is_animated(stage),
        prims=dict(sorted(census.prims.items())),
        purposes=dict(census.purposes),
        variants=tuple(
            VariantFact(name, choices, selected, len(paths), paths[0])
            for (name, choices, selected), paths in census.variants.items()
        ),
        missing=tuple(sorted({str(file) for file in missing if not file.is_file()})),
        materials={path: MaterialFact() for path in census.materials},
        cameras=_cameras(stage, options),
    )


def _cameras(stage: Usd.Stage, options: LoadOptions) -> tuple[CameraFact, ...]:
    time, metres = stage_time(stage, options.time), metres_per_unit(stage, WarningLog())
    # Where they stand is not reported, and what cannot be used is in the loader's warnings.
    cameras = read_cameras(stage, time, np.zeros(3), metres, WarningLog())
    return tuple(
        CameraFact(
            path=camera.path,
            projection="perspective" if camera.view.ortho_height is None else "orthographic",
            fov=round(camera.view.fov, ROUND) if camera.view.ortho_height is None else None,
            height=camera.view.ortho_height,
            aspect=round(camera.aspect, ROUND),
        )
        for camera in cameras
    )


class _Census:
    """Counts prims."""

    def __init__(self, time: Usd.TimeCode, drawn: set[Sdf.Path]) -> None:
        self._time = time
        self._drawn = drawn
        self.prims: dict[str, PrimCount] = {}
        self.purposes: Counter[str] = Counter()
        self.materials: list[str] = []
        self.variants: dict[tuple[str, tuple[str, ...], str], list[str]] = {}

    def count(self, prim: Usd.Prim) -> None:
        """Notes one prim."""
        if prim.IsPseudoRoot() or prim.IsPrototype():
            return
        entry = self.prims.setdefault(str(prim.GetTypeName()) or "without a type", PrimCount())
        entry.total += 1
        if prim.IsA(UsdGeom.Gprim):
            self._geometry(prim, entry)
        elif prim.IsA(UsdShade.Material):
            self.materials.append(_readable(prim.GetStage(), prim.GetPath()))
        if prim.HasVariantSets():
            for name in prim.GetVariantSets().GetNames():
                chosen = prim.GetVariantSet(name)
                key = (name, tuple(chosen.GetVariantNames()), chosen.GetVariantSelection())
                self.variants.setdefault(key, []).append(_readable(prim.GetStage(), prim.GetPath()))

    def _geometry(self, prim: Usd.Prim, entry: PrimCount) -> None:
        purpose = UsdGeom.Imageable(prim).ComputePurpose()
        self.purposes[str(purpose)] += 1
        entry.drawn = entry.drawn or 0
        if prim.GetPath() in self._drawn:
            entry.drawn += 1
        else:
            reason = self._reason(prim, purpose)
            entry.reasons[reason] = entry.reasons.get(reason, 0) + 1

    def _reason(self, prim: Usd.Prim, purpose: str) -> str:
        if not prim.IsActive():
            return "inactive"
        if purpose not in DRAWN_PURPOSES:
            return f"purpose {purpose}"
        if UsdGeom.Imageable(prim).ComputeVisibility(self._time) == UsdGeom.Tokens.invisible:
            return "invisible"
        if prim.IsAbstract():
            return "in a class"
        if not prim.IsDefined():
            return "only an over"
        return "empty, not supported or never instanced"


def _kind(part: Part) -> Kind:
    if part.style.opacity_threshold > 0.0 and part.style.cut_out_alpha >= 1.0 and part.surface.glass is None:
        return "cut-out"
    return "opaque" if part.style.layer == "opaque" else "transparent"


def _why(surface: Surface, alpha: float | None) -> str:
    if surface.glass is not None:
        return _why_glass(surface, surface.glass)
    text = f"opacity {_source(surface.opacity)}"
    if surface.threshold > 0.0:
        text += f", cut out below {surface.threshold:g}"
    return text if alpha is None else f"every surface has alpha {alpha:g}; as authored: {text}"


def _why_glass(surface: Surface, glass: Glass) -> str:
    low, high = (_short(1.0 - (1.0 - mirrored) * _let_through(surface, glass)) for mirrored in glass.reflectance)
    text = f"glass: {glass.said}, drawn with Fresnel alpha {low} to {high}"
    if not surface.colour.is_constant:
        text += " and a tint that varies"
    elif glass.transmittance is None and min(surface.colour.rgb) < 1.0:
        text += f" and tint {' '.join(_short(x) for x in surface.colour.rgb)}"
    if glass.has_presence:
        text += f", opacity {_source(surface.opacity)}"
    elif glass.presence < 1.0:
        text += f", times opacity {glass.presence:g}"
    return text + (f", cut out below {surface.threshold:g}" if surface.threshold > 0.0 else "")


def _let_through(surface: Surface, glass: Glass) -> float:
    """Fraction of the light that is not reflected and goes through; at most, where it varies."""
    tint = glass.transmittance
    if tint is None:
        tint = sum(surface.colour.rgb) / 3.0 if surface.colour.is_constant else 1.0
    if glass.has_presence:
        return tint * (1.0 - glass.body)
    return tint * (1.0 - surface.opacity.number_bias if surface.opacity.is_constant else 1.0)


def _short(value: float) -> str:
    """A number in [0,1] to two digits, without the zero before its point."""
    text = f"{value:.2g}"
    return text[1:] if text.startswith("0.") else text


def _source(opacity: Driver) -> str:
    if opacity.sampler is not None:
        return f"from {opacity.sampler.file.name}, channel {'rgba'[opacity.number_channel]}"
    return f"from primvar {opacity.primvar}" if opacity.primvar is not None else f"{opacity.number_bias:g}"


def _add_finds(report: SceneReport, finds: _Finds) -> None:
    report.meshes, report.instances = len(finds.shapes), finds.instances
    report.triangles = dict(finds.triangles)
    report.materials |= finds.materials


def _add_scene(report: SceneReport, scene: SceneArrays) -> None:
    corners = np.round(scene.bounds + scene.origin, ROUND)
    report.bounds = tuple(tuple(float(x) for x in corner) for corner in corners)
    report.warnings = scene.warnings
    report.textures = tuple(sorted({texture.name for texture in scene.textures}))
