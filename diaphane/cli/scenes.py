"""`diaphane scenes`: what the server may render."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns, size
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, LimitOption, UrlOption, connect
from diaphane.cli.state import JsonOption

app = typer.Typer(
    help="Scenes on a server: upload, list, show. (`diaphane scene` is about files on this machine.)",
    no_args_is_help=True,
)


@app.command()
def upload(
    files: Annotated[list[Path], typer.Argument(help="Scenes: .usd, .usda, .usdc, .usdz, .glb.")],
    name: Annotated[str | None, typer.Option("--name", help="Name of the scene. Default: that of its file.")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait until the server has checked them.")] = True,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Upload scenes with all files that they use; only what the server lacks is sent."""
    from diaphane.cli import inputs
    from diaphane.client.packing import pack
    from evaluation.progress import make_progress
    from schemas.problem import Problem

    if name is not None and len(files) > 1:
        raise Problem("--name names one scene, and several were given.", "Upload them one by one, or leave --name out.")
    packages = [pack(path, name) for path in files]
    server = connect(url, key_file)
    progress = make_progress(sys.stderr, silent=as_json)
    scenes = inputs.upload(server, packages, progress)
    if wait:
        scenes = inputs.await_checks(server, [scene["id"] for scene in scenes], progress)
    _show_all(scenes, as_json=as_json)
    for path, scene in zip(files, scenes, strict=True):
        inputs.ensure_accepted(scene, str(path))


@app.command("list")
def list_(
    limit: LimitOption = 50,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Scenes that were uploaded, newest first."""
    _show_all(list(connect(url, key_file).scenes.list(limit)), as_json=as_json)


@app.command()
def show(
    scene_id: Annotated[str, typer.Argument(metavar="ID", help="Id of the scene.")],
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """A scene: its files, what was found in it, or why it was rejected."""
    scene = connect(url, key_file).scenes.get(scene_id)
    if as_json:
        output.print_json(scene)
        return
    print(f"{scene['id']}  {plain(scene['name'])}  {scene['state']}  {scene['created']}")
    if problem := scene.get("problem"):
        print(f"  {plain(problem.get('detail') or problem['title'])}\n  {plain(problem.get('remedy', ''))}".rstrip())
    for fact, value in (scene.get("facts") or {}).items():
        print(f"  {plain(fact)}: {plain(value)}")
    rows = [(name, size(file["bytes"]), file["sha256"]) for name, file in scene["files"].items()]
    print_columns(("file", "size", "sha256"), rows)


def _show_all(scenes: Sequence[dict[str, Any]], *, as_json: bool) -> None:
    if as_json:
        output.print_json({"scenes": scenes})
        return
    rows = [(s["id"], s["state"], size(s["bytes"]), s["created"], s["name"]) for s in scenes]
    print_columns(("id", "state", "size", "created", "name"), rows)
