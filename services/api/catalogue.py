"""`/v1/problems`: what the errors mean."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path

from services.api.answers import ProblemPage
from services.problems import CATALOGUE, ProblemType, Refusal

router = APIRouter(prefix="/v1/problems", tags=["problems"])


@router.get("")
async def list_problems() -> ProblemPage:
    """All types of problems."""
    return ProblemPage(items=list(CATALOGUE.values()))


@router.get("/{slug}")
async def read_problem(slug: Annotated[str, Path(pattern=r"^[a-z-]{1,40}$")]) -> ProblemType:
    """A type of problem."""
    if slug not in CATALOGUE:
        raise Refusal("not-found", "There is no problem of this name.")
    return CATALOGUE[slug]
