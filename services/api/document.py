"""`/v1/openapi.json`."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

router = APIRouter(prefix="/v1/openapi.json", tags=["pages"])


@router.get("", response_class=Response, responses={200: {"content": {"application/json": {"schema": {}}}}})
def read_document(request: Request) -> Response:
    """This document."""
    # The application gives it: what describes all routes describes this one, too, and cannot be imported here.
    return Response(request.app.state.document(), media_type="application/json")
