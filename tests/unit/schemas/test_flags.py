"""One field of the model is an option of the commands, a field of the API, part of the plan, and in the documents."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from schemas.flags import checked, flags, given, written
from schemas.job import JobSpec
from schemas.options import Options
from schemas.problem import Problem

ROOT = Path(__file__).resolve().parents[3]

WITH_ANOTHER_OPTION = """
import json
from typing import Annotated

import typer
from pydantic import Field

from schemas import options
from schemas.option import Option


class Options(options.Options):
    spare: Annotated[int, Field(ge=2, le=9), Option("Spare so many sparrows.")] = 3


options.Options = Options  # before anything else is loaded, as if the field stood there

from schemas.job import JobSpec
from services.api.description import build_document
from diaphane.cli import tables
from diaphane.cli.app import app
from schemas.flags import given, written
from diaphane.local.options import BuildOptions
from stages.plan import plan_of_job

commands = typer.main.get_command(app).commands
commands = [commands["build"], commands["jobs"].commands["submit"], commands["retrain"]]
fields = {"kind": "train", "name": "glass", "dataset": f"dst_{0:032x}", **given(JobSpec, {"spare": 5})}
plan = plan_of_job(JobSpec.model_validate(fields), {})
print(json.dumps({
    "help": [[option.help for option in command.params if "--spare" in option.opts] for command in commands],
    "schema": build_document()["components"]["schemas"]["JobSpec"]["properties"]["spare"],
    "plan": plan.options.spare,
    "again": written(plan.options)[-2:],
    "table": tables.build_table(),
    "inputs": tables.action_inputs(),
    "environment": tables.action_environment(),
}))
"""


def test_an_option_is_written_once() -> None:
    done = subprocess.run([sys.executable, "-c", WITH_ANOTHER_OPTION], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    words = "Spare so many sparrows. (2 to 9; default: 3)"
    assert found["help"] == [[words]] * 3
    described = {"type": "integer", "minimum": 2, "maximum": 9, "default": 3, "description": "Spare so many sparrows."}
    assert found["schema"] == {**described, "title": "Spare"}
    assert found["plan"] == 5
    assert found["again"] == ["--spare", "5"]
    assert "| `--spare` | `3` | Spare so many sparrows. 2 to 9. |" in found["table"].splitlines()
    assert f'  spare:\n    description: "{words}"\n    default: ""' in found["inputs"]
    assert "        RETRAIN_SPARE: ${{ inputs.spare }}" in found["environment"].splitlines()


def test_what_is_written_is_read_again() -> None:
    options = Options(budgets=(0.5, 2.0), alpha=0.33, width=64, height=48, seed=7, weights="flip")
    words = written(options)
    typed = dict(zip(words[::2], words[1::2], strict=True))
    values = {flag.parameter: flag.kind(typed[flag.names[0]]) for flag in flags(Options) if flag.names[0] in typed}
    assert checked(Options, given(Options, values)) == options
    assert "--steps" not in typed, "not given: the trainer's"


def test_a_switch_is_written_with_its_name_or_with_no() -> None:
    job = JobSpec(kind="train", name="glass", dataset=f"dst_{0:032x}")
    assert "--replay" in written(job)
    assert "--no-replay" in written(job.model_copy(update={"replay": False}))


def test_fields_that_do_not_fit_each_other_are_a_sentence() -> None:
    with pytest.raises(Problem) as caught:
        checked(JobSpec, {"kind": "train", "dataset": f"dst_{0:032x}"})
    assert caught.value.title == "A train needs a name."


@pytest.mark.parametrize("model", [Options, JobSpec])
def test_every_field_that_may_be_absent_says_what_holds_then(model: type[Options]) -> None:
    for flag in flags(model):
        assert flag.default or flag.absent, flag.names
