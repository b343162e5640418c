"""`diaphane retrain` and what other repositories call it by: better, worse, repeated, incomparable."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.fake_server import KEY, FakeServer, fake_server

import services
from diaphane.cli.app import run
from diaphane.cli.comparison import comparison_of
from diaphane.cli.tables import retrain_flags
from schemas.problem import ExitCode

ROOT = Path(services.__file__).parent.parent
RETRAIN = ROOT / "deploy" / "retrain"
COMMAND = [
    "retrain",
    "cups.usdz",
    "leaves.usdz",
    "--name",
    "glass",
    "--holdout",
    "bottles.usdz",
    "--holdout",
    "vase.usdz",
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith(("DIAPHANE_", "GITHUB_", "RETRAIN_"))]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
    for number, name in enumerate(("cups", "leaves", "bottles", "vase")):
        (tmp_path / f"{name}.usdz").write_bytes(bytes([number]) * 1500)
    return tmp_path


@pytest.fixture
def server(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeServer]:
    """A server whose champion of the name `glass` has version 1.0.0."""
    monkeypatch.setenv("DIAPHANE_KEY", KEY)
    with fake_server() as fake:
        monkeypatch.setenv("DIAPHANE_URL", fake.url)
        fake.publish("glass", 0.5)
        fake.move("glass", "champion", "1.0.0", "first")
        yield fake


def builds(
    server: FakeServer, score: float | None, rival: float | None, **per_scene: tuple[float, float | None]
) -> None:
    """Every job publishes a version of this score; its scenes have these scores of their own."""

    def outcome(spec: dict[str, Any]) -> dict[str, Any]:
        (job_id,) = [job_id for job_id, job in server.jobs.items() if job["spec"] is spec]
        version = server.publish(spec["name"], score, job_id)
        scenes = {name: {"score": ours, "rival": theirs} for name, (ours, theirs) in per_scene.items()}
        result = {"reference": f"{spec['name']}@{version}", "score": score, "rival_score": rival, "champion": False}
        result |= {"per_scene": scenes, "report": "a" * 64, "reason": "As the registry says."}
        return {"state": "succeeded", "result": result, "skipped": {"views already captured": 6}}

    server.outcome = outcome


def better(server: FakeServer) -> None:
    builds(server, 0.4, 0.5, bottles=(0.38, 0.5), vase=(0.42, 0.5))


def worse(server: FakeServer) -> None:
    builds(server, 0.6, 0.5, bottles=(0.9, 0.5), vase=(0.4, 0.5))


def test_a_better_version_passes_and_stays_a_candidate(
    server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    better(server)
    assert run([*COMMAND, "--summary", "table.md"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert captured.out == (folder / "table.md").read_text()
    assert "✅ Diaphane: `glass@1.1.0` against the champion `1.0.0`" in captured.out
    assert "| `bottles` | 0.500 | 0.380 | −24.0 % |" in captured.out
    assert "| all held-out scenes | 0.500 | 0.400 | −20.0 % |" in captured.out
    assert "`6 views already captured`" in captured.out
    assert "render: 4/4" in captured.err
    assert server.alias("glass", "champion") == "1.0.0"
    (job,) = server.jobs.values()
    spec = job["spec"]
    assert (spec["kind"], spec["promote"], spec["start_from"]) == ("build", "never", "champion")
    names = {scene_id: scene["name"] for scene_id, scene in server.scenes.items()}
    held_out = {names[use["scene"]]: use["holdout"] for use in spec["scenes"]}
    assert held_out == {"cups": False, "leaves": False, "bottles": True, "vase": True}


def test_a_worse_version_fails_the_build(server: FakeServer, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    worse(server)
    assert run([*COMMAND, "--summary", "table.md", "--promote"]) == ExitCode.CHECK_FAILED
    captured = capsys.readouterr()
    assert "❌ Diaphane" in (folder / "table.md").read_text()
    assert "| `bottles` | 0.500 | 0.900 | +80.0 % |" in captured.out
    assert "- The error on `bottles` is +80.0 % against the champion's." in captured.out
    assert "glass@1.1.0 does not pass: The error on all held-out scenes is +20.0 %" in captured.err
    assert "`vase` is" not in captured.out
    assert server.alias("glass", "champion") == "1.0.0"


@pytest.mark.parametrize(("threshold", "status"), [("0.79", ExitCode.CHECK_FAILED), ("0.81", ExitCode.OK)])
def test_the_threshold_decides(threshold: str, status: ExitCode, server: FakeServer) -> None:
    worse(server)
    assert run([*COMMAND, "--max-regression", threshold]) == status


def test_one_scene_that_is_much_worse_is_not_hidden_by_the_mean(server: FakeServer) -> None:
    builds(server, 0.4, 0.5, bottles=(0.6, 0.5), vase=(0.26, 0.5))
    assert run(COMMAND) == ExitCode.CHECK_FAILED


def test_a_repeated_run_finds_the_same_job_and_sends_nothing(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    better(server)
    assert run(COMMAND) == ExitCode.OK
    first = capsys.readouterr().out
    server.asked.clear()
    assert run(COMMAND) == ExitCode.OK
    assert capsys.readouterr().out == first
    assert len(server.jobs) == 1
    assert server.count("(POST|PATCH)", "/v1/uploads.*") == 0


def test_changed_content_is_another_job_and_only_the_change_is_sent(server: FakeServer, folder: Path) -> None:
    better(server)
    assert run(COMMAND) == ExitCode.OK
    (folder / "cups.usdz").write_bytes(b"changed")
    server.asked.clear()
    assert run(COMMAND) == ExitCode.OK
    assert len(server.jobs) == 2
    assert server.count("POST", "/v1/uploads") == 1


def test_a_failed_job_goes_on_when_the_run_is_repeated(server: FakeServer) -> None:
    server.outcome = lambda _: {"state": "failed", "problem": {"detail": "The disk is full."}}
    assert run(COMMAND) == ExitCode.CHECK_FAILED
    better(server)
    assert run(COMMAND) == ExitCode.OK
    (job,) = server.jobs.values()
    assert job["attempt"] == 2


def test_the_network_to_begin_with_is_looked_up_before_anything_is_sent(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*COMMAND, "--from", "glass@best"]) == ExitCode.NOT_FOUND
    assert not [asked for asked in server.asked if asked.method != "GET"]
    better(server)
    assert run([*COMMAND, "--from", "glass@champion", "--no-replay", "--patience", "2"]) == ExitCode.OK
    (job,) = server.jobs.values()
    spec = job["spec"]
    assert (spec["start_from"], spec["replay"], spec["patience"]) == ("glass@1.0.0", False, 2)


def test_a_promoted_version_s_own_job_is_found_by_what_it_began_with(server: FakeServer) -> None:
    better(server)
    assert run([*COMMAND, "--promote"]) == ExitCode.OK
    (job,) = server.jobs.values()
    job["spec"]["start_from"] = "glass@1.0.0"  # as a server answers that has decided what the alias means
    assert run([*COMMAND, "--promote"]) == ExitCode.OK
    assert len(server.jobs) == 1
    assert run([*COMMAND, "--from", "glass@1.1.0"]) == ExitCode.OK
    assert len(server.jobs) == 2, "the same scenes on another beginning are another job"


def test_a_better_version_is_promoted_if_asked_and_a_repeated_run_finds_it(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    better(server)
    assert run([*COMMAND, "--promote"]) == ExitCode.OK
    first = capsys.readouterr().out
    assert server.alias("glass", "champion") == "1.1.0"
    assert server.moves[-1]["why"] == "diaphane retrain: error -20.0 % on the committed scenes"
    assert run([*COMMAND, "--promote"]) == ExitCode.OK
    assert capsys.readouterr().out == first
    assert len(server.jobs) == 1


def test_another_champion_makes_it_another_job(server: FakeServer) -> None:
    better(server)
    assert run(COMMAND) == ExitCode.OK
    server.publish("glass", 0.3)
    server.move("glass", "champion", "1.2.0", "by hand")
    assert run(COMMAND) == ExitCode.OK
    assert len(server.jobs) == 2


def test_the_first_version_of_a_name_has_nothing_to_be_worse_than(
    server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    builds(server, 0.7, None, bottles=(0.7, None), vase=(0.7, None))
    command = ["water" if word == "glass" else word for word in COMMAND]
    assert run([*command, "--json"]) == ExitCode.OK
    answer = json.loads(capsys.readouterr().out)
    assert (answer["passed"], answer["champion"], answer["reference"]) == (True, None, "water@1.0.0")
    (job,) = server.jobs.values()
    assert job["spec"]["start_from"] == "scratch"
    assert server.alias("water", "champion") is None
    assert run([*command, "--promote"]) == ExitCode.OK
    assert server.alias("water", "champion") == "1.0.0"


@pytest.mark.parametrize(
    ("score", "rival", "per_scene", "words"),
    [
        (0.4, None, {"bottles": (0.4, None), "vase": (0.4, None)}, "could not be compared with the champion 1.0.0"),
        (None, None, {}, "could be compared: use smaller budgets"),
        (0.4, 0.5, {"bottles": (0.4, 0.5)}, "Only 1 of 2 held-out scenes"),
        (0.4, 0.5, {"bottles": (0.4, 0.5), "vase": (float("nan"), 0.5)}, "`vase` could not be measured"),
    ],
)
def test_what_was_not_compared_does_not_pass(
    score: float | None,
    rival: float | None,
    per_scene: dict[str, Any],
    words: str,
    server: FakeServer,
    capsys: pytest.CaptureFixture[str],
) -> None:
    builds(server, score, rival, **per_scene)
    assert run([*COMMAND, "--promote"]) == ExitCode.CHECK_FAILED
    assert words in capsys.readouterr().out
    assert server.alias("glass", "champion") == "1.0.0"


def test_without_a_baseline_nothing_is_compared(server: FakeServer) -> None:
    worse(server)
    assert run([*COMMAND, "--baseline", "none"]) == ExitCode.OK


def test_the_same_files_as_the_champion_pass() -> None:
    result = {"reference": "glass@1.0.0", "champion": True, "score": 0.5, "rival_score": None}
    job = {"result": {**result, "per_scene": {"vase": {"score": 0.5, "rival": None}}}}
    comparison = comparison_of(job, "1.0.0", 1)
    assert comparison.faults(0.05) == []
    assert not comparison.is_better
    assert "these files are the champion's" in comparison.markdown(0.05)


def test_a_name_of_a_scene_cannot_write_into_the_pull_request() -> None:
    label = "a|b`<img src=x> @everyone [x](http://x)\n| c |"
    job = {"result": {"reference": "glass@1.0.0", "score": 0.5, "per_scene": {label: {"score": 0.5, "rival": None}}}}
    table = comparison_of(job, None, 1).markdown(0.05)
    (line,) = [line for line in table.splitlines() if "@everyone" in line]
    assert line.startswith(r"| `a\|b'<img src=x> @everyone [x](http://x) \| c \|` |")
    assert len(re.findall(r"(?<!\\)\|", line)) == 5


def test_quarantined_views_are_named_in_the_table(server: FakeServer, capsys: pytest.CaptureFixture[str]) -> None:
    better(server)
    problem = {"detail": "The driver crashed."}
    server.tasks = [{"stage": "render", "name": "cups front", "state": "quarantined", "problem": problem}]
    assert run(COMMAND) == ExitCode.OK
    assert "- Left out: `render of cups front: The driver crashed.`" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--max-regression", "-1"], "--max-regression -1.0 is not a fraction"),
        (["--max-regression", "nan"], "is not a fraction"),
        (["--baseline", "glass@1.0.0"], "--baseline 'glass@1.0.0' is not known"),
        (["--patience", "-1"], "patience"),
        (["--weights", "mine"], "There are no weights 'mine'."),
        (["--budgets", "0"], "A budget of 0 cannot be used"),
        (["--size", "big"], "is not a size"),
        (["--holdout", "cups.usdz", "--holdout", "leaves.usdz"], "Every scene is held out"),
    ],
)
def test_mistakes_are_found_before_anything_is_sent(
    options: list[str], words: str, server: FakeServer, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*COMMAND, *options]) == ExitCode.USAGE
    assert words in capsys.readouterr().err
    assert not [asked for asked in server.asked if asked.method != "GET"]


# What other repositories call


def script(folder: Path, server: FakeServer, **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs retrain.sh with `diaphane` on the path, and nothing of this process's environment."""
    programs = folder / "bin"
    programs.mkdir(exist_ok=True)
    (programs / "diaphane").write_text(
        f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -c "from diaphane.cli import main; main()" "$@"\n'
    )
    (programs / "diaphane").chmod(0o755)
    environment = {"PATH": f"{programs}:/usr/bin:/bin", "DIAPHANE_URL": server.url, "DIAPHANE_KEY": KEY}
    environment |= {"RETRAIN_NAME": "glass", "RETRAIN_HOLDOUT": "bottles.usdz\nvase.usdz\n", "RETRAIN_SCENES": "*.usdz"}
    command = [str(RETRAIN / "retrain.sh")]
    return subprocess.run(
        command, cwd=folder, env={**environment, **variables}, capture_output=True, text=True, timeout=60
    )


