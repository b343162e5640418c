"""The command line as users meet it: output, errors and exit statuses. The pipeline behind `build` is replaced here."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from support.bundles import make_bundle
from support.measured import example

import services
from diaphane.cli.app import run
from diaphane.local.options import BuildOptions
from diaphane.local.result import BuildResult
from evaluation.progress import Progress
from evaluation.versions import diaphane_version
from schemas.bundle import CARD, write_card
from schemas.measurement import RegistryResult
from schemas.options import Options
from schemas.problem import ExitCode, Problem
from services.database import open_database
from services.registry import open_registry
from services.settings import Settings
from services.storage import open_storage

Build = Callable[[BuildOptions, Progress], BuildResult]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DIAPHANE_STATE", raising=False)
    for name in ("bottles", "foliage"):
        (tmp_path / f"{name}.usda").write_text("#usda 1.0\n")
    return tmp_path


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> Callable[[Build], list[BuildOptions]]:
    """Puts a function in the pipeline's place; returns the options that it was called with."""

    def put(build: Build) -> list[BuildOptions]:
        asked: list[BuildOptions] = []

        def spy(options: BuildOptions, progress: Progress) -> BuildResult:
            asked.append(options)
            return build(options, progress)

        module = ModuleType("diaphane.local.build")
        vars(module)["build"] = spy
        monkeypatch.setitem(sys.modules, "diaphane.local.build", module)
        monkeypatch.setattr(services, "build", module, raising=False)
        return asked

    return put


def succeed(options: BuildOptions, progress: Progress) -> BuildResult:
    with progress.stage("render", 1) as stage:
        stage.advance()
    return BuildResult(
        report=options.state / "report.html",
        dataset=options.state / "datasets" / options.name,
        licences="Commercial use is allowed by the licences of all 2 training scenes.",
        registry=RegistryResult(
            reference=f"{options.name}@1.0.0", folder="folder", champion=True, reason="It is the first version."
        ),
        held_out=("bottles",),
        measurements=tuple(example()),
        skipped={"views": 2},
        worked=False,
        seconds=1.5,
    )


def raising(error: BaseException) -> Build:
    def build(options: BuildOptions, progress: Progress) -> BuildResult:
        raise error

    return build


ROOT = Path(services.__file__).parent.parent
BUILD = ["build", "bottles.usda", "foliage.usda", "--name", "glass", "--budgets", "1,2"]


def test_help_loads_nothing_heavy() -> None:
    heavy = ("torch", "numba", "moderngl", "pxr", "numpy", "pydantic", "httpx", "sqlalchemy", "fastapi", "jinja2")
    asked = "import sys; from diaphane.cli.app import run; run(['--help'])"
    code = f"{asked}; print([m for m in {heavy} if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert answer.stdout.splitlines()[-1] == "[]"


def test_build_passes_its_options_on(pipeline: Callable[[Build], list[BuildOptions]]) -> None:
    asked = pipeline(succeed)
    options = ["--alpha", "0.33", "--holdout", "bottles.usda", "--size", "64x48", "--tail", "binned-8", "--g", "0.5"]
    options += ["--seed", "7", "--steps", "9", "--views-per-scene", "2", "--state", "state"]
    options += ["--licence", "CC0", "--licence", "bottles=CC-BY-4.0, Jane"]
    assert run([*BUILD, *options]) == ExitCode.OK
    assert asked == [
        BuildOptions(
            scenes=(Path("bottles.usda"), Path("foliage.usda")),
            name="glass",
            options=Options(
                budgets=(1.0, 2.0),
                alpha=0.33,
                views_per_scene=2,
                width=64,
                height=48,
                tail="binned-8",
                g=0.5,
                seed=7,
                steps=9,
            ),
            holdout=(Path("bottles.usda"),),
            licences={Path("bottles.usda"): "CC-BY-4.0, Jane", Path("foliage.usda"): "CC0"},
            state=Path("state"),
        )
    ]


def test_the_options_of_the_command_line_default_to_those_of_the_library(
    pipeline: Callable[[Build], list[BuildOptions]],
) -> None:
    asked = pipeline(succeed)
    run(["build", "bottles.usda", "foliage.usda", "--name", "glass"])
    assert asked == [BuildOptions((Path("bottles.usda"), Path("foliage.usda")), "glass")]


