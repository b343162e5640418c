"""What holds wherever a training begins with a network that has learned already: in a local build and in a job.

Rules:
- a scene is replayed only if the new training does not have it, by name or by content: its new version takes its place;
- what was held out is never replayed, and what the network was trained on cannot be held out: its score would prove
  nothing;
- labels of another tail, metric or sample are not mixed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from schemas.problem import ExitCode, Problem
from stages.plan import Plan, PlannedScene


def scenes_of(plan: Plan) -> dict[str, str]:
    """Label -> digest of all scenes of a plan."""
    return {scene.label: scene.source.digest for scene in plan.scenes}


def is_replayed(own: Mapping[str, str], label: str, digest: str) -> bool:
    """Whether a scene that was learned is trained on again.

    Args:
        own: Label -> digest of the scenes that the new training has, those that it holds out too.
        label: What the scene was called.
        digest: Hex digest of its content.
    """
    return label not in own and digest not in own.values()


def check_labels(called: str, made: Mapping[str, Any], asked: Mapping[str, Any], remedy: str) -> None:
    """Refuses to mix labels that do not mean the same.

    Args:
        called: What the earlier labels are called, at the beginning of a sentence.
        made: How they were made: name of a setting -> value.
        asked: How the new ones are made; has at least the names of `made`.
        remedy: What a user can do about it.

    Raises:
        Problem: They differ.
    """
    faults = [
        f"{name} {_shown(value)} instead of {_shown(asked[name])}"
        for name, value in made.items()
        if value != asked[name]
    ]
    if faults:
        raise Problem(f"{called} is labelled otherwise: {', '.join(faults)}.", remedy)


def refuse_known(scenes: Iterable[PlannedScene], known: Collection[str]) -> None:
    """Refuses to hold out what was learned.

    Args:
        scenes: Of the new training.
        known: Digests of the scenes that the network was trained on.

    Raises:
        Problem: One of them is held out.
    """
    for scene in scenes:
        if scene.held_out and scene.source.digest in known:
            raise Problem(
                f"The scene {scene.label} is held out, but the pretrained network was trained on it.",
                "Hold out another one (--holdout), or start from another network (--from): a test on what was "
                "trained on proves nothing.",
                ExitCode.CHECK_FAILED,
            )


def without_champion(name: str) -> str:
    """What is said where a training was to begin with the champion of a name that has none."""
    return f"{name} has no champion yet: the training begins from scratch."


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
