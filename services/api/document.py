"""`/v1/openapi.json`."""

from __future__ import annotations

from fastapi import APIRouter, Response

router = APIRouter(prefix="/v1/openapi.json", tags=["pages"])


@router.get("", response_class=Response, responses={200: {"content": {"application/json": {"schema": {}}}}})
def read_document() -> Response:
    """This document."""
    from services.api.description import document_text  # which describes this very route

    return Response(document_text(), media_type="application/json")
