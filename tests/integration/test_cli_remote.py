"""The commands that talk to a server, against one that fails on demand: what is sent, what is shown, how they end."""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.fake_server import KEY, PART_BYTES, FakeServer, Fault, fake_server

import services
from diaphane.cli import inputs
from diaphane.cli.app import run
from diaphane.client import Client
from diaphane.client.events import server_sent
from diaphane.client.packing import pack
from diaphane.client.transport import Transport
from schemas.problem import ExitCode, Problem

ROOT = Path(services.__file__).parent.parent


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith(("DIAPHANE_", "GITHUB_"))]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def server(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeServer]:
    monkeypatch.setenv("DIAPHANE_KEY", KEY)
    with fake_server() as fake:
        monkeypatch.setenv("DIAPHANE_URL", fake.url)
        yield fake


def client(server: FakeServer) -> Client:
    return Client(server.url, KEY)


def usdz(folder: Path, name: str = "glass.usdz", size: int = 2500) -> Path:
    path = folder / name
    path.write_bytes(bytes(i * 7 % 251 for i in range(size)))
    return path


def layered(folder: Path) -> Path:
    """A root layer with a sublayer, a texture, a missing one, in folders of their own."""
    (folder / "parts").mkdir()
    (folder / "parts" / "cup.usda").write_text('#usda 1.0\ndef Xform "Cup"\n{\n    asset a = @../maps/a.png@\n}\n')
    (folder / "maps").mkdir()
    (folder / "maps" / "a.png").write_bytes(b"not really")
    root = folder / "table.usda"
    root.write_text('#usda 1.0\n(\n    subLayers = [@parts/cup.usda@]\n)\ndef "T"\n{\n    asset b = @maps/b.png@\n}\n')
    return root


# Uploads


