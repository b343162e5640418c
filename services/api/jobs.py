"""`/v1/jobs`: what the service makes, and how it goes."""

from __future__ import annotations

from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Query, Request, Response

from schemas.job import JobKind, JobSpec, JobState, TaskState
from schemas.problem import ExitCode, Problem
from schemas.service import JobRecord, KeyRecord, SceneRecord, TaskRecord
from services.acceptance import accept
from services.api.answers import EventPage, JobPage, TaskPage
from services.api.body import JsonBody
from services.api.bounds import most_jobs, require_within
from services.api.feeds import Feeds
from services.api.pages import LINK_HEADER, MOMENT, TASK_PLACE, Page
from services.api.parts import JobId, NameQuery, Services
from services.api.places import moment, position
from services.api.security import Caller, Needs, require_own, require_scope
from services.api.streams import EventStream
from services.database import tables
from services.keys import allows
from services.problems import Refusal
from services.service import Service

EVENTS_PER_PAGE = 500
_EVENT = 2**31 - 1

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])
_submit = [Depends(Needs("submit"))]


@router.post(
    "",
    status_code=202,
    dependencies=_submit,
    responses={200: {"model": JobRecord, "description": "The same request came before."}, 404: {}, 409: {}},
)
def submit_job(
    body: Annotated[JobSpec, Depends(JsonBody(JobSpec))],
    service: Services,
    caller: Caller,
    request: Request,
    response: Response,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            pattern=r"^[!-~]+$",
            description="A request with the key of an earlier one is answered with the job of that one.",
        ),
    ] = None,
) -> JobRecord:
    """Submits a job."""
    scenes = _require_accepted(service, body)
    spec = _within_scope(body, caller)
    require_within(spec, scenes, caller, service.settings)
    named: dict[str, Any] = {"submitted_by": caller.id, "idempotency_key": idempotency_key}
    record, new = service.jobs.repeated(spec, **named), False
    if record is None:
        accepted = accept(spec, scenes, service.registry, service.measured, service.storage.store)
        named["most"] = most_jobs(caller, service.settings)
        record, new = service.jobs.submit(spec, **named, request_id=request.state.request_id, accepted=accepted)
    response.headers["Location"] = f"/v1/jobs/{record.id}"
    response.status_code = 202 if new else 200
    return record


def _within_scope(spec: JobSpec, key: KeyRecord) -> JobSpec:
    """What a key may ask for: without the scope `publish`, a better version stays a candidate.

    Raises:
        Refusal: A promotion is asked for in so many words, or to be served before all others, and the key may not.
    """
    if spec.priority == "high":
        require_scope(key, "admin")
    if spec.kind != "build" or spec.promote == "never" or allows(key, "publish"):
        return spec
    if "promote" in spec.model_fields_set:
        require_scope(key, "publish")
    return spec.model_copy(update={"promote": "never"})


@router.get("", responses={200: {"headers": LINK_HEADER}})
def list_jobs(
    service: Services,
    paging: Page,
    state: Annotated[JobState | None, Query()] = None,
    kind: Annotated[JobKind | None, Query()] = None,
    name: NameQuery = None,
) -> JobPage:
    """Jobs, newest first."""
    found = service.jobs.list(state=state, kind=kind, name=name, limit=paging.fetch, after=paging.after(MOMENT))
    place = lambda job: moment(service.database, tables.jobs, job.id, job.created)  # noqa: E731
    return JobPage(items=paging.page(found, place))


@router.get("/{job_id}")
def read_job(job_id: JobId, service: Services) -> JobRecord:
    """A job."""
    return service.jobs.get(job_id)


@router.post("/{job_id}/cancel", dependencies=_submit, responses={409: {}})
def cancel_job(job_id: JobId, service: Services, caller: Caller) -> JobRecord:
    """Cancels a job of the same key, or with `admin` any: what runs is stopped, what was made stays."""
    require_own_job(service, caller, job_id)
    return service.jobs.cancel(job_id)


@router.post("/{job_id}/retry", dependencies=_submit, responses={409: {}})
def retry_job(job_id: JobId, service: Services, caller: Caller) -> JobRecord:
    """Goes on with a failed or cancelled job of the same key, or with `admin` any; what was made is found again."""
    require_own_job(service, caller, job_id)
    return service.jobs.retry(job_id, most=most_jobs(caller, service.settings))


