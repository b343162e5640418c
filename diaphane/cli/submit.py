"""`diaphane jobs submit`: from options to a job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.scene_options import LicenceOption
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, connect
from diaphane.cli.state import JsonOption

if TYPE_CHECKING:
    from diaphane.cli.inputs import SceneInput

ViewsOption = Annotated[
    Path | None, typer.Option("--views", help="Read the views of local scenes from this JSON file.")
]


def submit(
    kind: Annotated[str, typer.Argument(help="build, render, label, train or evaluate.")],
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Id of a scene, or a file, uploaded if it is new; repeatable.")
    ] = None,
    holdout: Annotated[
        list[str] | None,
        typer.Option("--holdout", help="Evaluate on this scene and never train on it; repeatable. Default: a quarter."),
    ] = None,
    licence: LicenceOption = None,
    views: ViewsOption = None,
    idempotency_key: Annotated[
        str | None, typer.Option("--idempotency-key", help="Resubmitting with this key returns the existing job.")
    ] = None,
    is_watched: Annotated[bool, typer.Option("--watch", help="Follow the job to its end.")] = False,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
    **given: Any,
) -> None:
    """Submit a job; local scenes are uploaded as far as the server lacks them."""
    from diaphane.cli.inputs import bring, named_scenes, scene_uses, with_licences
    from diaphane.cli.job_text import show_job
    from diaphane.cli.watching import ensure_success, follow

    fields = job_fields(given)
    inputs = with_licences(named_scenes(scene or (), holdout or ()), licence or ())
    # Everything but the scenes' ids is checked before anything is uploaded.
    job_spec({**fields, "kind": kind, "scenes": [_stand_in(i, entry) for i, entry in enumerate(inputs)]})
    server = connect(url, key_file)
    scenes = bring(server, [entry.reference for entry in inputs], silent=as_json)
    if kind == "build" and not holdout:
        inputs = _split(inputs, scenes)
    spec = job_spec({**fields, "kind": kind, "scenes": scene_uses(inputs, scenes, views)})
    job, _ = server.jobs.submit(spec, idempotency_key)
    if not is_watched:
        _announce(job, as_json=as_json)
        return
    output.err().print(f"{job['id']}: watch it from elsewhere with: diaphane jobs watch {job['id']}", markup=False)
    job = follow(server, job["id"], silent=as_json)
    show_job(job, as_json=as_json)
    ensure_success(job)


def job_fields(given: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a job from options; what was not given is left out.

    Raises:
        Problem: An option cannot be read.
    """
    from schemas import flags
    from schemas.job import JobSpec

    return flags.given(JobSpec, given)


def job_spec(fields: Mapping[str, Any]) -> dict[str, Any]:
    """A checked job as JSON.

    Raises:
        Problem: It is not one.
    """
    from diaphane.local.options import asked
    from schemas.job import JobSpec

    spec = asked(JobSpec, fields)
    # What is not said of a promotion is decided by what the key may do.
    unsaid = {"promote"} - spec.model_fields_set
    return spec.model_dump(mode="json", exclude=unsaid)


def _stand_in(number: int, entry: SceneInput) -> dict[str, Any]:
    stand_in = entry.reference if entry.is_id else f"scn_{number:032x}"
    return {"scene": stand_in, "holdout": entry.held_out, "licence": entry.licence}


def _split(inputs: list[SceneInput], scenes: Sequence[dict[str, Any]]) -> list[SceneInput]:
    """A quarter of the scenes is held out, by their names, as `diaphane build` does."""
    from diaphane.local.options import default_holdout

    # The number tells scenes of one name apart.
    paths = [Path(str(i)) / str(scene["name"]) for i, scene in enumerate(scenes)]
    chosen = default_holdout(paths)
    return [replace(entry, held_out=path in chosen) for entry, path in zip(inputs, paths, strict=True)]


def _announce(job: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        output.print_json(job)
        return
    print(f"{job['id']}  {job['state']}")
    output.err().print(f"Watch it with: diaphane jobs watch {job['id']}", markup=False)
