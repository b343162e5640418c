"""How much a key may ask for: the size of a job and how many wait, before anything is queued.

A bound is the key's own, where an administrator set one; else that of the service, which keys with `admin` do not have.
"""

from __future__ import annotations

from collections.abc import Mapping

from schemas.job import JobSpec
from schemas.service import KeyRecord, SceneRecord
from services.keys import allows
from services.problems import Refusal
from services.settings import Settings

USUAL_STEPS = 10_000
"""No size of a network has more steps of its own."""

_REMEDY = "Ask for less at once, or an administrator for a key with a higher bound (diaphane keys create)."


def require_within(spec: JobSpec, scenes: Mapping[str, SceneRecord], key: KeyRecord, settings: Settings) -> None:
    """Refuses a job that is larger than its key may submit.

    Args:
        spec: The job.
        scenes: Records of its scenes, by id.
        key: The key.
        settings: With the bounds of the service.

    Raises:
        Refusal: It is.
    """
    pixels = pixels_of(spec, scenes)
    most = _bound(key, key.bounds.job_pixels, settings.job_pixels)
    if most is not None and pixels > most:
        raise Refusal("too-large", f"The job has {pixels} pixels in all views; the key may ask for {most}.", _REMEDY)
    most = _bound(key, key.bounds.job_steps, settings.job_steps)
    if spec.kind in ("build", "train") and most is not None:
        steps = spec.steps or (0 if most >= USUAL_STEPS else _default_steps(spec))
        if steps > most:
            raise Refusal("too-large", f"The job has {steps} steps; the key may ask for {most}.", _REMEDY)


def most_jobs(key: KeyRecord, settings: Settings) -> int | None:
    """How many jobs of a key may not have ended: those of a key take turns with those of others. None: any number."""
    return _bound(key, key.bounds.jobs, settings.jobs)


def pixels_of(spec: JobSpec, scenes: Mapping[str, SceneRecord]) -> int:
    """Pixels of all views of a job: those that it lists, else the stages' cameras, at most as many as are sampled."""
    views = sum(len(use.views) or _views(spec, scenes[use.scene]) for use in spec.scenes)
    return views * spec.width * spec.height


def _default_steps(spec: JobSpec) -> int:
    from trainer.config import TrainConfig  # imported late: it takes a second, and is hardly ever needed

    return TrainConfig.sized(spec.network).steps


def _views(spec: JobSpec, scene: SceneRecord) -> int:
    cameras = (scene.facts or {}).get("cameras", 0)
    return min(cameras, spec.views_per_scene) if cameras else spec.views_per_scene


def _bound(key: KeyRecord, own: int | None, general: int) -> int | None:
    if own is not None:
        return own
    return None if allows(key, "admin") else general
