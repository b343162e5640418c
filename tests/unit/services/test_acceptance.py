"""What is decided of a job that begins with a version: once, by the same rules as a local build, without a trainer."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.bundles import make_bundle
from support.runner import TableRunner, scene

from schemas.job import JobSpec
from schemas.problem import ExitCode, Problem
from schemas.service import ShardRef
from schemas.tail import BINNED_TAILS, TAILS
from services.acceptance import accept, begun_plan
from services.database import open_database
from services.fine_tuning import is_replayed
from services.measured import Measured
from services.pipeline import JobContext, run_job
from services.registry import Registry, open_registry
from services.retention import DAY, sweep
from services.settings import Settings
from services.storage import Blobs, Storage
from stages.inputs import METRIC, trained_on
from stages.label import LabelParams
from stages.plan import Plan, plan_of_job
from stages.store import Address, Store
from stages.train import TRAIN

OLD, BOTH, NEW, UNSEEN = (scene(n, name) for n, name in enumerate(("old", "both", "new", "unseen")))
SCENES = {record.id: record for record in (OLD, BOTH, NEW, UNSEEN)}


def spec(*used: Any, kind: str = "build", start: str = "glass@champion", **more: Any) -> JobSpec:
    uses = [{"scene": record.id, "holdout": record is UNSEEN} for record in used or (NEW, UNSEEN)]
    sizes = {"width": 16, "height": 16, "budgets": [1.0]}
    return JobSpec.model_validate({"kind": kind, "name": "fresh", "scenes": uses, **sizes, "start_from": start, **more})


class Home:
    """A registry, a store, and a version `glass@1.0.0` that was trained on the scenes `old` and `both`."""

    def __init__(self, folder: Path, url: str) -> None:
        self.folder, self.database = folder, open_database(url)
        self.store, blobs = Store(folder / "store"), Blobs(folder / "store")
        self.storage = Storage(self.store, blobs)
        self.registry: Registry = open_registry(self.database, blobs, Settings(state=folder))
        self.measured = Measured(self.database)
        plan = plan_of_job(spec(OLD, BOTH, start="scratch"), SCENES)
        self.labels = [self.label(record.name, plan) for record in (OLD, BOTH)]
        self.publish(TRAIN.ask(plan, list(zip((OLD.digest, BOTH.digest), self.labels, strict=True)), None), "a")

    def label(self, name: str, plan: Plan) -> str:
        options = plan.options
        params = LabelParams(
            budgets=(256,), tail=options.tail, g=options.g, metric=METRIC, seed=options.seed, weights=options.weights
        )
        return self.put(Address("label", "v", (name,), params.model_dump(mode="json")))

    def put(self, address: Address) -> str:
        with self.store.put(address) as folder:
            (folder / "facts.json").write_text("{}")
        return address.artifact

    def publish(self, train: Any, weights: str, name: str = "glass", **scenes: str) -> None:
        self.put(train.address)
        known = scenes or {record.name: record.digest for record in (OLD, BOTH)}
        bundle = make_bundle(self.folder / f"bundle-{name}-{weights}", weights, scenes=known)
        made = self.registry.publish(name, bundle, 0.5, {}, artifacts=(train.artifact, *train.needs))
        self.registry.promote(name, made.version, "the newest")

    def accept(self, wanted: JobSpec) -> Any:
        return accept(wanted, SCENES, self.registry, self.measured, self.store)

    def plan(self, wanted: JobSpec) -> Plan:
        return begun_plan(wanted, plan_of_job(wanted, SCENES), self.registry, self.measured, self.store).plan


@pytest.fixture
def home(tmp_path: Path, database_url: str) -> Iterator[Home]:
    found = Home(tmp_path, database_url)
    yield found
    found.database.close()


def test_an_alias_becomes_the_version_that_it_means_now(home: Home) -> None:
    accepted = home.accept(spec())
    assert accepted.spec == spec(start="glass@1.0.0")
    assert accepted.notes == ("The training starts from glass@1.0.0, and the network keeps its size, 4 units.",)
    before = home.plan(accepted.spec)
    home.publish(TRAIN.ask(before, [(NEW.digest, home.labels[0])], None), "b")
    assert home.accept(spec(start="glass")).spec.start_from == "glass@1.1.0"
    assert home.plan(accepted.spec) == before, "a retry is the same training wherever the alias points"


def test_scenes_that_the_job_does_not_have_are_replayed(home: Home) -> None:
    plan = home.plan(spec())
    assert plan.replayed == ((OLD.digest, home.labels[0]), (BOTH.digest, home.labels[1]))
    assert plan.learned == {"old": OLD.digest, "both": BOTH.digest}
    assert plan.start is not None
    assert plan.start.files
    assert home.plan(spec(NEW, BOTH, UNSEEN)).replayed == ((OLD.digest, home.labels[0]),)
    assert home.plan(spec(replay=False)).replayed == ()


def test_what_was_replayed_once_is_replayed_again_by_the_next(home: Home) -> None:
    plan = home.plan(spec())
    own = home.label("new", plan)
    train = TRAIN.ask(plan, [(NEW.digest, own)], plan.start)
    assert [shard.replayed for shard in trained_on(train.inputs)] == [False, True, True]
    assert [shard.artifact for shard in trained_on(train.inputs)] == list(train.needs) == [own, *home.labels]
    assert train.artifact != TRAIN.ask(home.plan(spec(replay=False)), [(NEW.digest, own)], plan.start).artifact
    home.publish(train, "b", "fresh", **{r.name: r.digest for r in (OLD, BOTH, NEW)})
    assert [artifact for _, artifact in home.plan(spec(UNSEEN, OLD, start="fresh")).replayed] == [own, home.labels[1]]


def test_what_was_learned_cannot_be_held_out(home: Home) -> None:
    uses = [{"scene": NEW.id}, {"scene": OLD.id, "holdout": True}]
    with pytest.raises(Problem, match="The scene old is held out, but") as caught:
        home.accept(spec(scenes=uses, replay=False))
    assert caught.value.code is ExitCode.CHECK_FAILED


@pytest.mark.parametrize("change", [{"tail": "binned-8"}, {"g": 0.5}, {"seed": 1}, {"weights": "flip"}])
def test_labels_of_another_kind_are_refused(home: Home, change: dict[str, Any]) -> None:
    with pytest.raises(Problem, match=f"trained on is labelled otherwise: {next(iter(change))} ") as caught:
        home.accept(spec(**change))
    assert "--no-replay" in caught.value.remedy
    home.accept(spec(**change, replay=False))
    home.accept(spec(OLD, BOTH, UNSEEN, **change))  # nothing is mixed: it has all of the scenes itself


def test_a_data_set_is_compared_by_its_own_settings(home: Home) -> None:
    plan = plan_of_job(spec(), SCENES)
    shard = {"view": "front", "artifact": home.labels[0], "sha256": "0" * 64, "bytes": 1}
    refs = [ShardRef(scene="both", scene_digest="5" * 64, **shard)]  # type: ignore[arg-type]
    fits = home.measured.record_dataset(plan.settings, refs, None).id
    other = home.measured.record_dataset({**plan.settings, "seed": 4}, refs, None).id
    weighted = home.measured.record_dataset({**plan.settings, "weights": "flip"}, refs, None).id
    wanted = spec(kind="train", scenes=[], dataset=fits, seed=9)
    assert [digest for digest, _ in home.plan(wanted).replayed] == [OLD.digest]
    with pytest.raises(Problem, match="seed 0 instead of 4"):
        home.accept(spec(kind="train", scenes=[], dataset=other))
    with pytest.raises(Problem, match="weights none instead of flip"):
        home.accept(spec(kind="train", scenes=[], dataset=weighted))


def test_a_name_without_a_champion_begins_from_scratch_and_says_so(home: Home) -> None:
    accepted = home.accept(spec(start="champion"))
    assert (accepted.spec.start_from, len(accepted.notes)) == ("scratch", 1)
    assert "fresh has no champion yet" in accepted.notes[0]
    assert home.accept(spec(start="champion", name="glass")).spec.start_from == "glass@1.0.0"


@pytest.mark.parametrize("reference", ["none", "glass@1.2.0", "glass@best"])
def test_what_does_not_exist_is_said(home: Home, reference: str) -> None:
    with pytest.raises(Problem) as caught:
        home.accept(spec(start=reference))
    assert caught.value.code is ExitCode.NOT_FOUND


def test_a_version_that_came_as_files_says_what_it_may_forget(home: Home) -> None:
    home.registry.publish("files", make_bundle(home.folder / "files", "f", scenes={"old": OLD.digest, "x": "7"}), 1, {})
    accepted = home.accept(spec(NEW, OLD, UNSEEN, start="files@1.0.0"))
    assert accepted.notes[1] == "No labels of x are known, which files@1.0.0 was trained on: it may forget them."
    assert home.plan(accepted.spec).replayed == ()
    assert len(home.accept(spec(NEW, OLD, UNSEEN, start="files@1.0.0", replay=False)).notes) == 1


def test_labels_that_are_gone_are_named(home: Home) -> None:
    home.store.remove(home.labels[0])
    with pytest.raises(Problem, match=f"{home.labels[0]} is gone") as caught:
        home.accept(spec())
    assert "--no-replay" in caught.value.remedy


def test_retention_leaves_what_a_job_may_replay(home: Home) -> None:
    loose = home.put(Address("label", "v", ("loose",), {}))
    now = max(found.last_used for found in home.store.artifacts()) + 400 * DAY
    sweep(home.database, home.storage, Settings(state=home.folder, keep_days=1.0, keep_bytes=1), now)
    assert not home.store.holds(loose)
    assert len(home.plan(spec()).replayed) == 2


def test_a_job_of_before_has_the_addresses_of_before(home: Home) -> None:
    old = spec(start="champion", name="glass").model_dump(mode="json", exclude={"replay", "patience", "weights"})
    stored = JobSpec.model_validate(old)
    plan = home.plan(stored)
    assert (plan.start, plan.replayed, plan.options.patience, plan.from_champion) == (None, (), 0, True)
    train = TRAIN.ask(plan, [(NEW.digest, home.labels[0])], None)
    assert train.inputs == (f"{NEW.digest}:{home.labels[0].partition('/')[2]}",)
    assert (train.params["patience"], train.params["start"], train.params["replay"]) == (0, None, None)


@pytest.mark.parametrize("kind", ["render", "label", "evaluate"])
def test_what_trains_nothing_begins_with_nothing(kind: str) -> None:
    with pytest.raises(ValueError, match="trains nothing"):
        spec(kind=kind, model="glass")
    assert spec(kind=kind, model="glass", start="champion").begins_with is None, "it was allowed before"


@pytest.mark.parametrize("tail", [tail for tail in TAILS if tail not in BINNED_TAILS])
def test_what_labels_has_a_tail_with_bins(tail: str) -> None:
    for kind in ("build", "label", "train", "evaluate"):
        with pytest.raises(ValueError, match="the tail is one of binned-8, binned-12"):
            spec(kind=kind, model="glass", start="scratch", tail=tail)
    assert spec(kind="render", start="scratch", tail=tail).tail == tail


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"kind": "render"}, "a render makes no rows"),
        ({"kind": "evaluate", "model": "glass"}, "an evaluate makes no rows"),
        ({"kind": "train", "scenes": [], "dataset": "dst_" + "0" * 32}, "the rows of a data set were weighted"),
        ({"weights": "saliency"}, "'none' or 'flip'"),
    ],
)
def test_weights_are_for_jobs_that_label(wanted: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        spec(start="scratch", **{"weights": "flip", **wanted})


@given(
    own=st.dictionaries(st.sampled_from("abc"), st.sampled_from("123")),
    label=st.sampled_from("abc"),
    digest=st.sampled_from("123"),
)
def test_a_scene_is_replayed_unless_its_name_or_its_content_is_there(
    own: dict[str, str], label: str, digest: str
) -> None:
    kept = is_replayed(own, label, digest)
    assert kept == all(name != label and content != digest for name, content in own.items())


def test_the_pipeline_trains_on_old_and_new_and_keeps_both_in_the_provenance(home: Home) -> None:
    runner = TableRunner()
    runner.registry, runner.store, runner.measured.dataset = _registry(home, runner), home.store, home.measured.dataset
    wanted = spec(kind="train", start="glass@1.0.0", patience=3)
    run_job(wanted, SCENES, runner, JobContext("job_0", "2026-01-01T00:00:00+00:00"))  # type: ignore[arg-type]
    (train,), (export,) = runner.of("train"), runner.of("export")
    assert train.needs[-2:] == tuple(home.labels)
    assert train.bundle is not None
    assert train.bundle.digest == home.registry.resolve("glass").digest
    assert train.params["patience"] == 3
    assert set(export.needs) >= {train.artifact, *home.labels}
    assert export.params["scenes"] == {"old": OLD.digest, "both": BOTH.digest, "new": NEW.digest}


def _registry(home: Home, runner: TableRunner) -> Any:
    """The registry, into which nothing can be published."""
    home.store.fetch = runner.store.fetch  # type: ignore[method-assign]
    table, real = runner.registry, home.registry
    reading = {name: getattr(real, name) for name in ("resolve", "record", "made_from", "champion", "versions")}
    return SimpleNamespace(**reading, folder=table.folder, publish=table.publish, consider=table.consider)


def test_the_api_needs_no_trainer_for_it() -> None:
    heavy = "{'torch', 'numba', 'moderngl', 'trainer', 'labeller', 'pxr'} & set(sys.modules)"
    code = f"import sys; import services.acceptance; print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
