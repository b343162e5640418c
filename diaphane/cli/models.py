"""`diaphane models`: what the registry holds, that of the state folder or that of a server."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain
from diaphane.cli.server import URL_VARIABLE, KeyFileOption, connect
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from schemas.licence import verdict
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from diaphane.client import Client
    from services.registry import Publication, Registry

app = typer.Typer(help="Published bundles: list, show, promote, roll back.", no_args_is_help=True)

NameArgument = Annotated[str, typer.Argument(help="Name of the bundle.")]
ReasonOption = Annotated[str, typer.Option("--reason", help="State why; the history keeps it.")]
AliasOption = Annotated[str, typer.Option("--alias", help="Move this alias.")]
ServerOption = Annotated[
    str | None,
    typer.Option("--url", envvar=URL_VARIABLE, help="Use this server's registry instead of the state folder's."),
]
CHAMPION = "champion"


class Models(Protocol):
    """A registry, here or on a server; answers are those of the REST interface (`schemas.service`)."""

    def models(self) -> Sequence[dict[str, Any]]:
        """All names."""

    def versions(self, name: str) -> Sequence[dict[str, Any]]:
        """All versions of a name, oldest first."""

    def version(self, name: str, selector: str) -> dict[str, Any]:
        """A version by number or alias."""

    def aliases(self, name: str) -> dict[str, Any]:
        """Aliases and their history, oldest move first."""

    def move_alias(self, name: str, alias: str, version: str, reason: str) -> None:
        """Points an alias at a version."""

    def roll_back(self, name: str, alias: str, reason: str) -> None:
        """Points an alias at the version that it meant before."""


@app.command("list")
def list_(
    state: StateOption = DEFAULT_STATE,
    url: ServerOption = None,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """All bundles, with their latest version and their champion."""
    with closing(_open(state, url, key_file)) as registry:
        entries = [
            {"name": model["name"], "latest": model["latest"], "champion": model["aliases"].get(CHAMPION)}
            for model in registry.models()
        ]
    if as_json:
        output.print_json({"bundles": entries})
        return
    if not entries:
        output.err().print("No bundle is published yet: `diaphane build` publishes one.")
    for entry in entries:
        print(f"{entry['name']}  latest {entry['latest']}  champion {entry['champion'] or 'none'}")


@app.command()
def show(
    reference: Annotated[str, typer.Argument(help="NAME, NAME@VERSION or NAME@ALIAS.")],
    state: StateOption = DEFAULT_STATE,
    url: ServerOption = None,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Versions of a bundle with scores and digests, and the moves of its aliases; or one version of it."""
    name, at, selector = reference.partition("@")
    with closing(_open(state, url, key_file)) as registry:
        versions = [registry.version(name, selector or CHAMPION)] if at else registry.versions(name)
        if not versions:
            raise Problem(f"There is no bundle '{plain(name)}'.", "See `diaphane models list`.", ExitCode.NOT_FOUND)
        meaning = registry.aliases(name)
    if as_json:
        output.print_json({"name": name, "versions": versions, **meaning})
        return
    for version in versions:
        marks = [alias for alias, number in meaning["aliases"].items() if number == version["version"]]
        score = "none" if version["score"] is None else f"{version['score']:.4g}"
        print(f"{name}@{version['version']}  score {score}  {version['created']}  {', '.join(marks)}".rstrip())
        print(f"  sha256 {version['digest']}")
        provenance = version["provenance"]
        print(f"  {plain(verdict(provenance['scenes'], provenance.get('licences', {})))}")
        if "folder" in version:
            print(f"  {version['folder']}")
        if card := _card(version):
            print(f"  model card: {card}")
    for move in meaning["history"]:
        who, why = plain(move["who"]), plain(move["why"])
        print(f"{move['at']}  {move['alias']}: {move['before'] or 'none'} -> {move['after']}  by {who}: {why}")


