"""`/models`: what is published, how good it is, and which version is meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path as FolderPath
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, StringConstraints

from evaluation.summary import BUNDLE
from schemas.bundle import CARD, WEIGHTS, Manifest
from schemas.licence import verdict
from schemas.measurement import Measurement
from schemas.problem import ExitCode, Problem
from services.api.answers import Reason, VersionOrAlias
from services.api.pages import Page
from services.api.parts import NamePath, Services, VersionPath
from services.api.security import Caller, Needs
from services.api.streams import FileRange
from services.dashboard import measured
from services.dashboard.figures import champions
from services.dashboard.page import PageRoute, redirect, render
from services.dashboard.visitor import FormBody
from services.problems import Refusal
from services.registry.records import CANDIDATE, CHAMPION

router = APIRouter(prefix="/models", route_class=PageRoute, include_in_schema=False)
_publish = [Depends(Needs("publish"))]

_VERSIONS_COMPARED = 12
_MOVES = 50


class MoveForm(BaseModel):
    """Where an alias shall point, and why."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    version: VersionOrAlias
    alias: Annotated[str, StringConstraints(pattern=r"^[a-z](?:[a-z0-9-]{0,38}[a-z0-9])?$")]
    reason: Reason


class RollbackForm(BaseModel):
    """Which alias shall mean what it meant before, and why."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    alias: Annotated[str, StringConstraints(pattern=r"^[a-z](?:[a-z0-9-]{0,38}[a-z0-9])?$")]
    reason: Reason


@router.get("", response_class=Response)
def list_models(request: Request, service: Services, paging: Page) -> Response:
    """All names."""
    models = paging.slice(service.registry.models(), lambda model: model.name)
    best = champions(service.database, len(models), [model.name for model in models])
    return render(
        request,
        "models",
        models=models,
        champions={champion.name: champion for champion in best},
        paging=paging,
    )


@router.get("/{name}", response_class=Response)
def show_model(
    request: Request,
    name: NamePath,
    service: Services,
    paging: Page,
    version: Annotated[str, Query(pattern=r"^(?:[A-Za-z0-9][A-Za-z0-9.-]{0,39})?$")] = "",
) -> Response:
    """A name: its versions, and one of them closely."""
    registry = service.registry
    published = registry.versions(name)
    if not published:
        raise Problem(f"There is no model '{name}'.", "See the list of models.", ExitCode.NOT_FOUND)
    aliases = registry.aliases(name).aliases
    chosen = registry.resolve(f"{name}@{version or aliases.get(CHAMPION) or published[-1].version}")
    reference = f"{name}@{chosen.version}"
    recent = [publication.version for publication in published[-_VERSIONS_COMPARED:]]
    scenes = measured.history(service.database, name, recent)
    own = measured.of_version(service.database, reference)
    moves = registry.moves(name)[::-1]
    manifest = registry.manifest(chosen)
    return render(
        request,
        "model",
        name=name,
        reference=reference,
        record=registry.record(chosen),
        manifest=manifest,
        licences=verdict(manifest.provenance.scenes, manifest.provenance.licences),
        card=_card(registry.folder(chosen)),
        cost=_cost(manifest, own),
        versions=paging.slice(published[::-1], lambda publication: publication.version),
        count=len(published),
        numbers=[publication.version for publication in published[::-1]][:200],
        paging=paging,
        aliases=aliases,
        # Whoever asks for no version comes for what waits to be promoted.
        promoted=chosen.version if version else aliases.get(CANDIDATE, chosen.version),
        aliases_offered=sorted({CHAMPION, CANDIDATE, *aliases}),
        moves=moves[:_MOVES],
        move_count=len(moves),
        key_names=service.keys.names({move.who for move in moves[:_MOVES]}),
        recent=recent,
        scenes=scenes,
        history=measured.history_chart(scenes, recent),
        worse=measured.WORSE,
        comparison=measured.compare(own, reference) if own else None,
        views=len({(m.scene, m.view) for m in own}),
    )


@router.get("/{name}/{version}/files/{file}", response_class=Response)
async def download_file(
    name: NamePath, version: VersionPath, file: Annotated[str, Path(pattern=r"^[a-z_.]{1,40}$")], service: Services
) -> Response:
    """A file of a version, to keep."""
    registry = service.registry
    publication = await to_thread.run_sync(registry.resolve, f"{name}@{version}")
    record = await to_thread.run_sync(registry.record, publication)
    if file not in record.files:
        raise Refusal("not-found", f"{name}@{publication.version} has no file of this name.")
    found = record.files[file]
    path = await to_thread.run_sync(service.storage.blobs.path, found.sha256)
    headers = {
        "Content-Disposition": f'attachment; filename="{name}-{publication.version}-{file}"',
        "ETag": f'"{found.sha256}"',
    }
    return FileRange(path, 0, found.bytes, 200, headers)


@router.post("/{name}/promote", response_class=Response, dependencies=_publish)
def promote(
    name: NamePath, service: Services, caller: Caller, body: Annotated[MoveForm, Depends(FormBody(MoveForm))]
) -> Response:
    """Points an alias at a version."""
    service.registry.promote(name, body.version, body.reason, body.alias, caller.id)
    return redirect(f"/models/{name}#aliases")


@router.post("/{name}/rollback", response_class=Response, dependencies=_publish)
def roll_back(
    name: NamePath, service: Services, caller: Caller, body: Annotated[RollbackForm, Depends(FormBody(RollbackForm))]
) -> Response:
    """Points an alias at the version that it meant before."""
    service.registry.rollback(name, body.reason, body.alias, caller.id)
    return redirect(f"/models/{name}#aliases")


def _card(folder: FolderPath) -> str | None:
    """The model card of a version, Markdown; None where it has none."""
    file = folder / CARD
    return file.read_text(encoding="utf-8") if file.is_file() else None


def _cost(manifest: Manifest, own: Sequence[Measurement]) -> dict[str, int | None]:
    """What a frame with a version is made of: counts and bytes.

    Args:
        manifest: Of the version.
        own: Pictures that were measured on its views; its own say which buffers its frames need.
    """
    buffers = [m.pixel_bytes for m in own if m.technique == BUNDLE and m.pixel_bytes is not None]
    peaks = [m.total_bytes for m in own if m.technique == BUNDLE and m.total_bytes is not None]
    return {
        "weights": manifest.weight_count,
        "multiply_adds": sum(math.prod(layer.shape) for layer in manifest.layers if layer.layout == "out,in"),
        "features": len(manifest.features),
        "input_bytes": 4 * len(manifest.features),
        "buffer_bytes": max(buffers, default=None),
        "peak_bytes": max(peaks, default=None),
        "file_bytes": manifest.files[WEIGHTS].bytes,
    }
