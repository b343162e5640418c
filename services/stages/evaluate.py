"""Stage `evaluate`: real pictures of every technique, within every budget, against the exact one.

Techniques that do not depend on the bundle (`baseline`) and the bundle itself (`bundle`) are separate artifacts, so
that a new bundle renders only its own pictures.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from labeller.curves import composite
from renderer import metrics
from renderer.dump import read_dump
from renderer.frame import Frame
from renderer.techniques import (
    Budget,
    KBuffer,
    KBufferDeep,
    KBufferImportance,
    KBufferOptimal,
    Rendered,
    SBuffer,
    Technique,
)
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.measurement import Measurement
from schemas.problem import ExitCode, Problem
from services.stages.label import LabelledView
from services.stages.pictures import quantise_map, stem, write_png
from services.stages.render import frame_of
from services.stages.workspace import Workspace
from services.store import Address
from services.versions import code_version

_SOURCES = ("renderer.techniques", "renderer.allocation", "renderer.shaders", "renderer.metrics", "labeller.curves")

Kind = Literal["baseline", "bundle"]

AGREEMENT = 1
"""Steps of 1/255 by which a GL picture may differ from the CPU simulation of its own allocation, in any channel."""


@dataclass(frozen=True, slots=True)
class EvaluatedView:
    """Measurements and pictures of one view.

    Attributes:
        labelled: The view.
        measurements: Of all techniques and budgets.
        folders: Where the pictures are, by technique.
    """

    labelled: LabelledView
    measurements: tuple[Measurement, ...]
    folders: dict[str, Path]


def evaluate_views(
    work: Workspace,
    views: Iterable[LabelledView],
    bundle: Path,
    bundle_digest: str,
    kinds: tuple[Kind, ...] = ("baseline", "bundle"),
) -> tuple[EvaluatedView, ...]:
    """Render and measure views with the baselines, the oracle and a bundle.

    Args:
        work: The build.
        views: Labelled views.
        bundle: The bundle's folder.
        bundle_digest: Hash of its files.
        kinds: Which of the two kinds of technique.
    """
    listed = list(views)
    evaluated = []
    with work.progress.stage("evaluate pictures", len(kinds) * len(listed)) as stage:
        for view in listed:
            # The frame's opaque and gather passes serve both kinds, if either has to be rendered at all.
            session = _Session(work, view)
            folders: dict[str, Path] = {}
            measurements: list[Measurement] = []
            for kind in kinds:
                folder = _evaluate(work, view, kind, session, bundle, bundle_digest)
                records = json.loads((folder / "measurements.json").read_text(encoding="utf-8"))
                made = [Measurement.model_validate({**record, "scene": view.scene.label}) for record in records]
                folders |= {m.technique: folder for m in made}
                measurements += made
                stage.advance(1, f"{view.scene.label} {view.rendered.view.name} {kind}")
            evaluated.append(EvaluatedView(view, tuple(measurements), folders))
    return tuple(evaluated)


class _Session:
    """What both kinds of one view share, made when first needed."""

    def __init__(self, work: Workspace, view: LabelledView) -> None:
        self._work, self._view = work, view
        self._frame: Frame | None = None
        self._dump: FragmentDump | None = None
        self._exact: NDArray[np.uint8] | None = None

    @property
    def frame(self) -> Frame:
        """The view on the GPU."""
        if self._frame is None:
            self._frame = frame_of(self._work, self._view.scene, self._view.rendered.view)
        return self._frame

    @property
    def dump(self) -> FragmentDump:
        """Its fragments."""
        if self._dump is None:
            self._dump = read_dump(self._view.rendered.folder)
        return self._dump

    @property
    def exact(self) -> NDArray[np.uint8]:
        """The reference picture, uint8 [H, W, 3]: all fragments composited on the CPU in float64."""
        if self._exact is None:
            self._exact = self.simulate(self.dump.counts.astype(np.int32))
        return self._exact

    def simulate(self, k: NDArray[np.int32]) -> NDArray[np.uint8]:
        """The CPU's picture of an allocation, uint8 [H, W, 3]."""
        options = self._work.options
        linear = composite(self.dump, k, options.tail, options.g)
        return display8(linear.reshape(options.height, options.width, 3))


def _evaluate(
    work: Workspace, view: LabelledView, kind: Kind, session: _Session, bundle: Path, bundle_digest: str
) -> Path:
    options = work.options
    inputs = [view.rendered.address.key, view.address.key, *([bundle_digest] if kind == "bundle" else [])]
    params = {"kind": kind, "budgets": list(work.budgets), "tail": options.tail, "g": options.g}
    address = Address("evaluate", code_version(*_SOURCES, __name__), inputs, params)
    folder = work.store.get(address)
    if folder is not None:
        work.progress.skipped(f"{kind} pictures already rendered")
        return folder
    work.worked = True
    with work.store.put(address) as made:
        if kind == "baseline":
            records = _baseline(work, view, session, made)
        else:
            records = _bundle(work, view, session, made, bundle)
        text = json.dumps([record.model_dump(mode="json", exclude={"scene"}) for record in records])
        (made / "measurements.json").write_text(text, encoding="utf-8")
    return work.store.path(address)


