"""`/v1/models`: published versions, and the aliases that point at them."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response

from schemas.problem import ExitCode, Problem
from schemas.service import ModelRecord, PointerRecord, VersionRecord
from services.api.answers import AliasesRecord, ModelPage, Move, Reasoned, SigningKeys, VersionPage
from services.api.body import JsonBody
from services.api.etags import is_current
from services.api.pages import LINK_HEADER, Page
from services.api.parts import AliasPath, NamePath, Services, VersionPath
from services.api.security import Caller, Needs
from services.service import Service

router = APIRouter(prefix="/v1", tags=["models"])
_publish = [Depends(Needs("publish"))]
_ETAG: dict[str, Any] = {"ETag": {"description": "Changes with the record.", "schema": {"type": "string"}}}
_IF_NONE_MATCH: dict[str, Any] = {
    "parameters": [
        {
            "name": "If-None-Match",
            "in": "header",
            "required": False,
            "schema": {"type": "string"},
            "description": "ETags of records that the client has.",
        }
    ]
}


@router.get("/models", responses={200: {"headers": LINK_HEADER}})
def list_models(service: Services, paging: Page) -> ModelPage:
    """Names in the registry."""
    return ModelPage(items=paging.slice(service.registry.models(), lambda model: model.name))


@router.get("/models/{name}")
def read_model(name: NamePath, service: Services) -> ModelRecord:
    """A name in the registry."""
    return _model(service, name)


@router.get("/models/{name}/versions", responses={200: {"headers": LINK_HEADER}})
def list_versions(name: NamePath, service: Services, paging: Page) -> VersionPage:
    """Versions of a name, newest first."""
    _model(service, name)
    publications = paging.slice(service.registry.versions(name)[::-1], lambda publication: publication.version)
    return VersionPage(items=service.registry.records(name, publications))


@router.get(
    "/models/{name}/versions/{version}",
    response_model=VersionRecord,
    responses={200: {"headers": _ETAG}, 304: {"description": "The client has it.", "headers": _ETAG}},
    openapi_extra=_IF_NONE_MATCH,
)
def read_version(name: NamePath, version: VersionPath, request: Request, service: Services) -> Response:
    """A version, by number or alias; what an alias means is signed in its pointer alone."""
    content = service.registry.record(service.registry.resolve(f"{name}@{version}")).model_dump_json().encode()
    tag = hashlib.sha256(content).hexdigest()
    headers = {"ETag": f'"{tag}"'}
    if is_current(request, tag):
        return Response(status_code=304, headers=headers)
    return Response(content, media_type="application/json", headers=headers)


@router.get("/models/{name}/pointers/{version}")
def read_pointer(name: NamePath, version: VersionPath, service: Services, response: Response) -> PointerRecord:
    """What an alias means now, signed, until it expires. Nothing in between may keep it."""
    response.headers["Cache-Control"] = "no-store"
    return service.registry.pointer(name, version)


@router.get("/models/{name}/aliases")
def read_aliases(name: NamePath, service: Services) -> AliasesRecord:
    """Where the aliases of a name point, and how they got there."""
    return _aliases(service, name)


@router.put("/models/{name}/aliases/{alias}", dependencies=_publish)
def move_alias(
    name: NamePath, alias: AliasPath, body: Annotated[Move, Depends(JsonBody(Move))], service: Services, caller: Caller
) -> AliasesRecord:
    """Points an alias at a version."""
    service.registry.promote(name, body.version, body.reason, alias, caller.id)
    return _aliases(service, name)


@router.post("/models/{name}/aliases/{alias}/rollback", dependencies=_publish, responses={409: {}})
def roll_back_alias(
    name: NamePath,
    alias: AliasPath,
    body: Annotated[Reasoned, Depends(JsonBody(Reasoned))],
    service: Services,
    caller: Caller,
) -> AliasesRecord:
    """Points an alias at the version that it meant before."""
    service.registry.rollback(name, body.reason, alias, caller.id)
    return _aliases(service, name)


@router.get("/signing-keys")
def list_signing_keys(service: Services) -> SigningKeys:
    """The public key that versions and aliases are signed with, then those before it; a client pins the first."""
    return SigningKeys(keys=service.registry.public_keys())


def _model(service: Service, name: str) -> ModelRecord:
    found = next((model for model in service.registry.models() if model.name == name), None)
    if found is None:
        raise Problem(f"There is no bundle '{name}' in the registry.", "List the models.", ExitCode.NOT_FOUND)
    return found


def _aliases(service: Service, name: str) -> AliasesRecord:
    model = _model(service, name)
    moves = sorted(service.registry.moves(name), key=lambda move: move.at, reverse=True)
    return AliasesRecord(aliases=model.aliases, history=moves)
