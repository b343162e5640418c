"""From scene files to advice, one scene after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from evaluation.advice.measure import Measuring
from evaluation.advice.options import AdviceOptions
from evaluation.advice.rules import advise, shown_instead
from evaluation.advice.sheet import Sheet, sheet
from evaluation.advice.words import Asked, commands, sentences
from evaluation.bench.cells import Bundle, bundle_of
from evaluation.local_scenes import LocalScene, as_usd
from evaluation.summary import EXACT
from renderer.views import scene_views
from schemas.advice import Advice, Work
from schemas.glass import DEFAULT_GLASS
from schemas.view import View

VIEWS: Final = 3
"""Of a scene; those of a views file are spread over it."""
_SEED: Final = 0


@dataclass(frozen=True, slots=True)
class Advised:
    """Advice on a scene, with pictures.

    Attributes:
        file: The scene.
        advice: What to use, and why.
        sheet: Its worst views and pixels; None: there is nothing to show.
    """

    file: Path
    advice: Advice
    sheet: Sheet | None


def advised(options: AdviceOptions, folder: Path | None, has_pictures: bool = True) -> Iterator[Advised]:
    """Advice on every scene.

    Args:
        options: What to advise on.
        folder: Of the bundle of the options (`used_bundle`); None: there is none.
        has_pictures: Whether the sheet of the worst views is made.

    Raises:
        Problem: A scene cannot be loaded, or the bundle is none.
    """
    bundle = None if folder is None else bundle_of(folder)
    for file in options.scenes:
        with as_usd(file) as usd:
            local = LocalScene(file, usd, options.load)
            local.at(None)
            yield _advised(options, file, local, bundle, has_pictures)


def _advised(
    options: AdviceOptions, file: Path, local: LocalScene, bundle: Bundle | None, has_pictures: bool
) -> Advised:
    measuring = Measuring(file.stem, local.gpu(), _views(options, local), options.size, options.memory, bundle)
    advice = advise(measuring.scene(), options.size, options.memory)
    work = tuple(_work(measuring, advice))
    advice = advice.model_copy(update={"work": work, "warnings": tuple(local.now.scene.warnings)})
    advice = advice.model_copy(update={"text": sentences(advice), "commands": commands(advice, _asked(options, file))})
    shown = shown_instead(advice)
    is_shown = has_pictures and shown is not None
    return Advised(file, advice, sheet(measuring, shown) if is_shown and shown is not None else None)


def _work(measuring: Measuring, advice: Advice) -> Iterator[Work]:
    """Accounts of the S-buffer and of what takes less, on the view with most fragments."""
    shown = shown_instead(advice)
    if shown is None and advice.choice.chosen is None:
        return
    loads = {view.name: view.load for view in advice.scene.views}
    view = max(measuring.views, key=lambda each: loads[each.name])
    for one in advice.scene.candidates:
        if one == shown or one.technique == EXACT:
            yield measuring.work(view, one)


def _views(options: AdviceOptions, local: LocalScene) -> list[View]:
    if options.views is None:
        return list(scene_views(local.now.scene, VIEWS, _SEED))
    found = [chosen.view for chosen in local.views(None, options.views)]
    return found[:: -(-len(found) // VIEWS)][:VIEWS]


def _asked(options: AdviceOptions, file: Path) -> Asked:
    given: list[str] = []
    load = options.load
    given += [] if load.alpha is None else ["--alpha", f"{load.alpha:g}"]
    given += [] if load.glass == DEFAULT_GLASS else ["--glass", load.glass]
    for variant in load.variants:
        given += ["--variant", variant]
    given += ["--refine", str(load.refine)] if load.refine else []
    return Asked(
        file=str(file),
        loading=tuple(given),
        views=None if options.views is None else str(options.views),
        bundle=None if options.used_bundle is None else _named(options.used_bundle),
    )


def _named(bundle: str) -> str:
    """The bundle as short as it can be named from here."""
    here = Path.cwd()
    path = Path(bundle)
    return str(path.relative_to(here)) if path.is_absolute() and path.is_relative_to(here) else bundle
