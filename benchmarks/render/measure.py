"""What is measured of the renderer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.render.setup import Subject, in_turns
from labeller.curves import error_curves
from labeller.rules import allocate_curves
from renderer import metrics
from renderer.capture import capture
from renderer.fragment_list import KEY_BYTES, PLACE_BYTES
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.techniques import (
    TECHNIQUES,
    Budget,
    KBufferDeep,
    KBufferImportance,
    Needs,
    Rendered,
    Technique,
    technique,
)
from schemas.colour import display8
from schemas.view import View

SIZE = (1430, 960)
FACTOR = 2
"""F / (W H) of the bounded techniques."""
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


def learned_cost(subject: Subject, bundle: Path, rounds: int) -> dict[str, Any]:
    """What `kbuffer-deep` costs beyond `kbuffer-importance`, with the network in GLSL and in onnxruntime."""
    budget = Budget(FACTOR * SIZE[0] * SIZE[1])
    made: dict[str, Technique] = {
        "importance": KBufferImportance(),
        "deep, GLSL": KBufferDeep(bundle, "glsl"),
        "deep, onnxruntime": KBufferDeep(bundle, "onnx"),
    }
    passes: dict[str, list[dict[str, float]]] = {name: [] for name in made}

    def run(name: str) -> Callable[[], object]:
        def call() -> None:
            passes[name].append(made[name].render(Frame(subject.gpu, subject.views[0], *SIZE), budget).passes)

        return call

    times = in_turns(rounds, {name: run(name) for name in made})
    base = times["importance"]
    return {
        "scene": subject.name,
        "times": times,
        "extra_ms": {name: times[name]["median"] - base["median"] for name in made if name != "importance"},
        "ratio": {name: times[name]["median"] / base["median"] for name in made if name != "importance"},
        "passes": {name: _medians(found[1:]) for name, found in passes.items()},
    }


def every_technique(subject: Subject, bundle: Path | None, rounds: int, names: list[str]) -> list[dict[str, Any]]:
    """Time, memory and error of every technique on one view, F = 2 W H."""
    view = subject.views[0]
    dump = capture(Frame(subject.gpu, view, *SIZE)).dump
    budget = Budget(FACTOR * dump.pixels)
    optimum = allocate_curves(dump, error_curves(dump), [budget.fragments], "optimal")[0].k
    needs = Needs(bundle=bundle, allocate=lambda *_: np.asarray(optimum, dtype=np.int32))
    exact = display8(technique("sbuffer").render(Frame(subject.gpu, view, *SIZE), budget).linear)
    rows = []
    for name in names:
        if name == "kbuffer-deep" and bundle is None:
            continue
        found = [_one(subject.gpu, view, name, needs, budget) for _ in range(rounds + 1)][1:]
        last = found[-1]
        rows.append(
            {
                "scene": subject.name,
                "technique": name,
                "family": TECHNIQUES[name].family,
                "total_ms": float(np.median([r.milliseconds for r in found])),
                "passes": _medians([r.passes for r in found]),
                "pool_bytes": last.pool_bytes,
                "pixel_bytes": last.pixel_bytes,
                "total_bytes": last.total_bytes,
                "captured": last.captured,
                "mse": metrics.mse(display8(last.linear), exact),
                "flip": metrics.flip(display8(last.linear), exact)[0],
                "skips": dict(last.skips),
            }
        )
    return rows


def _one(gpu: GpuScene, view: View, name: str, needs: Needs, budget: Budget) -> Rendered:
    return technique(name, needs).render(Frame(gpu, view, *SIZE), budget)


def _medians(passes: list[dict[str, float]]) -> dict[str, float]:
    return {name: float(np.median([p[name] for p in passes])) for name in passes[0]}


def _copy_speed() -> float:
    """Bytes per second of a copy of 256 MiB, read and written."""
    source = np.ones(1 << 28, dtype=np.uint8)
    target = np.empty_like(source)
    least = in_turns(4, {"copy": lambda: np.copyto(target, source)})["copy"]["least"]
    return 2e3 * source.nbytes / least
