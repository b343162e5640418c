"""`/jobs`: all jobs, and one of them with its stages, tasks and log."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple, get_args

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Query, Request, Response

from schemas.job import FINAL_STATES, JobKind, JobState, TaskState
from schemas.service import EventRecord
from services.api.bounds import most_jobs
from services.api.jobs import last_number, require_own_job, stream_events
from services.api.pages import MOMENT, TASK_PLACE, Page
from services.api.parts import JobId, Services
from services.api.places import moment
from services.api.security import Caller, Needs, is_own
from services.api.streams import FileRange
from services.dashboard.page import PageRoute, redirect, render
from services.dashboard.stages import graph
from services.dashboard.visitor import FormBody, NoFields
from services.database import tables
from services.problems import Refusal
from services.service import Service

router = APIRouter(prefix="/jobs", route_class=PageRoute, include_in_schema=False)
_submit = [Depends(Needs("submit"))]

_LOG_EVENTS = 200
_SHOWN_APART = {"kind", "name", "scenes", "priority", "width", "height", "budgets", "tail"}
# A form sends what is not filled in as an empty text.
_Name = Annotated[str, Query(pattern=r"^(?:[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?)?$")]
_Button = Annotated[NoFields, Depends(FormBody(NoFields))]

# The report has a script and a style of its own: it is shown as if it came from another origin that knows nobody.
_REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Line(NamedTuple):
    """An event of a job's log: its number, when it was (UTC), of which kind it is, and what it tells."""

    number: int
    at: str
    kind: str
    what: str


@router.get("", response_class=Response)
def list_jobs(
    request: Request,
    service: Services,
    paging: Page,
    state: JobState | Literal[""] = "",
    kind: JobKind | Literal[""] = "",
    name: _Name = "",
) -> Response:
    """Jobs, newest first."""
    found = service.jobs.list(
        state=state or None, kind=kind or None, name=name or None, limit=paging.fetch, after=paging.after(MOMENT)
    )
    jobs = paging.page(found, lambda job: moment(service.database, tables.jobs, job.id, job.created))
    return render(
        request,
        "jobs",
        jobs=jobs,
        paging=paging,
        chosen={"state": state, "kind": kind, "name": name},
        states=get_args(JobState),
        kinds=get_args(JobKind),
    )


@router.get("/{job_id}", response_class=Response)
def show_job(
    request: Request,
    job_id: JobId,
    service: Services,
    caller: Caller,
    paging: Page,
    stage: Annotated[str, Query(pattern=r"^[a-z]{0,32}$")] = "",
    state: TaskState | Literal[""] = "",
    until: Annotated[int | None, Query(ge=1, le=2**31 - 1)] = None,
) -> Response:
    """A job; the query chooses among its tasks, and until which event its log goes."""
    last, final = request.app.state.feeds.state(job_id) or (0, True)
    job = service.jobs.get(job_id)
    is_mine = is_own(caller, job.submitted_by)
    positioned = service.jobs.positioned_tasks(
        job_id, stage=stage or None, state=state or None, limit=paging.fetch, after=paging.after(TASK_PLACE)
    )
    tasks = paging.page(positioned, lambda pair: [pair[1].stage, pair[0]])
    return render(
        request,
        "job",
        job=job,
        nodes=graph(job),
        settings=job.spec.model_dump(mode="json", exclude=_SHOWN_APART, exclude_defaults=True),
        tasks=[task for _, task in tasks],
        paging=paging,
        chosen={"stage": stage, "state": state},
        states=get_args(TaskState),
        log=_log(service, job_id, min(until or last, last)),
        until=until,
        last=last,
        is_live=not final,
        key_names=service.keys.names({job.submitted_by}),
        address=f"{request.url.path}?{request.url.query}" if request.url.query else request.url.path,
        can_retry=is_mine and job.state in ("failed", "cancelled"),
        can_cancel=is_mine and job.state not in (*FINAL_STATES, "cancelling"),
    )


@router.get("/{job_id}/events", response_class=Response)
async def stream_job(
    request: Request,
    job_id: JobId,
    after: Annotated[int, Query(ge=0, le=2**31 - 1)] = 0,
    last_event_id: Annotated[str, Header()] = "",
) -> Response:
    """Server-sent events: what happens in a job."""
    return await stream_events(request, job_id, last_number(last_event_id, after))


@router.get("/{job_id}/report", response_class=Response)
async def show_report(job_id: JobId, service: Services) -> Response:
    """The report of a build."""
    job = await to_thread.run_sync(service.jobs.get, job_id)
    sha256 = (job.result or {}).get("report")
    size = None if sha256 is None else await to_thread.run_sync(service.storage.blobs.size, sha256)
    if sha256 is None or size is None:
        raise Refusal("not-found", "This job has no report.", "Builds have one once they have succeeded.")
    path = await to_thread.run_sync(service.storage.blobs.path, sha256)
    headers = {"Content-Security-Policy": _REPORT_POLICY, "Content-Type": "text/html; charset=utf-8"}
    return FileRange(path, 0, size, 200, headers)


@router.post("/{job_id}/cancel", response_class=Response, dependencies=_submit)
def cancel_job(job_id: JobId, service: Services, caller: Caller, _: _Button) -> Response:
    """Cancels a job."""
    require_own_job(service, caller, job_id)
    return redirect(f"/jobs/{service.jobs.cancel(job_id).id}")


@router.post("/{job_id}/retry", response_class=Response, dependencies=_submit)
def retry_job(job_id: JobId, service: Services, caller: Caller, _: _Button) -> Response:
    """Goes on with a failed or cancelled job."""
    require_own_job(service, caller, job_id)
    return redirect(f"/jobs/{service.jobs.retry(job_id, most=most_jobs(caller, service.settings)).id}")


def _log(service: Service, job_id: str, until: int) -> list[Line]:
    """The events up to a number, latest first."""
    first = max(0, until - _LOG_EVENTS)
    return [_line(event) for event in service.jobs.events(job_id, first, until - first)][::-1]


def _line(event: EventRecord) -> Line:
    data = event.data
    where = " ".join(str(data[key]) for key in ("stage", "name") if data.get(key))
    problem = data.get("problem") or {}
    said = [data.get("text") or data.get("state") or "", problem.get("detail") or ""]
    what = ": ".join(part for part in (where, *map(str, said)) if part)
    return Line(event.number, f"{event.at[5:10]} {event.at[11:19]}", event.kind, what)
