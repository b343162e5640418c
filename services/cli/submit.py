"""`diaphane jobs submit`: from options to a job."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from schemas.glass import GLASS_HELP
from schemas.pixel_weights import WEIGHTS_HELP
from schemas.problem import Problem
from schemas.tail import TAIL_HELP
from services.cli import output
from services.cli.scene_options import LicenceOption
from services.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, connect
from services.cli.state import JsonOption
from services.cli.technique_options import BudgetsOption

if TYPE_CHECKING:
    from services.cli.inputs import SceneInput

AlphaOption = Annotated[float | None, typer.Option("--alpha", help="Opacity that every surface gets, in (0, 1).")]
ViewsOption = Annotated[Path | None, typer.Option("--views", help="JSON file with the views of local scenes.")]
GlassOption = Annotated[str | None, typer.Option("--glass", help=GLASS_HELP)]
ViewsPerSceneOption = Annotated[
    int | None, typer.Option("--views-per-scene", help="Views sampled of a scene that has no cameras.")
]
SizeOption = Annotated[str | None, typer.Option("--size", help="Width and height of the pictures, pixels: 1430x960.")]
TailOption = Annotated[str | None, typer.Option("--tail", help=TAIL_HELP)]
SteepnessOption = Annotated[float | None, typer.Option("--g", help="Steepness of the density tail.")]
SeedOption = Annotated[int | None, typer.Option("--seed", help="Seed of everything drawn at random.")]
NetworkOption = Annotated[str | None, typer.Option("--network", help="Size of the network: tiny, small or full.")]
StepsOption = Annotated[int | None, typer.Option("--steps", help="Optimiser steps.")]
NoReplayOption = Annotated[
    bool, typer.Option("--no-replay", help="Do not train again on what --from was trained on: it may be forgotten.")
]
PatienceOption = Annotated[
    int | None, typer.Option("--patience", help="Stop after so many validations without a better score; 0: never.")
]
WeightsOption = Annotated[str | None, typer.Option("--weights", help=WEIGHTS_HELP)]
PriorityOption = Annotated[str | None, typer.Option("--priority", help="low, normal or high.")]


def submit(
    kind: Annotated[str, typer.Argument(help="build, render, label, train or evaluate.")],
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Id, or file that is uploaded if it is new; repeatable.")
    ] = None,
    holdout: Annotated[
        list[str] | None,
        typer.Option("--holdout", help="Scene to evaluate on and never train on; repeatable. Default: a quarter."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Name of the bundle in the registry.")] = None,
    dataset: Annotated[str | None, typer.Option("--dataset", help="Data set that a train learns from.")] = None,
    model: Annotated[str | None, typer.Option("--model", help="Version that an evaluate measures.")] = None,
    licence: LicenceOption = None,
    budgets: BudgetsOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = None,
    views: ViewsOption = None,
    views_per_scene: ViewsPerSceneOption = None,
    size: SizeOption = None,
    tail: TailOption = None,
    g: SteepnessOption = None,
    seed: SeedOption = None,
    network: NetworkOption = None,
    steps: StepsOption = None,
    start: Annotated[
        str | None,
        typer.Option("--from", "--start-from", help="scratch, champion (the name's own), or NAME@ALIAS to begin with."),
    ] = None,
    is_forgotten: NoReplayOption = False,
    patience: PatienceOption = None,
    weights: WeightsOption = None,
    promote: Annotated[str | None, typer.Option("--promote", help="if-better or never.")] = None,
    priority: PriorityOption = None,
    idempotency_key: Annotated[
        str | None, typer.Option("--idempotency-key", help="The same key with the same job finds that job.")
    ] = None,
    is_watched: Annotated[bool, typer.Option("--watch", help="Follow the job to its end.")] = False,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Submit a job; local scenes are uploaded as far as the server lacks them."""
    from services.cli.inputs import bring, named_scenes, scene_uses, with_licences
    from services.cli.job_text import show_job
    from services.cli.watching import ensure_success, follow

    fields = job_fields(
        budgets=budgets,
        alpha=alpha,
        glass=glass,
        views_per_scene=views_per_scene,
        size=size,
        tail=tail,
        g=g,
        seed=seed,
        network=network,
        steps=steps,
        patience=patience,
        weights=weights,
        priority=priority,
    )
    named = {"name": name, "dataset": dataset, "model": model, "start_from": start, "promote": promote}
    fields |= {"replay": False} if is_forgotten else {}
    fields |= {field: value for field, value in named.items() if value is not None}
    inputs = with_licences(named_scenes(scene or (), holdout or ()), licence or ())
    # Everything but the scenes' ids is checked before anything is uploaded.
    job_spec({**fields, "kind": kind, "scenes": [_stand_in(i, entry) for i, entry in enumerate(inputs)]})
    remote = connect(url, key_file)
    scenes = bring(remote, [entry.reference for entry in inputs], silent=as_json)
    if kind == "build" and not holdout:
        inputs = _split(inputs, scenes)
    spec = job_spec({**fields, "kind": kind, "scenes": scene_uses(inputs, scenes, views)})
    job, _ = remote.submit(spec, idempotency_key)
    if not is_watched:
        _announce(job, as_json=as_json)
        return
    output.err().print(f"{job['id']}: watch it from elsewhere with: diaphane jobs watch {job['id']}", markup=False)
    job = follow(remote, job["id"], silent=as_json)
    show_job(job, as_json=as_json)
    ensure_success(job)


