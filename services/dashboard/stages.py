"""The stages of a job as a graph: what each needs, and how it stands."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.job import FINAL_STATES
from schemas.service import JobRecord, StageProgress
from services.engine.progress import STAGES_OF, WITHOUT_SCENES
from stages.catalogue import STAGES


@dataclass(frozen=True, slots=True)
class Node:
    """A stage of a job.

    Attributes:
        stage: Its name.
        needs: Stages of the job that come before it.
        progress: Of its tasks; zeros while there is none.
        state: waiting, queued, running, done, partly (some tasks were quarantined), stopped, or unreached when the job
            ended before it.
    """

    stage: str
    needs: tuple[str, ...]
    progress: StageProgress
    state: str


def graph(job: JobRecord) -> list[Node]:
    """All stages of a job, each after those that it needs."""
    known = {progress.stage: progress for progress in job.stages}
    own = STAGES_OF[job.kind] if job.spec.dataset is None else WITHOUT_SCENES
    order = [stage for stage in STAGES if stage in own or stage in known]
    return [
        Node(
            stage,
            tuple(needed for needed in STAGES[stage].after if needed in order),
            known.get(stage, StageProgress(stage=stage)),
            _state(known.get(stage), job.state),
        )
        for stage in order
    ]


def _state(progress: StageProgress | None, job_state: str) -> str:
    if progress is None or progress.total == 0:
        return "unreached" if job_state in FINAL_STATES else "waiting"
    ended = progress.done + progress.skipped + progress.quarantined
    if ended >= progress.total:
        return "partly" if progress.quarantined else "done"
    if job_state in FINAL_STATES:
        return "stopped"
    return "running" if progress.running else "queued"
