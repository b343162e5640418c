"""A job of a server as text: what it is, how far it is, and what came of it."""

from __future__ import annotations

from typing import Any

from diaphane.cli import output
from diaphane.cli.lines import percent, plain, print_columns, seconds


def show_job(job: dict[str, Any], *, as_json: bool) -> None:
    """Prints a job."""
    if as_json:
        output.print_json(job)
        return
    name = f"  {job['name']}" if job.get("name") else ""
    print(f"{job['id']}  {job['kind']}{name}  {job['state']}  {percent(job['fraction'])}  attempt {job['attempt']}")
    if problem := job.get("problem"):
        print(f"  {plain(problem.get('detail') or problem['title'])}\n  {plain(problem.get('remedy', ''))}".rstrip())
    if job.get("stages"):
        columns = ("total", "done", "skipped", "running", "queued", "quarantined")
        rows = [(s["stage"], *(s[c] for c in columns), seconds(s["eta_seconds"])) for s in job["stages"]]
        print_columns(("stage", *columns, "to go"), rows)
    if job.get("skipped"):
        print("Skipped: " + ", ".join(f"{count:,} {plain(what)}" for what, count in job["skipped"].items()) + ".")
    for name, value in (job.get("result") or {}).items():
        if isinstance(value, str | int | float):
            print(f"{plain(name)}: {plain(value)}")
    for label, lines in ((job.get("result") or {}).get("advice") or {}).items():
        print(f"{plain(label)}: {plain(' '.join(lines))}")
