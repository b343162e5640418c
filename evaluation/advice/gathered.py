"""The numbers of advice out of what a benchmark, a build or the service measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from evaluation.advice.amounts import DEFAULT_MEMORY, parse_memory
from evaluation.advice.rules import advise, candidates
from evaluation.advice.words import sentences
from evaluation.summary import BUNDLE, EXACT, ORACLE
from schemas.advice import Advice, AdvisedScene, Sample, SeenView, Size, sbuffer_bytes
from schemas.bench import BenchCell, BenchView
from schemas.measurement import Measurement

BOUNDED = ("kbuffer", "kbuffer-dynamic", "kbuffer-importance", BUNDLE)
"""Techniques of measurements that a renderer can run within a budget."""


def of_bench(title: str, views: Sequence[BenchView]) -> Advice:
    """Advice within the usual memory at the size of a benchmark.

    Args:
        title: Of the views.
        views: Of one scene, opacity and size.
    """
    size = Size(width=views[0].width, height=views[0].height)
    seen = [SeenView(name=view.view, load=view.fragments / size.pixels, most=view.most) for view in views]
    samples = [
        sample for view in views for cell in view.cells if (sample := _of_cell(view.view, cell, size)) is not None
    ]
    return said(_scene(title, seen, samples, size), size, parse_memory(DEFAULT_MEMORY))


def of_measurements(
    title: str, measured: Sequence[tuple[Measurement, str]], size: Size | None = None, memory: int | None = None
) -> Advice | None:
    """Advice by what a job or a build measured; None of nothing.

    Args:
        title: How the scene is called.
        measured: Measurements of the scene, each with the label of the bundle that it is of. Of two of the same view,
            technique and budget the first counts; of several sizes that of most of them.
        size: Of the picture; None: as measured.
        memory: Bytes; None: the usual ones.
    """
    sizes = Counter((m.width, m.height) for m, _ in measured)
    if not sizes:
        return None
    width, height = max(sizes, key=lambda each: (sizes[each], each))
    found = [(m, bundle) for m, bundle in measured if (m.width, m.height) == (width, height)]
    taken = Size(width=width, height=height)
    views: dict[str, SeenView] = {}
    for m, _ in found:
        most = m.k_max if m.technique == EXACT else None
        if m.view not in views or most is not None:
            views[m.view] = SeenView(name=m.view, load=m.total_fragments / taken.pixels, most=most)
    samples = [sample for m, bundle in found if (sample := _of_measurement(m, bundle, taken)) is not None]
    given = parse_memory(DEFAULT_MEMORY) if memory is None else memory
    return said(_scene(title, list(views.values()), samples, taken), size or taken, given)


def said(scene: AdvisedScene, size: Size, memory: int) -> Advice:
    """Advice with its words.

    Args:
        scene: What is known.
        size: Of the picture.
        memory: Bytes that all buffers of a frame may take.
    """
    advice = advise(scene, size, memory)
    return advice.model_copy(update={"text": sentences(advice)})


def _scene(title: str, views: Sequence[SeenView], samples: Sequence[Sample], size: Size) -> AdvisedScene:
    there = [view for view in views if view.load]
    return AdvisedScene(
        name=title,
        views=tuple(views),
        counted=size,
        measured=size,
        candidates=candidates([*samples, *_sbuffers(there)], [view.name for view in there]),
    )


def _sbuffers(views: Sequence[SeenView]) -> Iterator[Sample]:
    """What the S-buffer takes, whether or not it was measured: its bytes follow from the fragments."""
    for view in views:
        yield Sample(view=view.name, technique=EXACT, family="exact", pixel_bytes=sbuffer_bytes(view.load), mse=0.0)


def _of_cell(view: str, cell: BenchCell, size: Size) -> Sample | None:
    if cell.basis == "memory" or cell.technique in (ORACLE, EXACT) or cell.total_bytes is None:
        return None
    is_exact = cell.family == "exact"
    if cell.mse is None and not is_exact:
        return None
    return Sample(
        view=view,
        technique=cell.technique,
        family=cell.family,
        budget=cell.budget_factor,
        tail=cell.tail or "",
        bundle=cell.bundle or "",
        pixel_bytes=cell.total_bytes / size.pixels,
        mse=0.0 if is_exact else cell.mse or 0.0,
    )


def _of_measurement(m: Measurement, bundle: str, size: Size) -> Sample | None:
    if m.technique not in BOUNDED or m.total_bytes is None or m.mse is None:
        return None
    return Sample(
        view=m.view,
        technique=m.technique,
        family="bounded",
        budget=m.budget_factor,
        tail=m.tail,
        bundle=bundle if m.technique == BUNDLE else "",
        pixel_bytes=m.total_bytes / size.pixels,
        mse=m.mse,
    )
