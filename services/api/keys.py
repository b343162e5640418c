"""`/v1/keys`: who may use the service; for administrators."""

from __future__ import annotations

from datetime import UTC
from typing import Annotated

from fastapi import APIRouter, Depends, Response

from services.api.answers import CreatedKey, KeyPage, NewKey
from services.api.body import JsonBody
from services.api.pages import LINK_HEADER, Page
from services.api.parts import KeyId, Services
from services.api.security import Caller, Needs
from services.problems import Refusal

router = APIRouter(prefix="/v1/keys", tags=["keys"], dependencies=[Depends(Needs("admin"))])


@router.get("", responses={200: {"headers": LINK_HEADER}})
def list_keys(service: Services, paging: Page) -> KeyPage:
    """All keys, newest first, without their secrets."""
    return KeyPage(items=paging.slice(service.keys.list(), lambda key: key.id))


@router.post("", status_code=201)
def create_key(body: Annotated[NewKey, Depends(JsonBody(NewKey))], service: Services, response: Response) -> CreatedKey:
    """Makes a key; its secret is in this answer and nowhere else."""
    expires = body.expires
    if expires is not None:
        expires = expires if expires.tzinfo else expires.replace(tzinfo=UTC)
    key, secret = service.keys.create(body.name, body.scopes, expires.timestamp() if expires else None, body.bounds)
    response.headers["Cache-Control"] = "no-store"
    return CreatedKey(key=key, secret=secret)


@router.delete("/{key_id}", status_code=204, responses={409: {}})
def revoke_key(key_id: KeyId, service: Services, caller: Caller) -> None:
    """Revokes a key at once; not the one that asks, so that nobody is locked out."""
    if key_id == caller.id:
        raise Refusal("conflict", "A key does not revoke itself.", "Make another key with admin, and use that.")
    service.keys.revoke(key_id)
