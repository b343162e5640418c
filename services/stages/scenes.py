"""Stage `scene`: reads each stage once, and notes its views and what was found in it."""

from __future__ import annotations

import json
from pathlib import Path

from renderer.scene import scene_digest
from renderer.views import scene_views, views_from_file
from schemas.problem import Problem
from schemas.view import View
from services.stages.workspace import SceneEntry, Workspace
from services.store import Address, file_sha256
from services.versions import code_version

_SOURCES = ("schemas.scene", "schemas.view", "schemas.colour", "renderer.scene", "renderer.usd", "renderer.views")


def scene_version() -> str:
    """Code version of whatever decides what a scene is."""
    return code_version(*_SOURCES)


def inspect_scenes(work: Workspace) -> tuple[SceneEntry, ...]:
    """Views and facts of every scene.

    Raises:
        Problem: A file is not a scene, or has nothing transparent in it.
    """
    options = work.options
    with work.progress.stage("read scenes", len(options.scenes)) as stage:
        entries = []
        for path in options.scenes:
            entries.append(_inspect(work, path))
            stage.advance(1, options.labels[path])
    _refuse_copies(entries)
    return _transparent(work, entries)


def _inspect(work: Workspace, path: Path) -> SceneEntry:
    options = work.options
    digest = scene_digest(path)
    views_file = None if options.views is None else file_sha256(options.views)
    # Where a views file says nothing of a scene, its entry is chosen by the file's name: both belong to the key.
    params = {
        "alpha": options.alpha,
        "views": views_file,
        "path": None if options.views is None else str(path.resolve()),
        "count": options.views_per_scene,
        "seed": options.seed,
    }
    address = Address("scene", scene_version(), (digest,), params)
    folder = work.store.get(address)
    if folder is None:
        work.worked = True
        with work.store.put(address) as made:
            (made / "scene.json").write_text(json.dumps(_facts(work, path)), encoding="utf-8")
        folder = work.store.path(address)
    else:
        work.progress.skipped("scenes already read")
    facts = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    return SceneEntry(
        path=path,
        label=options.labels[path],
        digest=digest,
        held_out=path in options.holdout,
        views=tuple(View.model_validate(view) for view in facts["views"]),
        triangles=facts["triangles"],
        opaque=facts["opaque"],
        warnings=tuple(facts["warnings"]),
    )


def _facts(work: Workspace, path: Path) -> dict[str, object]:
    options = work.options
    scene = work.scene(path)
    views = views_from_file(options.views, path, scene) if options.views is not None else ()
    if options.views is not None and not views:
        work.progress.note(f"{options.views} has no views of {path}: its own cameras or sampled views are used.")
    views = views or scene_views(scene, options.views_per_scene, options.seed)
    return {
        "views": [view.model_dump(mode="json") for view in views],
        "triangles": scene.triangles,
        "opaque": scene.is_opaque,
        "warnings": list(scene.warnings),
    }


def _refuse_copies(entries: list[SceneEntry]) -> None:
    """The split is by asset: a copy of a training scene under another name would prove nothing."""
    seen: dict[tuple[str, int], str] = {}
    for entry in entries:
        # The digest of a scene holds its file names; the root file and what comes of it do not depend on them.
        content = file_sha256(entry.path), entry.triangles
        if content in seen:
            raise Problem(f"{seen[content]} and {entry.label} have the same content.", "Name each scene once.")
        seen[content] = entry.label


def _transparent(work: Workspace, entries: list[SceneEntry]) -> tuple[SceneEntry, ...]:
    """The scenes that have something transparent; an opaque one among them is left out, and that is said.

    Raises:
        Problem: None is left, or none to train on, or none of those held out.
    """
    opaque = [entry for entry in entries if entry.opaque]
    kept = [entry for entry in entries if not entry.opaque]
    if opaque:
        names = ", ".join(entry.label for entry in opaque)
        why = f"Nothing in {names} is transparent, so there is nothing to allocate."
        remedy = "Make every surface of all scenes transparent with --alpha 0.33, or name other scenes."
        if {entry.held_out for entry in kept} != {entry.held_out for entry in entries}:
            raise Problem(why, remedy)
        work.progress.skipped("opaque scenes", len(opaque))
        work.progress.note(f"{why} Left out. {remedy}")
    return tuple(kept)
