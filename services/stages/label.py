"""Stage `label`: error curves of every view, its allocations by every rule at every budget, and its training rows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

from labeller.allocate import allocate
from labeller.allocation import RULES, Allocation
from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.shards import write_shard
from renderer.dump import read_dump
from schemas.fragments import FragmentDump
from schemas.measurement import Certificate
from schemas.tail import MetricName
from services.stages.render import RenderedView
from services.stages.workspace import SceneEntry, Workspace
from services.store import Address
from services.versions import code_version

METRIC: MetricName = "display"
SHARD = "shard.safetensors"
_OPTIMAL = "optimal.safetensors"
_FACTS = "label.json"
_SOURCES = ("labeller", "renderer.allocation", "renderer.features", "renderer.dump", "schemas.tail", "schemas.colour")


@dataclass(frozen=True, slots=True)
class LabelledView:
    """A view with its curves and allocations.

    Attributes:
        rendered: The view.
        address: Of the label artifact.
        folder: Where it is.
        certificates: Of the optimal allocation, and the errors of the other rules, one per budget.
    """

    rendered: RenderedView
    address: Address
    folder: Path
    certificates: tuple[Certificate, ...]

    @property
    def scene(self) -> SceneEntry:
        """The scene it is a view of."""
        return self.rendered.scene

    def optimal(self, fragments: int) -> NDArray[np.int32]:
        """int32 [P], the certified optimal allocation of a budget below N."""
        return np.asarray(load_file(self.folder / _OPTIMAL)[str(fragments)], dtype=np.int32)


def label_views(work: Workspace, views: tuple[RenderedView, ...]) -> tuple[LabelledView, ...]:
    """Labels of all views: all budgets of a view in one task."""
    labelled = []
    with work.progress.stage("error curves", len(views)) as stage:
        for view in views:
            labelled.append(_label(work, view))
            stage.advance(1, f"{view.scene.label} {view.view.name}")
    return tuple(labelled)


def _label(work: Workspace, view: RenderedView) -> LabelledView:
    options = work.options
    params = {
        "budgets": list(work.budgets),
        "tail": options.tail,
        "g": options.g,
        "metric": METRIC,
        "seed": options.seed,
    }
    address = Address("label", code_version(*_SOURCES, __name__), (view.address.key,), params)
    folder = work.store.get(address)
    if folder is None:
        work.worked = True
        with work.store.put(address) as made:
            _make(work, read_dump(view.folder), made)
        folder = work.store.path(address)
    else:
        work.progress.skipped("views already labelled")
    facts = json.loads((folder / _FACTS).read_text(encoding="utf-8"))
    certificates = [
        Certificate(
            scene=view.scene.label,
            view=view.view.name,
            budget_factor=factor,
            rules={rule: errors[index] for rule, errors in facts["errors"].items() if rule != "optimal"},
            **facts["certificates"][index],
        )
        for index, factor in enumerate(options.budgets)
    ]
    return LabelledView(view, address, folder, tuple(certificates))


def _make(work: Workspace, dump: FragmentDump, folder: Path) -> None:
    options = work.options
    curves = error_curves(dump, options.tail, options.g, METRIC)
    hulls = lower_hulls(curves, 1)
    made = {rule: allocate(dump, curves, work.budgets, rule, hulls=hulls) for rule in RULES}
    optimal = made["optimal"]
    # k rarely exceeds 255, never 65535 at any budget that is not exact; 16 bits halve the artifact.
    save_file(
        {str(a.budget): np.minimum(a.k, 65535).astype(np.uint16) for a in optimal if not a.exact} or _NOTHING,
        folder / _OPTIMAL,
    )
    write_shard(folder / SHARD, dump, curves, hulls, work.budgets, seed=options.seed)
    facts = {
        "errors": {rule: [a.error for a in allocations] for rule, allocations in made.items()},
        "certificates": [_certificate(a) for a in optimal],
    }
    (folder / _FACTS).write_text(json.dumps(facts), encoding="utf-8")


_NOTHING = {"none": np.zeros(1, dtype=np.uint16)}
"""A safetensors file must hold something."""


def _certificate(a: Allocation) -> dict[str, float]:
    return {"error": a.error, "bound": a.error if a.bound is None else a.bound, "gap": a.gap or 0.0}
