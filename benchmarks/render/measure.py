"""What is measured of the renderer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.render.setup import Subject, in_turns
from renderer.capture import capture
from renderer.fragment_list import KEY_BYTES, PLACE_BYTES
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.techniques import Budget, KBufferDeep, Technique, technique
from renderer.timing import READBACK, recording, shared_clock
from schemas.bundle import load_manifest

SIZE = (1430, 960)
EXACT = "sbuffer"
"""What the other techniques' frames are compared with."""
_EMPTY = "benchmark/empty.frag"


def capture_cost(subject: Subject, rounds: int) -> dict[str, Any]:
    """The whole capture against one pass over the same triangles with an empty fragment shader."""
    frame = Frame(subject.gpu, subject.views[0], *SIZE)
    captured = capture(frame)

    def empty() -> None:
        frame.draw_transparent(_EMPTY, frame.target([]))
        frame.ctx.finish()

    passes: list[dict[str, float]] = []

    def whole() -> None:
        passes.append(capture(frame).passes)

    times = in_turns(rounds, {"empty": empty, "capture": whole})
    fragments = captured.dump.total
    moved = fragments * (KEY_BYTES + PLACE_BYTES) * 4 + fragments * (KEY_BYTES + 1) * 2 + fragments * 8
    return {
        "scene": subject.name,
        "triangles": len(subject.gpu.scene.indices) // 3,
        "fragments": fragments,
        "hidden": hidden_fragments(frame),
        "culled": frame.culled_triangles,
        "ratio": {key: times["capture"][key] / times["empty"][key] for key in ("median", "least")},
        "fragments_per_s": {key: 1e3 * fragments / times["capture"][key] for key in ("median", "least")},
        "times": times,
        "passes": {name: float(np.median([p[name] for p in passes[1:]])) for name in passes[0]},
        "bytes_moved": moved,
        "copy_bytes_per_s": _copy_speed(),
    }


def second_view(subject: Subject, rounds: int) -> dict[str, Any]:
    """A view of a scene that is on the GPU already, against everything from the file on."""
    work: dict[str, Callable[[], object]] = {
        "second view": lambda: capture(Frame(subject.gpu, subject.views[1], *SIZE)),
        "upload and view": lambda: capture(
            Frame(GpuScene(subject.gpu.ctx, subject.gpu.scene), subject.views[1], *SIZE)
        ),
        "capture alone": _captures(Frame(subject.gpu, subject.views[1], *SIZE)),
    }
    times = in_turns(rounds, work)
    return {"scene": subject.name, "load_ms": subject.load_ms, "upload_ms": subject.upload_ms, "times": times}


def _captures(frame: Frame) -> Callable[[], object]:
    return lambda: capture(frame)


def frame_costs(subject: Subject, bundle: Path, rounds: int) -> dict[str, Any]:
    """Whole frames by technique and pass, by the clock that others on the machine do not change."""
    tail = load_manifest(bundle).tail
    budget = Budget(SIZE[0] * SIZE[1], tail.name, tail.g)
    made: dict[str, Technique] = {
        EXACT: technique(EXACT),
        **{name: technique(name) for name in ("weighted-blended", "moment", "binned")},
        "kbuffer-deep": KBufferDeep(bundle, "glsl"),
        "kbuffer-deep, onnxruntime": KBufferDeep(bundle, "onnx"),
    }
    passes: dict[str, list[dict[str, float]]] = {name: [] for name in made}
    seconds = shared_clock(subject.gpu.ctx)
    for number in range(rounds + 1):
        for name, each in made.items():
            with recording(subject.gpu.ctx, seconds) as found:
                rendered = each.render(Frame(subject.gpu, subject.views[0], *SIZE), budget)
            if number:
                passes[name].append({key: ms for key, ms in found.passes.items() if key != READBACK})
            if name == EXACT:
                fragments = rendered.captured
    frames = {name: float(np.median([sum(each.values()) for each in found])) for name, found in passes.items()}
    return {
        "scene": subject.name,
        "fragments_per_pixel": fragments / (SIZE[0] * SIZE[1]),
        "frames": frames,
        "ratio": {name: ms / frames[EXACT] for name, ms in frames.items()},
        "passes": {name: _medians(found) for name, found in passes.items()},
    }


def _medians(passes: list[dict[str, float]]) -> dict[str, float]:
    return {name: float(np.median([p[name] for p in passes])) for name in passes[0]}


def _copy_speed() -> float:
    """Bytes per second of a copy of 256 MiB, read and written."""
    source = np.ones(1 << 28, dtype=np.uint8)
    target = np.empty_like(source)
    least = in_turns(4, {"copy": lambda: np.copyto(target, source)})["copy"]["least"]
    return 2e3 * source.nbytes / least