def _baseline(work: Workspace, view: LabelledView, session: _Session, folder: Path) -> list[Measurement]:
    write_png(folder / "exact.png", session.exact)
    records = [_exact(work, view, session)]
    for shot in _shots(work, view, session, folder):
        records.append(shot.take(KBuffer.name, KBuffer))
        records.append(shot.take(KBufferImportance.name, KBufferImportance))
        records.append(shot.take(KBufferOptimal.name, partial(_oracle, view, shot.fragments)))
    return records


def _oracle(view: LabelledView, fragments: int) -> KBufferOptimal:
    return KBufferOptimal(view.optimal(fragments))


def _bundle(work: Workspace, view: LabelledView, session: _Session, folder: Path, bundle: Path) -> list[Measurement]:
    technique = KBufferDeep(bundle)
    return [shot.take(technique.name, lambda: technique) for shot in _shots(work, view, session, folder)]


def _shots(work: Workspace, view: LabelledView, session: _Session, folder: Path) -> list[_Shot]:
    budgets = zip(work.options.budgets, work.budgets, strict=True)
    return [_Shot(work, view, session, folder, factor, fragments) for factor, fragments in budgets]


def _exact(work: Workspace, view: LabelledView, session: _Session) -> Measurement:
    """The exact technique: what it costs is the budget it needs."""
    shot = _Shot(work, view, session, None, view.rendered.total / session.frame.pixels, view.rendered.total)
    try:
        rendered = SBuffer().render(session.frame, Budget(shot.fragments))
    except Problem as problem:  # more fragments than a storage buffer holds: the others still can be measured
        return shot.record("sbuffer", exact=True, skipped=problem.title)
    return shot.measure("sbuffer", rendered, exact=True)


@dataclass(frozen=True, slots=True)
class _Shot:
    """A view and a budget, waiting for a technique."""

    work: Workspace
    view: LabelledView
    session: _Session
    folder: Path | None
    factor: float
    fragments: int

    def take(self, name: str, make: Callable[[], Technique]) -> Measurement:
        """Render with the technique that `make` gives, compare, keep the pictures."""
        if self.fragments >= self.view.rendered.total:
            why = "the budget holds every fragment: every technique is exact"
            return self.record(name, exact=True, skipped=why, mse=0.0)
        options = self.work.options
        rendered = make().render(self.session.frame, Budget(self.fragments, options.tail, options.g))
        return self.measure(name, rendered)

    def measure(self, name: str, rendered: Rendered, exact: bool = False) -> Measurement:
        """Compare with the exact picture and with the CPU simulation of the same allocation."""
        image, reference = display8(rendered.linear), self.session.exact
        difference = _largest_difference(image, self.session.simulate(rendered.k))
        if difference > AGREEMENT:
            raise Problem(
                f"The GL picture of {name} ({self.view.scene.label}, {self.view.rendered.view.name}) "
                f"differs from the CPU simulation of the same allocation by {difference}/255.",
                "This is a defect of the driver or of Diaphane: please report it with the scene.",
                ExitCode.CHECK_FAILED,
            )
        error = metrics.mse(image, reference)
        flip, flip_map = metrics.flip(image, reference)
        if self.folder is not None:
            self._keep(self.folder, name, image, flip_map, rendered.k)
        occupied = self.session.dump.counts > 0
        shape = (-1, 3)
        return self.record(
            name,
            exact=exact,
            mse=error,
            mse_occupied=metrics.mse(image.reshape(shape)[occupied], reference.reshape(shape)[occupied]),
            psnr=None if error == 0.0 else metrics.psnr(error),
            flip=flip,
            k_min=int(rendered.k[occupied].min()),
            k_max=int(rendered.k.max()),
            captured_fragments=rendered.captured,
            pool_bytes=rendered.pool_bytes,
            total_bytes=rendered.total_bytes,
            passes=rendered.passes,
            total_ms=rendered.milliseconds,
            cpu_difference=difference,
        )

    def record(self, name: str, **measured: Any) -> Measurement:
        """A measurement of this view and budget."""
        options = self.work.options
        return Measurement(
            scene=self.view.scene.label,
            view=self.view.rendered.view.name,
            technique=name,
            budget=self.fragments,
            budget_factor=self.factor,
            width=options.width,
            height=options.height,
            alpha=options.alpha,
            tail=options.tail,
            total_fragments=self.view.rendered.total,
            **measured,
        )

    def _keep(
        self, folder: Path, name: str, image: NDArray[np.uint8], flip_map: NDArray[np.float32], k: NDArray[np.int32]
    ) -> None:
        base = stem(name, self.factor)
        write_png(folder / f"{base}.png", image)
        write_png(folder / f"{base}.flip.png", quantise_map(flip_map))
        write_png(folder / f"{base}.k.png", np.minimum(k, 255).astype(np.uint8).reshape(image.shape[:2]))


def _largest_difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> int:
    return int(np.abs(a.astype(np.int16) - b.astype(np.int16)).max())
