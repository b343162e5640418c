"""What the OpenAPI document says; `services.api.openapi` writes it to a file.

FastAPI describes paths, queries and answers; this adds what the project does its own way: bodies, problems, scopes.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.metadata import version
from typing import Any

from fastapi import APIRouter, FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from schemas.service import ProblemDocument
from services.api.routes import GUARDED, OPEN, body_of, routes, scope_of
from services.problems import CATALOGUE, MEDIA_TYPE

_REFERENCE = "#/components/schemas/{model}"
_DESCRIPTION = (
    "Jobs, scenes, measurements and signed bundles of Diaphane. Errors are `application/problem+json`; their types are "
    "explained at `/v1/problems`. Lists come in pages, with a `Link` to the next. Beside `Authorization`, a request "
    "may have an `X-Request-ID`, which the answer and the logs repeat."
)
_ALWAYS = (421, 431, 500, 503)
_WRITING = (507,)
_GUARDED = (401, 403, 429)
_EXAMPLES: dict[str, Any] = {
    "JobSpec": {
        "kind": "build",
        "name": "glass",
        "scenes": [{"scene": "scn_0123456789abcdef0123456789abcdef"}],
        "budgets": [0.5, 1.0, 2.0],
    },
    "NewUpload": {"sha256": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855", "bytes": 0},
    "NewScene": {
        "name": "bottles",
        "root": "bottles.usda",
        "files": {"bottles.usda": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"},
    },
    "Move": {"version": "1.3.0", "reason": "Better on the terrace."},
    "Reasoned": {"reason": "Worse on the terrace than measured."},
    "NewKey": {"name": "ci", "scopes": ["submit"]},
    "NewWebhook": {"url": "https://ci.example.org/diaphane", "events": ["job.failed", "model.champion"]},
    "Hashes": {"sha256": ["e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"]},
}


def build_document() -> dict[str, Any]:
    """The document; it depends on the code alone."""
    app = FastAPI()
    for router in (*GUARDED, *OPEN):
        app.include_router(router)
    document = get_openapi(title="Diaphane", version=version("diaphane"), description=_DESCRIPTION, routes=app.routes)
    schemas = document["components"]["schemas"]
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    _add_models(schemas)
    document["components"]["securitySchemes"] = {
        "key": {"type": "http", "scheme": "bearer", "description": "An API key. A list names the scope that is needed."}
    }
    document["components"]["responses"] = {str(status): _problem(status) for status in sorted(_statuses())}
    for routers in (GUARDED, OPEN):
        _describe(document["paths"], routers)
    return document


@cache
def document_text() -> str:
    """The document as it is sent and committed."""
    return json.dumps(build_document(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _describe(paths: dict[str, Any], routers: tuple[APIRouter, ...]) -> None:
    for route in routes(routers):
        for method in route.methods or ():
            operation = paths[route.path_format][method.lower()]
            operation["operationId"] = route.name
            _describe_one(operation, route, guarded=routers is GUARDED, writes=method not in ("GET", "HEAD"))


def _describe_one(operation: dict[str, Any], route: APIRoute, *, guarded: bool, writes: bool) -> None:
    model = body_of(route)
    if model is not None:
        content: dict[str, Any] = {"schema": {"$ref": _REFERENCE.format(model=model.__name__)}}
        content["example"] = _EXAMPLES[model.__name__]
        operation["requestBody"] = {"required": True, "content": {"application/json": content}}
    statuses = set(_ALWAYS) | set(_WRITING if writes else ())
    if guarded:
        operation["security"] = [{"key": [scope_of(route)]}]
        statuses |= set(_GUARDED)
    if "requestBody" in operation:
        statuses |= {400, 408, 413, 415, 422}
    places = {parameter["in"] for parameter in operation.get("parameters", ())}
    statuses |= {404} if "path" in places else set()
    statuses |= {422} if places & {"query", "header"} else set()
    answers = operation["responses"]
    answers.pop("422", None)
    for status in sorted(statuses | {int(status) for status in answers if status in ("404", "409", "416")}):
        answers.setdefault(str(status), {})
        if not answers[str(status)].get("content"):
            answers[str(status)] = {"$ref": f"#/components/responses/{status}"}


def _add_models(schemas: dict[str, Any]) -> None:
    bodies: list[type[BaseModel]] = [model for route in routes(GUARDED) if (model := body_of(route)) is not None]
    wanted: list[type[BaseModel]] = [ProblemDocument, *dict.fromkeys(bodies)]
    _, made = models_json_schema([(model, "validation") for model in wanted], ref_template=_REFERENCE)
    schemas |= made["$defs"]


def _statuses() -> set[int]:
    return {kind.status for kind in CATALOGUE.values()}


def _problem(status: int) -> dict[str, Any]:
    kinds = [kind for kind in CATALOGUE.values() if kind.status == status]
    answer: dict[str, Any] = {
        "description": " ".join(kind.title for kind in kinds),
        "content": {MEDIA_TYPE: {"schema": {"$ref": _REFERENCE.format(model="ProblemDocument")}}},
    }
    if status in (429, 503):
        answer["headers"] = {"Retry-After": {"description": "Seconds.", "schema": {"type": "integer"}}}
    if status == 401:
        answer["headers"] = {"WWW-Authenticate": {"schema": {"type": "string"}}}
    return answer
