"""What a build that begins with a network replays, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.bundles import make_bundle
from support.shards import CODE, random_dataset

from diaphane.local.datasets import write_dataset
from diaphane.local.options import BuildOptions
from diaphane.local.replay import fine_tuning
from evaluation.progress import SilentProgress
from labeller.dataset import open_dataset
from labeller.sampling import Sampling
from schemas.options import Options
from schemas.problem import Problem
from schemas.view import View
from stages.label import Shard
from stages.plan import Plan, PlannedScene
from stages.tasks import Source

NO_REGISTRY: Any = None
"""A bundle in a folder needs none."""


class Heard(SilentProgress):
    """Keeps the notes."""

    def __init__(self) -> None:
        super().__init__()
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


@pytest.fixture
def plan(options: BuildOptions) -> Plan:
    labels = open_dataset(options.state / "datasets" / "glass").index.labels
    scenes = tuple(
        PlannedScene(label, Source(digest=f"digest of {label}"), held_out)
        for label, held_out in (("new", False), ("unseen", True))
    )
    return Plan("fresh", scenes, Options(budgets=(1.0,), width=64, height=48, tail=labels.tail, g=labels.g))


@pytest.fixture
def options(tmp_path: Path) -> BuildOptions:
    (tmp_path / "new.usda").write_text("#usda 1.0\n")
    bundle = make_bundle(tmp_path / "bundle", scenes={"box": "digest of box", "town": "digest of town"})
    dataset = tmp_path / "state" / "datasets" / "glass"  # the bundle's name
    dataset.mkdir(parents=True)
    random_dataset(dataset, fraction=Sampling().fraction)
    return BuildOptions((tmp_path / "new.usda",), "fresh", start=str(bundle), state=tmp_path / "state")


def test_nothing_is_asked_for_and_nothing_changes(plan: Plan, options: BuildOptions) -> None:
    assert fine_tuning(plan, replace(options, start=None), NO_REGISTRY, Heard()) == (plan, None)


def test_training_scenes_of_the_bundles_data_set_are_replayed(plan: Plan, options: BuildOptions) -> None:
    tuned, replay = fine_tuning(plan, options, NO_REGISTRY, Heard())
    assert replay is not None
    assert [entry.asset for entry in replay.entries] == ["box", "box", "town"], "what was held out stays so"
    assert tuned.replay == replay.source
    assert set(replay.source.files) == {entry.file for entry in replay.entries}
    assert tuned.start is not None
    assert tuned.start.folder == options.start
    assert tuned.learned == {"box": "digest of box", "town": "digest of town"}


@pytest.mark.parametrize(("label", "digest"), [("box", "changed"), ("renamed", "digest of box")])
def test_a_scene_of_the_build_takes_the_place_of_the_old_one(
    label: str, digest: str, plan: Plan, options: BuildOptions
) -> None:
    again = replace(plan, scenes=(PlannedScene(label, Source(digest=digest), False), *plan.scenes))
    _, replay = fine_tuning(again, options, NO_REGISTRY, Heard())
    assert replay is not None
    assert [entry.asset for entry in replay.entries] == ["town"]


def test_a_held_out_scene_that_was_learned_is_refused(plan: Plan, options: BuildOptions) -> None:
    known = replace(plan, scenes=(*plan.scenes, PlannedScene("alias", Source(digest="digest of town"), True)))
    with pytest.raises(Problem, match="alias is held out, but"):
        fine_tuning(known, options, NO_REGISTRY, Heard())


@pytest.mark.parametrize("change", [{"tail": "exact-coverage"}, {"g": 0.5}, {"seed": 1}, {"weights": "flip"}])
def test_labels_of_another_kind_are_refused(change: dict[str, Any], plan: Plan, options: BuildOptions) -> None:
    with pytest.raises(Problem, match="labelled otherwise") as caught:
        fine_tuning(plan.with_options(**change), options, NO_REGISTRY, Heard())
    assert "--replay" in caught.value.remedy


def test_it_is_said_when_there_is_nothing_to_replay(plan: Plan, options: BuildOptions, tmp_path: Path) -> None:
    heard = Heard()
    tuned, replay = fine_tuning(plan, replace(options, state=tmp_path / "other"), NO_REGISTRY, heard)
    assert replay is None
    assert tuned.replay is None
    assert tuned.start is not None
    assert "may be forgotten" in heard.notes[-1]


def test_it_is_said_that_a_network_keeps_its_size(plan: Plan, options: BuildOptions) -> None:
    heard = Heard()
    fine_tuning(plan, options, NO_REGISTRY, heard)
    assert any("4 units" in note and "--network" in note for note in heard.notes)


def test_a_missing_data_set_is_refused(plan: Plan, options: BuildOptions, tmp_path: Path) -> None:
    with pytest.raises(Problem, match="no index"):
        fine_tuning(plan, replace(options, replay=tmp_path / "none"), NO_REGISTRY, Heard())


def test_the_new_data_set_holds_what_was_replayed_so_that_the_same_build_finds_it_again(
    plan: Plan, options: BuildOptions, tmp_path: Path
) -> None:
    _, replay = fine_tuning(plan, options, NO_REGISTRY, Heard())
    assert replay is not None
    made = replay.dataset.folder
    written = open_dataset(made).index.shards[2]  # a shard of the same kind stands for the build's own
    camera = View(name="front", eye=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "shard.safetensors").write_bytes((made / written.file).read_bytes())
    view: Any = SimpleNamespace(
        scene=SimpleNamespace(label="new", held_out=False, digest="digest of new"),
        rendered=SimpleNamespace(view=camera),
        task=SimpleNamespace(artifact="", version=CODE),
        facts=SimpleNamespace(shard=Shard(sha256=written.sha256, bytes=0)),
    )
    store: Any = SimpleNamespace(fetch=lambda artifact: tmp_path / "store")
    write_dataset(made, [view], store, replay)  # the folder of the old data set becomes that of the new one
    dataset = open_dataset(made)
    assert [entry.asset for entry in dataset.index.shards] == ["new", "box", "box", "town"]
    for entry in dataset.index.shards:
        dataset.check(entry)
    _, again = fine_tuning(plan, options, NO_REGISTRY, Heard())
    assert again is not None
    assert again.source == replay.source
