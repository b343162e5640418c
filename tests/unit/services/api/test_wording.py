"""What is said of a field: our words, for every rule that a route has and every error that pydantic knows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import pytest
from pydantic import TypeAdapter
from pydantic_core._pydantic_core import list_all_errors
from support.api import Api

from services.api.body import JsonBody
from services.api.routes import routes
from services.api.wording import PATTERNS, faults, sentence
from services.dashboard.visitor import FormBody


def _patterns(schema: Any) -> Iterator[str]:
    """All patterns of a JSON schema."""
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield schema["pattern"]
        for value in schema.values():
            yield from _patterns(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from _patterns(value)


def _found(dependant: Any) -> Iterator[str]:
    """Patterns of what a dependency takes, and those that it depends on."""
    for field in (*dependant.query_params, *dependant.header_params, *dependant.cookie_params):
        yield from _patterns(TypeAdapter(Annotated[field.field_info.annotation, field.field_info]).json_schema())
    if isinstance(dependant.call, (JsonBody, FormBody)):
        yield from _patterns(dependant.call.model.model_json_schema())
    for inner in dependant.dependencies:
        yield from _found(inner)


def _used(api: Api) -> set[str]:
    """Patterns of queries, headers, bodies and forms of all routes."""
    return {pattern for route in routes(api.app.state.routers) for pattern in _found(route.dependant)}


def test_every_pattern_has_words_and_no_words_are_left_over(api: Api) -> None:
    assert _used(api) == set(PATTERNS)


@pytest.mark.parametrize("error", list_all_errors(), ids=lambda error: error["type"])
def test_no_error_is_told_in_the_words_of_pydantic(error: Any) -> None:
    context = dict(error.get("example_context") or {})
    if error["type"] == "value_error":
        context = {"error": ValueError("a build needs a name.")}
    said = faults(
        [{"type": error["type"], "loc": ("body", "field"), "msg": error["example_message_python"], "ctx": context}]
    )
    assert [one["at"] for one in said] == ["body.field"]
    (message,) = (one["message"] for one in said)
    assert message
    assert not {"Input", "should", "valid", "Field", "Value"} & set(message.split())
    assert sentence(said[0]).startswith("'field' in the body")


def test_places_are_named_and_what_is_allowed_is_said(api: Api) -> None:
    spec = {"kind": "odd", "scenes": [{"scene": "scn_secret"}], "budgets": ["secret"], "secret": 1, "width": 3}
    document = api.post("/v1/jobs", json=spec).json()
    said = {one["at"]: one["message"] for one in document["errors"]}
    assert said["body.kind"] == "has to be 'build', 'render', 'label', 'train' or 'evaluate'"
    assert said["body.scenes.0.scene"] == "has to be the id of a scene: scn_ and 32 hex digits"
    assert said["body.budgets.0"] == "has to be a number"
    assert said["body.width"] == "has to be at least 16"
    assert said["body.secret"] == "is nothing that is known here"
    assert document["detail"] == "'budgets.0' in the body has to be a number."
    whole = api.post("/v1/jobs", json={"kind": "build", "scenes": [{"scene": "scn_" + "0" * 32}]}).json()
    assert whole["detail"] == "The body: a build needs a name."
    assert api.post("/v1/jobs", json=[]).json()["detail"] == "The body has to be an object."
    assert api.get("/v1/jobs?limit=201").json()["detail"] == "'limit' in the address has to be at most 200."
    assert api.post("/v1/keys", json={"scopes": ["read"]}, scope="admin").json()["errors"] == [
        {"at": "body.name", "message": "is missing"}
    ]


def test_members_of_a_union_are_one_place() -> None:
    literals = [
        {"type": "literal_error", "loc": ("query", "state", "literal['a','b']"), "ctx": {"expected": "'a' or 'b'"}},
        {"type": "literal_error", "loc": ("query", "state", "literal['']"), "ctx": {"expected": "''"}},
    ]
    (said,) = faults(literals)
    assert sentence(said) == "'state' in the address has to be 'a' or 'b', or empty."
