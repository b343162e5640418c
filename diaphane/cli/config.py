"""What commands take from files where neither an option nor a variable of the environment says it.

- The project's file is the nearest `diaphane.toml`, in the working folder or above it.
- The user's file is `$XDG_CONFIG_HOME/diaphane/config.toml`, by default `~/.config/diaphane/config.toml`.
- An option beats the environment, which beats the project's file, which beats the user's.
- A project's file may come with somebody else's scenes. It names no key, and no key of the user's goes to a server that
  it alone names, unless that is this machine.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from pydantic import ValidationError

PROJECT_FILE = "diaphane.toml"
USER_FILE = Path("diaphane") / "config.toml"
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class Entries:
    """What a file says; None: nothing.

    Attributes:
        path: Of the file; None: there is no file.
        url: Of the server.
        key_file: File with the key of that server; only the user's file has one.
        budget: For commands of one budget: fragments as a multiple of width x height.
        budgets: For commands of several, as `--budgets` has them.
    """

    path: Path | None = None
    url: str | None = None
    key_file: Path | None = None
    budget: float | None = None
    budgets: str | None = None


@dataclass(slots=True)
class Config:
    """Both files.

    Attributes:
        project: The project's.
        user: The user's.
        is_project_asked: Whether the command that runs was given its URL by the project's file.
    """

    project: Entries = field(default_factory=Entries)
    user: Entries = field(default_factory=Entries)
    is_project_asked: bool = False

    def defaults(self, command: Any) -> dict[str, Any]:
        """Values of the options of a command, or of each command of a group, by the names of their parameters.

        Args:
            command: A command, or a group of them.
        """
        inner: Mapping[str, Any] | None = getattr(command, "commands", None)
        if inner is not None:
            return {name: self.defaults(each) for name, each in inner.items()}
        found = {name: getattr(self.project, name) or getattr(self.user, name) for name in ("budget", "budgets")}
        if self.project.url is not None or self.user.url is not None:
            found["url"] = self._url
        return {name: value for name, value in found.items() if value is not None}

    def _url(self) -> str | None:
        """Called where a command asks for its URL, and neither an option nor the environment names one."""
        self.is_project_asked = self.project.url is not None
        return self.project.url or self.user.url

    def key_file(self, url: str, default_url: str) -> Path | None:
        """The user's file with the key of a server; None: there is none.

        Args:
            url: Of the server.
            default_url: What the key belongs to where no URL is beside it.
        """
        belongs = self.user.url or default_url
        return self.user.key_file if url.rstrip("/") == belongs.rstrip("/") else None

    def check_key(self, url: str) -> None:
        """Refuses to send a key to a server that only the project's file names.

        Args:
            url: Of the server.

        Raises:
            Problem: It is such a server.
        """
        from urllib.parse import urlsplit

        own = (self.user.url or "").rstrip("/")
        if not self.is_project_asked or url.rstrip("/") == own or urlsplit(url).hostname in LOOPBACK:
            return
        raise Problem(
            f"The key is not sent to {url}: only {self.project.path} names that server.",
            f"If you trust it, name it yourself: `export DIAPHANE_URL={url}`, or `url` in {user_file()}.",
            ExitCode.AUTH,
        )


_CURRENT: ContextVar[Config] = ContextVar("config")


def current() -> Config:
    """The configuration of the command that runs; an empty one outside of commands."""
    return _CURRENT.get(Config())


def read() -> Config:
    """Both files as they are now, which `current` gives from here on.

    Raises:
        Problem: One cannot be read, or says what it cannot.
    """
    project = next((path for path in _above(Path.cwd()) if path.is_file()), None)
    if project is not None and project.stat().st_uid not in (os.getuid(), 0):
        raise Problem(
            f"{project} belongs to another user of this machine, and is not read.",
            "Run in a folder that is not below it, or make the file your own.",
        )
    own = user_file()
    made = Config(
        Entries() if project is None else _entries(project, is_project=True),
        _entries(own, is_project=False) if own.is_file() else Entries(),
    )
    _CURRENT.set(made)
    return made


def user_file() -> Path:
    """Where the user's file is."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / USER_FILE


def _above(folder: Path) -> list[Path]:
    return [each / PROJECT_FILE for each in (folder, *folder.parents)]


def _entries(path: Path, *, is_project: bool) -> Entries:
    from pydantic import ValidationError

    from schemas.config import ConfigFile

    try:
        said = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise Problem(f"{path} cannot be read as TOML: {error}.", "Correct the file, or remove it.") from error
    if is_project and "key_file" in said:
        raise Problem(
            f"{path} names a key file, and a project's file is read by everyone who has the project.",
            f"Move `key_file` to {user_file()}.",
        )
    try:
        found = ConfigFile.model_validate(said)
    except ValidationError as error:
        raise Problem(
            f"{path}: {_said(error)}.", "Correct the file; docs/CONFIGURATION.md lists the entries."
        ) from None
    return Entries(
        path=path,
        url=found.url,
        key_file=None if found.key_file is None else path.parent / Path(found.key_file).expanduser(),
        budget=found.budget,
        budgets=None if found.budgets is None else ",".join(f"{budget:g}" for budget in found.budgets),
    )


def _said(error: ValidationError) -> str:
    first = error.errors()[0]
    name = ".".join(map(str, first["loc"]))
    if first["type"] == "extra_forbidden":
        return f"there is no entry '{name}'"
    return f"{name}: {first['msg']}"
