"""`diaphane jobs`: work on a server."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.job_text import show_job
from diaphane.cli.lines import percent, plain, print_columns, seconds
from diaphane.cli.model_options import add_command
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, LimitOption, UrlOption, connect
from diaphane.cli.state import JsonOption
from diaphane.cli.submit import submit

app = typer.Typer(help="Jobs on a server: submit, watch, cancel, retry.", no_args_is_help=True)
add_command(app, "submit", submit, "schemas.job:JobSpec", without=("kind",))

JobArgument = Annotated[str, typer.Argument(metavar="ID", help="Id of the job.")]
StateFilter = Annotated[str | None, typer.Option("--state", help="List only those in this state.")]
StageFilter = Annotated[str | None, typer.Option("--stage", help="List only those of this stage.")]


@app.command("list")
def list_(
    state: StateFilter = None,
    kind: Annotated[str | None, typer.Option("--kind", help="List only those of this kind.")] = None,
    name: Annotated[str | None, typer.Option("--name", help="List only those that publish under this name.")] = None,
    limit: LimitOption = 50,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Jobs, newest first."""
    jobs = list(connect(url, key_file).jobs.list(limit, state=state, kind=kind, name=name))
    if as_json:
        output.print_json({"jobs": jobs})
        return
    print_columns(
        ("id", "kind", "name", "state", "stage", "done", "to go", "created"),
        [
            (
                job["id"],
                job["kind"],
                job["name"],
                job["state"],
                job["stage"],
                percent(job["fraction"]),
                seconds(job["eta_seconds"]),
                job["created"],
            )
            for job in jobs
        ],
    )


@app.command()
def show(
    job_id: JobArgument, url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False
) -> None:
    """A job: how far it is, what it made, why it failed."""
    show_job(connect(url, key_file).jobs.get(job_id), as_json=as_json)


@app.command()
def watch(
    job_id: JobArgument, url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False
) -> None:
    """Follow a job to its end; exit status 0 if it succeeded, 1 if it failed, 130 if it was cancelled."""
    from diaphane.cli.watching import ensure_success, follow

    job = follow(connect(url, key_file), job_id, silent=as_json)
    show_job(job, as_json=as_json)
    ensure_success(job)


@app.command()
def cancel(
    job_id: JobArgument, url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False
) -> None:
    """Stop a job; what it made until now is kept."""
    _say(connect(url, key_file).jobs.cancel(job_id), as_json=as_json)


@app.command()
def retry(
    job_id: JobArgument, url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False
) -> None:
    """Let a failed or cancelled job go on; what is made already is not made again."""
    _say(connect(url, key_file).jobs.retry(job_id), as_json=as_json)


@app.command()
def tasks(
    job_id: JobArgument,
    stage: StageFilter = None,
    state: StateFilter = None,
    limit: LimitOption = 200,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """The tasks of a job; a quarantined one with the reason."""
    found = list(connect(url, key_file).jobs.tasks(job_id, limit, stage=stage, state=state))
    if as_json:
        output.print_json({"tasks": found})
        return
    rows = []
    for task in found:
        problem = task.get("problem") or {}
        note = problem.get("detail") or problem.get("title") or task.get("note")
        rows.append((task["stage"], task["name"], task["state"], seconds(task.get("seconds")), note))
    print_columns(("stage", "task", "state", "took", "note"), rows)


@app.command()
def events(
    job_id: JobArgument,
    after: Annotated[int, typer.Option("--after", min=0, help="List only those after this number.")] = 0,
    is_followed: Annotated[bool, typer.Option("--follow", help="Follow the events until the job ends.")] = False,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """What happened in a job; with --json one object a line."""
    import json

    jobs = connect(url, key_file).jobs
    for event in jobs.events(job_id, after) if is_followed else jobs.past_events(job_id, after):
        if as_json:
            print(json.dumps(event), flush=True)
            continue
        details = event["data"].items() if isinstance(event["data"], dict) else [("", event["data"])]
        text = "  ".join(f"{name} {value}".strip() for name, value in details)
        print(f"{event['number']:>5}  {event.get('at', '')}  {event['kind']:<5}  {plain(text)}", flush=True)


def _say(job: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        output.print_json(job)
    else:
        print(f"{job['id']}  {job['state']}")
