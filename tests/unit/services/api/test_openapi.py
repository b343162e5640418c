from __future__ import annotations

import json

import pytest
from support.api import Api

from services.api.description import build_document, document_text
from services.api.openapi import FILE

DOCUMENT = build_document()
OPERATIONS = [
    (method, path, operation)
    for path, operations in DOCUMENT["paths"].items()
    for method, operation in operations.items()
]


def test_the_committed_document_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == document_text(), "run `python -m services.api.openapi`"


def test_it_is_served(api: Api) -> None:
    assert api.get("/v1/openapi.json", None).json() == json.loads(document_text())


@pytest.mark.parametrize(("method", "path", "operation"), OPERATIONS)
def test_every_operation_is_described(method: str, path: str, operation: dict[str, object]) -> None:
    assert operation["description"]
    responses = operation["responses"]
    assert isinstance(responses, dict)
    assert {"500", "503", "421"} <= set(responses)
    for status, response in responses.items():
        if int(status) >= 400 and path != "/v1/health/ready":
            assert response == {"$ref": f"#/components/responses/{status}"}
    if method in ("post", "put") and not path.endswith(("/cancel", "/retry", "/test")):
        assert "application/json" in operation["requestBody"]["content"]  # type: ignore[index]


def test_operations_have_different_ids() -> None:
    ids = [operation["operationId"] for _, _, operation in OPERATIONS]
    assert len(set(ids)) == len(ids)
