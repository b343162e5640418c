"""`/docs`: the API's OpenAPI document as a page, made by the server like every other page."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from fastapi import APIRouter, Request, Response
from markupsafe import Markup

from services.dashboard.page import PageRoute, render

router = APIRouter(prefix="/docs", route_class=PageRoute, include_in_schema=False)

_METHODS: Final = ("get", "head", "post", "put", "patch", "delete")


@dataclass(frozen=True)
class Field:
    """A parameter of an operation, or a property of a schema."""

    name: str
    place: str
    """Where a parameter stands; empty for a property."""
    required: bool
    type: str
    """In words, for instance `string or null`."""
    description: str


@dataclass(frozen=True)
class Operation:
    """One method of one path."""

    id: str
    method: str
    path: str
    scope: str
    """What a key needs; empty where none is needed."""
    description: str
    fields: tuple[Field, ...]
    body: str
    """Name of the schema of a JSON body; empty without one."""
    example: str
    answers: tuple[tuple[str, str], ...]
    """Status, and the name of the schema of what succeeds."""


@dataclass(frozen=True)
class Reference:
    """What the page shows."""

    groups: tuple[tuple[str, tuple[Operation, ...]], ...]
    """Tag and its operations, in the order of their paths."""
    schemas: tuple[tuple[str, str, tuple[Field, ...]], ...]
    """Name, description and properties."""


@router.get("", response_class=Response)
def show_reference(request: Request) -> Response:
    """The page."""
    return render(request, "docs", reference=reference(request.app.state.document()), prose=prose)


@cache
def reference(text: str) -> Reference:
    """An OpenAPI document, in the order that people read it.

    Args:
        text: JSON.
    """
    document = json.loads(text)
    groups: dict[str, list[Operation]] = {}
    for path, operations in sorted(document["paths"].items()):
        for method in _METHODS:
            if method in operations:
                operation = operations[method]
                groups.setdefault(operation["tags"][0], []).append(_operation(method, path, operation))
    schemas = document["components"]["schemas"]
    described = {name: attributes(schema.get("description", "")) for name, schema in schemas.items()}
    return Reference(
        tuple((tag, tuple(found)) for tag, found in sorted(groups.items())),
        tuple((name, text, tuple(_properties(schemas[name], of))) for name, (text, of) in described.items()),
    )


def _operation(method: str, path: str, operation: Mapping[str, Any]) -> Operation:
    body = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
    needs = [scope for one in operation.get("security", ()) for scopes in one.values() for scope in scopes]
    fields = (
        Field(one["name"], one["in"], one["required"], type_in_words(one["schema"]), one.get("description", ""))
        for one in operation.get("parameters", ())
    )
    answers = (
        (status, _schema_of(answer)) for status, answer in operation["responses"].items() if status.startswith("2")
    )
    return Operation(
        operation["operationId"],
        method.upper(),
        path,
        ", ".join(needs),
        operation.get("description", ""),
        tuple(fields),
        type_in_words(body["schema"]) if body else "",
        json.dumps(body["example"], indent=2) if "example" in body else "",
        tuple(answers),
    )


def _schema_of(answer: Mapping[str, Any]) -> str:
    schema = answer.get("content", {}).get("application/json", {}).get("schema")
    return type_in_words(schema) if schema else ""


def _properties(schema: Mapping[str, Any], described: Mapping[str, str]) -> Iterator[Field]:
    required = schema.get("required", ())
    for name, one in schema.get("properties", {}).items():
        yield Field(name, "", name in required, type_in_words(one), one.get("description") or described.get(name, ""))


def attributes(description: str) -> tuple[str, dict[str, str]]:
    """Takes apart what a schema has of a class's docstring.

    Args:
        description: Text, and after it a section `Attributes:` if the class has one.

    Returns:
        The text, and attribute -> what it means.
    """
    text, _, section = description.partition("\n\nAttributes:\n")
    found: dict[str, str] = {}
    for entry in re.split(r"\n {4}(?! )", f"\n{section}")[1:]:
        name, _, meaning = entry.partition(":")
        found[name] = " ".join(meaning.split())
    return text, found


def prose(text: str) -> Markup:
    """A description with what stands between backticks as code."""
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if index % 2 else part for index, part in enumerate(text.split("`"))
    )


def type_in_words(schema: Mapping[str, Any]) -> str:
    """The type that a schema means, in short.

    Args:
        schema: A JSON schema, as Pydantic writes it.
    """
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(value) for value in schema["enum"])
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(type_in_words(one) for one in schema[key]))
    kind = schema.get("type", "any")
    if kind == "array":
        return f"list of {type_in_words(schema.get('items', {}))}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"map to {type_in_words(schema['additionalProperties'])}"
    return str(kind)
