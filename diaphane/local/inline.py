"""The runner of a local build: every task in this process, one after the other."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from evaluation.progress import Progress, Stage
from services.measured import Measured
from services.registry import Registry
from services.sources import materialise
from services.storage import Storage
from stages import bodies
from stages.catalogue import STAGES
from stages.desk import Desk
from stages.tasks import FACTS, JsonFacts, StageName, Task
from stages.train import TRAIN


class InlineRunner:
    """Makes artifacts in this process.

    Args:
        storage: Artifacts and blobs.
        registry: Where bundles are published.
        measured: Where measurements are kept.
        progress: Where progress goes.
    """

    def __init__(self, storage: Storage, registry: Registry, measured: Measured, progress: Progress) -> None:
        self.store, self.blobs = storage.store, storage.blobs
        self.registry, self.measured, self.progress = registry, measured, progress
        self.job_id: str | None = None
        self.who: str | None = None
        self.worked = False
        """Whether any artifact was made."""
        self._desk = Desk(storage.store, lambda source: materialise(source, storage.blobs, storage.store.root / "tmp"))

    def map(self, stage: StageName, tasks: Sequence[Task]) -> list[JsonFacts | None]:
        """See `services.runner.Runner`; a task that fails ends the build with its error."""
        facts: list[JsonFacts | None] = []
        if stage == "train":
            return [self._train(task) for task in tasks]
        with self.progress.stage(STAGES[stage].title, len(tasks)) as bar:
            for task in tasks:
                notes: list[str] = []
                facts.append(self._make(task, _Last(notes)))
                bar.advance(1, " ".join([task.name, *notes[-1:]]))
        return facts

    def step(self, name: str, body: Callable[[], Any]) -> Any:
        """See `services.runner.Runner`."""
        return body()

    def _train(self, task: Task) -> JsonFacts:
        """One long task: its bar counts thousandths, not tasks."""
        with self.progress.stage(TRAIN.title, _PARTS) as bar:
            return self._make(task, _Fractions(bar))

    def _make(self, task: Task, report: Callable[[float, str], None]) -> JsonFacts:
        if self.store.get(task.address) is None:
            self.worked = True
            bodies.make_at(self._desk, task, report)
        else:
            self.progress.skipped(STAGES[task.stage].known(task))
        facts: JsonFacts = json.loads((self.store.path(task.address) / FACTS).read_text(encoding="utf-8"))
        return facts


class _Last:
    """Keeps what a task says, for the line that is shown when it is done."""

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes

    def __call__(self, fraction: float, note: str) -> None:
        """See `stages.tasks.Report`."""
        self._notes.append(note)


_PARTS = 1000


class _Fractions:
    """Advances a bar of `_PARTS` steps by fractions."""

    def __init__(self, bar: Stage) -> None:
        self._bar, self._done = bar, 0

    def __call__(self, fraction: float, note: str) -> None:
        """See `stages.tasks.Report`."""
        done = int(fraction * _PARTS)
        self._bar.advance(done - self._done, note)
        self._done = done
