"""From a USD stage to SceneArrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Ar, Sdf, Tf, Usd, UsdGeom

from renderer.usd.assemble import Placed, assemble
from renderer.usd.bindings import bindings
from renderer.usd.cameras import read_cameras
from renderer.usd.digest import scene_digest
from renderer.usd.geometry import read_shape
from renderer.usd.instances import Draw, Walker, product
from renderer.usd.left_out import log_left_out
from renderer.usd.materials import MaterialTable
from renderer.usd.parts import Part, build_parts
from renderer.usd.shape import Reading
from renderer.usd.stage import (
    WarningLog,
    canonical_path,
    open_stage,
    stage_time,
    usd_diagnostics,
    usd_reason,
    used_layers,
)
from renderer.usd.textures import TextureTable
from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays

__all__ = ["LoadOptions", "NothingToDraw", "load_scene", "scene_digest"]

UP_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}

MAX_REFINE = 8
"""Each level makes four times as many faces."""


class NothingToDraw(Problem):
    """A scene without geometry at its time, which may have some at another one."""


ShapeKey = tuple[Sdf.Path, ...]

Watch = Callable[[Draw, Sequence[Part]], None]
"""Is told of everything that is drawn, and of the parts of its shape."""


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """How a stage is read.

    Attributes:
        alpha: Opacity in (0,1] of every surface, instead of its own; cut-outs keep their shape, a texture's opacity
            without a threshold is multiplied; nothing is glass then. None: as authored.
        glass: How surfaces that transmit light are read.
        time: Time code to read at; None: the start of the stage's range.
        variants: Selections `set=choice` (every prim that has the set) or `/prim/path:set=choice`.
        refine: Levels of subdivision of meshes that have a scheme, 0 to MAX_REFINE; 0: their cages, as `usdrecord
            --complexity low`.
        home: Folder that everything which the stage opens has to lie in, for scenes of strangers; None: anywhere.
    """

    alpha: float | None = None
    glass: GlassReading = DEFAULT_GLASS
    time: float | None = None
    variants: tuple[str, ...] = ()
    refine: int = 0
    home: Path | None = None

    def __post_init__(self) -> None:
        if self.alpha is not None and not 0.0 < self.alpha <= 1.0:
            raise Problem(f"An alpha of {self.alpha} is not possible.", "Give a number above 0 and at most 1.")
        if self.time is not None and math.isinf(self.time):
            raise Problem(f"A time of {self.time} is not possible.", "Give a time code.")
        if not 0 <= self.refine <= MAX_REFINE:
            raise Problem(
                f"Refining by {self.refine} levels is not possible.", f"Give a number from 0 to {MAX_REFINE}."
            )


def load_scene(path: Path, options: LoadOptions = LoadOptions(), watch: Watch | None = None) -> SceneArrays:
    """Reads a USD file and everything it refers to.

    Args:
        path: A .usd, .usda, .usdc or .usdz file.
        options: Alpha, time, variants, and where its files may lie.
        watch: For reports of what was found.

    Raises:
        Problem: The file is missing, is not USD, has no geometry, or has points that are not finite.
    """
    log = WarningLog()
    try:
        with usd_diagnostics(log):
            stage = open_stage(path, options.variants)
            # Whatever is looked up while it is read is looked up as the stage does it.
            with Ar.ResolverContextBinder(stage.GetPathResolverContext()):
                scene = _StageReader(stage, path, options, log, watch).read()
            log_left_out(stage.GetRootLayer(), log)
            used_layers(stage, options.home and options.home.resolve())
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        # Also a damaged file's strings can have bytes that are no text.
        raise Problem(
            f"{path} cannot be read as USD: {usd_reason(error)}.", "Check it with usdchecker.", ExitCode.USAGE
        ) from error
    return replace(scene, warnings=tuple(_named_from(options.home, line) for line in log.lines()))


def _named_from(home: Path | None, line: str) -> str:
    """A warning with names of files as they are in a folder, wherever that lies today."""
    return line if home is None else line.replace(f"{home}/", "").replace(f"{home.resolve()}/", "")


class _StageReader:
    """Reads one stage; the parts of each distinct shape are made once."""

    def __init__(
        self, stage: Usd.Stage, path: Path, options: LoadOptions, log: WarningLog, watch: Watch | None
    ) -> None:
        self._stage = stage
        self._path = path
        self._alpha = options.alpha
        self._log = log
        self._watch = watch
        self._refine = options.refine
        self._time = stage_time(stage, options.time)
        self._textures = TextureTable(options.home and options.home.resolve())
        glass = options.glass if options.alpha is None else "plain"
        self._materials = MaterialTable(self._time, self._textures, log, glass)
        self._metres = metres_per_unit(stage, log)

    def read(self) -> SceneArrays:
        """The whole scene, without the warnings."""
        placed = self._placed()
        if not placed:
            raise NothingToDraw(
                f"{self._path} has no geometry that can be drawn.",
                "Check that it has visible meshes or gprims of purpose default or render.",
                ExitCode.USAGE,
            )
        arrays = assemble(placed)
        up = str(UsdGeom.GetStageUpAxis(self._stage))
        cameras = read_cameras(self._stage, self._time, arrays.origin, self._metres, self._log)
        return SceneArrays(
            name=self._path.stem,
            positions=arrays.positions,
            normals=arrays.normals,
            uvs=arrays.uvs,
            colours=arrays.colours,
            indices=arrays.indices,
            batches=arrays.batches,
            textures=tuple(self._textures.textures),
            origin=arrays.origin,
            bounds=arrays.bounds,
            up=UP_AXES.get(up, UP_AXES["Y"]),
            metres_per_unit=self._metres,
            cameras=tuple(camera.view for camera in cameras),
            warnings=(),
            more_uvs=arrays.more_uvs,
        )

    def _placed(self) -> list[Placed]:
        parts: dict[ShapeKey, list[Part]] = {}
        matrices: dict[ShapeKey, list[NDArray[np.float64]]] = {}
        for draw in Walker(self._time, self._log).draws(self._stage):
            key = shape_key(draw)
            if key not in parts:
                reading = Reading(self._time, self._log, self._refine, draw.skin)
                shape = read_shape(draw.prim, reading)
                parts[key] = [] if shape is None else build_parts(draw.prim, shape, self._materials, self._alpha)
            matrices.setdefault(key, []).append(draw.matrices)
            if self._watch is not None:
                self._watch(draw, parts[key])
        scale = np.diag([self._metres, self._metres, self._metres, 1.0])
        places = {key: product(np.concatenate(some), scale) for key, some in matrices.items()}
        return [Placed(part, places[key], str(key[0])) for key, shape_parts in parts.items() for part in shape_parts]


def shape_key(draw: Draw) -> ShapeKey:
    """What decides how a prim looks: its place in its prototype, its pose, its materials and inherited primvars.

    Instances of one prototype share the first, but may move otherwise, be bound to other materials or inherit other
    colours.
    """
    prim = draw.prim
    key = [canonical_path(prim), *(draw.skin.key if draw.skin is not None else ())]
    key += [path for path, _ in bindings(prim) if path is not None]
    if prim.IsInstanceProxy():
        for primvar in UsdGeom.PrimvarsAPI(prim).FindInheritablePrimvars():
            key.append(canonical_path(primvar.GetAttr().GetPrim()).AppendProperty(primvar.GetAttr().GetName()))
    return tuple(key)


def metres_per_unit(stage: Usd.Stage, log: WarningLog) -> float:
    """Metres per stage unit: USD's default, with a warning, where what is authored is no length."""
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not (np.isfinite(metres) and metres > 0.0):
        log.add(f"metersPerUnit is {metres}, 0.01 is used", "/")
        return 0.01
    return metres
