"""Who does what the pipeline asks for: a runner makes what is missing.

The pipeline (`services.pipeline`) is the same on a laptop and on a cluster; a runner is what differs. Only addresses
and small facts pass between them, everything else goes through the store.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from evaluation.progress import Progress
from stages.store import Store
from stages.tasks import JsonFacts, StageName, Task

if TYPE_CHECKING:
    from services.measured import Measured
    from services.registry import Registry
    from services.storage import Blobs


class Runner(Protocol):
    """Makes artifacts.

    Attributes:
        progress: Where notes and counts of skipped work go.
        store: Where artifacts lie.
        blobs: Where files lie that are asked for by hash.
        registry: Where bundles are published.
        measured: Where measurements and data sets are kept.
        job_id: Of the job, None outside the service.
        who: Id of the key that submitted it, None outside the service.
    """

    progress: Progress
    store: Store
    blobs: Blobs
    registry: Registry
    measured: Measured
    job_id: str | None
    who: str | None

    def map(self, stage: StageName, tasks: Sequence[Task]) -> list[JsonFacts | None]:
        """Makes what is missing of a stage's artifacts.

        Returns:
            The facts of each artifact, in the order of the tasks; None for a task that failed to the end.
        """

    def step(self, name: str, body: Callable[[], Any]) -> Any:
        """Runs something idempotent beside the artifacts (publishing, recording), and remembers its JSON result."""
