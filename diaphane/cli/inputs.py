"""The scenes that a job is made from: ids, or local files that are uploaded as far as the server lacks them."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diaphane.cli.lines import plain
from diaphane.client.packing import Package, pack
from evaluation.progress import Progress, make_progress
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from diaphane.client import Client, Record

_ID = re.compile(r"scn_[0-9a-f]{32}")
_FIRST_TOLD_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class SceneInput:
    """A scene as named on the command line.

    Attributes:
        reference: An id or the path of a file.
        held_out: Whether it is evaluated on and never trained on.
        licence: Its licence and whom to name for it; None: as its stage states them.
    """

    reference: str
    held_out: bool
    licence: str | None = None

    @property
    def is_id(self) -> bool:
        """Whether the server has it already."""
        return _ID.fullmatch(self.reference) is not None


def named_scenes(scenes: Sequence[str], held_out: Sequence[str]) -> list[SceneInput]:
    """All scenes in order; what is held out is among them by path, stem or id, or comes on top.

    Raises:
        Problem: A held-out entry is neither a file nor an id, or names several scenes by their stem.
    """
    found = dict.fromkeys(scenes, False)
    for entry in held_out:
        paths = [s for s in scenes if s == entry or Path(s).resolve() == Path(entry).resolve()]
        matches = paths or [s for s in scenes if Path(s).stem == entry]
        if len(matches) > 1:
            raise Problem(f"The held-out scene {entry} names more than one of the scenes.", "Name it by its path.")
        if not matches and not _ID.fullmatch(entry) and not Path(entry).is_file():
            raise Problem(
                f"The held-out scene {entry} is neither among the scenes nor a file.",
                "Name it by its path, or by its id from `diaphane scenes list`.",
                ExitCode.NOT_FOUND,
            )
        found[matches[0] if matches else entry] = True
    return [SceneInput(reference, held) for reference, held in found.items()]


def with_licences(inputs: Sequence[SceneInput], licences: Sequence[str]) -> list[SceneInput]:
    """The scenes with the licences of `--licence`; see `diaphane.local.options.parse_licences`.

    Raises:
        Problem: One is of no scene that is named.
    """
    from diaphane.local.options import parse_licences

    found = parse_licences(licences, [given.reference for given in inputs])
    return [replace(given, licence=found.get(given.reference)) for given in inputs]


def bring(server: Client, references: Sequence[str], *, silent: bool = False) -> list[Record]:
    """Uploads what is new of local scenes, and waits until the server has checked everything.

    Args:
        server: The server.
        references: Ids, or paths of files.
        silent: Whether no progress is shown.

    Returns:
        The scenes as the server knows them, in order.

    Raises:
        Problem: A file cannot be uploaded, a scene is rejected, or two are the same.
    """
    # Everything that can be wrong here is found before anything is sent.
    packages = {r: pack(Path(r)) for r in references if not _ID.fullmatch(r)}
    progress = make_progress(sys.stderr, silent=silent)
    sent = upload(server, list(packages.values()), progress)
    ids = dict(zip(packages, (scene["id"] for scene in sent), strict=True))
    checked = await_checks(server, [ids.get(reference, reference) for reference in references], progress)
    scenes: list[Record] = []
    for reference, scene in zip(references, checked, strict=True):
        ensure_accepted(scene, reference)
        twin = next((i for i, other in enumerate(scenes) if other["id"] == scene["id"]), None)
        if twin is not None:
            raise Problem(f"{references[twin]} and {reference} are the same scene.", "Name each scene once.")
        scenes.append(scene)
    return scenes


def upload(server: Client, packages: Sequence[Package], progress: Progress) -> list[Record]:
    """Uploads and registers scenes; says what they refer to and lack.

    Returns:
        The scenes, perhaps still being checked.
    """
    if not packages:
        return []
    scenes = []
    with progress.stage("upload scenes", len(packages)) as stage:
        for package in packages:
            for name in package.missing:
                progress.note(plain(f"{package.root} refers to {name}, which does not exist: it is left out."))
            sent = 0

            def advance(name: str, count: int) -> None:
                nonlocal sent
                sent += count
                stage.advance(0, f"{name} {sent / 2**20:.1f} MiB")

            scenes.append(server.scenes.upload(package, advance))
            if not sent:
                progress.skipped("scenes that the server had already")
            stage.advance(1, package.name)
    return scenes


def await_checks(server: Client, scene_ids: Sequence[str], progress: Progress) -> list[Record]:
    """Waits until the server has checked scenes, and says that it still does.

    Args:
        server: The server.
        scene_ids: Their ids.
        progress: What it is said to.

    Returns:
        The scenes, accepted or rejected, in order.

    Raises:
        Problem: A check does not end.
    """
    scenes = []
    with progress.stage("check scenes", len(scene_ids)) as stage:
        for scene_id in scene_ids:
            told = 0.0

            def say(waited: float, scene: dict[str, Any]) -> None:
                nonlocal told
                name = plain(scene.get("name") or scene["id"])
                stage.advance(0, f"{name} {waited:.0f} s")
                if waited >= max(_FIRST_TOLD_SECONDS, 2.0 * told):
                    told = waited
                    progress.note(
                        f"{name} is still being checked ({waited:.0f} s); `diaphane workers` shows the queue."
                    )

            scenes.append(server.scenes.wait(scene_id, waiting=say))
            stage.advance(1)
    return scenes


def ensure_accepted(scene: dict[str, Any], what: str) -> None:
    """Raises the reason why a scene was rejected.

    Raises:
        Problem: It was.
    """
    if scene["state"] == "rejected":
        problem = scene.get("problem") or {}
        reason = plain(problem.get("detail") or problem.get("title") or "no reason was given.")
        remedy = plain(problem.get("remedy") or "Change the scene.")
        raise Problem(f"The server rejects {what}: {reason}", remedy, ExitCode.CHECK_FAILED)


def scene_uses(
    inputs: Sequence[SceneInput], scenes: Sequence[dict[str, Any]], views: Path | None = None
) -> list[dict[str, Any]]:
    """The scenes as a job lists them (`schemas.job.SceneUse`).

    Args:
        inputs: As named on the command line.
        scenes: As the server knows them.
        views: JSON file with views of the local ones.
    """
    uses = []
    for given, scene in zip(inputs, scenes, strict=True):
        use: dict[str, Any] = {"scene": scene["id"], "holdout": given.held_out, "licence": given.licence}
        if views is not None and not given.is_id:
            from renderer.views import listed_views

            use["views"] = [view.model_dump(mode="json") for view in listed_views(views, Path(given.reference))]
        uses.append(use)
    return uses