@app.command()
def promote(
    name: NameArgument,
    version: Annotated[str, typer.Argument(help="Version to make the champion.")],
    reason: ReasonOption,
    alias: AliasOption = CHAMPION,
    state: StateOption = DEFAULT_STATE,
    url: ServerOption = None,
    key_file: KeyFileOption = None,
) -> None:
    """Make a version the champion."""
    with closing(_open(state, url, key_file)) as registry:
        registry.move_alias(name, alias, version, reason)
        _say(registry, name, alias)


@app.command()
def rollback(
    name: NameArgument,
    reason: ReasonOption,
    alias: AliasOption = CHAMPION,
    state: StateOption = DEFAULT_STATE,
    url: ServerOption = None,
    key_file: KeyFileOption = None,
) -> None:
    """Make the version before the champion again."""
    with closing(_open(state, url, key_file)) as registry:
        registry.roll_back(name, alias, reason)
        _say(registry, name, alias)


def _card(version: dict[str, Any]) -> str | None:
    """Where the model card of a version is, if it has one: a file, or an address of the server."""
    # Imported late: `diaphane --help` needs no schemas.
    from schemas.bundle import CARD

    if CARD not in version["files"]:
        return None
    if "folder" in version:
        return f"{version['folder']}/{CARD}"
    return f"/v1/blobs/sha256/{version['files'][CARD]['sha256']}"


def _say(registry: Models, name: str, alias: str) -> None:
    version = registry.version(name, alias)["version"]
    print(f"{name}@{version} is the {alias}.")


def _open(state: Path, url: str | None, key_file: Path | None) -> _Local | _Server:
    return _Local(state) if url is None else _Server(connect(url, key_file))


class _Local:
    """The registry of a state folder.

    Args:
        state: The folder.
    """

    def __init__(self, state: Path) -> None:
        # Imported late: `diaphane --help` needs no database.
        from diaphane.local.state import open_local

        self._open = ExitStack()
        self._registry: Registry = self._open.enter_context(open_local(state)).registry

    def close(self) -> None:
        self._open.close()

    def models(self) -> list[dict[str, Any]]:
        return [model.model_dump(mode="json") for model in self._registry.models()]

    def versions(self, name: str) -> list[dict[str, Any]]:
        return [self._detail(publication) for publication in self._registry.versions(name)]

    def version(self, name: str, selector: str) -> dict[str, Any]:
        return self._detail(self._registry.resolve(f"{name}@{selector}"))

    def aliases(self, name: str) -> dict[str, Any]:
        history = [move.model_dump(mode="json") for move in self._registry.moves(name)]
        return {"aliases": self._registry.aliases(name).aliases, "history": history}

    def move_alias(self, name: str, alias: str, version: str, reason: str) -> None:
        self._registry.promote(name, version, reason, alias)

    def roll_back(self, name: str, alias: str, reason: str) -> None:
        self._registry.rollback(name, reason, alias)

    def _detail(self, publication: Publication) -> dict[str, Any]:
        record = self._registry.record(publication).model_dump(mode="json")
        return {**record, "folder": str(self._registry.folder(publication))}


class _Server:
    """The registry of a server.

    Args:
        server: The server.
    """

    def __init__(self, server: Client) -> None:
        self._server = server

    def close(self) -> None:
        self._server.close()

    def models(self) -> list[dict[str, Any]]:
        return list(self._server.models.list())

    def versions(self, name: str) -> list[dict[str, Any]]:
        return sorted(self._server.models.versions(name), key=lambda version: _order(version["version"]))

    def version(self, name: str, selector: str) -> dict[str, Any]:
        return self._server.models.get(name, selector)

    def aliases(self, name: str) -> dict[str, Any]:
        found = self._server.models.aliases(name)
        return {**found, "history": sorted(found["history"], key=lambda move: str(move["at"]))}

    def move_alias(self, name: str, alias: str, version: str, reason: str) -> None:
        self._server.models.move_alias(name, alias, version, reason)

    def roll_back(self, name: str, alias: str, reason: str) -> None:
        self._server.models.roll_back(name, alias, reason)


def _order(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))
