"""What the registry knows of a published bundle."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict

CHAMPION = "champion"
CANDIDATE = "candidate"
PUBLICATION = "publication.json"
"""File of a checkout that says which version it is."""


class Publication(BaseModel):
    """A published version.

    Attributes:
        name: Name of the bundle.
        version: Semantic version.
        digest: Hex sha256 over the names and contents of the bundle's files.
        score: Geometric mean over held-out views and budgets of the bundle's squared error over VKB's; lower is better;
            None where nothing could be compared.
        evaluation: What the score was measured on.
        created: UTC, ISO 8601.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    digest: str
    score: float | None
    evaluation: dict[str, Any]
    created: str


class Move(BaseModel):
    """One move of an alias: from which version to which, when, by whom and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    alias: str
    before: str | None
    after: str
    when: str
    who: str
    why: str


class Aliases(BaseModel):
    """Where the aliases of a name point, and how they got there."""

    model_config = ConfigDict(extra="forbid")

    aliases: dict[str, str] = {}
    history: list[Move] = []
