"""The main job, whole, on small pictures of the project's own scenes."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path

import pytest

from diaphane.local.build import build
from diaphane.local.options import BuildOptions
from diaphane.local.result import BuildResult
from diaphane.local.state import open_local
from evaluation import summary
from evaluation.progress import PlainProgress, SilentProgress
from labeller.dataset import open_dataset
from renderer.samples import write_samples
from schemas.bundle import load_manifest
from schemas.options import Options
from schemas.problem import Problem
from schemas.tail import DEFAULT_TAIL
from services import steps

TRAIN = ("nested_shells.usda", "torus_knots.usdc")
HELD_OUT = "voxel_town.usdc"


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    write_samples(folder)
    return folder


def options(
    samples: Path, state: Path, scenes: tuple[str, ...] = (*TRAIN, HELD_OUT), **changes: object
) -> BuildOptions:
    usual = Options(budgets=(1.0, 2.0), width=96, height=64, views_per_scene=2, network="tiny", steps=200)
    own = {name: changes.pop(name) for name in Options.model_fields.keys() & changes.keys()}
    settings: dict[str, object] = {
        "scenes": tuple(samples / name for name in scenes),
        "name": "small",
        "options": Options(**{**usual.model_dump(), **own}),
        "holdout": (samples / HELD_OUT,),
        "state": state,
    }
    return BuildOptions(**{**settings, **changes})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def state(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("state")


@pytest.fixture(scope="module")
def built(samples: Path, state: Path) -> BuildResult:
    result = build(options(samples, state), SilentProgress())
    crown(state)
    return result


def crown(state: Path) -> None:
    """Makes the first version the champion by hand: so little training may leave it behind VKB."""
    with open_local(state) as local:
        local.registry.promote("small", "1.0.0", "a test")


def test_build_publishes_a_proven_bundle(built: BuildResult, state: Path) -> None:
    with open_local(state) as local:
        publication = local.registry.resolve("small@champion")
    manifest = load_manifest(Path(built.registry.folder))
    assert publication.score == built.registry.score
    assert built.registry.score is not None
    assert built.registry.champion == (built.registry.score <= 1.0)
    assert manifest.parity.torch_onnx <= 1e-5
    assert manifest.parity.torch_glsl <= 1e-5
    assert set(manifest.provenance.scenes) == {"nested_shells", "torus_knots"}
    assert set(manifest.provenance.holdout) == {"voxel_town"}


def test_held_out_pictures_are_measured_next_to_fixed_vkb_and_oracle(built: BuildResult) -> None:
    assert built.held_out == ("voxel_town",)
    measured = summary.compared(built.measurements)
    assert {m.technique for m in measured} == {"kbuffer", "kbuffer-importance", "kbuffer-deep", "kbuffer-optimal"}
    assert {m.scene for m in measured} == {"voxel_town"}
    for m in measured:
        assert m.cpu_difference is not None
        assert m.cpu_difference <= 1
        assert m.captured_fragments is not None
        assert m.captured_fragments <= m.budget
        if m.technique == "kbuffer-deep":
            assert m.captured_fragments > m.budget - 255, "a predicted budget is met up to one bin of one pixel"


def test_oracle_is_never_worse_than_the_others(built: BuildResult) -> None:
    for technique in ("kbuffer", "kbuffer-importance", "kbuffer-deep"):
        for ratio in summary.ratios(built.measurements, technique, "kbuffer-optimal"):
            assert ratio > 0.98, "the oracle minimises the error before 8-bit rounding, which may add a little"


def test_report_stands_alone(built: BuildResult) -> None:
    html = built.report.read_text(encoding="utf-8")
    assert "voxel_town" in html
    assert 'src="http' not in html
    assert "data:image/webp;base64," in html


def test_the_data_set_can_be_copied_and_read_by_itself(built: BuildResult, state: Path, tmp_path: Path) -> None:
    assert built.dataset == state / "datasets" / "small"
    dataset = open_dataset(Path(shutil.copytree(built.dataset, tmp_path / "elsewhere")))
    assert {entry.asset for entry in dataset.index.shards if entry.split == "held-out"} == {"voxel_town"}
    trained = list(dataset.shards("train"))
    assert {entry.asset for entry, _ in trained} == {"nested_shells", "torus_knots"}
    assert len(trained) == 4
    for entry, shard in trained:
        assert dataset.check(entry).segments == shard.segments > 0
        assert entry.source.camera.name == entry.source.view
        assert (shard.meta.width, shard.meta.height) == (96, 64)


def test_a_shard_that_was_lost_is_there_again_after_the_same_command(
    built: BuildResult, samples: Path, state: Path
) -> None:
    (first, *_) = open_dataset(built.dataset).index.shards
    (built.dataset / first.file).unlink()
    with pytest.raises(Problem, match="is missing"):
        open_dataset(built.dataset)
    assert not build(options(samples, state), SilentProgress()).worked
    open_dataset(built.dataset).check(first)


def test_same_command_again_does_nothing(built: BuildResult, samples: Path, state: Path) -> None:
    again = build(options(samples, state), SilentProgress())
    assert not again.worked
    assert again.registry.reference == built.registry.reference
    assert again.skipped["views already captured"] == 6


def test_an_added_scene_is_the_only_one_rendered_and_labelled(built: BuildResult, samples: Path, state: Path) -> None:
    more = options(samples, state, scenes=(*TRAIN, HELD_OUT, "bottles.usdc"))
    store = state / "store"
    before = {stage: len(list((store / stage).glob("*/*"))) for stage in ("render", "label")}
    result = build(more, SilentProgress())
    after = {stage: len(list((store / stage).glob("*/*"))) for stage in ("render", "label")}
    assert {stage: after[stage] - before[stage] for stage in before} == {"render": 2, "label": 2}
    assert result.skipped["baseline pictures already rendered"] == 2
    assert result.registry.reference == "small@1.1.0"
    assert {entry.asset for entry in open_dataset(result.dataset).index.shards} >= {"bottles", "voxel_town"}


def test_a_champion_of_another_tail_is_measured_with_its_own(samples: Path, tmp_path: Path) -> None:
    small = {"scenes": (TRAIN[0], HELD_OUT), "budgets": (1.0,), "width": 64, "height": 48, "steps": 20}
    first = build(options(samples, tmp_path, tail="binned-8", **small), SilentProgress())  # type: ignore[arg-type]
    crown(tmp_path)
    second = build(options(samples, tmp_path, **small), SilentProgress())  # type: ignore[arg-type]
    assert (first.registry.reference, second.registry.reference) == ("small@1.0.0", "small@1.1.0")
    assert second.registry.reason.endswith("of the champion 1.0.0 on these views.")
    assert {m.tail for m in second.measurements} == {DEFAULT_TAIL}


def test_interrupted_build_continues(samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    wanted = options(samples, tmp_path, scenes=(TRAIN[0], HELD_OUT), steps=50)
    with monkeypatch.context() as patch:
        patch.setattr(steps, "learn", interrupted)
        with pytest.raises(KeyboardInterrupt):
            build(wanted, SilentProgress())
    result = build(wanted, SilentProgress())
    assert result.skipped["views already captured"] == 4
    assert result.skipped["views already labelled"] == 4


def test_budget_beyond_all_fragments_is_exact_and_says_so(samples: Path, tmp_path: Path) -> None:
    result = build(
        options(samples, tmp_path, scenes=(TRAIN[0], HELD_OUT), budgets=(1.0, 1.0000001, 64.0), steps=50),
        SilentProgress(),
    )
    beyond = [m for m in result.measurements if m.budget_factor == 64.0]
    assert beyond
    for m in beyond:
        assert m.exact
        assert m.mse == 0.0
        assert m.skipped is not None
        assert "exact" in m.skipped
    assert result.skipped["budgets that hold all fragments of a view"] == 4
    assert result.skipped["budgets given more than once"] == 4
    assert result.skipped["pixels exact at k = 0"] > 0
    assert "pixels exact at k = 0" in result.report.read_text(encoding="utf-8")


def test_an_opaque_scene_that_is_held_out_by_itself_is_not_scored(samples: Path, tmp_path: Path) -> None:
    solid = tmp_path / "solid.usda"
    solid.write_text('#usda 1.0\n(defaultPrim = "C")\ndef Cube "C" {}\n', encoding="utf-8")
    wanted = BuildOptions(
        scenes=(samples / TRAIN[0], solid),
        name="unscored",
        options=Options(budgets=(1.0,), width=64, height=48, network="tiny", steps=20),
        state=tmp_path / "state",
    )
    assert wanted.holdout == (solid,), "the automatic choice"
    log = io.StringIO()
    result = build(wanted, PlainProgress(log))
    assert "Nothing in solid is transparent" in log.getvalue()
    assert "nothing is scored" in log.getvalue()
    assert result.skipped["opaque scenes"] == 1
    assert result.registry.score is None
    assert {m.scene for m in result.measurements} == {"nested_shells"}
    assert "No scene was held out" in result.report.read_text(encoding="utf-8")


def test_opaque_scene_is_refused_with_the_way_out(tmp_path: Path) -> None:
    scene = tmp_path / "solid.usda"
    scene.write_text('#usda 1.0\n(defaultPrim = "C")\ndef Cube "C" {}\n', encoding="utf-8")
    small = Options(width=64, height=48, network="tiny", steps=20)
    wanted = BuildOptions(scenes=(scene,), name="solid", options=small, state=tmp_path / "state")
    with pytest.raises(Problem, match=r"solid.*--alpha 0\.33"):
        build(wanted, SilentProgress())
    made = build(
        BuildOptions(
            scenes=(scene,),
            name="solid",
            options=Options(**{**small.model_dump(), "budgets": (0.25,), "alpha": 0.33}),
            state=tmp_path / "state",
        ),
        SilentProgress(),
    )
    assert made.held_out == ()
    assert not made.registry.champion, "one scene proves nothing, so nothing is promoted"
    assert json.loads(Path(made.registry.folder, "manifest.json").read_text())["tail"]["name"] == DEFAULT_TAIL


def test_a_copy_of_a_scene_is_refused_since_the_split_is_by_content(samples: Path, tmp_path: Path) -> None:
    copy = tmp_path / "other_name.usdc"
    copy.write_bytes((samples / HELD_OUT).read_bytes())
    wanted = options(samples, tmp_path, scenes=(HELD_OUT,), holdout=())
    with pytest.raises(Problem, match="voxel_town and other_name have the same content"):
        build(
            BuildOptions(scenes=(*wanted.scenes, copy), name="twins", holdout=(copy,), state=tmp_path), SilentProgress()
        )


def test_a_champion_trained_on_a_held_out_scene_is_not_compared_and_stays(
    built: BuildResult, samples: Path, state: Path
) -> None:
    result = build(options(samples, state, holdout=(samples / TRAIN[0],), steps=60), SilentProgress())
    assert not result.registry.champion
    assert "trained on" in result.registry.reason
