"""The benchmark of forgetting on the service: which jobs it asks for, and its page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pytest

from benchmarks import forgetting
from benchmarks.forgetting import NEW, OLD, SETTINGS, measure, page
from schemas.job import JobSpec
from schemas.problem import Problem

MACHINE = {"processor": "Abacus", "cores": "2", "memory": "1 GiB"}
SCENES = {name: f"scn_{number:032x}" for number, name in enumerate((*OLD, NEW))}


class Server:
    """Does every job by the second look; a version's scores grow with its number."""

    def __init__(self, failing: str = "") -> None:
        self.specs: list[JobSpec] = []
        self._failing = failing

    def submit(self, spec: Mapping[str, Any]) -> tuple[dict[str, Any], bool]:
        self.specs.append(JobSpec.model_validate(dict(spec)))
        return {"id": f"job_{len(self.specs) - 1}", "state": "queued"}, True

    def get(self, job_id: str) -> dict[str, Any]:
        spec = self.specs[int(job_id.removeprefix("job_"))]
        if spec.name == self._failing:
            return {"id": job_id, "state": "failed", "problem": {"detail": "No view is left.", "remedy": "Add one."}}
        result: dict[str, Any] = {"reference": f"{spec.name}@1.0.0"}
        if spec.kind == "evaluate":
            step = [wanted.model for wanted in self.specs if wanted.kind == "evaluate"].index(spec.model)
            result = {"per_scene": {name: {"score": (1 + n) * 2.0**step} for n, name in enumerate(SCENES)}}
        return {"id": job_id, "state": "succeeded", "result": result}


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forgetting, "_POLL_SECONDS", 0.0)


def test_versions_differ_in_what_they_begin_with_and_replay_and_are_measured_alike() -> None:
    server = Server()
    measure(server, SCENES, 7)
    trained = {spec.name: spec for spec in server.specs if spec.kind == "train"}
    names = {identity: name for name, identity in SCENES.items()}
    assert {n: [names[use.scene] for use in s.scenes] for n, s in trained.items()} == {
        "before": [*OLD],
        "alone": [NEW],
        "replayed": [NEW],
        "scratch": [*OLD, NEW],
    }
    assert {n: (s.start_from, s.replay) for n, s in trained.items() if s.start_from != "scratch"} == {
        "alone": ("before@1.0.0", False),
        "replayed": ("before@1.0.0", True),
    }
    judged = [spec for spec in server.specs if spec.kind == "evaluate"]
    assert [spec.model for spec in judged] == [f"{name}@1.0.0" for name in ("before", "alone", "replayed", "scratch")]
    assert all(len(spec.scenes) == 3 for spec in judged)
    assert {(s.width, s.height, s.seed) for s in server.specs} == {(SETTINGS["width"], SETTINGS["height"], 0)}
    assert {spec.steps for spec in trained.values()} == {7}


def test_the_page_has_a_row_for_each_version_with_the_mean_of_the_old_scenes() -> None:
    rows = measure(Server(), SCENES, 7)
    about = {"command": "python -m benchmarks.forgetting", "created": "now", "machine": MACHINE}
    text = page({**about, "old": list(OLD), "new": NEW, "settings": {**SETTINGS, "steps": 7}, "rows": rows})
    cells = [line.strip("| ").split(" | ") for line in text.splitlines() if re.search(r"\d\.\d{3}", line)]
    assert [row[0] for row in cells] == [row["title"] for row in rows]
    # The geometric mean of 1 and 2, times two for every further version.
    assert [float(row[1]) for row in cells] == pytest.approx([2**0.5 * 2.0**n for n in range(4)], abs=1e-3)
    assert [float(cell) for cell in cells[1][2:]] == [2.0, 4.0, 6.0]


def test_a_job_that_fails_ends_it() -> None:
    with pytest.raises(Problem, match="No view is left"):
        measure(Server(failing="alone"), SCENES, 7)
