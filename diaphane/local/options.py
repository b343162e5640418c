"""What a user can ask `diaphane build` for, checked before any work starts.

Rules:
- every scene exists and is named once; held-out scenes are among the scenes, and at least one is left to train on;
- budgets are positive multiples of width * height fragments;
- the tail has depth bins, which a bundle's cores are made of;
- whatever does not hold is a `Problem` that names the option and says what to change.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from evaluation.choices import check_budget, check_bundle
from schemas.bundle_files import check_name
from schemas.flags import checked
from schemas.licence import tidy
from schemas.limits import LIMITS
from schemas.options import Options
from schemas.problem import ExitCode, Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TailName

M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class BuildOptions:
    """What `diaphane build` is asked for.

    Attributes:
        scenes: USD files, in the order given.
        name: Name of the bundle in the registry.
        options: What decides the outcome beside the scenes; the tail is one with depth bins.
        holdout: Those of `scenes` that are evaluated on and never trained on. Empty: chosen by `default_holdout`.
        licences: Scene -> its licence and whom to name for it, instead of what its stage states.
        views: JSON file with views; None: the stage's cameras, else sampled ones.
        start: Bundle whose weights the training begins with: a folder, or a reference of the registry.
        replay: Folder of a data set that is trained on as well, so that `start` does not forget it; None: that of the
            bundle's name, where there is one.
        state: Folder of artifacts, registry and reports.

    Raises:
        Problem: The options do not fit each other, or a scene is missing or named twice.
    """

    scenes: tuple[Path, ...]
    name: str
    options: Options = field(default_factory=Options)
    holdout: tuple[Path, ...] = ()
    licences: Mapping[Path, str] = field(default_factory=dict)
    views: Path | None = None
    start: str | None = None
    replay: Path | None = None
    state: Path = field(default=Path(".diaphane"))

    def __post_init__(self) -> None:
        check_name(self.name)
        check_bundle_tail(self.options.tail)
        _check_scenes(self.scenes)
        check_bundle(self.start, "--from")
        if self.replay is not None and self.start is None:
            raise Problem(
                "--replay needs --from: only a fine-tuning replays data.", "Add --from, or leave out --replay."
            )
        object.__setattr__(self, "holdout", _resolve_holdout(self.holdout, self.scenes))
        if self.views is not None and not self.views.is_file():
            raise Problem(
                f"There is no views file {self.views}.", "Check the path given to --views.", ExitCode.NOT_FOUND
            )

    @property
    def training(self) -> tuple[Path, ...]:
        """The scenes that are trained on: all that are not held out."""
        return tuple(scene for scene in self.scenes if scene not in self.holdout)

    @property
    def labels(self) -> dict[Path, str]:
        """A unique short name of every scene: its stem, with as many parent folders as tell it from the others."""
        labels: dict[Path, str] = {}
        for scene in self.scenes:
            parts = scene.resolve().with_suffix("").parts
            depth = next(d for d in range(1, len(parts) + 1) if _is_unique(parts[-d:], self.scenes))
            labels[scene] = "/".join(parts[-depth:])
        return labels


def asked(model: type[M], fields: Mapping[str, Any]) -> M:
    """The options of a build, or a job, of these fields.

    Args:
        model: `schemas.options.Options`, or what has its fields.
        fields: Name -> value.

    Raises:
        Problem: They cannot be.
    """
    budgets = fields.get("budgets")
    if budgets is not None:
        width, height = (fields.get(side, Options.model_fields[side].default) for side in ("width", "height"))
        _check_budgets(budgets, (width, height) if min(width, height) > 0 else None)
    return checked(model, fields)


def check_bundle_tail(tail: TailName) -> None:
    """Refuse to make a bundle for a tail that its predictor cannot use.

    Args:
        tail: Asked for.

    Raises:
        Problem: It has no depth bins.
    """
    if tail not in BINNED_TAILS:
        raise Problem(
            f"A bundle cannot be made for the tail {tail}: it has no depth bins, and cores are made of depth bins.",
            f"Use one of {', '.join(BINNED_TAILS)}: --tail {DEFAULT_TAIL}.",
        )


def parse_licences(texts: Sequence[str], scenes: Sequence[str]) -> dict[str, str]:
    """Licences of scenes, with whom to name for them.

    Args:
        texts: Each the licence of all scenes, or `SCENE=LICENCE`, which comes before that.
        scenes: As named on the command line; one can be meant by its stem too.

    Returns:
        Scene as named -> licence.

    Raises:
        Problem: A licence is empty, or of no scene that is named, or of several.
    """
    of_all: dict[str, str] = {}
    own: dict[str, str] = {}
    for text in texts:
        name, equals, licence = text.partition("=")
        named = [scene for scene in scenes if scene == name] or [scene for scene in scenes if Path(scene).stem == name]
        said = tidy(licence if equals else text)
        if not said or (equals and len(named) != 1):
            raise Problem(
                f"--licence '{text}' names no licence of a scene.",
                'Write it like --licence "CC0" for all scenes, or --licence "SCENE=CC-BY-4.0, by somebody" for one.',
            )
        if equals:
            own[named[0]] = said
        else:
            of_all = dict.fromkeys(scenes, said)
    return {**of_all, **own}


def default_holdout(scenes: Sequence[Path]) -> tuple[Path, ...]:
    """A quarter of the scenes, at least one; none of a single scene. The choice depends on their names alone."""
    if len(scenes) < 2:
        return ()
    ranked = sorted(scenes, key=lambda scene: hashlib.sha256(scene.stem.encode()).hexdigest())
    chosen = set(ranked[: max(1, len(scenes) // 4)])
    return tuple(scene for scene in scenes if scene in chosen)


def _is_unique(tail: tuple[str, ...], scenes: Sequence[Path]) -> bool:
    return sum(scene.resolve().with_suffix("").parts[-len(tail) :] == tail for scene in scenes) == 1


def _check_scenes(scenes: tuple[Path, ...]) -> None:
    if not scenes:
        raise Problem("No scene was given.", "Name at least one USD file: diaphane build SCENE.usdc --name NAME.")
    for scene in scenes:
        if scene.is_dir():
            raise Problem(f"{scene} is a folder.", "Name the USD file in it.")
        if not scene.is_file():
            raise Problem(f"There is no file {scene}.", "Check the path.", ExitCode.NOT_FOUND)
    # Two files that differ in the suffix alone (a.usda, a.usdc) could not be told apart in tables either.
    twice = [path for path, n in Counter(scene.resolve().with_suffix("") for scene in scenes).items() if n > 1]
    if twice:
        raise Problem(f"The scene {twice[0].name} is given more than once ({twice[0]}).", "Name each scene once.")


def _check_budgets(budgets: Sequence[float], size: tuple[int, int] | None) -> None:
    if not budgets:
        raise Problem("No budget was given.", "Give at least one, --budgets .5,1,2, or leave out --budgets.")
    if len(budgets) > LIMITS.budgets:
        raise Problem(f"{len(budgets)} budgets are too few or too many.", f"Give 1 to {LIMITS.budgets}.")
    for budget in budgets:
        check_budget(budget, "--budgets .5,1,2", size)


def _resolve_holdout(wanted: tuple[Path, ...], scenes: tuple[Path, ...]) -> tuple[Path, ...]:
    if not wanted:
        return default_holdout(scenes)
    chosen: set[Path] = set()
    for entry in wanted:
        matches = [s for s in scenes if s.resolve() == entry.resolve()] or [s for s in scenes if s.stem == str(entry)]
        if len(matches) != 1:
            fault = "is not among the scenes" if not matches else "names more than one of the scenes"
            raise Problem(f"The held-out scene {entry} {fault}.", "Name it in both places, by the same path.")
        chosen.add(matches[0])
    if len(chosen) == len(scenes):
        raise Problem("Every scene is held out, so none is left to train on.", "Hold out fewer, or add scenes.")
    return tuple(scene for scene in scenes if scene in chosen)