def job_fields(
    *,
    budgets: str | None,
    size: str | None,
    tail: str | None,
    network: str | None,
    weights: str | None,
    glass: str | None,
    **plain_fields: Any,
) -> dict[str, Any]:
    """Fields of a job from options; what was not given is left to the server's defaults.

    Raises:
        Problem: An option cannot be read.
    """
    from services.options import parse_budgets, parse_glass, parse_network, parse_size, parse_tail, parse_weights

    fields = {name: value for name, value in plain_fields.items() if value is not None}
    if budgets is not None:
        fields["budgets"] = sorted(set(parse_budgets(budgets)))
    if size is not None:
        fields["width"], fields["height"] = parse_size(size)
    if tail is not None:
        fields["tail"] = parse_tail(tail)
    if network is not None:
        fields["network"] = parse_network(network)
    if glass is not None:
        fields["glass"] = parse_glass(glass)
    if weights is not None:
        fields["weights"] = parse_weights(weights)
    return fields


def job_spec(fields: Mapping[str, Any]) -> dict[str, Any]:
    """A checked job as JSON.

    Raises:
        Problem: It is not one.
    """
    from pydantic import ValidationError

    from schemas.job import JobSpec

    try:
        spec = JobSpec.model_validate_json(json.dumps(fields))
    except ValidationError as error:
        faults = [_fault(detail) for detail in error.errors(include_url=False, include_input=False)]
        raise Problem(f"This is no job: {'; '.join(faults)}.", "Change those options.") from None
    # What is not said of a promotion is decided by what the key may do.
    unsaid = {"promote"} - spec.model_fields_set
    return spec.model_dump(mode="json", exclude=unsaid)


def _fault(detail: Any) -> str:
    where = ".".join(str(part) for part in detail["loc"])
    what = str(detail["msg"]).removeprefix("Value error, ")
    return f"{where}: {what}" if where else what


def _stand_in(number: int, entry: SceneInput) -> dict[str, Any]:
    stand_in = entry.reference if entry.is_id else f"scn_{number:032x}"
    return {"scene": stand_in, "holdout": entry.held_out, "licence": entry.licence}


def _split(inputs: list[SceneInput], scenes: list[dict[str, Any]]) -> list[SceneInput]:
    """A quarter of the scenes is held out, by their names, as `diaphane build` does."""
    from services.options import default_holdout

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