def test_the_script_passes_and_writes_where_a_workflow_looks(server: FakeServer, folder: Path) -> None:
    better(server)
    options = {"RETRAIN_BUDGETS": "1,2", "RETRAIN_SIZE": "64x48", "RETRAIN_STEPS": "9", "RETRAIN_PROMOTE": "true"}
    options |= {"RETRAIN_START_FROM": "scratch", "RETRAIN_REPLAY": "false", "RETRAIN_PATIENCE": "2"}
    options |= {"RETRAIN_WEIGHTS": "flip"}
    pages = {"GITHUB_STEP_SUMMARY": "page.md", "GITHUB_OUTPUT": "outputs", "RETRAIN_SUMMARY": "table.md"}
    done = script(folder, server, **options, **pages)
    assert done.returncode == ExitCode.OK, done.stderr
    assert (folder / "page.md").read_text() == (folder / "table.md").read_text() == done.stdout
    job_id = next(iter(server.jobs))
    assert (folder / "outputs").read_text() == f"reference=glass@1.1.0\njob={job_id}\npassed=true\n"
    assert server.alias("glass", "champion") == "1.1.0"
    spec = server.jobs[job_id]["spec"]
    assert (spec["budgets"], spec["width"], spec["height"], spec["steps"]) == ([1.0, 2.0], 64, 48, 9)
    assert (spec["start_from"], spec["replay"], spec["patience"]) == ("scratch", False, 2)
    assert spec["weights"] == "flip"
    assert [use["holdout"] for use in spec["scenes"]] == [True, False, False, True]
    assert KEY not in done.stdout + done.stderr


