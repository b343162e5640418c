"""`diaphane datasets`: label shards that trainings learn from."""

from __future__ import annotations

from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns, size
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, LimitOption, UrlOption, connect
from diaphane.cli.state import JsonOption

app = typer.Typer(help="Data sets on a server: list, show.", no_args_is_help=True)


@app.command("list")
def list_(
    limit: LimitOption = 50,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Data sets, newest first."""
    found = list(connect(url, key_file).datasets.list(limit))
    if as_json:
        output.print_json({"datasets": found})
        return
    rows = [
        (
            entry["id"],
            len(entry["shards"]),
            size(sum(s["bytes"] for s in entry["shards"])),
            entry["created"],
            entry["job_id"],
        )
        for entry in found
    ]
    print_columns(("id", "shards", "size", "created", "job"), rows)


@app.command()
def show(
    dataset_id: Annotated[str, typer.Argument(metavar="ID", help="Id of the data set.")],
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """A data set: what it was made with, and its shards."""
    found = connect(url, key_file).datasets.get(dataset_id)
    if as_json:
        output.print_json(found)
        return
    print(f"{found['id']}  {found['created']}  job {found['job_id'] or 'none'}")
    for name, value in found["settings"].items():
        print(f"  {plain(name)}: {plain(value)}")
    rows = [(s["scene"], s["view"], size(s["bytes"]), s["sha256"]) for s in found["shards"]]
    print_columns(("scene", "view", "size", "sha256"), rows)
