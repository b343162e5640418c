"""`/v1/measurements`: what techniques and bundles achieved."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import BeforeValidator

from schemas.limits import LIMITS
from services.api.answers import MeasurementPage
from services.api.pages import LINK_HEADER, NUMBER, Page
from services.api.parts import Services, Text
from services.measured import MeasurementFilter

router = APIRouter(prefix="/v1/measurements", tags=["measurements"])

_TIME = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _require_time(text: object) -> object:
    """A number would be taken for seconds since 1970."""
    if isinstance(text, str) and not _TIME.match(text):
        raise ValueError("a time is written 2026-03-01T12:00:00Z")
    return text


_Time = Annotated[
    datetime | None, BeforeValidator(_require_time), Query(description="ISO 8601; UTC where it has no zone.")
]


@router.get("", responses={200: {"headers": LINK_HEADER}})
def query_measurements(
    service: Services,
    paging: Page,
    scene: Annotated[Text | None, Query(description="Label of the scene, or digest of its content.")] = None,
    technique: Annotated[Text | None, Query(description="Name of the technique.")] = None,
    budget: Annotated[
        float | None,
        Query(gt=0.0, le=LIMITS.budget, allow_inf_nan=False, description="As a multiple of width * height."),
    ] = None,
    model: Annotated[Text | None, Query(description="`name@version`, or `name` for all its versions.")] = None,
    job: Annotated[str | None, Query(pattern=r"^job_[0-9a-f]{24}$")] = None,
    since: _Time = None,
    until: _Time = None,
) -> MeasurementPage:
    """Measurements, newest first."""
    wanted = MeasurementFilter(
        scene=scene,
        technique=technique,
        budget=budget,
        model=model,
        job=job,
        since=_seconds(since),
        until=_seconds(until),
    )
    found = service.measured.query(wanted, paging.fetch, paging.after(NUMBER))
    return MeasurementPage(items=paging.page(found, lambda record: record.id))


def _seconds(time: datetime | None) -> float | None:
    if time is None:
        return None
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
