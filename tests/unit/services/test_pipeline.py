"""The order of the stages, and what becomes of what fails, over a runner that answers from a table."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import pytest
from support.bundles import make_bundle
from support.runner import TableRunner, scene

from schemas.job import JobSpec
from schemas.problem import Problem
from services.engine.progress import STAGES_OF
from services.pipeline import JobContext, run_job
from stages.catalogue import STAGES
from stages.tasks import StageName, Task

SCENES = {record.id: record for record in (scene(1, "bottles"), scene(2, "knots"), scene(3, "town"))}
JOB = JobContext(id="job_0", created="2026-01-01T00:00:00+00:00")


def spec(kind: str = "build", **changes: Any) -> JobSpec:
    uses = [{"scene": key, "holdout": record.name == "town"} for key, record in SCENES.items()]
    return JobSpec.model_validate(
        {"kind": kind, "name": "glass", "scenes": uses, "width": 16, "height": 16, "budgets": [1.0], **changes}
    )


def run(runner: TableRunner, wanted: JobSpec) -> dict[str, Any]:
    return run_job(wanted, SCENES, runner, JOB)  # type: ignore[arg-type]


def test_a_build_goes_through_every_stage_once_and_publishes_what_it_measured() -> None:
    runner = TableRunner()
    result = run(runner, spec())
    assert runner.stages() == ["scene", "render", "label", "train", "export", "evaluate", "report"]
    assert [len(runner.of(stage)) for stage in runner.stages()] == [3, 6, 6, 1, 1, 4, 1]
    assert result["reference"] == "glass@1.0.0"
    assert result["score"] == pytest.approx(0.5), "1e-5 of the bundle over 2e-5 of VKB"
    assert result["per_scene"] == {"town": {"score": pytest.approx(0.5), "rival": None}}
    (published,) = runner.published
    assert published["job_id"] == "job_0"
    assert published["artifacts"][0] == runner.of("export")[0].artifact
    assert {need.partition("/")[0] for need in published["artifacts"][1:]} == {"train", "label"}


def test_stages_come_after_what_their_tasks_need() -> None:
    runner = TableRunner()
    run(runner, spec())
    assert list(STAGES) == runner.stages() == list(get_args(StageName)) == list(STAGES_OF["build"])
    needed = {(task.stage, need.partition("/")[0]) for task in runner.asked for need in task.needs}
    direct = {(stage, before) for stage in STAGES for before in STAGES[stage].after}
    # Views of a scene are facts that a capture is asked for with, and no artifact that it reads.
    assert direct - {("render", "scene")} <= needed
    with pytest.raises(ValueError, match="the stage label does not come after train"):
        Task(name="early", stage="label", version="1", needs=("train/" + "0" * 64,))


def test_held_out_views_are_not_trained_on() -> None:
    runner = TableRunner()
    run(runner, spec())
    (train,) = runner.of("train")
    held_out = {task.artifact for task in runner.of("label") if task.name.startswith("town")}
    assert len(train.needs) == 4
    assert not held_out & set(train.needs)
    assert {shard.scene for shard in runner.shards} == {"bottles", "knots"}
    assert {task.name.split()[0] for task in runner.of("evaluate")} == {"town"}


@pytest.mark.parametrize(
    ("kind", "stages"),
    [
        ("render", ["scene", "render"]),
        ("label", ["scene", "render", "label"]),
        ("train", ["scene", "render", "label", "train", "export"]),
        ("evaluate", ["scene", "render", "label", "evaluate"]),
    ],
)
def test_a_part_of_the_job_ends_where_its_kind_says(kind: str, stages: list[str]) -> None:
    champion = SimpleNamespace(name="glass", version="1.0.0", digest="c" * 64, files={})
    runner = TableRunner(champion)
    result = run(runner, spec(kind, **({"model": "glass"} if kind == "evaluate" else {})))
    assert runner.stages() == stages
    if kind == "train":
        assert runner.published[0]["score"] is None
        assert runner.considered == [(None, None, False)], "what was not measured is never promoted"
    if kind == "evaluate":
        assert result["score"] == pytest.approx(1.5)
        assert set(result["per_scene"]) == set(result["advice"]) == {"bottles", "knots", "town"}


def test_an_evaluation_without_a_model_measures_the_rest_and_advises() -> None:
    runner = TableRunner()
    result = run(runner, spec("evaluate"))
    assert {task.name.split()[-1] for task in runner.of("evaluate")} == {"baseline"}
    assert (result["reference"], result["score"]) == (None, None)
    assert all("S-buffer" in " ".join(result["advice"][label]) for label in ("bottles", "knots", "town"))


def test_a_view_that_fails_to_the_end_is_left_out_and_the_rest_goes_on() -> None:
    runner = TableRunner(
        fails=[("render", "knots view1"), ("label", "bottles view0"), ("evaluate", "town view0 bundle")]
    )
    run(runner, spec())
    assert len(runner.of("label")) == 5
    assert len(runner.of("train")[0].needs) == 2, "knots view0 and bottles view1"
    assert [count for _, count, model in runner.recorded if model] == [1], "the view with both pictures"


def test_a_training_without_a_champion_to_start_from_says_so() -> None:
    runner = TableRunner()
    said: list[str] = []
    runner.progress.note = said.append  # type: ignore[method-assign]
    run(runner, spec(start_from="champion"))
    assert runner.of("train")[0].bundle is None
    assert any("no champion yet" in text for text in said)


def test_a_stage_that_fails_everywhere_ends_the_job_with_what_to_do() -> None:
    runner = TableRunner(fails=[("train", "glass")])
    with pytest.raises(Problem, match="train failed for its 1 task") as caught:
        run(runner, spec())
    assert "retry" in caught.value.remedy


def test_views_without_fragments_and_opaque_scenes_are_skipped_and_counted() -> None:
    runner = TableRunner()
    runner.empty = {"knots view0"}
    runner.opaque = {"bottles"}
    run(runner, spec())
    assert runner.progress.skips["opaque scenes"] == 1
    assert runner.progress.skips["views without a transparent pixel"] == 1
    assert [task.name for task in runner.of("label")] == ["knots view1", "town view0", "town view1"]


def test_what_a_picture_lacks_is_said_of_each_scene_in_a_few_lines() -> None:
    runner = TableRunner()
    runner.warnings = {"town": [f"reason {i}: /P" for i in range(9)], "knots": ["lights are not used: /Sun"]}
    said: list[str] = []
    runner.progress.note = said.append  # type: ignore[method-assign]
    run(runner, spec())
    assert [line for line in said if "knots" in line] == ["warning: knots: lights are not used: /Sun"]
    town = [line for line in said if "town" in line]
    assert town[:-1] == [f"warning: town: reason {i}: /P" for i in range(6)]
    assert town[-1] == "warning: town: and 3 more", "the files of a job are not on this machine"


@pytest.mark.parametrize("how", ["opaque", "empty"])
def test_a_held_out_scene_with_nothing_transparent_is_not_scored_and_that_is_said(how: str) -> None:
    runner = TableRunner()
    runner.opaque = {"town"} if how == "opaque" else set()
    runner.empty = {"town view0", "town view1"} if how == "empty" else set()
    said: list[str] = []
    runner.progress.note = said.append  # type: ignore[method-assign]
    result = run(runner, spec())
    assert {task.name.split()[0] for task in runner.of("label")} == {"bottles", "knots"}, "no curve work for it"
    assert result["score"] is None
    assert result["per_scene"] == {}
    assert runner.published[0]["score"] is None
    (note,) = said
    assert "town" in note
    assert "no scene remains that was held out: nothing is scored" in note
    skipped = {"opaque": "opaque scenes", "empty": "views without a transparent pixel"}[how]
    assert runner.progress.skips[skipped] == {"opaque": 1, "empty": 2}[how]


def test_one_held_out_scene_of_two_without_a_transparent_view_leaves_the_other_scored() -> None:
    runner = TableRunner()
    runner.empty = {"town view0", "town view1"}
    said: list[str] = []
    runner.progress.note = said.append  # type: ignore[method-assign]
    uses = [{"scene": key, "holdout": record.name != "bottles"} for key, record in SCENES.items()]
    result = run(runner, spec(scenes=uses))
    assert result["score"] == pytest.approx(0.5)
    assert set(result["per_scene"]) == {"knots"}
    assert len(said) == 1
    assert "nothing is scored" not in said[0]


def test_budgets_that_were_not_given_follow_from_the_held_out_views_and_are_in_the_keys() -> None:
    runner = TableRunner()
    runner.totals = {"town view0": 600, "town view1": 100, "bottles view0": 25_000}
    said: list[str] = []
    runner.progress.note = said.append  # type: ignore[method-assign]
    run(runner, spec(budgets=None))
    assert said == [
        "Budgets 0.05, 0.125, 0.25, 0.5, 1 (x width x height), because the 2 views to measure hold 0.39 to 2.3 "
        "transparent fragments per pixel: a budget decides something where it holds up to 75% of a view's fragments. "
        "--budgets gives others."
    ]
    factors = [0.05, 0.125, 0.25, 0.5, 1.0]
    budgets = [int(factor * 256) for factor in factors]
    assert all(task.params["budgets"] == budgets for task in (*runner.of("label"), *runner.of("evaluate")))
    assert all(task.params["factors"] == factors for task in runner.of("evaluate"))
    assert runner.of("export")[0].params["settings"]["budgets"] == factors
    assert runner.published[0]["evaluation"]["budgets"] == budgets
    given = TableRunner()
    run(given, spec(budgets=factors))
    assert [task.address for task in given.of("label")] == [task.address for task in runner.of("label")]


@pytest.mark.parametrize(
    ("total", "budgets", "why", "remedy"),
    [
        (
            600,
            [3.0, 4.0],
            "Even the smallest budget, 3, holds all fragments, as the 6 captured views have 2.3 per pixel",
            "Give smaller budgets, --budgets 0.25,0.5,1, or render",
        ),
        (10, None, "The budget 0.05 holds all fragments, as the 6 captured views have 0.039 per pixel", "Render these"),
    ],
)
def test_a_build_whose_budgets_hold_everything_ends_before_its_labels(
    total: int, budgets: list[float] | None, why: str, remedy: str
) -> None:
    runner = TableRunner()
    runner.totals = {f"{record.name} view{view}": total for record in SCENES.values() for view in range(2)}
    with pytest.raises(Problem) as caught:
        run(runner, spec(budgets=budgets))
    assert caught.value.title.startswith(why)
    assert caught.value.remedy.startswith(remedy)
    assert runner.stages() == ["scene", "render"]
    assert not runner.published


def test_budgets_that_hold_all_held_out_views_are_said_before_the_training() -> None:
    runner = TableRunner()
    runner.totals = {"town view0": 600, "town view1": 100}
    said: list[str] = []

    def note(text: str) -> None:
        assert runner.stages() == ["scene", "render"]
        said.append(text)

    runner.progress.note = note  # type: ignore[method-assign]
    run(runner, spec(budgets=[3.0]))
    assert len(said) == 1
    assert "Nothing will be scored. Give smaller budgets, --budgets 0.05,0.125,0.25,0.5,1, or" in said[0]


def test_labels_alone_may_hold_everything() -> None:
    runner = TableRunner()
    result = run(runner, spec("label", name=None, budgets=[64.0]))
    assert len(result["views"]) == 6


def test_a_version_has_a_card_with_the_licences_of_what_it_learned_and_what_was_measured() -> None:
    runner = TableRunner()
    runner.licences = {"bottles": "CC-BY-NC-4.0; Jane", "town": "CC0"}
    run(runner, spec())
    provenance = runner.of("export")[0].params
    assert provenance["licences"] == {"bottles": "CC-BY-NC-4.0; Jane", "town": "CC0"}
    (card,) = runner.cards
    assert (
        "NOT CLEARED: 1 of 2 training scenes forbid it by their licence (bottles); 1 of 2 training scenes have" in card
    )
    assert "| bottles | CC-BY-NC-4.0; Jane | forbidden |" in card
    assert "| knots | unknown: none is stated | unknown |" in card
    assert "2 views of 1 scene that it was not trained on" in card
    assert "| 1 | 2 | 1.00 | 0.500 | 10.0 |" in card
    assert "In none of 2 cells" in card
    assert "diaphane build bottles.usdc knots.usdc town.usdc --name glass --holdout town.usdc --budgets 1" in card
    given = TableRunner()
    given.licences = runner.licences
    uses = [{"scene": key, "holdout": record.name == "town", "licence": "MIT"} for key, record in SCENES.items()]
    run(given, spec(scenes=uses))
    assert "Commercial use is allowed by the licences of all 2 training scenes." in given.cards[0]
    assert [task.address for task in given.of("train")] == [task.address for task in runner.of("train")]
    assert [t.address for t in given.of("evaluate")] == [t.address for t in runner.of("evaluate")]


def test_a_version_that_was_not_measured_says_so_on_its_card() -> None:
    runner = TableRunner()
    run(runner, spec("train"))
    assert "no claim about its error is founded" in runner.cards[0]


def test_licences_of_a_data_set_are_those_of_its_scenes() -> None:
    runner = TableRunner()
    runner.licences = {"bottles": "CC0"}
    run(runner, spec("label", name=None))
    (bottles,) = (record for record in SCENES.values() if record.name == "bottles")
    assert runner.settings["licences"] == {bottles.digest: "CC0"}


def test_what_took_no_part_in_the_labels_is_counted_over_all_views() -> None:
    runner = TableRunner()
    run(runner, spec())
    assert runner.progress.skips["pixels exact at k = 0"] == 3 * 6
    assert "budgets given more than once" not in runner.progress.skips, "what did not occur is not mentioned"


@pytest.mark.parametrize("opaque", [{"bottles", "knots"}, {"bottles", "knots", "town"}])
def test_only_opaque_scenes_to_train_on_are_a_problem(opaque: set[str]) -> None:
    runner = TableRunner()
    runner.opaque = opaque
    with pytest.raises(Problem, match=r"Nothing in bottles, knots.* is transparent"):
        run(runner, spec())


def test_nothing_transparent_to_train_on_is_a_problem() -> None:
    runner = TableRunner()
    runner.empty = {f"{name} view{i}" for name in ("bottles", "knots") for i in range(2)}
    with pytest.raises(Problem, match="nothing to train on"):
        run(runner, spec())


def _champion(trained_on: str, tmp_path: Path) -> Any:
    folder = make_bundle(tmp_path / "champion", scenes={"some": trained_on})
    return SimpleNamespace(name="glass", version="1.0.0", digest="c" * 64, files={}, folder=folder)


def test_the_champion_is_measured_on_the_same_views(tmp_path: Path) -> None:
    runner = TableRunner(_champion("9" * 64, tmp_path))
    result = run(runner, spec())
    assert len(runner.of("evaluate")) == 6
    assert result["rival_score"] == pytest.approx(1.5)
    assert runner.considered == [(pytest.approx(0.5), pytest.approx(1.5), True)]


def test_a_champion_that_was_trained_on_a_held_out_scene_is_not_compared(tmp_path: Path) -> None:
    town = next(record for record in SCENES.values() if record.name == "town")
    runner = TableRunner(_champion(town.digest, tmp_path))
    assert run(runner, spec())["rival_score"] is None
    assert runner.considered == [(pytest.approx(0.5), None, True)]


def test_fine_tuning_is_another_training_than_one_from_scratch(tmp_path: Path) -> None:
    champion = _champion("9" * 64, tmp_path)
    scratch, tuned = TableRunner(champion), TableRunner(champion)
    run(scratch, spec())
    run(tuned, spec(start_from="champion", promote="never"))
    assert scratch.of("train")[0].bundle is None
    assert tuned.of("train")[0].bundle is not None
    assert scratch.of("train")[0].artifact != tuned.of("train")[0].artifact
    assert tuned.considered[0][2] is False


def test_a_data_set_is_trained_on_with_the_settings_it_was_made_with() -> None:
    runner = TableRunner()
    wanted = JobSpec(kind="train", name="glass", dataset="dst_" + "0" * 32, seed=7)
    run_job(wanted, {}, runner, JOB)  # type: ignore[arg-type]
    assert runner.stages() == ["train", "export"]
    assert runner.of("train")[0].needs == ("label/abc",)
    assert runner.of("export")[0].params["settings"]["size"] == [32, 16]
    assert runner.of("train")[0].params["seed"] == 7


def test_weights_of_a_job_are_in_the_keys_of_its_labels_and_in_its_bundle() -> None:
    usual, named, weighted = TableRunner(), TableRunner(), TableRunner()
    for runner, more in ((usual, {}), (named, {"weights": "none"}), (weighted, {"weights": "flip"})):
        run(runner, spec(**more))
    assert {task.params["weights"] for task in weighted.of("label")} == {"flip"}
    assert weighted.of("export")[0].params["settings"]["weights"] == "flip"
    assert weighted.of("render") == usual.of("render")
    for stage in ("label", "train", "export"):
        assert named.of(stage) == usual.of(stage), "artifacts from before are still found"
        assert not {task.artifact for task in weighted.of(stage)} & {task.artifact for task in usual.of(stage)}


def test_what_does_not_change_a_picture_does_not_change_its_address() -> None:
    one, other = TableRunner(), TableRunner()
    run(one, spec())
    run(other, spec(budgets=[1.0, 2.0], steps=7, name="other"))
    for stage in ("scene", "render"):
        assert [task.artifact for task in one.of(stage)] == [task.artifact for task in other.of(stage)]
    assert one.of("label")[0].artifact != other.of("label")[0].artifact


def test_the_reading_of_glass_reaches_every_task_that_loads_a_scene_and_the_bundle() -> None:
    usual, plain = TableRunner(), TableRunner()
    run(usual, spec())
    run(plain, spec(glass="plain"))
    for runner, wanted in ((usual, "fresnel"), (plain, "plain")):
        read = [task for stage in ("scene", "render", "evaluate") for task in runner.of(stage)]
        assert {task.params["glass"] for task in read} == {wanted}
        assert [task.params["settings"]["glass"] for task in runner.of("export")] == [wanted]
