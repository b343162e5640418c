"""`/v1/models`: published versions, and the aliases that point at them."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends

from schemas.problem import ExitCode, Problem
from schemas.service import ModelRecord, VersionRecord
from services.api.answers import AliasesRecord, ModelPage, Move, Reasoned, SigningKeys, VersionPage
from services.api.body import JsonBody
from services.api.pages import LINK_HEADER, Page
from services.api.parts import AliasPath, NamePath, Services, VersionPath
from services.api.security import Caller, Needs
from services.service import Service

router = APIRouter(prefix="/v1", tags=["models"])
_publish = [Depends(Needs("publish"))]


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


@router.get("/models/{name}/versions/{version}")
def read_version(name: NamePath, version: VersionPath, service: Services) -> VersionRecord:
    """A version, by number or alias."""
    return service.registry.record(service.registry.resolve(f"{name}@{version}"))


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
    """Public keys that versions are signed with; a client pins them."""
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
