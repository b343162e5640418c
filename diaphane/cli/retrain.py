"""`diaphane retrain`: what the continuous integration of a repository of scenes calls when one of them changes."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.scene_options import LicenceOption
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, connect
from diaphane.cli.state import JsonOption
from diaphane.cli.submit import ViewsOption, job_fields, job_spec
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from diaphane.cli.comparison import Comparison
    from diaphane.client import Client

CHAMPION, SCRATCH = "champion", "scratch"
OWN = ("name", "dataset", "model", "start_from", "promote")
"""Fields of a job that are decided here."""
VARIABLES = "RETRAIN_"
"""What the names of the variables begin with that `deploy/retrain` gives options by."""
_SHOWN_TASKS = 5


def retrain(
    scenes: Annotated[list[str], typer.Argument(help="Scenes, files or ids, to train on.")],
    name: Annotated[str, typer.Option("--name", help="Name of the bundle in the registry.")],
    holdout: Annotated[
        list[str], typer.Option("--holdout", help="Evaluate on this committed scene and never train on it; repeatable.")
    ],
    max_regression: Annotated[
        float, typer.Option("--max-regression", help="Allow errors to exceed the champion's by this fraction.")
    ] = 0.05,
    baseline: Annotated[str, typer.Option("--baseline", help="champion, or none: nothing is compared.")] = CHAMPION,
    start: Annotated[
        str,
        typer.Option("--from", "--start-from", help="Start from champion (the name's own), scratch, or NAME@ALIAS."),
    ] = CHAMPION,
    is_promoted: Annotated[bool, typer.Option("--promote", help="Make it the champion if it is better.")] = False,
    summary: Annotated[Path | None, typer.Option("--summary", help="Write the Markdown table to this file.")] = None,
    licence: LicenceOption = None,
    views: ViewsOption = None,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
    **given: Any,
) -> None:
    """Build from changed scenes, compare with the champion on the held-out ones, and fail if that is worse.

    The same scenes again find the same job. The new version stays a candidate unless --promote is given.
    """
    _check(max_regression, baseline)
    fields = job_fields(given)
    server = connect(url, key_file)
    champion = _champion(server, name)
    fields |= {"kind": "build", "name": name, "promote": "never", "start_from": _start(server, start, champion)}
    spec = _with_scenes(server, fields, (scenes, holdout, licence or []), views, silent=as_json)
    job, rival = _finished(server, spec, champion, silent=as_json)
    comparison = _compare(server, job, spec, rival if baseline == CHAMPION else None)
    faults = comparison.faults(max_regression)
    if is_promoted and not faults and comparison.is_better:
        _promote(server, name, comparison)
    _publish(comparison.markdown(max_regression), summary)
    _hand_on({"reference": comparison.reference, "job": job["id"], "passed": str(not faults).lower()})
    if as_json:
        output.print_json(_as_json(job, comparison, faults))
    else:
        print(comparison.markdown(max_regression), end="")
    if faults:
        raise Problem(
            f"{comparison.reference} does not pass: {' '.join(faults)}",
            f"Look at the pictures of the job {job['id']}, or raise --max-regression on purpose.",
            ExitCode.CHECK_FAILED,
        )


def _check(max_regression: float, baseline: str) -> None:
    if not (math.isfinite(max_regression) and max_regression >= 0.0):
        raise Problem(f"--max-regression {max_regression} is not a fraction.", "Write it like --max-regression 0.05.")
    if baseline not in (CHAMPION, "none"):
        raise Problem(f"--baseline '{baseline}' is not known.", f"Choose {CHAMPION} or none.")


def _start(server: Client, start: str, champion: dict[str, Any] | None) -> str:
    """What the job is told to begin with: a version in the place of an alias, so that a repeated run means the same."""
    if start == CHAMPION:
        return SCRATCH if champion is None else CHAMPION
    if start == SCRATCH:
        return SCRATCH
    name, _, selector = start.partition("@")
    version = server.models.get(name, selector or CHAMPION)["version"]
    return f"{name}@{version}"


def _champion(server: Client, name: str) -> dict[str, Any] | None:
    """The champion of a name, if there is one yet."""
    from diaphane.client.transport import RefusedRequest

    try:
        return server.models.get(name, CHAMPION)
    except RefusedRequest as refused:
        if refused.code is ExitCode.NOT_FOUND:
            return None
        raise


def _with_scenes(
    server: Client,
    fields: Mapping[str, Any],
    named: tuple[list[str], list[str], list[str]],
    views: Path | None,
    *,
    silent: bool,
) -> dict[str, Any]:
    """The job with its scenes; `named` are those to train on, those held out, and licences, as on the command line."""
    from diaphane.cli.inputs import bring, named_scenes, scene_uses, with_licences

    scenes, holdout, licences = named
    inputs = with_licences(named_scenes(scenes, holdout), licences)
    stand_ins = [{"scene": f"scn_{i:032x}", "holdout": given.held_out} for i, given in enumerate(inputs)]
    job_spec({**fields, "scenes": stand_ins})  # whatever is wrong is said before anything is uploaded
    known = bring(server, [given.reference for given in inputs], silent=silent)
    return job_spec({**fields, "scenes": scene_uses(inputs, known, views)})


def _finished(
    server: Client, spec: dict[str, Any], champion: dict[str, Any] | None, *, silent: bool
) -> tuple[dict[str, Any], str | None]:
    """The job of these scenes, finished, and the version that it was compared with.

    A repeated run finds the job of the first: by its key, or because the champion itself came of it.
    """
    from diaphane.cli.watching import ensure_success, follow

    before = None if champion is None else str(champion["version"])
    job = _job_of(server, champion, spec)
    if job is not None:
        before = _before(server, spec["name"], str(before))
    else:
        job, is_new = server.jobs.submit(spec, _idempotency_key(spec, before))
        if not is_new and job["state"] in ("failed", "cancelled"):
            job = server.jobs.retry(job["id"])
    if not silent:
        output.err().print(f"Job {job['id']}: {job['state']}", markup=False)
    job = follow(server, job["id"], silent=silent)
    ensure_success(job)
    return job, before


def _job_of(server: Client, version: dict[str, Any] | None, spec: Mapping[str, Any]) -> dict[str, Any] | None:
    """The job that published a version, if it was the very same job."""
    from diaphane.client.transport import RefusedRequest

    if version is None or not version.get("job_id"):
        return None
    try:
        job = server.jobs.get(version["job_id"])
    except RefusedRequest as refused:
        if refused.code is ExitCode.NOT_FOUND:  # jobs are removed by age
            return None
        raise
    mine, its = ({**s, "start_from": None, "priority": None} for s in (spec, job["spec"]))
    same = mine == its and _began_alike(str(spec["name"]), spec["start_from"], job["spec"]["start_from"])
    return job if job["state"] == "succeeded" and same else None


def _began_alike(name: str, start: str, its: str) -> bool:
    """Whether a job began with what is asked for: the champion of its time, which the first version did not have."""
    return start == its or (start == CHAMPION and (its == SCRATCH or its.startswith(f"{name}@")))


def _before(server: Client, name: str, version: str) -> str | None:
    """The champion before a version became it."""
    moves = [m for m in server.models.aliases(name)["history"] if m["alias"] == CHAMPION and m["after"] == version]
    return max(moves, key=lambda move: str(move["at"]))["before"] if moves else None


def _idempotency_key(spec: Mapping[str, Any], champion: str | None) -> str:
    """Scenes are named by their content, so the spec is all content; against another champion it is another job."""
    text = json.dumps({"spec": spec, CHAMPION: champion}, sort_keys=True, separators=(",", ":"))
    return f"retrain-{hashlib.sha256(text.encode()).hexdigest()}"


def _compare(server: Client, job: dict[str, Any], spec: Mapping[str, Any], champion: str | None) -> Comparison:
    from diaphane.cli.comparison import code, comparison_of

    notes = []
    if job.get("skipped"):
        counts = ", ".join(f"{count:,} {what}" for what, count in job["skipped"].items())
        notes.append(f"Skipped, because it was there already: {code(counts)}.")
    for task in server.jobs.tasks(job["id"], _SHOWN_TASKS, state="quarantined"):
        problem = task.get("problem") or {}
        what = f"{task['stage']} of {task['name']}: {problem.get('detail', 'it failed')}"
        notes.append(f"Left out: {code(what)}.")
    notes.append(f"Job {code(job['id'])}.")
    expected = sum(use["holdout"] for use in spec["scenes"])
    return comparison_of(job, champion, expected, tuple(notes))


def _promote(server: Client, name: str, comparison: Comparison) -> None:
    version = comparison.reference.partition("@")[2]
    parity = server.models.get(name, version).get("parity") or {}
    if max(parity["torch_onnx"], parity["torch_glsl"]) > parity["tolerance"]:
        raise Problem(
            f"{comparison.reference} is better, but its exported forms do not agree.",
            "Report it; the version stays a candidate.",
            ExitCode.CHECK_FAILED,
        )
    change = comparison.total.change
    why = "first version" if change is None else f"error {100.0 * change:+.1f} % on the committed scenes"
    server.models.move_alias(name, CHAMPION, version, f"diaphane retrain: {why}")


def _publish(table: str, summary: Path | None) -> None:
    """Writes the table to the file that was asked for, and onto the page of a GitHub workflow's run."""
    if summary is not None:
        summary.write_text(table, encoding="utf-8")
    if page := os.environ.get("GITHUB_STEP_SUMMARY"):
        with Path(page).open("a", encoding="utf-8") as stream:
            stream.write(table)


def _hand_on(outputs: Mapping[str, str]) -> None:
    """Sets the outputs of a GitHub workflow's step."""
    if path := os.environ.get("GITHUB_OUTPUT"):
        with Path(path).open("a", encoding="utf-8") as stream:
            stream.writelines(f"{name}={value}\n" for name, value in outputs.items())


def _as_json(job: dict[str, Any], comparison: Comparison, faults: list[str]) -> dict[str, Any]:
    rows = [
        {"scene": row.scene, "score": row.score, "rival": row.rival, "change": row.change} for row in comparison.rows
    ]
    return {
        "reference": comparison.reference,
        "champion": comparison.champion,
        "passed": not faults,
        "faults": faults,
        "score": comparison.total.score,
        "rival_score": comparison.total.rival,
        "change": comparison.total.change,
        "scenes": rows,
        "job": job["id"],
        "report": (job["result"] or {}).get("report"),
    }