def test_the_script_fails_where_the_version_is_worse(server: FakeServer, folder: Path) -> None:
    worse(server)
    done = script(folder, server, GITHUB_OUTPUT="outputs")
    assert done.returncode == ExitCode.CHECK_FAILED
    assert "❌" in done.stdout
    assert "passed=false" in (folder / "outputs").read_text()
    assert script(folder, server, RETRAIN_MAX_REGRESSION="0.9").returncode == ExitCode.OK


def test_nothing_that_the_script_is_given_becomes_shell_code(server: FakeServer, folder: Path) -> None:
    better(server)
    hostile = '$(touch pwned) `touch pwned`; touch pwned & "x" -- --promote.usdz'
    shutil.copyfile(folder / "cups.usdz", folder / hostile)
    done = script(folder, server, RETRAIN_SCENES=f"{hostile}\nleaves.usdz", RETRAIN_SUMMARY="$(touch pwned).md")
    assert done.returncode == ExitCode.OK, done.stderr
    assert not (folder / "pwned").exists()
    assert hostile in {scene["root"] for scene in server.scenes.values()}
    assert (folder / "$(touch pwned).md").is_file()
    assert server.alias("glass", "champion") == "1.0.0"
    assert script(folder, server, RETRAIN_NAME="$(touch pwned)").returncode == ExitCode.USAGE
    assert not (folder / "pwned").exists()


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ({"DIAPHANE_KEY": ""}, "set DIAPHANE_KEY"),
        ({"RETRAIN_NAME": ""}, "set RETRAIN_NAME"),
        ({"RETRAIN_SCENES": ""}, "set RETRAIN_SCENES"),
        ({"RETRAIN_HOLDOUT": ""}, "set RETRAIN_HOLDOUT"),
        ({"RETRAIN_PROMOTE": "yes"}, "use true or false"),
        ({"RETRAIN_REPLAY": "no"}, "use true or false"),
    ],
)
def test_the_script_says_what_is_missing(
    variables: dict[str, str], words: str, server: FakeServer, folder: Path
) -> None:
    done = script(folder, server, **variables)
    assert done.returncode == ExitCode.USAGE
    assert words in done.stderr
    assert server.asked == []


