"""What is said of a field that is an option of commands; `schemas.flags` reads it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler


@dataclass(frozen=True, slots=True)
class Option:
    """What is said of a field, as part of its annotation: in the help of commands, in schemas, in documents.

    Attributes:
        words: What it means; sentences.
        flags: How a command line has it; empty: `--name-of-field`. Fields of the same flags are one option, with an x
            between their values.
        joint: What it means on a command line that has several fields in one option; empty: `words`.
        absent: What holds where nothing is given and the default is None.
        example: A value, for messages and documents; empty: the default.
    """

    words: str
    flags: tuple[str, ...] = ()
    joint: str = ""
    absent: str = ""
    example: str = ""

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The field's schema, described."""
        null = f" Null: {self.absent}." if self.absent else ""
        return {**handler(schema), "description": f"{self.words}{null}"}
