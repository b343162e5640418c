"""Files of settings: which one counts, and where a key goes."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer

from diaphane.cli import config
from diaphane.cli.server import DEFAULT_URL, UrlOption, find_key
from schemas.problem import ExitCode, Problem

KEY = "dia_secret"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    project = tmp_path / "project" / "shots"
    project.mkdir(parents=True)
    monkeypatch.chdir(project)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    for name in ("DIAPHANE_URL", "DIAPHANE_KEY", "DIAPHANE_KEY_FILE"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def write_project(folder: Path, text: str) -> None:
    (folder / "project" / config.PROJECT_FILE).write_text(text)


def write_user(text: str) -> Path:
    path = config.user_file()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def asked(*arguments: str) -> tuple[str, str | None, float]:
    """The URL, budgets and budget that a command gets."""
    app, found = typer.Typer(), list[tuple[str, str | None, float]]()

    @app.command()
    def one(
        url: UrlOption = DEFAULT_URL,
        budgets: str | None = typer.Option(None),
        budget: float = typer.Option(2.0),
    ) -> None:
        found.append((url, budgets, budget))

    @app.command()
    def other() -> None: ...

    command = typer.main.get_command(app)
    command.main(["one", *arguments], standalone_mode=False, default_map=config.read().defaults(command))
    return found[0]


def test_an_option_beats_the_environment_which_beats_the_project_which_beats_the_user(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert asked() == (DEFAULT_URL, None, 2.0)
    write_user('url = "http://user"\nbudgets = [0.5, 1]\nbudget = 3.0\n')
    assert asked() == ("http://user", "0.5,1", 3.0)
    write_project(folder, 'url = "http://project"\nbudgets = [4.0]\n')
    assert asked() == ("http://project", "4", 3.0)
    monkeypatch.setenv("DIAPHANE_URL", "http://environment")
    assert asked() == ("http://environment", "4", 3.0)
    assert asked("--url", "http://option", "--budgets", "7", "--budget", "1") == ("http://option", "7", 1.0)


def test_the_users_key_file_belongs_to_the_url_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_user('url = "https://mine.example"\nkey_file = "key"\n')
    (path.parent / "key").write_text(f"{KEY}\n")
    config.read()
    with pytest.raises(Problem, match="chmod 600"):
        find_key("https://mine.example", None)
    (path.parent / "key").chmod(0o600)
    assert find_key("https://mine.example/", None) == KEY
    assert find_key("https://other.example", None) is None
    monkeypatch.setenv("DIAPHANE_KEY", "dia_environment")
    assert find_key("https://mine.example", None) == "dia_environment"
    assert find_key("https://mine.example", path.parent / "key") == KEY


def test_no_key_goes_to_a_server_that_only_a_project_names(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIAPHANE_KEY", KEY)
    write_project(folder, 'url = "https://theirs.example"\n')
    url, *_ = asked()
    with pytest.raises(Problem, match=r"only .*diaphane.toml names that server") as refused:
        find_key(url, None)
    assert refused.value.code is ExitCode.AUTH
    assert KEY not in str(refused.value)
    assert find_key(asked("--url", url)[0], None) == KEY
    write_user(f'url = "{url}"\n')
    assert find_key(asked()[0], None) == KEY
    write_user("")
    write_project(folder, f'url = "{DEFAULT_URL}"\n')
    assert find_key(asked()[0], None) == KEY


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("url = ", "cannot be read as TOML"),
        ('key = "dia_x"', "there is no entry 'key'"),
        ('key_file = "key"', "names a key file"),
        ("budgets = [0.5, 'much']", "budgets.1"),
        ("budget = -1.0", "budget"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(folder: Path, text: str, said: str) -> None:
    write_project(folder, text)
    with pytest.raises(Problem, match=said) as problem:
        config.read()
    assert config.PROJECT_FILE in problem.value.title