@pytest.mark.parametrize("shell", ["sh", "dash", "bash"])
def test_the_script_parses_in_every_shell(shell: str) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell}")
    subprocess.run([shell, "-n", str(RETRAIN / "retrain.sh")], check=True)
    assert (RETRAIN / "retrain.sh").stat().st_mode & 0o111


def test_shellcheck_has_nothing_to_say() -> None:
    if shutil.which("shellcheck") is None:
        pytest.skip("there is no shellcheck")
    subprocess.run(["shellcheck", "--shell=sh", str(RETRAIN / "retrain.sh")], check=True)


def documented() -> set[str]:
    """Variables that the script's own head lists."""
    head = (RETRAIN / "retrain.sh").read_text().split("set -eu")[0]
    return set(re.findall(r"RETRAIN_[A-Z_]+", head))


def test_the_script_reads_every_variable_that_it_lists_and_no_other() -> None:
    body = (RETRAIN / "retrain.sh").read_text().split("set -eu")[1]
    assert set(re.findall(r"\$\{?(RETRAIN_[A-Z_]+)", body)) == documented()


def test_the_github_action_hands_its_inputs_over_as_environment_only() -> None:
    action = yaml.safe_load((RETRAIN / "action.yml").read_text())
    steps = action["runs"]["steps"]
    assert action["runs"]["using"] == "composite"
    assert all("${{" not in step["run"] and step["shell"] == "bash" for step in steps)
    environment = steps[-1]["env"]
    read_by_the_command = {f"RETRAIN_{flag.parameter.upper()}" for flag in retrain_flags()}
    assert {name for name in environment if name.startswith("RETRAIN_")} == documented() | read_by_the_command
    used = {re.fullmatch(r"\$\{\{ inputs\.([a-z-]+) \}\}", value)[1] for value in environment.values()}  # type: ignore[index]
    assert used | {"install"} == set(action["inputs"])
    assert all(entry.get("required") or "default" in entry for entry in action["inputs"].values())
    for name, output in action["outputs"].items():
        assert output["value"] == f"${{{{ steps.{steps[-1]['id']}.outputs.{name} }}}}"


def test_the_gitlab_job_runs_the_script_and_keeps_the_table() -> None:
    template = yaml.safe_load((RETRAIN / "gitlab-ci.yml").read_text())
    (name,) = template
    job = template[name]
    assert name == ".diaphane-retrain"
    assert job["script"] == ["/tmp/diaphane/deploy/retrain/retrain.sh"]
    assert job["artifacts"] | {"when": "always", "paths": ["$RETRAIN_SUMMARY"]} == job["artifacts"]
    assert {v for v in job["variables"] if v.startswith("RETRAIN_")} <= documented()
    assert "DIAPHANE_KEY" not in job["variables"]
    for line in job["before_script"]:
        subprocess.run(["bash", "-n", "-c", line], check=True)