def test_build_prints_the_table_and_where_the_report_is(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline(succeed)
    assert run(BUILD) == ExitCode.OK
    captured = capsys.readouterr()
    assert "Report: .diaphane/report.html" in captured.out
    assert "bundle (kbuffer-deep)" in captured.out
    assert "…" not in captured.out, "nothing is cut off in 80 columns"
    assert "Nothing had to be done" in captured.out
    assert "render: 1" in captured.err


def test_json_is_one_object_on_stdout_and_nothing_else(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline(succeed)
    assert run([*BUILD, "--json"]) == ExitCode.OK
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert result["registry"]["reference"] == "glass@1.0.0"
    assert result["skipped"] == {"views": 2}
    assert captured.err == ""


def test_the_state_folder_comes_from_the_environment(
    pipeline: Callable[[Build], list[BuildOptions]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DIAPHANE_STATE", "elsewhere")
    asked = pipeline(succeed)
    run(BUILD)
    assert asked[0].state == Path("elsewhere")


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["build", "nowhere.usda", "--name", "glass"], ExitCode.NOT_FOUND, "no file nowhere.usda"),
        ([*BUILD, "--budgets", "0"], ExitCode.USAGE, "A budget of 0 "),
        ([*BUILD, "--licence", "potles=CC0"], ExitCode.USAGE, "--licence 'potles=CC0' names no licence of a scene"),
        ([*BUILD, "--budgets", "one"], ExitCode.USAGE, "not a list of numbers"),
        ([*BUILD, "--budgets", "1e-9"], ExitCode.USAGE, "less than one fragment of a picture of 1430x960 pixels"),
        ([*BUILD, "--from", ""], ExitCode.USAGE, "--from is empty"),
        ([*BUILD, "--steps", "1000000000000"], ExitCode.USAGE, "is not 1..1000000"),
        (["bench", "bottles.usda", "-o", "out", "--budgets", "1e-9"], ExitCode.USAGE, "less than one fragment"),
        (["bench", "bottles.usda", "-o", "out", "--bundle", ""], ExitCode.USAGE, "--bundle is empty"),
        (["render", "bottles.usda", "--bundle", ""], ExitCode.USAGE, "--bundle is empty"),
        (["render", "bottles.usda", "-t", ""], ExitCode.USAGE, "No technique is named"),
        (["render", "bottles.usda", "--size", "64x48", "--budget", "1e-9"], ExitCode.USAGE, "less than one fragment"),
        ([*BUILD, "--size", "big"], ExitCode.USAGE, "is not a size"),
        ([*BUILD, "--alpha", "2"], ExitCode.USAGE, "--alpha 2 is not between 0 and 1"),
        ([*BUILD, "--alpha", "much"], ExitCode.USAGE, "'--alpha'"),
        ([*BUILD, "--name", "../x"], ExitCode.USAGE, "cannot be the name"),
        ([*BUILD, "--colour"], ExitCode.USAGE, "--colour"),
        (["build", "bottles.usda"], ExitCode.USAGE, "--name"),
        (["paint"], ExitCode.USAGE, "paint"),
        (["models", "show", "glass"], ExitCode.NOT_FOUND, "no bundle 'glass'"),
    ],
)
def test_mistakes_end_with_what_to_do(
    arguments: list[str], status: ExitCode, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == status
    captured = capsys.readouterr()
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 2
    assert captured.out == ""
    assert run([*arguments, "--json"]) == status
    problem = json.loads(capsys.readouterr().err)
    assert problem["code"] == status
    assert words in problem["title"]
    assert problem["remedy"]


def test_a_problem_of_the_pipeline_ends_with_its_status(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline(raising(Problem("bottles.usda is opaque.", "Give --alpha 0.33.", ExitCode.CHECK_FAILED)))
    assert run(BUILD) == ExitCode.CHECK_FAILED
    assert capsys.readouterr().err == "error: bottles.usda is opaque.\nGive --alpha 0.33.\n"


def test_an_interrupt_says_how_to_continue(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline(raising(KeyboardInterrupt()))
    assert run([*BUILD, "--views-per-scene", "2"]) == ExitCode.INTERRUPTED
    command = "diaphane build bottles.usda foliage.usda --name glass --budgets 1,2 --views-per-scene 2"
    assert f"Continue with: {command}" in capsys.readouterr().err


def test_an_interrupt_that_compiled_code_turned_into_another_error_is_one(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    error = SystemError("<function f> returned a result with an exception set")
    error.__cause__ = KeyboardInterrupt()
    pipeline(raising(error))
    assert run(BUILD) == ExitCode.INTERRUPTED
    assert capsys.readouterr().err.startswith("error: Stopped.\n")


def test_an_unexpected_error_is_short_and_its_traceback_is_kept(
    pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    pipeline(raising(ZeroDivisionError("division by zero")))
    assert run(BUILD) == ExitCode.CHECK_FAILED
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    assert "ZeroDivisionError: division by zero" in captured.err
    (path,) = (folder / ".diaphane" / "errors").iterdir()
    assert path.name in captured.err
    assert "Traceback" in path.read_text()


def test_no_command_prints_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "build" in captured.out + captured.err


@pytest.mark.parametrize("arguments", [["-h"], ["build", "-h"], ["models", "show", "-h"], ["models"]])
def test_help_is_asked_for_by_one_letter_and_is_no_failure(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == ExitCode.OK
    captured = capsys.readouterr()
    assert "Usage: diaphane" in captured.out + captured.err
    assert "error" not in captured.err


def test_the_version_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == ExitCode.OK
    assert capsys.readouterr().out == f"diaphane {diaphane_version()}\n"


@pytest.mark.parametrize(
    ("typed", "offered"), [("bui", {"build"}), ("models sh", {"show"}), ("build --st", {"--state", "--steps"})]
)
def test_a_shell_completes_commands_and_options(
    typed: str, offered: set[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_DIAPHANE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"diaphane {typed}")
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split())))
    with pytest.raises(SystemExit) as end:
        run([])
    assert end.value.code == 0
    assert set(capsys.readouterr().out.split()) == offered


def test_version_names_the_libraries(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["version", "--json"]) == ExitCode.OK
    assert set(json.loads(capsys.readouterr().out)) >= {"diaphane", "python", "numpy"}
    assert run(["version"]) == ExitCode.OK
    assert "numpy " in capsys.readouterr().out


def publish(folder: Path, weights: str, score: float | None, card: str | None = None) -> None:
    settings = Settings(state=folder / ".diaphane")
    database = open_database(settings.database_url)
    registry = open_registry(database, open_storage(settings).blobs, settings)
    bundle = make_bundle(folder / f"bundle-{weights}", weights)
    if card is not None:
        write_card(bundle, card)
    publication = registry.publish("glass", bundle, score, {})
    champion = registry.champion("glass")
    registry.consider(publication, score, champion.score if champion else None)
    database.close()


def test_models_are_listed_shown_promoted_and_rolled_back(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["models", "list"]) == ExitCode.OK
    assert "No bundle is published" in capsys.readouterr().err
    publish(folder, "a", 0.5)
    publish(folder, "b", None, "# Model card: glass\n")
    assert run(["models", "list"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass  latest 1.1.0  champion 1.0.0\n"
    assert run(["models", "promote", "glass", "1.1.0", "--reason", "smaller"]) == ExitCode.OK
    assert run(["models", "show", "glass"]) == ExitCode.OK
    shown = capsys.readouterr().out
    assert "glass@1.0.0  score 0.5" in shown
    assert "glass@1.1.0  score none" in shown
    assert shown.count("Commercial use is NOT CLEARED: 1 of 1 training scenes have no licence that is known") == 2
    assert f"registry/glass/1.1.0/{CARD}" in shown
    assert "champion: 1.0.0 -> 1.1.0" in shown
    assert "smaller" in shown
    assert run(["models", "list", "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["bundles"] == [{"name": "glass", "latest": "1.1.0", "champion": "1.1.0"}]
    assert run(["models", "show", "glass@1.0.0", "--json"]) == ExitCode.OK
    (version,) = json.loads(capsys.readouterr().out)["versions"]
    assert version["score"] == 0.5
    assert CARD not in version["files"]
    assert Path(version["folder"]).is_dir()
    assert run(["models", "rollback", "glass", "--reason", "flickers"]) == ExitCode.OK
    assert capsys.readouterr().out == "glass@1.0.0 is the champion.\n"
    assert run(["models", "rollback", "glass", "--reason", "flickers"]) == ExitCode.CONFLICT


def test_a_real_interrupt_ends_with_130(tmp_path: Path) -> None:
    code = (
        "import sys, time, types, diaphane.local\n"
        "module = types.ModuleType('diaphane.local.build')\n"
        "def build(options, progress):\n"
        "    with progress.stage('render', 9):\n"
        "        time.sleep(60)\n"
        "module.build = build\n"
        "diaphane.local.build = sys.modules['diaphane.local.build'] = module\n"
        f"from diaphane.cli import main; main({BUILD!r})\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert child.stderr is not None
    assert child.stderr.readline() == b"render: 9\n"
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=20)
    assert child.returncode == ExitCode.INTERRUPTED
    assert b"Continue with: diaphane build" in err
    assert b"Traceback" not in err


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device", "st/dump"), OSError(30, "Read-only file system")]
)
def test_a_disk_that_cannot_be_written_is_worth_another_try(
    error: OSError, pipeline: Callable[[Build], list[BuildOptions]], capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline(raising(error))
    assert run(["build", "bottles.usda", "foliage.usda", "--name", "glass"]) == ExitCode.TRY_AGAIN
    message = capsys.readouterr().err
    assert str(error.strerror) in message
    assert "--state" in message
    assert "Traceback" not in message
