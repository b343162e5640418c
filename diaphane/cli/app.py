"""The commands and how they end.

Exit statuses are those of `schemas.problem.ExitCode`: an error says what is wrong and what to do, never a traceback.
"""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Annotated, NoReturn

import typer
from typer.exceptions import Abort, Exit, TyperException

from diaphane.cli import (
    advise,
    bench,
    build,
    config,
    dataset,
    datasets,
    dump,
    health,
    jobs,
    keys,
    measurements,
    models,
    output,
    render,
    retrain,
    samples,
    scene,
    scenes,
    serve,
    storm,
    stress,
    view,
    webhooks,
    worker,
    workers,
)
from diaphane.cli.model_options import add_command
from diaphane.cli.state import DEFAULT_STATE, STATE_VARIABLE
from schemas.problem import ExitCode, Problem

app = typer.Typer(
    name="diaphane",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
add_command(app, "build", build.build, "schemas.options:Options")
app.command("render")(render.render)
app.command("view")(view.view)
app.command("dump")(dump.dump)
app.command("advise")(advise.advise)
add_command(app, "bench", bench.bench, "schemas.work:Device")
app.add_typer(scene.app, name="scene")
app.command("samples")(samples.samples)
app.command("stress")(stress.stress)
app.add_typer(storm.app, name="storm")
app.command("serve")(serve.serve)
app.command("worker")(worker.worker)
add_command(app, "retrain", retrain.retrain, "schemas.job:JobSpec", without=retrain.OWN, variables=retrain.VARIABLES)
app.add_typer(scenes.app, name="scenes")
app.add_typer(jobs.app, name="jobs")
app.add_typer(dataset.app, name="dataset")
app.add_typer(datasets.app, name="datasets")
app.command("measurements")(measurements.measurements)
app.add_typer(models.app, name="models")
app.add_typer(keys.app, name="keys")
app.add_typer(webhooks.app, name="webhooks")
app.command("workers")(workers.workers)
app.command("health")(health.health)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from evaluation.versions import diaphane_version

        print(f"diaphane {diaphane_version()}")
        raise Exit


@app.callback()
def common(
    _: Annotated[
        bool, typer.Option("--version", help="Print the version, and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Learns where a renderer should spend a fixed budget of transparent fragments."""


@app.command("version")
def version(as_json: bool = typer.Option(False, "--json", help="Print one JSON object on stdout.")) -> None:
    """Version of Diaphane and of the libraries that can change a result."""
    from evaluation.versions import library_versions

    versions = library_versions()
    if as_json:
        output.print_json(versions)
        return
    for name, value in versions.items():
        print(f"{name} {value}")


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Entry point of `diaphane`: runs a command and exits with its status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    sys.exit(run(given))


def run(arguments: Sequence[str]) -> int:
    """Runs a command; returns its exit status.

    Args:
        arguments: What stands after `diaphane` on the command line.
    """
    as_json = "--json" in arguments
    output.set_up_logging()
    signal.signal(signal.SIGTERM, _terminate)
    try:
        status = _call(arguments)
    except TyperException as error:
        return _usage(error, as_json)
    except Problem as problem:
        return output.show_problem(problem, as_json=as_json)
    except BrokenPipeError:
        # Whoever read our output has left, as `head` does; nothing more can be written, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return int(ExitCode.CHECK_FAILED)
    except OSError as error:
        return output.show_problem(_disk(error), as_json=as_json)
    except Exception as error:
        state = Path(os.environ.get(STATE_VARIABLE, DEFAULT_STATE))
        return output.show_problem(output.unexpected(error, state), as_json=as_json)
    if status == ExitCode.INTERRUPTED:
        # A benchmark that began afresh would throw away what it has measured until now.
        again = shlex.join(["diaphane", *(argument for argument in arguments if argument != "--fresh")])
        stopped = Problem("Stopped.", f"Continue with: {again}", ExitCode.INTERRUPTED)
        return output.show_problem(stopped, as_json=as_json)
    return status


def _call(arguments: Sequence[str]) -> int:
    command = typer.main.get_command(app)
    defaults = config.read().defaults(command)
    try:
        status = command.main(args=list(arguments), prog_name="diaphane", standalone_mode=False, default_map=defaults)
    except Exit as exit_:
        return exit_.exit_code
    except (KeyboardInterrupt, Abort):
        return ExitCode.INTERRUPTED
    except Exception as error:
        if _interrupted(error):
            return ExitCode.INTERRUPTED
        raise
    return int(status or 0)  # typer itself gives 130 for an interrupt within a command


def _interrupted(error: BaseException | None) -> bool:
    """Whether an interrupt is behind an error: one that arrives within compiled code may leave it as a SystemError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _disk(error: OSError) -> Problem:
    """A full disk, a read-only or missing folder: nothing is wrong with the command, so it can be run again."""
    where = f"{error.filename}: " if error.filename else ""
    return Problem(
        f"{where}{error.strerror or error}.",
        "Make room, or name a folder that can be written, also with --state; the same command then continues.",
        ExitCode.TRY_AGAIN,
    )


def _usage(error: TyperException, as_json: bool) -> int:
    text = error.format_message()
    if not text:  # no command was named: the help has been printed
        return int(ExitCode.OK)
    command = getattr(getattr(error, "ctx", None), "command_path", "diaphane")
    problem = Problem(text[0].upper() + text[1:].rstrip(".") + ".", f"See `{command} --help`.", ExitCode.USAGE)
    return output.show_problem(problem, as_json=as_json)


def _terminate(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt
