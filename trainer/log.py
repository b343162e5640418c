"""How a training goes, as JSON lines: one for every few steps and for every validation, written while it goes on."""

from __future__ import annotations

import json
import time
from pathlib import Path

from pydantic import BaseModel, ConfigDict


class LogLine(BaseModel):
    """Where a training stands.

    Attributes:
        step: Steps done.
        loss: Of that step's batch.
        score: Geometric mean of error / optimum at the step's validation; None at other steps.
        lr: Learning rate of the step.
        seconds: Since the training began or was taken up again.
        rows_per_second: Rows of batches since the line before, validations included.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    step: int
    loss: float
    score: float | None
    lr: float
    seconds: float
    rows_per_second: float


class TrainLog:
    """Appends lines to a file; those of steps that are done again give way.

    Args:
        path: The file; None: nothing is written.
        step: Steps done before.
        batch: Rows of a step.
    """

    def __init__(self, path: Path | None, step: int, batch: int) -> None:
        self._path, self._batch = path, batch
        self._began = self._last = time.monotonic()
        self._step = step
        if path is not None:
            kept = [line for line in read_log(path) if line.step <= step] if step else []
            path.write_text("".join(f"{line.model_dump_json()}\n" for line in kept), encoding="utf-8")

    def write(self, step: int, loss: float, score: float | None, lr: float) -> None:
        """Adds a line.

        Args:
            step: Steps done.
            loss: Of the last one's batch.
            score: Of its validation; None: there was none.
            lr: Its learning rate.
        """
        now = time.monotonic()
        rate = (step - self._step) * self._batch / max(now - self._last, 1e-9)
        line = LogLine(
            step=step,
            loss=loss,
            score=score,
            lr=lr,
            seconds=round(now - self._began, 3),
            rows_per_second=round(rate, 1),
        )
        self._step, self._last = step, now
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(line.model_dump_json() + "\n")


def read_log(path: Path) -> list[LogLine]:
    """The lines of a log; one that was cut off by a kill is left out."""
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            lines.append(LogLine.model_validate(json.loads(text)))
        except ValueError:
            break
    return lines