@router.get("/{job_id}/tasks", responses={200: {"headers": LINK_HEADER}})
def list_tasks(
    job_id: JobId,
    service: Services,
    paging: Page,
    stage: Annotated[str | None, Query(pattern=r"^[a-z]{1,32}$")] = None,
    state: Annotated[TaskState | None, Query()] = None,
) -> TaskPage:
    """Tasks of a job, by stage."""
    service.jobs.get(job_id)
    found = service.jobs.tasks(job_id, stage=stage, state=state, limit=paging.fetch, after=paging.after(TASK_PLACE))

    def place(task: TaskRecord) -> list[str | int]:
        return position(service.database, job_id, task.stage, task.name)

    return TaskPage(items=paging.page(found, place))


@router.get(
    "/{job_id}/events",
    response_model=EventPage,
    responses={
        200: {
            "headers": LINK_HEADER,
            "description": "A page of events; with `Accept: text/event-stream` all of them, as they happen.",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        204: {"description": "The job has ended, and there is nothing after `Last-Event-ID`: do not ask again."},
    },
)
async def read_events(
    job_id: JobId,
    service: Services,
    request: Request,
    response: Response,
    after: Annotated[int, Query(ge=0, le=_EVENT, description="Number of the last event that is known.")] = 0,
    limit: Annotated[int, Query(ge=1, le=EVENTS_PER_PAGE)] = 100,
    accept: Annotated[str, Header()] = "",
    last_event_id: Annotated[str, Header(description="Number of the last event that a listener has.")] = "",
) -> EventPage | Response:
    """What happened in a job, as a page or as server-sent events."""
    if "text/event-stream" in accept:
        return await stream_events(request, job_id, last_number(last_event_id, after))
    await to_thread.run_sync(service.jobs.get, job_id)
    found = await to_thread.run_sync(service.jobs.events, job_id, after, limit + 1)
    items = list(found[:limit])
    if len(found) > limit:
        path = request.scope["path"]
        response.headers["Link"] = f'<{path}?after={items[-1].number}&limit={limit}>; rel="next"'
    return EventPage(items=items)


async def stream_events(request: Request, job_id: str, after: int) -> Response:
    """The events of a job as they happen, for as long as the key of the request is valid.

    Args:
        request: The request.
        job_id: The job.
        after: Number of the last event that the listener has.

    Raises:
        Problem: There is no such job.
    """
    feeds: Feeds = request.app.state.feeds
    state = await to_thread.run_sync(feeds.state, job_id)
    if state is None:
        raise Problem(f"There is no job {job_id}.", "List the jobs.", ExitCode.NOT_FOUND)
    last, final = state
    if final and after >= last:
        return Response(status_code=204)  # to a browser this says that it need not connect again
    return EventStream(feeds.listen(job_id, after, state))


def require_own_job(service: Service, key: KeyRecord, job_id: str) -> None:
    """Refuses a key that would change the job of another one.

    Raises:
        Problem: There is no such job.
        Refusal: It belongs to another key.
    """
    require_own(key, service.jobs.get(job_id).submitted_by, f"The job {job_id}")


def last_number(header: str, after: int) -> int:
    """The event that a listener has last: what it says when it connects again, else `after`.

    Raises:
        Refusal: The header is no number of an event.
    """
    if not header:
        return after
    if not (header.isascii() and header.isdecimal()) or len(header) > 10 or int(header) > _EVENT:
        raise Refusal("malformed", "Last-Event-ID is not the number of an event.")
    return int(header)


def _require_accepted(service: Service, spec: JobSpec) -> dict[str, SceneRecord]:
    """The scenes of a job, before anything is queued.

    Raises:
        Problem: A scene does not exist.
        Refusal: A scene is not accepted.
    """
    known = service.scenes.many(use.scene for use in spec.scenes)
    for use in spec.scenes:
        if use.scene not in known:
            raise Problem(f"There is no scene {use.scene}.", "Upload it first.", ExitCode.NOT_FOUND)
        if known[use.scene].state != "accepted":
            raise Refusal("scene-not-accepted", f"The scene {use.scene} is {known[use.scene].state}.")
    if spec.dataset is not None:
        service.measured.dataset(spec.dataset)
    if spec.model is not None:
        service.registry.resolve(spec.model)
    return known
