"""`/v1/scenes`: files that belong together, checked before a job may use them."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from evaluation.advice.amounts import parse_frame, parse_memory
from schemas.advice import Advice
from schemas.service import SceneRecord, SceneState
from services.api.answers import NewScene, ScenePage
from services.api.body import JsonBody
from services.api.pages import LINK_HEADER, MOMENT, Page
from services.api.parts import SceneIdPath, Services
from services.api.places import moment
from services.api.security import Caller, Needs
from services.database import tables
from services.problems import Refusal
from services.stored_advice import stored_advice

router = APIRouter(prefix="/v1/scenes", tags=["scenes"])


@router.post(
    "",
    status_code=202,
    dependencies=[Depends(Needs("submit"))],
    responses={200: {"model": SceneRecord, "description": "The scene was known."}, 409: {}},
)
def create_scene(
    body: Annotated[NewScene, Depends(JsonBody(NewScene))], service: Services, caller: Caller, response: Response
) -> SceneRecord:
    """Registers a scene, and has it checked; the same files are the same scene."""
    record, new = service.scenes.create(body.name, body.root, body.files, caller.id)
    response.headers["Location"] = f"/v1/scenes/{record.id}"
    response.status_code = 202 if new or record.state == "checking" else 200
    return record


@router.get("", responses={200: {"headers": LINK_HEADER}})
def list_scenes(service: Services, paging: Page, state: Annotated[SceneState | None, Query()] = None) -> ScenePage:
    """Scenes, newest first."""
    found = service.scenes.list(state=state, limit=paging.fetch, after=paging.after(MOMENT))
    place = lambda scene: moment(service.database, tables.scenes, scene.id, scene.created)  # noqa: E731
    return ScenePage(items=paging.page(found, place))


@router.get("/{scene_id}")
def read_scene(scene_id: SceneIdPath, service: Services) -> SceneRecord:
    """A scene."""
    return service.scenes.get(scene_id)


@router.get("/{scene_id}/advice")
def read_advice(
    scene_id: SceneIdPath,
    service: Services,
    memory: Annotated[
        str, Query(pattern=r"^[1-9][0-9]{0,5}(?:KiB|MiB|GiB)$", description="That all buffers of a frame may take.")
    ] = "64MiB",
    size: Annotated[
        str | None,
        Query(pattern=r"^[1-9][0-9]{1,4}x[1-9][0-9]{1,4}$", description="Of the frame; default: as measured."),
    ] = None,
) -> Advice:
    """Which technique the scene needs within a memory, by what jobs have measured on it."""
    scene = service.scenes.get(scene_id)
    frame = None if size is None else parse_frame(size)
    found = stored_advice(service.database, scene.name, scene.digest, frame, parse_memory(memory))
    if found is None:
        raise Refusal(
            "not-found",
            "Nothing was measured on this scene yet.",
            "Submit a job `evaluate` with it; it needs no model.",
        )
    return found
