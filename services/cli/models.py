"""`diaphane models`: what the registry holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.cli import output
from services.cli.state import DEFAULT_STATE, JsonOption, StateOption

if TYPE_CHECKING:
    from services.registry import Publication, Registry

app = typer.Typer(help="Published bundles: list, show, promote.", no_args_is_help=True)

NameArgument = Annotated[str, typer.Argument(help="Name of the bundle.")]


@app.command("list")
def list_(state: StateOption = DEFAULT_STATE, as_json: JsonOption = False) -> None:
    """All bundles, with their latest version and their champion."""
    registry = _registry(state)
    entries = [
        {
            "name": name,
            "latest": registry.versions(name)[-1].version,
            "champion": registry.aliases(name).aliases.get("champion"),
        }
        for name in registry.names()
    ]
    if as_json:
        output.print_json({"bundles": entries})
        return
    if not entries:
        output.err().print(f"No bundle is published in {registry.root} yet: `diaphane build` publishes one.")
    for entry in entries:
        print(f"{entry['name']}  latest {entry['latest']}  champion {entry['champion'] or 'none'}")


@app.command()
def show(
    reference: Annotated[str, typer.Argument(help="NAME, NAME@VERSION or NAME@ALIAS.")],
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
) -> None:
    """Versions of a bundle with scores and digests, and the moves of its aliases; or one version of it."""
    registry = _registry(state)
    chosen = registry.resolve(reference) if "@" in reference else None
    name = reference.partition("@")[0]
    publications = [chosen] if chosen else registry.versions(name)
    if not publications:
        registry.resolve(name)  # raises the Problem for an unknown name
    aliases = registry.aliases(name)
    if as_json:
        versions = [_detail(registry, publication) for publication in publications]
        output.print_json({"name": name, "versions": versions, **aliases.model_dump()})
        return
    for publication in publications:
        marks = [alias for alias, version in aliases.aliases.items() if version == publication.version]
        score = "none" if publication.score is None else f"{publication.score:.4g}"
        print(f"{name}@{publication.version}  score {score}  {publication.created}  {', '.join(marks)}".rstrip())
        print(f"  sha256 {publication.digest}\n  {registry.folder(publication)}")
    for move in aliases.history:
        print(f"{move.when}  {move.alias}: {move.before or 'none'} -> {move.after}  by {move.who}: {move.why}")


@app.command()
def promote(
    name: NameArgument,
    version: Annotated[str, typer.Argument(help="Version that becomes the champion.")],
    reason: Annotated[str, typer.Option("--reason", help="Why; kept in the history.")],
    state: StateOption = DEFAULT_STATE,
) -> None:
    """Make a version the champion."""
    _registry(state).promote(name, version, reason)
    print(f"{name}@{version} is the champion.")


def _registry(state: Path) -> Registry:
    # Imported late: `diaphane --help` does not need pydantic.
    from services.registry import Registry

    return Registry(state / "registry")


def _detail(registry: Registry, publication: Publication) -> dict[str, Any]:
    return {**publication.model_dump(), "folder": str(registry.folder(publication))}
