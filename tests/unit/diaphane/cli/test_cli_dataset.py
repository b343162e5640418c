"""`diaphane dataset inspect`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from support.shards import random_dataset

from diaphane.cli.app import run
from schemas.problem import ExitCode


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    random_dataset(folder)
    return folder


def test_inspect_prints_counts_and_bars(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dataset", "inspect", str(made)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "every shard verified against the index" in out
    assert re.search(r"^train +3 +2 ", out, re.MULTILINE)
    assert re.search(r"^held-out +1 +1 ", out, re.MULTILINE)
    assert "train: box, town" in out
    for title in ("Rows by n", "Hull segments by gain", "Budgets with an optimal allocation, by F / N"):
        assert title in out
    bars = re.findall(r"^ +\S.*? +([\d,]+)  (#+)$", out, re.MULTILINE)
    assert max(len(bar) for _, bar in bars) == 40
    assert re.search(r"^ +1e-\d+\.\.1e-\d+ +\d", out, re.MULTILINE)
    assert "price lambda, from 1e-" in out


def test_inspect_as_json_says_the_same_of_a_shard(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shard = made / "box-front.safetensors"
    assert run(["dataset", "inspect", str(shard), "--json"]) == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert found["path"] == str(shard)
    assert not found["indexed"]
    assert found["splits"]["all"]["rows"] == sum(entry["count"] for entry in found["n"])
    assert run(["dataset", "inspect", str(shard)]) == ExitCode.OK
    assert "no index: every shard verified by itself" in capsys.readouterr().out


def test_damage_is_named_and_fails(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = bytearray((made / "box-front.safetensors").read_bytes())
    content[len(content) // 2] ^= 1
    damaged = tmp_path / "box-front.safetensors"
    damaged.write_bytes(content)
    assert run(["dataset", "inspect", str(damaged)]) == ExitCode.CHECK_FAILED
    captured = capsys.readouterr()
    assert captured.out == ""
    assert f"error: The label shard {damaged} is damaged" in captured.err
    assert run(["dataset", "inspect", str(tmp_path / "nowhere")]) == ExitCode.NOT_FOUND


def test_names_in_errors_do_not_command_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dataset", "inspect", str(tmp_path / "\x1b]0;title\x07\x1b[31mred")]) == ExitCode.NOT_FOUND
    assert "\x1b" not in (told := capsys.readouterr().err)
    assert "title" in told