def test_an_upload_sends_parts_and_registers_the_scene(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = usdz(folder)
    server.checks = 3
    assert run(["scenes", "upload", "glass.usdz", "--json"]) == ExitCode.OK
    (scene,) = json.loads(capsys.readouterr().out)["scenes"]
    assert scene["state"] == "accepted"
    assert scene["name"] == "glass"
    assert list(server.blobs.values()) == [path.read_bytes()]
    assert server.count("PATCH", "/v1/uploads/.*") == 3


def test_what_the_server_has_is_not_sent_again(server: FakeServer, folder: Path) -> None:
    usdz(folder)
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    server.asked.clear()
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    assert server.count("POST", "/v1/blobs/missing") == 1
    assert server.count("(POST|PATCH)", "/v1/uploads.*") == 0
    assert len(server.scenes) == 1


@pytest.mark.parametrize("size", [0, 1, PART_BYTES, PART_BYTES + 1])
def test_files_of_any_size_arrive(server: FakeServer, folder: Path, size: int) -> None:
    path = usdz(folder, size=size)
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    assert list(server.blobs.values()) == [path.read_bytes()]


def test_a_part_whose_answer_was_lost_is_not_sent_twice(server: FakeServer, folder: Path) -> None:
    path = usdz(folder)
    server.faults.append(Fault("PATCH", "/v1/uploads/.*"))
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    assert list(server.blobs.values()) == [path.read_bytes()]
    offsets = [a.headers["upload-offset"] for a in server.asked if a.method == "PATCH"]
    assert offsets == ["0", "0", "1000", "2000"]


def test_an_upload_that_was_broken_off_goes_on_in_another_process(server: FakeServer, folder: Path) -> None:
    path = usdz(folder)
    server.faults.append(Fault("PATCH", "/v1/uploads/.*", status=403))
    with pytest.raises(Problem):
        client(server).scenes.upload(pack(path))
    (upload,) = server.uploads.values()
    upload["data"] = path.read_bytes()[:1500]
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    assert [a.headers["upload-offset"] for a in server.asked if a.method == "PATCH"][1:] == ["1500"]


def test_all_files_of_a_scene_are_sent_under_their_relative_names(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layered(folder)
    assert run(["scenes", "upload", "table.usda"]) == ExitCode.OK
    (scene,) = server.scenes.values()
    assert set(scene["files"]) == {"table.usda", "parts/cup.usda", "maps/a.png"}
    assert scene["root"] == "table.usda"
    assert "maps/b.png, which does not exist" in capsys.readouterr().err


def test_a_scene_that_refers_upwards_is_sent_from_the_folder_that_holds_all_of_it(
    server: FakeServer, folder: Path
) -> None:
    (folder / "inner").mkdir()
    (folder / "shared.usda").write_text("#usda 1.0\n")
    (folder / "inner" / "root.usda").write_text("#usda 1.0\n(\n    subLayers = [@../shared.usda@]\n)\n")
    assert run(["scenes", "upload", "inner/root.usda"]) == ExitCode.OK
    (scene,) = server.scenes.values()
    assert set(scene["files"]) == {"inner/root.usda", "shared.usda"}
    assert scene["root"] == "inner/root.usda"


def test_a_rejected_scene_ends_with_the_reason(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    usdz(folder)
    server.rejected["glass"] = {"title": "A title.", "detail": "It is\x1b[2J no scene.", "remedy": "Export it again."}
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.CHECK_FAILED
    captured = capsys.readouterr()
    assert "rejected" in captured.out
    assert "The server rejects glass.usdz: It is\\x1b[2J no scene.\nExport it again." in captured.err


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["scenes", "upload", "nowhere.usdz"], ExitCode.NOT_FOUND, "no file nowhere.usdz"),
        (["scenes", "upload", "notes.txt"], ExitCode.USAGE, "notes.txt is not a scene"),
        (["scenes", "upload", "a.usdz", "copy/a.usdz", "--name", "c"], ExitCode.USAGE, "--name names one scene"),
        (["scenes", "show", "scn_1"], ExitCode.NOT_FOUND, "no scene scn_1"),
        (["scenes", "show", "../jobs"], ExitCode.USAGE, "not a name or id"),
        (["jobs", "show", "job_1"], ExitCode.NOT_FOUND, "no job job_1"),
        (["jobs", "submit", "build", "--scene", "a.usdz"], ExitCode.USAGE, "A build needs a name."),
        (["jobs", "submit", "bake", "--scene", "a.usdz"], ExitCode.USAGE, "kind"),
        (["jobs", "submit", "render", "--scene", "a.usdz", "--size", "1x1"], ExitCode.USAGE, "1x1 is not 16..16384"),
        (["jobs", "submit", "render", "--scene", "a.usdz", "--holdout", "c"], ExitCode.NOT_FOUND, "scene c is neither"),
        (["jobs", "submit", "render", "--scene", "a.usdz", "--scene", "copy/a.usdz"], ExitCode.USAGE, "the same scene"),
        (["keys", "create", "ci", "--scope", "root"], ExitCode.USAGE, "no scope 'root'"),
        (["models", "show", "glass@9.9.9"], ExitCode.NOT_FOUND, "no version or alias"),
        (["jobs", "list", "--url", "ftp://x"], ExitCode.USAGE, "URL is not valid"),
        (["jobs", "list", "--url", "http://me:pass@host"], ExitCode.USAGE, "contains a password"),
        (["jobs", "list", "--key-file", "nowhere"], ExitCode.AUTH, "file nowhere cannot be read"),
        (["jobs", "list", "--key-file", "notes.txt"], ExitCode.AUTH, "does not hold an API key"),
    ],
)
def test_mistakes_end_with_what_to_do(
    arguments: list[str],
    status: ExitCode,
    words: str,
    server: FakeServer,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    usdz(folder, "a.usdz")
    (folder / "copy").mkdir()
    usdz(folder / "copy", "a.usdz")
    (folder / "notes.txt").write_text("some words\n")
    assert run(arguments) == status
    message = capsys.readouterr().err
    assert words in message
    assert "Traceback" not in message
    assert server.jobs == {}


# The connection


def test_a_busy_server_is_asked_again_when_it_says(server: FakeServer) -> None:
    server.faults.append(Fault("GET", "/v1/jobs", status=429, headers={"Retry-After": "0.05"}, times=2))
    server.faults.append(Fault("GET", "/v1/jobs", status=503))
    assert run(["jobs", "list"]) == ExitCode.OK
    assert server.count("GET", "/v1/jobs") == 4


def test_a_server_that_asks_for_more_patience_than_there_is_ends_with_try_again(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    server.faults.append(Fault("GET", "/v1/jobs", status=503, headers={"Retry-After": "3600"}))
    assert run(["jobs", "list"]) == ExitCode.TRY_AGAIN
    assert "Not now." in capsys.readouterr().err
    assert server.count("GET", "/v1/jobs") == 1


def test_a_server_that_is_away_ends_with_try_again() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{unused.getsockname()[1]}"
        with pytest.raises(Problem, match="cannot be reached") as caught:
            Transport(url, None, first_patience=0.3).request("GET", "/v1/jobs")
    assert caught.value.code is ExitCode.TRY_AGAIN


def test_what_must_not_happen_twice_is_not_repeated(server: FakeServer) -> None:
    server.publish("glass", 0.5)
    server.publish("glass", 0.4)
    server.move("glass", "champion", "1.0.0", "first")
    server.move("glass", "champion", "1.1.0", "second")
    server.faults.append(Fault("POST", "/v1/models/.*/rollback"))
    with pytest.raises(Problem) as caught:
        client(server).models.roll_back("glass", "champion", "worse")
    assert caught.value.code is ExitCode.TRY_AGAIN
    assert server.count("POST", "/v1/models/.*/rollback") == 1
    server.faults.append(Fault("POST", "/v1/models/.*/rollback", status=503))
    with pytest.raises(Problem):
        client(server).models.roll_back("glass", "champion", "worse")
    assert server.count("POST", "/v1/models/.*/rollback") == 2


@pytest.mark.parametrize(
    ("status", "kind", "code"),
    [
        (401, "unauthenticated", ExitCode.AUTH),
        (403, "forbidden", ExitCode.AUTH),
        (404, "not-found", ExitCode.NOT_FOUND),
        (408, "too-slow", ExitCode.TRY_AGAIN),
        (409, "conflict", ExitCode.CONFLICT),
        (413, "too-large", ExitCode.LIMIT),
        (431, "headers-too-large", ExitCode.LIMIT),
        (422, "invalid", ExitCode.USAGE),
        (422, "check-failed", ExitCode.CHECK_FAILED),
        (500, "internal", ExitCode.CHECK_FAILED),
        (507, "storage-full", ExitCode.TRY_AGAIN),
    ],
)
def test_problems_of_the_server_end_with_their_status(
    server: FakeServer, status: int, kind: str, code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    errors = [{"at": "query.limit", "message": "too many"}]
    document = {"type": f"/v1/problems/{kind}", "detail": "It is wrong.", "remedy": "Mend it.", "errors": errors}
    server.faults.append(Fault("GET", "/v1/workers", status=status, document=document))
    assert run(["workers", "--json"]) == code
    problem = json.loads(capsys.readouterr().err)
    assert problem == {
        "title": "It is wrong: query.limit: too many.",
        "remedy": "Mend it.",
        "code": int(code),
        "name": code.name.lower(),
    }


def test_a_redirect_is_not_followed(server: FakeServer) -> None:
    with fake_server() as other:
        server.faults.append(Fault("GET", "/v1/jobs", status=307, headers={"Location": f"{other.url}/v1/jobs"}))
        assert run(["jobs", "list"]) == ExitCode.USAGE
        assert other.asked == []


def test_an_upload_says_that_the_check_still_runs(
    server: FakeServer, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(inputs, "_FIRST_TOLD_SECONDS", 0.0)
    server.checks = 2
    usdz(folder)
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "check scenes: 1" in captured.err
    assert "glass is still being checked (0 s); `diaphane workers` shows the queue." in captured.err
    assert "accepted" in captured.out


def test_the_key_is_never_shown(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    usdz(folder)
    server.faults.append(Fault("POST", "/v1/scenes", status=503))
    transport = Transport(server.url, KEY)
    transport.request("GET", "/v1/jobs")
    assert run(["scenes", "upload", "glass.usdz"]) == ExitCode.OK
    assert run(["jobs", "show", "job_1"]) == ExitCode.NOT_FOUND
    captured = capsys.readouterr()
    assert all(asked.headers["authorization"] == f"Bearer {KEY}" for asked in server.asked)
    assert KEY not in captured.out + captured.err + caplog.text + repr(transport)


def test_the_key_comes_from_a_file_that_only_its_owner_reads(
    server: FakeServer, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("DIAPHANE_KEY")
    assert run(["jobs", "list"]) == ExitCode.AUTH
    (folder / "key").write_text(f"{KEY}\n")
    assert run(["jobs", "list", "--key-file", "key"]) == ExitCode.AUTH
    assert "chmod 600 key" in capsys.readouterr().err
    (folder / "key").chmod(0o600)
    assert run(["jobs", "list", "--key-file", "key"]) == ExitCode.OK


def test_no_command_takes_the_key_as_an_argument(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["jobs", "list", "--key", KEY]) == ExitCode.USAGE
    assert KEY not in capsys.readouterr().err


# Jobs


def submit(server: FakeServer, *options: str) -> int:
    return run(["jobs", "submit", "render", "--scene", "glass.usdz", *options])


def test_all_options_of_a_job_arrive(server: FakeServer, folder: Path) -> None:
    usdz(folder, "a.usdz")
    usdz(folder, "b.usdz", 10)
    camera = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 45}
    (folder / "views.json").write_text(json.dumps({"scenes": [{"main": "a.usdz", "views": [camera]}]}))
    options = ["--name", "glass", "--scene", "a.usdz", "--holdout", "b.usdz", "--budgets", "4,1", "--alpha", "0.33"]
    options += [
        "--glass",
        "plain",
        "--views-per-scene",
        "2",
        "--size",
        "64x48",
        "--tail",
        "binned-16",
        "--g",
        "0.5",
        "--seed",
        "7",
    ]
    options += [
        "--network",
        "tiny",
        "--steps",
        "9",
        "--from",
        "champion",
        "--no-replay",
        "--patience",
        "4",
        "--weights",
        "flip",
        "--promote",
        "never",
        "--priority",
        "high",
    ]
    assert run(["jobs", "submit", "build", *options, "--views", "views.json"]) == ExitCode.OK
    (job,) = server.jobs.values()
    spec = job["spec"]
    uses = spec.pop("scenes")
    names = {scene_id: scene["name"] for scene_id, scene in server.scenes.items()}
    assert [(names[use["scene"]], use["holdout"], len(use["views"])) for use in uses] == [
        ("a", False, 1),
        ("b", True, 0),
    ]
    assert spec == {
        "kind": "build",
        "name": "glass",
        "dataset": None,
        "model": None,
        "budgets": [1.0, 4.0],
        "alpha": 0.33,
        "glass": "plain",
        "views_per_scene": 2,
        "width": 64,
        "height": 48,
        "tail": "binned-16",
        "g": 0.5,
        "network": "tiny",
        "seed": 7,
        "steps": 9,
        "start_from": "champion",
        "replay": False,
        "patience": 4,
        "weights": "flip",
        "promote": "never",
        "priority": "high",
    }


def test_a_quarter_of_the_scenes_is_held_out_by_itself(server: FakeServer, folder: Path) -> None:
    names = [usdz(folder, f"s{i}.usdz", i + 1).name for i in range(4)]
    scenes = [word for name in names for word in ("--scene", name)]
    assert run(["jobs", "submit", "build", "--name", "glass", *scenes]) == ExitCode.OK
    (job,) = server.jobs.values()
    assert [use["holdout"] for use in job["spec"]["scenes"]].count(True) == 1


@pytest.mark.parametrize(
    ("outcome", "status"),
    [
        (
            {"state": "succeeded", "result": {"reference": "glass@1.0.0", "advice": {"a": ["Use b.", "Or c."]}}},
            ExitCode.OK,
        ),
        (
            {"state": "failed", "problem": {"detail": "No view is left.", "remedy": "Add scenes."}},
            ExitCode.CHECK_FAILED,
        ),
        ({"state": "cancelled"}, ExitCode.INTERRUPTED),
    ],
)
def test_watching_ends_as_the_job_does(
    outcome: dict[str, object], status: ExitCode, server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    usdz(folder)
    server.outcome = lambda _: outcome
    assert submit(server, "--watch") == status
    captured = capsys.readouterr()
    assert "render: 4/4 (1 skipped)" in captured.err
    assert "Rendering. \\u2028Still." in captured.err
    assert captured.err.count("Rendering.") == 1
    assert str(outcome["state"]) in captured.out
    assert ("a: Use b. Or c.\n" in captured.out) == (status is ExitCode.OK)
    if status is ExitCode.CHECK_FAILED:
        assert "failed: No view is left.\nAdd scenes. Once that is done: diaphane jobs retry job_" in captured.err
    (job_id,) = server.jobs
    assert run(["jobs", "watch", job_id, "--json"]) == status
    assert json.loads(capsys.readouterr().out)["state"] == outcome["state"]


def test_a_broken_stream_goes_on_after_the_last_event(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    usdz(folder)
    submit(server)
    (job_id,) = server.jobs
    server.cut_after = [2, 0, 1]
    server.faults.append(Fault("GET", "/v1/jobs/.*/events", status=503, headers={"Retry-After": "0"}))
    numbers = [event["number"] for event in client(server).jobs.events(job_id)]
    assert numbers == list(range(1, 8))
    capsys.readouterr()
    assert run(["jobs", "events", job_id, "--after", "5", "--json"]) == ExitCode.OK
    assert [json.loads(line)["number"] for line in capsys.readouterr().out.splitlines()] == [6, 7]


def test_events_are_read_whatever_the_pieces_they_come_in() -> None:
    text = ': hello\r\n\r\nid: 1\r\nevent: log\r\ndata: {"kind": "log", "data": {"text": "a\u2028b"}}\r\n\r\n'
    text += 'event: stage\nid: 2\ndata: {"stage":\ndata: "render"}\n\ndata: no id\n\nid: 3\n\n'
    wanted = [
        {"number": 1, "kind": "log", "data": {"text": "a\u2028b"}},
        {"number": 2, "kind": "stage", "data": {"stage": "render"}},
    ]
    raw = text.encode()
    for size in (1, 2, 7, len(raw)):
        assert list(server_sent(iter([raw[i : i + size] for i in range(0, len(raw), size)]))) == wanted


def test_lists_are_read_to_the_end_and_links_to_elsewhere_are_not_followed(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for i in range(5):
        usdz(folder, "glass.usdz", i + 1)
        submit(server)
    capsys.readouterr()
    assert run(["jobs", "list", "--json"]) == ExitCode.OK
    assert len(json.loads(capsys.readouterr().out)["jobs"]) == 5
    assert run(["scenes", "list", "--limit", "3", "--json"]) == ExitCode.OK
    assert len(json.loads(capsys.readouterr().out)["scenes"]) == 3
    assert run(["jobs", "list", "--kind", "train", "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["jobs"] == []


def test_jobs_are_cancelled_and_retried(server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    usdz(folder)
    submit(server)
    (job_id,) = server.jobs
    capsys.readouterr()
    assert run(["jobs", "cancel", job_id]) == ExitCode.OK
    assert capsys.readouterr().out == f"{job_id}  cancelled\n"
    assert run(["jobs", "retry", job_id]) == ExitCode.OK
    assert server.jobs[job_id]["attempt"] == 2
    assert run(["jobs", "retry", job_id]) == ExitCode.CONFLICT


def test_tasks_show_why_one_was_left_out(server: FakeServer, capsys: pytest.CaptureFixture[str]) -> None:
    task = {"stage": "render", "name": "glass front", "artifact": "render/1", "seconds": 2.0, "note": None}
    server.tasks = [
        {**task, "state": "done", "problem": None},
        {**task, "name": "glass back", "state": "quarantined", "problem": {"detail": "The driver crashed."}},
    ]
    assert run(["jobs", "tasks", "job_1", "--state", "quarantined"]) == ExitCode.OK
    heading, line = capsys.readouterr().out.splitlines()
    assert heading.split() == ["stage", "task", "state", "took", "note"]
    assert line.endswith("2 s   The driver crashed.")


def test_an_interrupt_while_watching_leaves_the_job_alone(server: FakeServer, folder: Path) -> None:
    usdz(folder)
    submit(server)
    (job_id,) = server.jobs
    waiting, release = threading.Event(), threading.Event()

    def hold(_: object) -> dict[str, object]:
        waiting.set()
        release.wait(20)
        return {"state": "succeeded"}

    server.outcome = hold
    command = [sys.executable, "-c", f"from diaphane.cli import main; main(['jobs', 'watch', '{job_id}'])"]
    child = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert waiting.wait(20)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=20)
    release.set()
    assert child.returncode == ExitCode.INTERRUPTED
    assert f"the job {job_id} continues" in err
    assert server.count("POST", "/v1/jobs/.*/cancel") == 0


# Models


def test_the_models_of_a_server_are_listed_shown_promoted_and_rolled_back(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    for score in (0.5, 0.4, 0.3):
        server.publish("glass", score)
    server.move("glass", "champion", "1.0.0", "first")
    assert run(["models", "list"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass  latest 1.2.0  champion 1.0.0\n"
    assert run(["models", "promote", "glass", "1.2.0", "--reason", "smaller"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass@1.2.0 is the champion.\n"
    assert run(["models", "rollback", "glass", "--reason", "flickers"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass@1.0.0 is the champion.\n"
    assert run(["models", "show", "glass"]) == ExitCode.OK
    shown = capsys.readouterr().out
    assert shown.index("glass@1.0.0  score 0.5") < shown.index("glass@1.2.0  score 0.3")
    assert "champion: 1.2.0 -> 1.0.0  by key: flickers" in shown
    assert shown.count("NOT CLEARED: 1 of 1 training scenes forbid it by their licence (vase).") == 3
    assert run(["models", "show", "glass@champion", "--json"]) == ExitCode.OK
    assert [v["version"] for v in json.loads(capsys.readouterr().out)["versions"]] == ["1.0.0"]


# Keys without a server


def test_the_first_key_is_made_without_a_server(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    create = ["keys", "create", "ci", "--scope", "submit", "--scope", "read", "--days", "30", "--local"]
    assert run(create) == ExitCode.OK
    secret = capsys.readouterr().out.strip()
    assert secret.startswith("dia_")
    assert run(["keys", "list", "--local", "--json"]) == ExitCode.OK
    text = capsys.readouterr().out
    (key,) = json.loads(text)["keys"]
    assert key["scopes"] == ["read", "submit"]
    assert key["expires"] > key["created"]
    assert secret not in text
    assert all(secret.encode() not in path.read_bytes() for path in folder.rglob("*") if path.is_file())
    assert run(["keys", "revoke", key["id"], "--local"]) == ExitCode.OK
    assert run(["keys", "list", "--local"]) == ExitCode.OK
    assert "revoked" in capsys.readouterr().out


def test_of_a_traceback_in_the_log_only_the_error_is_shown(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    usdz(folder)
    submit(server)
    (job_id,) = server.jobs
    text = 'Traceback (most recent call last):\n  File "a.py", line 1, in make\n    boil()\nValueError: bad luck'
    server.events[job_id][1]["data"] = {"stage": "render", "name": "glass front", "text": text}
    assert run(["jobs", "watch", job_id]) == ExitCode.OK
    shown = capsys.readouterr().err.splitlines()
    assert "render of glass front: ValueError: bad luck" in shown
    assert not [line for line in shown if "boil" in line or "Traceback" in line]


# The same client in a program


def test_a_program_uploads_submits_and_waits(server: FakeServer, folder: Path) -> None:
    usdz(folder)
    server.checks = 2
    with client(server) as asked:
        scene = asked.scenes.add("glass.usdz", "cup")
        assert (scene["state"], scene["name"]) == ("accepted", "cup")
        job, is_new = asked.jobs.submit({"kind": "render", "scenes": [{"scene": scene["id"]}]})
        assert is_new
        assert asked.jobs.wait(job["id"])["state"] == "succeeded"
        assert [one["id"] for one in asked.jobs.list()] == [job["id"]]
        assert job["id"] in asked.jobs.list()._repr_html_()
        assert asked.scenes.list() == [scene]
        assert KEY not in repr(asked) + asked._repr_html_()
