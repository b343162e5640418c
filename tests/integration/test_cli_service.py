"""The commands against a real service, with API, engine and registry; only the pipeline behind is a stand-in."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.live_service import FAILING_SEED, MENDED, Live, live_service
from support.receiver import receiver

import services
from diaphane.cli import webhooks
from diaphane.cli.app import run
from schemas.problem import ExitCode
from schemas.webhook import WEBHOOK_EVENTS

ROOT = Path(services.__file__).parent.parent
SCENES = ("cups", "leaves", "bottles", "vase")


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with live_service(tmp_path_factory.mktemp("service")) as service:
        yield service


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, live: Live, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith(("DIAPHANE_", "GITHUB_", "RETRAIN_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("DIAPHANE_URL", live.url)
    monkeypatch.setenv("DIAPHANE_KEY", live.key)
    monkeypatch.chdir(tmp_path)
    for name in SCENES:
        (tmp_path / f"{name}.usdz").write_text(f"the scene {name} " * 100)
    return tmp_path


def answer(arguments: list[str], capsys: pytest.CaptureFixture[str], status: int = ExitCode.OK) -> Any:
    """Runs a command; its JSON answer."""
    capsys.readouterr()
    ended = run([*arguments, "--json"])
    captured = capsys.readouterr()
    assert ended == status, captured.err
    return json.loads(captured.out)


def retrain(name: str, seed: int, *options: str) -> list[str]:
    command = ["retrain", "cups.usdz", "leaves.usdz", "--holdout", "bottles.usdz", "--holdout", "vase.usdz"]
    return [*command, "--name", name, "--seed", str(seed), *options]


def test_a_scene_goes_up_and_a_job_of_it_is_watched(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (scene,) = answer(["scenes", "upload", "cups.usdz", "--name", "some cups"], capsys)["scenes"]
    assert (scene["state"], scene["facts"]["triangles"]) == ("accepted", len((folder / "cups.usdz").read_text()))
    assert scene["id"] in {s["id"] for s in answer(["scenes", "list"], capsys)["scenes"]}
    assert answer(["scenes", "show", scene["id"]], capsys)["root"] == "cups.usdz"
    submit = ["jobs", "submit", "render", "--scene", scene["id"], "--size", "64x48"]
    assert run([*submit, "--watch"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "render: 1/1" in captured.err
    job_id = captured.out.split()[0]
    shown = answer(["jobs", "show", job_id], capsys)
    assert (shown["state"], shown["fraction"]) == ("succeeded", 1.0)
    (task,) = answer(["jobs", "tasks", job_id, "--state", "done"], capsys)["tasks"]
    assert task["name"] == "some cups"
    assert run(["jobs", "events", job_id, "--json"]) == ExitCode.OK
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [event["number"] for event in events] == list(range(1, len(events) + 1))
    assert run(["jobs", "watch", job_id]) == ExitCode.OK
    assert run(["jobs", "retry", job_id]) == ExitCode.CONFLICT
    assert run(["jobs", "cancel", job_id]) in (ExitCode.OK, ExitCode.CONFLICT)
    assert job_id in {job["id"] for job in answer(["jobs", "list", "--kind", "render"], capsys)["jobs"]}


def test_a_rejected_scene_says_why(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "broken.usdz").write_text("bad")
    assert run(["jobs", "submit", "render", "--scene", "broken.usdz"]) == ExitCode.CHECK_FAILED
    assert "The server rejects broken.usdz: The scene is bad.\nSend a good one." in capsys.readouterr().err


def test_workers_data_sets_and_measurements_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    roles = {queue["role"] for queue in answer(["workers"], capsys)["queues"]}
    assert roles == {"jobs", "render", "label", "train", "check"}
    assert answer(["datasets", "list"], capsys) == {"datasets": []}
    assert (
        answer(["measurements", "--technique", "kbuffer", "--since", "2026-01-01T00:00"], capsys)["measurements"] == []
    )
    for command in (["workers"], ["datasets", "list"], ["measurements"]):
        assert run(command) == ExitCode.OK
    assert run(["measurements", "--since", "yesterday"]) == ExitCode.USAGE
    assert run(["datasets", "show", "dst_" + "0" * 32]) == ExitCode.NOT_FOUND


def test_webhooks_are_made_tested_and_removed(capsys: pytest.CaptureFixture[str]) -> None:
    assert webhooks.EVENTS == WEBHOOK_EVENTS
    with receiver() as there:
        made = answer(["webhooks", "create", there.url, "--event", "model.champion"], capsys)
        hook, secret = made["webhook"]["id"], made["secret"]
        assert (made["webhook"]["url"], made["webhook"]["events"]) == (there.url, ["model.champion"])
        assert answer(["webhooks", "list"], capsys) == {"webhooks": [made["webhook"]]}
        there.answers += [200, 500]
        sent = answer(["webhooks", "test", hook], capsys)
        assert (sent["state"], sent["status"]) == ("delivered", 200)
        assert there.messages[0].verified(secret)["type"] == "webhook.test"
        assert run(["webhooks", "test", hook]) == ExitCode.CHECK_FAILED
        assert "The receiver answered 500." in capsys.readouterr().err
        found = answer(["webhooks", "deliveries", hook], capsys)["deliveries"]
        assert [(one["state"], one["status"]) for one in found] == [("waiting", 500), ("delivered", 200)]
        for command in (["webhooks", "list"], ["webhooks", "deliveries", hook], ["webhooks", "delete", hook]):
            assert run(command) == ExitCode.OK
            assert secret not in capsys.readouterr().out
    assert run(["webhooks", "create", there.url]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("whsec_")
    (left,) = answer(["webhooks", "list"], capsys)["webhooks"]
    assert run(["webhooks", "delete", left["id"]]) == ExitCode.OK
    assert run(["webhooks", "delete", left["id"]]) == ExitCode.NOT_FOUND
    assert run(["webhooks", "test", "../keys"]) == ExitCode.USAGE
    assert run(["webhooks", "create", "http://10.0.0.1/"]) == ExitCode.USAGE
    assert run(["webhooks", "create", "https://ci.example.org", "--event", "x"]) == ExitCode.USAGE


def test_keys_come_and_go(live: Live, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    made = answer(["keys", "create", "a reader", "--scope", "read", "--days", "1"], capsys)
    assert made["key"]["expires"] > made["key"]["created"]
    monkeypatch.setenv("DIAPHANE_KEY", made["secret"])
    assert run(["jobs", "list"]) == ExitCode.OK
    assert run(["scenes", "upload", "cups.usdz"]) == ExitCode.AUTH
    assert run(["keys", "list"]) == ExitCode.AUTH
    monkeypatch.setenv("DIAPHANE_KEY", live.key)
    assert made["key"]["id"] in {key["id"] for key in answer(["keys", "list"], capsys)["keys"]}
    assert run(["keys", "revoke", made["key"]["id"]]) == ExitCode.OK
    monkeypatch.setenv("DIAPHANE_KEY", made["secret"])
    assert run(["jobs", "list"]) == ExitCode.AUTH
    captured = capsys.readouterr()
    assert made["secret"] not in captured.out + captured.err
    assert made["secret"] not in (live.folder / "log").read_text()


def test_better_is_promoted_worse_fails_and_a_rollback_returns(capsys: pytest.CaptureFixture[str]) -> None:
    first = answer(retrain("glass", 0, "--promote"), capsys)
    assert (first["reference"], first["champion"], first["passed"]) == ("glass@1.0.0", None, True)
    better = answer(retrain("glass", 1, "--promote"), capsys)
    assert (better["reference"], better["champion"]) == ("glass@1.1.0", "1.0.0")
    assert [row["scene"] for row in better["scenes"]] == ["bottles", "vase"]
    assert better["change"] == pytest.approx(-0.2)
    worse = answer(retrain("glass", 2, "--promote"), capsys, ExitCode.CHECK_FAILED)
    assert (worse["champion"], worse["passed"]) == ("1.1.0", False)
    assert answer(["models", "list"], capsys)["bundles"] == [
        {"name": "glass", "latest": "1.2.0", "champion": "1.1.0"},
    ]
    shown = answer(["models", "show", "glass"], capsys)
    assert [version["version"] for version in shown["versions"]] == ["1.0.0", "1.1.0", "1.2.0"]
    assert shown["aliases"] == {"champion": "1.1.0", "candidate": "1.2.0"}
    assert run(["models", "rollback", "glass", "--reason", "flickers"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass@1.0.0 is the champion.\n"
    assert run(["models", "promote", "glass", "1.2.0", "--reason", "smaller"]) == ExitCode.OK
    assert answer(["models", "show", "glass@champion"], capsys)["versions"][0]["version"] == "1.2.0"


def test_repeated_runs_are_one_job(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(retrain("water", 0, "--promote", "--summary", "first.md")) == ExitCode.OK
    job = answer(retrain("water", 0, "--promote"), capsys)["job"]
    assert answer(retrain("water", 0, "--promote"), capsys)["job"] == job
    assert run(retrain("water", 1, "--summary", "better.md")) == ExitCode.OK
    assert run(retrain("water", 1, "--summary", "again.md")) == ExitCode.OK
    assert (folder / "better.md").read_text() == (folder / "again.md").read_text()
    assert len(answer(["jobs", "list", "--name", "water"], capsys)["jobs"]) == 2


def test_a_failed_build_goes_on_when_it_is_repeated(live: Live, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(retrain("ice", FAILING_SEED)) == ExitCode.CHECK_FAILED
    assert "failed: No training view is left.\nAdd scenes." in capsys.readouterr().err
    (live.folder / MENDED).touch()
    assert run(retrain("ice", FAILING_SEED)) == ExitCode.OK
    (job,) = answer(["jobs", "list", "--name", "ice"], capsys)["jobs"]
    assert job["attempt"] == 2


def test_the_script_of_the_repositories_tells_better_from_worse(folder: Path, live: Live) -> None:
    programs = folder / "bin"
    programs.mkdir()
    code = "from diaphane.cli import main; main()"
    (programs / "diaphane").write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -c "{code}" "$@"\n')
    (programs / "diaphane").chmod(0o755)
    environment = {"PATH": f"{programs}:/usr/bin:/bin", "DIAPHANE_URL": live.url, "DIAPHANE_KEY": live.key}
    environment |= {"RETRAIN_NAME": "smoke", "RETRAIN_SCENES": "*.usdz", "RETRAIN_HOLDOUT": "bottles.usdz\nvase.usdz"}

    def call(seed: int, **variables: str) -> subprocess.CompletedProcess[str]:
        variables = {**environment, "RETRAIN_SEED": str(seed), **variables}
        script = str(ROOT / "deploy" / "retrain" / "retrain.sh")
        return subprocess.run([script], env=variables, cwd=folder, capture_output=True, text=True, timeout=60)

    assert call(0, RETRAIN_PROMOTE="true").returncode == ExitCode.OK
    better = call(1, RETRAIN_SUMMARY="table.md")
    assert better.returncode == ExitCode.OK, better.stderr
    assert "| `bottles` | 0.500 | 0.400 | −20.0 % |" in (folder / "table.md").read_text()
    worse = call(2, RETRAIN_SUMMARY="table.md")
    assert worse.returncode == ExitCode.CHECK_FAILED
    assert "| all held-out scenes | 0.500 | 0.600 | +20.0 % |" in (folder / "table.md").read_text()
    assert call(2, RETRAIN_MAX_REGRESSION="0.25").returncode == ExitCode.OK
