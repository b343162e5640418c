"""Renders a stage in Storm. Run as a script by the interpreter that has OpenUSD with UsdAppUtils, and by no other.

Reads a job, JSON, from standard input: `evaluation.storm.engine.Job`. Prints a line of JSON: version, seconds and CPU
seconds of each frame. It imports nothing of Diaphane.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any


def main() -> None:
    """Render the job."""
    job = json.load(sys.stdin)
    sys.path.insert(0, job["modules"])
    import moderngl

    # Current before OpenUSD is imported: Storm takes the context that is there.
    settings: dict[str, Any] = {"backend": "egl"}
    context = moderngl.create_context(standalone=True, require=450, **settings)
    target = context.framebuffer([context.texture((64, 64), 4)], context.depth_renderbuffer((64, 64)))
    from pxr import Tf, Usd, UsdAppUtils, UsdGeom

    stage = Usd.Stage.Open(job["stage"])
    stage.SetEditTarget(stage.GetSessionLayer())
    if job["alpha"] is not None:
        _fade(stage, job["alpha"])
    recorder = UsdAppUtils.FrameRecorder()
    recorder.SetRendererPlugin("HdStormRendererPlugin")
    recorder.SetImageWidth(job["size"][0])
    recorder.SetColorCorrectionMode("sRGB")
    recorder.SetComplexity(1.0)
    recorder.SetIncludedPurposes(["default", "render"])
    camera = UsdGeom.Camera(_camera(stage, job))
    wall, cpu = [], []
    for _ in range(job["frames"]):
        begun, before = time.perf_counter(), time.process_time()
        target.use()
        try:
            recorder.Record(stage, camera, Usd.TimeCode.Default(), job["out"])
        except Tf.ErrorException:  # raised by the driver's "invalid enum" after the picture is on disk
            if not Path(job["out"]).is_file():
                raise
        wall.append(time.perf_counter() - begun)
        cpu.append(time.process_time() - before)
    version = ".".join(f"{part:02}" for part in Usd.GetVersion()[1:])
    print(json.dumps({"version": version, "seconds": wall, "cpu_seconds": cpu}))


def _camera(stage: Any, job: dict[str, Any]) -> Any:
    from pxr import Gf, Usd, UsdGeom

    made = Gf.Camera()
    width, height = job["size"]
    made.SetPerspectiveFromAspectRatioAndFieldOfView(width / height, job["fov"], Gf.Camera.FOVVertical)
    made.transform = Gf.Matrix4d(*job["camera"])
    made.clippingRange = Gf.Range1f(*job["clip"])
    camera = UsdGeom.Camera.Define(stage, "/DiaphaneCamera")
    camera.SetFromCamera(made, Usd.TimeCode.Default())
    return camera.GetPrim()


def _fade(stage: Any, alpha: float) -> None:
    """Give every UsdPreviewSurface one opacity."""
    from pxr import Sdf, Usd, UsdShade

    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        shader = UsdShade.Shader(prim)
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface" or prim.IsInstanceProxy():
            continue
        for name, value in (("opacity", alpha), ("opacityThreshold", 0.0)):
            shaded = shader.CreateInput(name, Sdf.ValueTypeNames.Float)
            shaded.GetAttr().SetConnections([])
            shaded.Set(value)


if __name__ == "__main__":
    main()
