"""A runner that answers from a table: for tests of the pipeline's order, without a renderer."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from evaluation.progress import SilentProgress
from schemas.bundle import CARD
from schemas.measurement import Measurement
from schemas.service import DatasetRecord, SceneRecord, ShardRef
from schemas.tail import DEFAULT_TAIL, DENSITY_G
from stages.desk import BUNDLE
from stages.tasks import JsonFacts, StageName, Task
from support.bundles import make_bundle

VIEW = {"eye": (0.0, 0.0, 5.0), "target": (0.0, 0.0, 0.0), "up": (0.0, 1.0, 0.0)}
TECHNIQUES = {"kbuffer": 4e-5, "kbuffer-importance": 2e-5, "kbuffer-optimal": 1e-6, "kbuffer-deep": 1e-5}


def scene(number: int, name: str) -> SceneRecord:
    digest = f"{number:064x}"
    return SceneRecord(
        id=f"scn_{digest[-32:]}",
        digest=digest,
        name=name,
        root=f"{name}.usdc",
        files={f"{name}.usdc": {"sha256": digest, "bytes": 1}},  # type: ignore[dict-item]
        bytes=1,
        state="accepted",
        created="2026-01-01T00:00:00+00:00",
    )


def measurement(technique: str, mse: float, factor: float = 1.0, view: str = "view0") -> dict[str, Any]:
    return Measurement(
        scene="",
        view=view,
        technique=technique,
        budget=100,
        budget_factor=factor,
        width=16,
        height=16,
        alpha=None,
        tail=DEFAULT_TAIL,
        mse=mse,
        total_fragments=1000,
    ).model_dump(mode="json")


class TableRunner:
    """Answers every task; `fails` names those that fail; `opaque`, `empty`, `totals`, `licences`: of scenes and views.

    Attributes:
        asked: Every task, in order.
        published: What was published.
        cards: The model cards of that.
    """

    def __init__(self, champion: Any = None, fails: Sequence[tuple[str, str]] = ()) -> None:
        self.progress = SilentProgress()
        self.job_id: str | None = "job_0"
        self.who: str | None = "key_0"
        self.fails = set(fails)
        self.opaque: set[str] = set()
        self.empty: set[str] = set()
        self.warnings: dict[str, list[str]] = {}
        self.totals: dict[str, int] = {}
        self.licences: dict[str, str] = {}
        self.cards: list[str] = []
        self._work = tempfile.TemporaryDirectory()
        self.bundle_mse = 1e-5
        self.rival_mse = 3e-5
        self.asked: list[Task] = []
        self.steps: list[str] = []
        self.published: list[dict[str, Any]] = []
        self.considered: list[tuple[float | None, float | None, bool]] = []
        self.recorded: list[tuple[str, int, str | None]] = []
        self.shards: list[ShardRef] = []
        self.settings: dict[str, Any] = {}
        self.store = SimpleNamespace(fetch=self._fetch)
        self.blobs = SimpleNamespace(put_file=lambda path: SimpleNamespace(sha256="a" * 64))
        self.registry = SimpleNamespace(
            champion=lambda name: champion,
            versions=lambda name: [],
            resolve=lambda reference: champion,
            record=lambda publication: publication,
            folder=lambda publication: getattr(publication, "folder", Path("published")),
            publish=self._publish,
            consider=self._consider,
        )
        self.measured = SimpleNamespace(record=self._record, record_dataset=self._dataset, dataset=self._known_dataset)

    def map(self, stage: StageName, tasks: Sequence[Task]) -> list[JsonFacts | None]:
        self.asked += tasks
        assert all(task.stage == stage for task in tasks)
        return [None if (stage, task.name) in self.fails else self._facts(task) for task in tasks]

    def step(self, name: str, body: Callable[[], Any]) -> Any:
        self.steps.append(name)
        return body()

    def stages(self) -> list[str]:
        """Stages in the order in which they were first asked for."""
        return list(dict.fromkeys(task.stage for task in self.asked))

    def of(self, stage: str) -> list[Task]:
        return [task for task in self.asked if task.stage == stage]

    def _facts(self, task: Task) -> JsonFacts:
        if task.stage == "scene":
            views = [{"name": f"view{i}", **VIEW} for i in range(2)]
            return {
                "views": views,
                "triangles": 12,
                "opaque": task.name in self.opaque,
                "content": task.inputs[0],
                "warnings": self.warnings.get(task.name, []),
                "licence": self.licences.get(task.name, ""),
            }
        if task.stage == "render":
            return {
                "total": 0 if task.name in self.empty else self.totals.get(task.name, 1000),
                "occupied": 10,
                "passes": {},
            }
        if task.stage == "label":
            count = len(task.params["budgets"])
            certificate = {"error": 1.0, "bound": 1.0, "gap": 0.0}
            return {
                "errors": {"optimal": [1.0] * count, "greedy": [1.5] * count},
                "certificates": [certificate] * count,
                "shard": {"sha256": "0" * 64, "bytes": 10},
                "skips": {"pixels exact at k = 0": 3, "budgets given more than once": 0},
            }
        if task.stage == "train":
            return {"history": [{"step": 1, "loss": 1.0, "over_optimum": 2.0}], "config": {}}
        if task.stage == "export":
            return {"digest": "e" * 64, "files": {"weights.safetensors": "f" * 64}, "parity": 1e-7}
        if task.stage == "evaluate":
            return {"measurements": self._measurements(task)}
        return {"sha256": "a" * 64, "bytes": 10}

    def _measurements(self, task: Task) -> list[dict[str, Any]]:
        view = task.params["view"]["name"]
        if task.params["kind"] == "baseline":
            return [measurement(name, mse, view=view) for name, mse in TECHNIQUES.items() if name != "kbuffer-deep"]
        own = any(need.startswith("export/") for need in task.needs)
        return [measurement("kbuffer-deep", self.bundle_mse if own else self.rival_mse, view=view)]

    def _fetch(self, artifact: str) -> Path:
        """Folder of an artifact: that of an export holds a bundle of its provenance, others are not there."""
        exported = next((task for task in self.of("export") if task.artifact == artifact), None)
        if exported is None:
            return Path(artifact)
        folder = Path(self._work.name) / artifact
        make_bundle(folder / BUNDLE, scenes=exported.params["scenes"], licences=exported.params["licences"])
        return folder

    def _publish(self, name: str, folder: Path, score: float | None, evaluation: Any, **more: Any) -> Any:
        self.cards.append((folder / CARD).read_text(encoding="utf-8"))
        self.published.append({"name": name, "folder": folder, "score": score, "evaluation": evaluation, **more})
        return SimpleNamespace(name=name, version="1.0.0", digest="e" * 64)

    def _consider(
        self, publication: Any, score: float | None, rival: float | None, who: str | None, promote: bool
    ) -> tuple[bool, str]:
        self.considered.append((score, rival, promote))
        return promote, "because"

    def _record(
        self, artifact: str, measured: Sequence[Measurement], digests: Any, model: str | None, job: Any
    ) -> None:
        assert all(one.camera is not None and one.camera.name == one.view for one in measured)
        self.recorded.append((artifact, len(measured), model))

    def _dataset(self, settings: Any, shards: Sequence[ShardRef], job: Any) -> Any:
        self.settings, self.shards = dict(settings), list(shards)
        return SimpleNamespace(id="dst_" + "0" * 32)

    def _known_dataset(self, _dataset_id: str) -> DatasetRecord:
        shard = ShardRef(
            scene="a", scene_digest="1" * 64, view="view0", artifact="label/abc", sha256="0" * 64, bytes=10
        )
        settings = {"alpha": 0.5, "size": [32, 16], "budgets": [2.0], "tail": DEFAULT_TAIL, "g": DENSITY_G, "seed": 3}
        return DatasetRecord(
            id="dst_" + "0" * 32, job_id=None, created="2026-01-01T00:00:00+00:00", settings=settings, shards=(shard,)
        )
