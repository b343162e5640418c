"""Shows a stage in Storm: colour without light, and depth. Run as a script by the interpreter that has Storm.

Reads a job, JSON, from standard input: `benchmarks.judging.storm.Job`. Writes NUMBER.rgba.npy (float32 [H, W, 4],
linear, premultiplied) and NUMBER.depth.npy (float32 [H, W], stage units, infinite where nothing is), row 0 at the top,
into its folder. It imports nothing of Diaphane.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

_MULTISAMPLE, _ANISOTROPY = 0x809D, 0x84FE
"""GL_MULTISAMPLE, GL_TEXTURE_MAX_ANISOTROPY."""
_ENTRY = "_ZN32pxrBlender_v25_02__pxrReserved__8internal5GLApi{}E"
"""Where OpenUSD of the wheel bpy keeps the driver's entries."""
_SWITCH = ctypes.CFUNCTYPE(None, ctypes.c_uint)
_SETTING = ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_uint, ctypes.c_float)
_SETTERS = ("glSamplerParameterf", "glTextureParameterf")
_KEPT: list[Any] = []
"""What C calls must not be freed."""


def main() -> None:
    """Render the job."""
    job = json.load(sys.stdin)
    sys.path.insert(0, job["modules"])
    # Current before OpenUSD is imported: Storm takes the context that is there.
    settings: dict[str, Any] = {"backend": "egl"}
    context = moderngl.create_context(standalone=True, require=450, **settings)
    from pxr import Usd

    stage = Usd.Stage.Open(job["stage"])
    stage.SetEditTarget(stage.GetSessionLayer())
    for prim, name, choice in job["variants"]:
        stage.GetPrimAtPath(prim).GetVariantSets().GetVariantSet(name).SetVariantSelection(choice)
    for number, shot in enumerate(job["shots"]):
        rgba, depth = _composited(context, stage, shot, job["time"])
        np.save(Path(job["out"]) / f"{number}.rgba.npy", rgba)
        np.save(Path(job["out"]) / f"{number}.depth.npy", depth)
    print(json.dumps({"version": ".".join(f"{part:02}" for part in Usd.GetVersion()[1:])}), flush=True)
    os._exit(0)  # what is torn down after the last picture may crash, and is of no use any more


def _composited(context: Any, stage: Any, shot: dict[str, Any], time: float | None) -> tuple[Any, Any]:
    """Over black; alpha is what white adds to it, because Storm's own leaves transparent surfaces out."""
    black, depth = _shown(context, stage, {**shot, "clear": 0.0}, time)
    if not shot["materials"]:
        return black, depth
    white, _ = _shown(context, stage, {**shot, "clear": 1.0}, time)
    alpha = 1.0 - (white[..., :3] - black[..., :3]).mean(axis=2, keepdims=True)
    return np.concatenate([black[..., :3], alpha], axis=2), depth


def _shown(context: Any, stage: Any, shot: dict[str, Any], time: float | None) -> tuple[Any, Any]:
    from pxr import Gf, Tf, Usd, UsdImagingGL

    width, height = shot["size"]
    colour = context.texture((width, height), 4, dtype="f4")
    buffer = context.depth_texture((width, height))
    target = context.framebuffer([colour], buffer)
    target.use()
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    engine = UsdImagingGL.Engine()
    engine.SetRendererPlugin("HdStormRendererPlugin")
    _see_centres()
    engine.SetRendererAov("color")
    engine.SetRenderBufferSize(Gf.Vec2i(width, height))
    engine.SetRenderViewport(Gf.Vec4d(0, 0, width, height))
    near, far = _point(engine, stage, shot, Usd.TimeCode.EarliestTime() if time is None else Usd.TimeCode(time))
    parameters = UsdImagingGL.RenderParams()
    parameters.frame = Usd.TimeCode.EarliestTime() if time is None else Usd.TimeCode(time)
    parameters.complexity = 1.0 + 0.1 * shot["refine"]
    parameters.showProxy, parameters.showRender, parameters.showGuides = False, True, False
    # Lit, but by nothing: without lighting Storm leaves the materials out.
    parameters.enableLighting, parameters.enableSceneLights = True, False
    parameters.enableSceneMaterials = shot["materials"]
    parameters.enableUsdDrawModes = shot["cards"]
    parameters.colorCorrectionMode = "disabled"
    parameters.clearColor = Gf.Vec4f(*[shot["clear"]] * 4)
    for _ in range(8):
        target.use()
        with suppress(Tf.ErrorException):  # raised by the driver's "invalid enum" after the frame is there
            engine.Render(stage.GetPseudoRoot(), parameters)
        if engine.IsConverged():
            break
    context.finish()
    rgba = np.frombuffer(colour.read(), np.float32).reshape(height, width, 4)[::-1]
    window = np.frombuffer(target.read(components=1, attachment=-1, dtype="f4"), np.float32).reshape(height, width)[
        ::-1
    ]
    return rgba, _distance(window.astype(np.float64), near, far, shot["orthographic"])


def _see_centres() -> None:
    """Put own entries in place of the driver's, so that a pixel is seen at its centre and a texel as it is stored.

    Storm draws four samples of a pixel, and has no setting for fewer: here they all show the centre. It samples every
    texture anisotropically, also its own picture when it is presented, which llvmpipe blurs.
    """
    if _KEPT:
        return
    loaded = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    library = ctypes.CDLL(next(line.split()[-1] for line in loaded if "libusd_ms" in line))
    entries: dict[str, Any] = {
        name: ctypes.c_void_p.in_dll(library, _ENTRY.format(f"{len(name)}{name}"))
        for name in ("glEnable", "glDisable", *_SETTERS)
    }
    _SWITCH(entries["glDisable"].value)(_MULTISAMPLE)
    switch = _SWITCH(entries["glEnable"].value)
    _replace(entries["glEnable"], switch, _SWITCH(lambda what: None if what == _MULTISAMPLE else switch(what)))
    for name in _SETTERS:
        setting = _SETTING(entries[name].value)
        _replace(entries[name], setting, _plain(setting))


def _plain(setting: Any) -> Any:
    """The same without anisotropy."""
    return _SETTING(lambda thing, what, value: setting(thing, what, 1.0 if what == _ANISOTROPY else value))


def _replace(entry: Any, was: Any, becomes: Any) -> None:
    _KEPT.extend((was, becomes))
    entry.value = ctypes.cast(becomes, ctypes.c_void_p).value


def _point(engine: Any, stage: Any, shot: dict[str, Any], time: Any) -> tuple[float, float]:
    """Take the stage's camera, or the matrices; near and far."""
    from pxr import CameraUtil, Gf, UsdGeom

    near, far = shot["clip"]
    if shot["camera"] is None:
        engine.SetCameraState(Gf.Matrix4d(*shot["view"]), Gf.Matrix4d(*shot["projection"]))
        return near, far
    camera = UsdGeom.Camera(stage.GetPrimAtPath(shot["camera"]))
    if not camera.GetClippingRangeAttr().HasAuthoredValue() and not camera.GetPrim().IsInstanceProxy():
        camera.GetClippingRangeAttr().Set(Gf.Vec2f(near, far))
    engine.SetWindowPolicy(CameraUtil.MatchVertically)
    engine.SetCameraPath(shot["camera"])
    found = camera.GetClippingRangeAttr().Get(time)
    return float(found[0]), float(found[1])


def _distance(window: Any, near: float, far: float, orthographic: bool) -> Any:
    deep = far - near
    distance = near + window * deep if orthographic else near * far / (far - window * deep)
    return np.where(window < 1.0, distance, np.inf).astype(np.float32)


if __name__ == "__main__":
    main()
