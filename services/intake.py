"""What an uploaded scene is: passed by the gate, opened, counted, read. Runs in a sandboxed child process."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Sdf, Tf, Usd, UsdGeom

from evaluation.wording import counted
from renderer.convert import stage_file
from renderer.gate import RejectedScene
from renderer.gate.check import CheckedUpload, check_upload
from renderer.gate.problems import shown
from renderer.scene import LoadOptions, load_scene
from renderer.usd.stage import OutsideHome, WarningLog, open_stage, stage_time, usd_diagnostics, used_layers
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

WARNINGS = 50
"""Most warnings that are kept."""
WARNING_LENGTH = 200
"""Most characters of one."""
GPRIM_POINTS = 600
"""About as many points as an implicit gprim is tessellated to; twice as many triangles."""

Size = tuple[int, int]
"""Points and triangles."""


def inspect(folder: Path, root: str, cache: Path | None = None) -> dict[str, Any]:
    """Reads an uploaded scene from end to end.

    Args:
        folder: Holds the upload's files and nothing else.
        root: Relative name of the file that is the scene.
        cache: Where a .glb is converted to; None: the folder for temporary files.

    Returns:
        `triangles`, `points`, `prims`, `layers`, `cameras`, `opaque` and `warnings`.

    Raises:
        RejectedScene: It is not accepted. Nothing in the message is a file's content.
    """
    folder = folder.resolve()
    # Layers are looked for in the upload only, whatever the environment says.
    Ar.DefaultResolver.SetDefaultSearchPath([])
    try:
        checked = check_upload(folder, root)
        stage_path = stage_file(folder, root, cache or Path(tempfile.gettempdir()))
        home = folder if stage_path.is_relative_to(folder) else stage_path.parent
        counts = _count(stage_path, home, root)
        scene = load_scene(stage_path, LoadOptions(home=home))
    except RejectedScene:
        raise
    except MemoryError as error:
        raise RejectedScene("scene-too-large", f"{shown(root)} needs more memory than a scene may use.") from error
    except OutsideHome as problem:
        raise RejectedScene("scene-path-outside", problem.title) from problem
    except Problem as problem:
        raise _rejection(problem, root) from problem
    except (OSError, Tf.ErrorException, ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise RejectedScene("scene-damaged", f"{shown(root)} cannot be read.") from error
    return {
        "triangles": scene.triangles,
        "points": counts.points,
        "prims": counts.prims,
        "layers": counts.layers,
        "cameras": len(scene.cameras),
        "opaque": scene.is_opaque,
        "warnings": _warnings(scene.warnings, home, checked),
    }


@dataclass
class _Counts:
    """What is counted of a stage.

    Attributes:
        prims: Composed prims, instance proxies included.
        points: Of everything that can be drawn, with instances.
        triangles: Of meshes and implicit gprims, with instances.
        layers: Layers that the stage uses.
    """

    prims: int = 0
    points: int = 0
    triangles: int = 0
    layers: int = 0
    _of_prototype: dict[Sdf.Path, Size] = field(default_factory=dict)


def _count(path: Path, home: Path, root: str) -> _Counts:
    """Opens the stage, and stops as soon as a budget is exceeded."""
    counts = _Counts()
    with usd_diagnostics(WarningLog()):
        stage = open_stage(path)
        counts.layers = used_layers(stage, home)
        if counts.layers > LIMITS.layers:
            raise RejectedScene(
                "scene-too-many-layers", f"The scene uses {counts.layers} layers, more than {LIMITS.layers}."
            )
        time = stage_time(stage, None)
        for prim in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)):
            counts.prims += 1
            if counts.prims > LIMITS.prims:
                raise RejectedScene("scene-too-large", f"{shown(root)} has more than {LIMITS.prims} prims.")
            points, triangles = _size(prim, time, counts, ())
            counts.points += points
            counts.triangles += triangles
            if counts.points > LIMITS.points:
                raise RejectedScene("scene-too-large", f"{shown(root)} has more than {LIMITS.points} points.")
            if counts.triangles > LIMITS.triangles:
                raise RejectedScene("scene-too-large", f"{shown(root)} has more than {LIMITS.triangles} triangles.")
    return counts


def _size(prim: Usd.Prim, time: Usd.TimeCode, counts: _Counts, parents: tuple[Sdf.Path, ...]) -> Size:
    """Of a gprim, or of all that a point instancer makes."""
    if prim.IsA(UsdGeom.PointInstancer):
        return _instanced_size(UsdGeom.PointInstancer(prim), time, counts, parents)
    if not prim.IsA(UsdGeom.Gprim):
        return 0, 0
    path = (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()
    if path not in counts._of_prototype:
        counts._of_prototype[path] = _own_size(prim, time)
    return counts._of_prototype[path]


def _own_size(prim: Usd.Prim, time: Usd.TimeCode) -> Size:
    if not prim.IsA(UsdGeom.PointBased):
        return GPRIM_POINTS, 2 * GPRIM_POINTS
    points = len(UsdGeom.PointBased(prim).GetPointsAttr().Get(time) or ())
    if not prim.IsA(UsdGeom.Mesh):
        return points, 0
    mesh = UsdGeom.Mesh(prim)
    corners, faces = mesh.GetFaceVertexIndicesAttr().Get(time), mesh.GetFaceVertexCountsAttr().Get(time)
    return points, max(0, len(corners or ()) - 2 * len(faces or ()))


def _instanced_size(
    instancer: UsdGeom.PointInstancer, time: Usd.TimeCode, counts: _Counts, parents: tuple[Sdf.Path, ...]
) -> Size:
    path = instancer.GetPath()
    indices = instancer.GetProtoIndicesAttr().Get(time)
    if path in parents or indices is None:
        return 0, 0
    stage = instancer.GetPrim().GetStage()
    sizes = []
    for target in instancer.GetPrototypesRel().GetForwardedTargets():
        prototype = stage.GetPrimAtPath(target)
        below = [_size(prim, time, counts, (*parents, path)) for prim in (_under(prototype) if prototype else ())]
        sizes.append((sum(size[0] for size in below), sum(size[1] for size in below)))
    placed = np.asarray(indices, dtype=np.int64).ravel()
    copies = np.bincount(placed[(placed >= 0) & (placed < len(sizes))], minlength=len(sizes))
    return (
        sum(int(count) * size[0] for count, size in zip(copies, sizes, strict=True)),
        sum(int(count) * size[1] for count, size in zip(copies, sizes, strict=True)),
    )


def _under(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    return iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)))


def _rejection(problem: Problem, root: str) -> RejectedScene:
    """A problem of reading, without the paths and quotations that are right for a local user's own files."""
    if problem.code == ExitCode.LIMIT:
        return RejectedScene("scene-too-large", f"{shown(root)} has too many triangles or copies.", problem.remedy)
    if "no geometry" in problem.title:
        return RejectedScene("scene-no-geometry", f"{shown(root)} has no geometry that can be drawn.")
    return RejectedScene("scene-damaged", f"{shown(root)} cannot be read, or has coordinates that are not finite.")


def _warnings(lines: tuple[str, ...], home: Path, checked: CheckedUpload) -> list[str]:
    """Warnings with names in the upload only; what USD itself says is only counted, as it quotes files."""
    own = [line for line in lines if not line.startswith("USD says")]
    found = [line.replace(f"{home}/", "")[:WARNING_LENGTH] for line in own[:WARNINGS]]
    if len(own) < len(lines):
        found.append("USD found composition errors; usdchecker lists them")
    if checked.missing:
        found.append(f"not in the upload: {counted(checked.missing, 'files')} that the scene names")
    return found
