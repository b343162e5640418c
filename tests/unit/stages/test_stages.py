"""Stages: light until they make something, with parameters and facts that nothing else gets into."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from typing import get_args

import pytest
from pydantic import ValidationError

from evaluation.versions import ROOT
from stages.catalogue import STAGES
from stages.stage import module_of
from stages.tasks import ROLES, StageName, Task
from stages.train import TRAIN, TrainParams

PARAMS = TrainParams(seed=1, steps=None, network="tiny", patience=3, start=None, replay=None)


def test_asking_loads_nothing_heavy() -> None:
    heavy = "{'torch', 'numba', 'moderngl', 'trainer', 'labeller', 'pxr', 'stages.plan'} & set(sys.modules)"
    code = f"import sys; import stages.catalogue; print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("name", get_args(StageName))
def test_a_stage_has_what_makes_it_and_comes_after_what_it_needs(name: StageName) -> None:
    stage, order = STAGES[name], list(STAGES)
    assert find_spec(module_of(name)) is not None
    assert stage.role in ROLES
    assert all(order.index(needed) < order.index(name) for needed in stage.after)


def test_parameters_come_out_of_a_task_as_they_went_in() -> None:
    task = TRAIN.task("glass", PARAMS, inputs=("a", "b"))
    travelled = Task.model_validate_json(task.model_dump_json())
    assert TRAIN.params_of(travelled) == PARAMS
    assert travelled.address == task.address
    assert task.address != TRAIN.task("glass", PARAMS.model_copy(update={"patience": 4}), inputs=("a", "b")).address


def test_a_parameter_that_a_stage_has_not_is_refused() -> None:
    task = TRAIN.task("glass", PARAMS, inputs=())
    with pytest.raises(ValidationError, match="spare"):
        TRAIN.params_of(task.model_copy(update={"params": {**task.params, "spare": 1}}))
