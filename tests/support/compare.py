"""A service with two views that were captured, labelled and evaluated, without a GPU: pictures by the labeller."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from evaluation.pictures import counts_map, quantise_map, stem, write_png
from labeller.allocation import RuleName
from labeller.curves import Curves, composite, error_curves
from labeller.rules import allocate_curves
from renderer import metrics
from renderer.dump import write_dump
from renderer.exr import write_exr
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.measurement import Measurement
from schemas.tail import TailName
from schemas.view import View as Camera
from stages.desk import save_facts
from stages.label import LABEL, LabelParams
from stages.making import label as making
from stages.store import Address
from support.api import Api, measurement
from support.dumps import random_dump

TAIL: TailName = "density-16"
G = 0.75
FACTORS = (1.0, 2.0)
CAMERA = Camera(name="front", eye=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
HOSTILE_VIEW = "<b onclick=x>\"'&?#/../%00"
RULES: dict[str, RuleName] = {"kbuffer": "fixed", "kbuffer-importance": "importance", "kbuffer-optimal": "optimal"}
MODELS: dict[str, RuleName] = {"glass@1.0.0": "uniform", "glass@1.1.0": "increment"}


@dataclass
class View:
    """What was made of a view.

    Attributes:
        dump: Its fragments.
        curves: Its error curves.
        render: Address of the fragments.
        label: Address of the labels.
        evaluations: Model, or None for the techniques without one -> address of the pictures.
    """

    dump: FragmentDump
    curves: Curves
    render: Address
    label: Address
    evaluations: dict[str | None, Address]

    def k(self, rule: RuleName, factor: float) -> np.ndarray:
        """int32 [P], an allocation."""
        return allocate_curves(self.dump, self.curves, [self.budget(factor)], rule)[0].k

    def budget(self, factor: float) -> int:
        return int(factor * self.dump.pixels)


@dataclass
class Filled:
    """A scene and its views."""

    scene: str
    views: dict[str, View]


def fill(api: Api, size: tuple[int, int] = (24, 16), max_n: int = 12) -> Filled:
    """Makes everything and records it."""
    scene = api.scene()
    digest = api.service.scenes.get(scene).digest
    names = ("front", HOSTILE_VIEW)
    return Filled(scene, {name: _view(api, digest, name, size, max_n, n) for n, name in enumerate(names)})


def _view(api: Api, digest: str, name: str, size: tuple[int, int], max_n: int, seed: int) -> View:
    store, dump = api.service.storage.store, random_dump(*size, max_n, seed=seed)
    render = Address("render", "v1", (digest,), {"view": {"name": name}})
    with store.put(render) as folder:
        write_dump(folder, dump)
    budgets = [int(factor * dump.pixels) for factor in FACTORS]
    params = LabelParams(budgets=tuple(budgets), tail=TAIL, g=G, metric="display", seed=1, weights="none")
    task = LABEL.task(name, params, inputs=(render.key,))
    labelled = task.address
    desk = SimpleNamespace(artifact=lambda task, stage: store.fetch(render.artifact))
    with store.put(labelled) as folder:
        save_facts(folder, making.make(desk, task, params, folder, lambda *_: None))  # type: ignore[arg-type]
    view = View(dump, error_curves(dump, TAIL, G), render, labelled, {})
    for model in (None, *MODELS):
        inputs = (render.key, labelled.key) if model is None else (render.key, labelled.key, model)
        address = Address("evaluate", "v1", inputs, {"tail": TAIL, "g": G, "factors": list(FACTORS)})
        with store.put(address) as folder:
            found = _evaluate(folder, view, name, model)
        api.service.measured.record(address.artifact, found, {"bottles": digest}, model, None)
        view.evaluations[model] = address
    return view


def _evaluate(folder: Path, view: View, name: str, model: str | None) -> list[Measurement]:
    dump = view.dump
    shape = (dump.height, dump.width, 3)
    linear = composite(dump, dump.counts, TAIL, G).reshape(shape)
    exact = display8(linear)
    write_png(folder / "exact.png", exact)
    write_exr(folder / "exact.exr", linear)
    everything = dump.total / dump.pixels
    shots = [(t, r, f) for f in FACTORS for t, r in RULES.items()]
    if model is not None:
        shots = [("kbuffer-deep", MODELS[model], factor) for factor in FACTORS]
    made = []
    about = {"view": name, "width": dump.width, "height": dump.height, "tail": TAIL, "total_fragments": dump.total}
    about["camera"] = CAMERA.model_copy(update={"name": name})
    for technique, rule, factor in shots:
        k = view.k(rule, factor)
        linear = composite(dump, k, TAIL, G).reshape(shape)
        picture = display8(linear)
        base = stem(technique, factor)
        write_png(folder / f"{base}.png", picture)
        write_exr(folder / f"{base}.exr", linear)
        write_png(folder / f"{base}.k.png", counts_map(k).reshape(shape[:2]))
        write_png(folder / f"{base}.flip.png", quantise_map(metrics.flip(picture, exact)[1]))
        more = {"technique": technique, "budget": view.budget(factor), "budget_factor": factor, "k_max": int(k.max())}
        made.append(measurement(mse=metrics.mse(picture, exact), **about, **more))
    if model is None:
        write_png(folder / f"{stem('sbuffer', everything)}.k.png", counts_map(dump.counts).reshape(shape[:2]))
        more = {"technique": "sbuffer", "budget": dump.total, "budget_factor": everything, "exact": True}
        made.append(measurement(mse=0.0, k_max=int(dump.counts.max()), **about, **more))
        held = {"technique": "kbuffer", "budget": 99 * dump.pixels, "budget_factor": 99.0, "exact": True}
        made.append(measurement(mse=0.0, skipped="the budget holds every fragment", **about, **held))
    return made
