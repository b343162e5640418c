"""Stage `publish`: the bundle into the registry, and the champion's alias to it if it is better on the same views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from schemas.bundle import load_manifest
from schemas.measurement import Measurement, RegistryResult
from services import summary
from services.registry import Publication, Registry, bundle_digest
from services.stages.evaluate import EvaluatedView
from services.stages.workspace import Workspace

MeasureBundle = Callable[[Path, str], Sequence[Measurement]]
"""Measures another bundle, given by folder and digest, on this build's held-out views."""


def publish(work: Workspace, bundle: Path, views: Sequence[EvaluatedView], measure: MeasureBundle) -> RegistryResult:
    """Publish a bundle with its score on the held-out views.

    A champion that was evaluated on other views is rendered on these, so that like is compared with like; one that was
    trained on a scene held out here cannot be compared, and stays.

    Args:
        work: The build.
        bundle: The exported bundle.
        views: All evaluated views; those of held-out scenes count.
        measure: Renders the champion where its score is not comparable.
    """
    registry = Registry(work.options.state / "registry")
    name = work.options.name
    held_out = [view for view in views if view.labelled.scene.held_out]
    measurements = [m for view in held_out for m in view.measurements]
    score = summary.score(measurements)
    known = {publication.digest for publication in registry.versions(name)}
    publication = registry.publish(name, bundle, score, _evaluation(work, held_out))
    if publication.digest in known:
        work.progress.skipped("bundles already published")
    rival = None if score is None else _rival(registry, publication, held_out, measure)
    promoted, reason = registry.consider(publication, score, rival)
    return RegistryResult(
        reference=f"{name}@{publication.version}",
        folder=str(registry.folder(publication)),
        champion=promoted,
        reason=reason,
        score=score,
    )


def _rival(
    registry: Registry, publication: Publication, held_out: Sequence[EvaluatedView], measure: MeasureBundle
) -> float | None:
    """The champion's score on the same views; None if there is no other champion, or it was trained on one of them."""
    champion = registry.champion(publication.name)
    if champion is None or champion.version == publication.version:
        return None
    folder = registry.folder(champion)
    trained_on = set(load_manifest(folder).provenance.scenes.values())
    if trained_on & {view.labelled.scene.digest for view in held_out}:
        return None
    baseline = [m for view in held_out for m in view.measurements if m.technique != summary.BUNDLE]
    return summary.score([*baseline, *measure(folder, bundle_digest(folder))])


def _evaluation(work: Workspace, held_out: Sequence[EvaluatedView]) -> dict[str, object]:
    options = work.options
    return {
        "views": sorted(view.labelled.rendered.address.key for view in held_out),
        "budgets": list(work.budgets),
        "tail": options.tail,
        "g": options.g,
    }
