"""A stage judged: its views here and in Storm, shape by shape and look by look."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image
from pxr import Usd

from benchmarks.casting.cases import Case
from benchmarks.judging import ours, storm
from benchmarks.judging.agreement import Count, Mask, look_agreement, shape_agreement
from benchmarks.judging.seen import Seen
from evaluation.storm.engine import Engine
from renderer.scene import LoadOptions, load_scene
from renderer.usd.cameras import StageCamera, read_cameras
from renderer.usd.stage import Selection, WarningLog, open_stage, stage_time, usd_diagnostics
from renderer.views import framing_view
from schemas.colour import display8
from schemas.problem import Problem
from schemas.scene import SceneArrays
from schemas.view import View

HEIGHT = 240
"""Rows of a picture."""
_ASPECT = 1.5
_WIDEST = 3.0
"""Greatest width / height of a picture through a camera."""
CAMERAS = 2
"""Cameras of a stage that are looked through."""
_REFINED = 200_000
"""Most triangles of the cages that are refined."""
_MAGENTA = (1.0, 0.0, 1.0, 1.0)
"""What `evaluation/storm/exact.glsl` shows everywhere where its pool is full."""

KINDS = ("silhouette", "depth", "camera", "refined", "opaque depth", "opacity", "colour")
"""What is counted: shape without materials, the same through cameras and refined once, and what materials show."""


@dataclass(slots=True)
class Verdict:
    """What was found about a stage.

    Attributes:
        case: The stage.
        counts: By kind.
        refused: Why there is nothing to compare.
        full: Pictures without looks, because Storm's pool of fragments is full.
        version: Of OpenUSD.
    """

    case: Case
    counts: dict[str, Count] = field(default_factory=lambda: {kind: Count() for kind in KINDS})
    refused: str = ""
    full: int = 0
    version: str = ""


@dataclass(frozen=True, slots=True)
class _Ask:
    """A picture to compare: what Storm is asked for, and the view here."""

    kind: str
    shot: storm.Shot
    view: View


def judge(ctx: moderngl.Context, engine: Engine, case: Case, sheets: Path | None) -> Verdict:
    """Compare a stage.

    Args:
        ctx: The context of this process.
        engine: Storm.
        case: The stage.
        sheets: Folder that gets a picture of every difference; None: none are written.
    """
    verdict = Verdict(case)
    options = LoadOptions(variants=case.variants, glass="plain")
    try:
        scene = load_scene(case.path, options)
        stage = open_stage(case.path, case.variants)
        asks = list(_asks(case, scene, _cameras(stage, scene)))
        code = stage_time(stage, None)
        time = None if code.IsEarliestTime() else code.GetValue()
        verdict.version, there = storm.shown(engine, case.path, _choices(case), time, [ask.shot for ask in asks])
    except Problem as problem:
        verdict.refused = problem.title
        return verdict
    refined = load_scene(case.path, replace(options, refine=1)) if any(ask.shot.refine for ask in asks) else scene
    made = {(False, 0): ours.solid(scene), (True, 0): ours.unlit(scene), (False, 1): ours.solid(refined)}
    for number, (ask, theirs) in enumerate(zip(asks, there, strict=True)):
        here = ours.shown(ctx, made[ask.shot.materials, ask.shot.refine], ask.view, ask.shot.size)
        wrong = _count(verdict, ask, here, theirs, _diagonal(scene))
        if sheets is not None and wrong is not None and wrong.any():
            _write(sheets / f"{case.scene}-{case.path.stem}-{number}-{ask.kind}.png", here, theirs, wrong)
    return verdict


def _count(verdict: Verdict, ask: _Ask, here: Seen, theirs: Seen, diagonal: float) -> Mask | None:
    """Add a picture to the counts; where it differs."""
    shape = shape_agreement(here, theirs, diagonal, ask.shot.clip)
    if not ask.shot.materials:
        kinds = ("silhouette", "depth") if ask.kind == "shape" else (ask.kind, ask.kind)
        for kind, name in zip(kinds, ("silhouette", "depth"), strict=True):
            verdict.counts[kind].add(shape.counts[name])
        return shape.wrong
    if (theirs.rgba == np.array(_MAGENTA, np.float32)).all(axis=2).mean() > 0.5:
        verdict.full += 1
        return None
    look = look_agreement(here, theirs)
    verdict.counts["opaque depth"].add(shape.counts["depth"])
    verdict.counts["opacity"].add(look.counts["opacity"])
    verdict.counts["colour"].add(look.counts["colour"])
    return look.wrong


def _asks(case: Case, scene: SceneArrays, cameras: tuple[StageCamera, ...]) -> Iterator[_Ask]:
    size = round(HEIGHT * _ASPECT), HEIGHT
    views = [framing_view(scene)]
    if case.views is not None:
        views += case.cameras(scene, 1)
    for view in views:
        shot = _shot(scene, view, size)
        yield _Ask("shape", shot, view)
        yield _Ask("look", replace(shot, materials=True), view)
    if scene.triangles <= _REFINED:
        yield _Ask("refined", replace(_shot(scene, views[0], size), refine=1), views[0])
    for camera in cameras[:CAMERAS]:
        wide = round(HEIGHT * min(max(camera.aspect, 1.0 / _WIDEST), _WIDEST)), HEIGHT
        yield _Ask("camera", replace(_shot(scene, camera.view, wide), camera=camera.path), camera.view)


def _shot(scene: SceneArrays, view: View, size: tuple[int, int]) -> storm.Shot:
    metres = scene.metres_per_unit
    near, far = view.clip_range(scene.bounds)
    to_world = np.linalg.inv(view.world_to_view())
    to_world[:3, 3] = (np.array(view.eye) + scene.origin) / metres
    projection = view.projection(size[0] / size[1], near / metres, far / metres)
    return storm.Shot(
        size=size,
        camera=None,
        view=tuple(np.linalg.inv(to_world).T.ravel().tolist()),
        projection=tuple(projection.T.ravel().tolist()),
        clip=(near / metres, far / metres),
        orthographic=view.ortho_height is not None,
        refine=0,
        materials=False,
    )


def _cameras(stage: Usd.Stage, scene: SceneArrays) -> tuple[StageCamera, ...]:
    with usd_diagnostics(WarningLog()):
        return read_cameras(stage, stage_time(stage, None), scene.origin, scene.metres_per_unit, WarningLog())


def _choices(case: Case) -> list[tuple[str, str, str]]:
    chosen = [Selection.of(text) for text in case.variants]
    return [(one.where, one.name, one.choice) for one in chosen]


def _diagonal(scene: SceneArrays) -> float:
    return float(np.linalg.norm(scene.bounds[1] - scene.bounds[0])) / scene.metres_per_unit


def _write(file: Path, here: Seen, there: Seen, wrong: Mask) -> None:
    """Here, in Storm, and what differs and is not explained; below, opacity and depth."""
    file.parent.mkdir(parents=True, exist_ok=True)
    depths = np.concatenate([each.depth[np.isfinite(each.depth)] for each in (here, there)])
    near, far = (float(depths.min()), float(depths.max())) if len(depths) else (0.0, 1.0)
    above = [display8(each.rgba[..., :3]) for each in (here, there)]
    scale = 230.0 / max(far - near, 1e-30)
    below = [np.clip(255.0 - scale * (np.minimum(each.depth, 2.0 * far) - near), 0.0, 255.0) for each in (here, there)]
    mask = np.repeat((255 * wrong)[..., None], 3, axis=2).astype(np.uint8)
    grey = [np.repeat(plane[..., None], 3, axis=2).astype(np.uint8) for plane in below]
    alpha = np.abs(here.rgba[..., 3] - there.rgba[..., 3])
    grey.append(np.repeat(np.clip(255 * alpha, 0, 255)[..., None], 3, axis=2).astype(np.uint8))
    Image.fromarray(np.concatenate([np.concatenate([*above, mask], 1), np.concatenate(grey, 1)], 0)).save(file)
