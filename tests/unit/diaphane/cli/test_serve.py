from __future__ import annotations

import socket
from pathlib import Path

import pytest

from diaphane.cli.app import run
from diaphane.cli.serve import announce, show_first_key
from diaphane.cli.worker import parse_roles
from schemas.problem import ExitCode, Problem
from services.api.server import is_loopback


class _Keys:
    def __init__(self, made: int) -> None:
        self.made = made

    def any(self) -> bool:
        return self.made > 0

    def create(self, name: str, scopes: tuple[str, ...]) -> tuple[None, str]:
        assert scopes == ("admin",)
        self.made += 1
        return None, "dia_secret"


class _Service:
    def __init__(self, made: int = 0) -> None:
        self.keys = _Keys(made)


def test_the_first_key_is_printed_once(capsys: pytest.CaptureFixture[str]) -> None:
    service = _Service()
    show_first_key(service, "127.0.0.1")  # type: ignore[arg-type]
    assert "dia_secret" in capsys.readouterr().out
    show_first_key(service, "127.0.0.1")  # type: ignore[arg-type]
    assert capsys.readouterr().out == ""
    assert service.keys.made == 1


def test_a_service_that_others_can_reach_needs_a_key_before_it_starts() -> None:
    service = _Service()
    with pytest.raises(Problem, match="no API key") as problem:
        show_first_key(service, "0.0.0.0")  # type: ignore[arg-type]
    assert problem.value.code is ExitCode.AUTH
    assert service.keys.made == 0
    show_first_key(_Service(made=1), "0.0.0.0")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("host", "expected"),
    [("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("h", False)],
)
def test_only_this_machine_reaches_the_loopback_interface(host: str, expected: bool) -> None:
    assert is_loopback(host) is expected


def test_roles_are_named_by_commas_and_an_unknown_one_is_told() -> None:
    assert parse_roles("label, render") == ("render", "label")
    with pytest.raises(Problem, match="'cook' is not a role"):
        parse_roles("render,cook")
    with pytest.raises(Problem, match="No role"):
        parse_roles(" , ")


def test_a_busy_port_is_said_before_a_key_is_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        assert run(["serve", "--port", port, "--state", str(tmp_path / "state")]) == ExitCode.CONFLICT
    captured = capsys.readouterr()
    assert captured.out == ""
    first, remedy = captured.err.splitlines()
    assert first == f"error: Diaphane cannot listen on port {port} of 127.0.0.1: address already in use."
    assert "--port" in remedy
    assert not (tmp_path / "state").exists()


def test_the_addresses_are_those_that_this_machine_reaches(capsys: pytest.CaptureFixture[str]) -> None:
    announce("0.0.0.0", 8035)
    first, *others = capsys.readouterr().out.splitlines()
    assert first == "Diaphane serves http://0.0.0.0:8035"
    assert "Dashboard: http://127.0.0.1:8035/" in others
    assert others[-1].endswith("export DIAPHANE_URL=http://127.0.0.1:8035")
    announce("::1", 80)
    assert "Dashboard: http://[::1]:80/" in capsys.readouterr().out
