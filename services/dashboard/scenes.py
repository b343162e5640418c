"""`/scenes`: what was uploaded, and what was measured on it."""

from __future__ import annotations

import io
from typing import Annotated, Any, Literal, get_args

import numpy as np
import sqlalchemy as sa
from fastapi import APIRouter, Path, Query, Request, Response
from PIL import Image

from evaluation.advice.page import part
from evaluation.report import colours
from schemas.limits import LIMITS
from schemas.service import SceneState
from services.api.etags import is_current
from services.api.pages import MOMENT, Page
from services.api.parts import SceneIdPath, Services
from services.api.places import moment
from services.dashboard import measured
from services.dashboard.page import PageRoute, render
from services.database import tables
from services.problems import Refusal
from services.scene_views import SeenView, Shot, certificates, views
from services.service import Service
from services.stored_advice import advice_of
from stages.store import MissingArtifact

router = APIRouter(prefix="/scenes", route_class=PageRoute, include_in_schema=False)

_MAPS = {"k": colours.COUNT, "flip": colours.HEAT}


@router.get("", response_class=Response)
def list_scenes(request: Request, service: Services, paging: Page, state: SceneState | Literal[""] = "") -> Response:
    """Scenes, newest first."""
    found = service.scenes.list(state=state or None, limit=paging.fetch, after=paging.after(MOMENT))
    scenes = paging.page(found, lambda scene: moment(service.database, tables.scenes, scene.id, scene.created))
    return render(
        request,
        "scenes",
        scenes=scenes,
        paging=paging,
        chosen=state,
        states=get_args(SceneState),
    )


@router.get("/{scene_id}", response_class=Response)
def show_scene(
    request: Request,
    scene_id: SceneIdPath,
    service: Services,
    view: Annotated[str, Query(max_length=LIMITS.view_name)] = "",
    budget: Annotated[str, Query(max_length=30)] = "",
) -> Response:
    """A scene; the query chooses the view and the budget of the pictures."""
    scene = service.scenes.get(scene_id)
    seen = views(service.database, scene.digest)
    shown = next((one for one in seen if one.name == view), seen[0] if seen else None)
    budgets = shown.budgets() if shown else []
    factor = next((one for one in budgets if f"{one:g}" == budget), budgets[len(budgets) // 2] if budgets else None)
    advice = advice_of(scene.name, seen)
    everything = [shot.measured for one in seen for shot in one.shots]
    return render(
        request,
        "scene",
        scene=scene,
        views=seen,
        shown=shown,
        budgets=budgets,
        factor=factor,
        advice=None if advice is None else part(advice),
        comparison=measured.compare(everything, scene.name) if everything else None,
        models=sorted({shot.model for one in seen for shot in one.shots if shot.model}),
        certificates=certificates(service.storage.store, shown) if shown else [],
        **_pictures(service, scene_id, shown, factor),
    )


@router.get("/{scene_id}/pictures/{key}/{kind}/{file}", response_class=Response)
def read_picture(
    request: Request,
    scene_id: SceneIdPath,
    key: Annotated[str, Path(pattern=r"^[0-9a-f]{64}$")],
    kind: Literal["picture", "k", "flip"],
    file: Annotated[str, Path(pattern=r"^[a-z0-9][a-z0-9.+-]{0,80}\.png$")],
    service: Services,
    top: Annotated[int, Query(ge=1, le=255, description="Where the scale of k ends.")] = 255,
) -> Response:
    """A picture of an evaluation; counts and errors in the colours of a heat map."""
    artifact, digest = f"evaluate/{key}", service.scenes.get(scene_id).digest
    mine = (tables.measurements.c.artifact == artifact) & (tables.measurements.c.scene_digest == digest)
    with service.database.read() as connection:
        if connection.scalar(sa.select(tables.measurements.c.id).where(mine).limit(1)) is None:
            raise Refusal("not-found", "This scene has no such picture.")
    # What has an address never changes, but it may be removed.
    headers = {"ETag": f'"{key[:16]}-{kind}-{top}-{file}"', "Cache-Control": "private, max-age=86400"}
    if is_current(request, headers["ETag"].strip('"')):
        return Response(status_code=304, headers=headers)
    try:
        content = service.storage.store.read(artifact, file)
    except (MissingArtifact, FileNotFoundError):
        raise Refusal("not-found", "The picture was removed because of its age.") from None
    return Response(_coloured(content, kind, top), media_type="image/png", headers=headers)


def _coloured(content: bytes, kind: str, top: int) -> bytes:
    """A stored map, 8 bits a pixel, as a picture; by the square root, so that small values can be told apart."""
    if kind not in _MAPS:
        return content
    with Image.open(io.BytesIO(content)) as image:
        values = np.asarray(image, dtype=np.float32) / (top if kind == "k" else 255)
    stream = io.BytesIO()
    Image.fromarray(colours.apply(np.sqrt(values), _MAPS[kind])).save(stream, format="PNG", compress_level=1)
    return stream.getvalue()


def _pictures(service: Service, scene_id: str, view: SeenView | None, factor: float | None) -> dict[str, Any]:
    """What the page shows of a view: addresses of pictures, as far as their artifacts are there."""
    exact = view.exact if view else None
    shots = view.within(factor) if view and factor is not None else []
    kept = {
        shot.artifact for shot in (*shots, *([exact] if exact else [])) if service.storage.store.holds(shot.artifact)
    }
    top = view.top(shots) if view else 1

    def address(shot: Shot, kind: str, file: str, end: int = 255) -> str:
        name = f"{file}.{kind}" if kind != "picture" else file
        query = f"?top={end}" if kind == "k" else ""
        return f"/scenes/{scene_id}/pictures/{shot.artifact.partition('/')[2]}/{kind}/{name}.png{query}"

    depth = exact if exact and exact.artifact in kept and exact.has_pictures else None
    return {
        "exact": address(depth, "picture", "exact") if depth else None,
        "depth": address(depth, "k", depth.stem, min(255, depth.measured.k_max or 1)) if depth else None,
        "maps": [(shot, address(shot, "k", shot.stem, top)) for shot in shots if shot.artifact in kept],
        "top": top,
        "lost": bool(shots) and not kept,
    }
