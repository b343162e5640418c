"""The registry: versions never change, a bundle is published once, the champion moves only to something better."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from schemas.problem import ExitCode, Problem
from services.registry import Registry, bundle_digest, check_name

EVALUATION = {"scenes": ["a", "b"], "budgets": [1.0, 2.0]}


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "registry")


def make_bundle(folder: Path, weights: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text("{}")
    (folder / "weights.safetensors").write_text(weights)
    return folder


def publish(registry: Registry, tmp_path: Path, weights: str, score: float | None = 0.5) -> str:
    """Publishes and considers a bundle, the champion being measured on the views that it was published with."""
    bundle = make_bundle(tmp_path / f"bundle-{weights}", weights)
    publication = registry.publish("glass", bundle, score, EVALUATION)
    champion = registry.champion("glass")
    registry.consider(publication, score, champion.score if champion else None)
    return publication.version


def test_versions_count_up(registry: Registry, tmp_path: Path) -> None:
    assert [publish(registry, tmp_path, w) for w in "abc"] == ["1.0.0", "1.1.0", "1.2.0"]
    assert [p.version for p in registry.versions("glass")] == ["1.0.0", "1.1.0", "1.2.0"]


def test_versions_are_ordered_as_numbers(registry: Registry, tmp_path: Path) -> None:
    for weights in "abcdefghijkl":
        publish(registry, tmp_path, weights)
    assert registry.versions("glass")[-1].version == "1.11.0"


def test_a_removed_version_is_not_given_out_again(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a")
    publish(registry, tmp_path, "b")
    shutil.rmtree(registry.root / "glass" / "versions" / "1.0.0")
    assert publish(registry, tmp_path, "c") == "1.2.0"


def test_the_same_bundle_is_published_once(registry: Registry, tmp_path: Path) -> None:
    first = registry.publish("glass", make_bundle(tmp_path / "one", "a"), 0.5, EVALUATION)
    again = registry.publish("glass", make_bundle(tmp_path / "two", "a"), 0.7, EVALUATION)
    assert again == first
    assert len(registry.versions("glass")) == 1


def test_concurrent_publishers_get_versions_of_their_own(registry: Registry, tmp_path: Path) -> None:
    bundles = [make_bundle(tmp_path / f"b{i}", str(i // 2)) for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        versions = list(pool.map(lambda b: registry.publish("glass", b, 0.5, EVALUATION).version, bundles))
    assert sorted(set(versions)) == ["1.0.0", "1.1.0", "1.2.0", "1.3.0"]
    assert versions[0::2] == versions[1::2]


def test_the_published_files_are_the_bundles_files(registry: Registry, tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "bundle", "a")
    (bundle / "meta.json").write_text("the store's, not part of the bundle")
    publication = registry.publish("glass", bundle, 0.5, EVALUATION)
    folder = registry.folder(publication)
    assert sorted(p.name for p in folder.iterdir()) == ["manifest.json", "publication.json", "weights.safetensors"]
    assert bundle_digest(folder) == publication.digest


def test_a_folder_without_manifest_is_refused(registry: Registry, tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"no manifest\.json"):
        registry.publish("glass", tmp_path, 0.5, EVALUATION)


def test_the_first_version_becomes_champion(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.9)
    champion = registry.champion("glass")
    assert champion is not None
    assert champion.version == "1.0.0"


@pytest.mark.parametrize(("score", "champion"), [(0.4, "1.1.0"), (0.5, "1.0.0"), (0.6, "1.0.0"), (None, "1.0.0")])
def test_the_champion_moves_only_to_a_lower_score(
    score: float | None, champion: str, registry: Registry, tmp_path: Path
) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publish(registry, tmp_path, "b", score)
    assert registry.resolve("glass@champion").version == champion


def test_a_champion_that_cannot_be_measured_stays(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle", "b"), 0.1, EVALUATION)
    moved, reason = registry.consider(publication, 0.1, None)
    assert not moved
    assert "1.0.0 was trained on a scene of these views, or could not be measured" in reason


def test_a_version_without_score_is_no_champion_even_if_it_is_the_first(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", None)
    assert registry.champion("glass") is None
    with pytest.raises(Problem, match="no version or alias 'champion'"):
        registry.resolve("glass")


def test_considering_the_champion_again_keeps_it_and_its_history(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    assert registry.consider(registry.resolve("glass"), 0.5, None)[0]
    assert len(registry.aliases("glass").history) == 1


def test_promotion_keeps_who_when_and_why(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publish(registry, tmp_path, "b", 0.6)
    registry.promote("glass", "1.1.0", "looks better in motion")
    move = registry.aliases("glass").history[-1]
    assert (move.alias, move.before, move.after) == ("champion", "1.0.0", "1.1.0")
    assert move.why == "looks better in motion"
    assert move.who
    assert move.when


def test_references_resolve__yes(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publish(registry, tmp_path, "b", 0.6)
    references = ("glass", "glass@champion", "glass@1.1.0")
    assert [registry.resolve(r).version for r in references] == ["1.0.0", "1.0.0", "1.1.0"]


@pytest.mark.parametrize("reference", ["other", "glass@2.0.0", "glass@candidate", "glass@../x"])
def test_references_resolve__no(reference: str, registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a")
    with pytest.raises(Problem) as caught:
        registry.resolve(reference)
    assert caught.value.code == ExitCode.NOT_FOUND


def test_names_lists_what_is_published(registry: Registry, tmp_path: Path) -> None:
    assert registry.names() == []
    publish(registry, tmp_path, "a")
    assert registry.names() == ["glass"]


@pytest.mark.parametrize("name", ["glass", "a", "0", "car-2", "a" * 63])
def test_names__yes(name: str) -> None:
    assert check_name(name) == name


@pytest.mark.parametrize(
    "name", ["", "-a", "a-", "A", "a_b", "a/b", "..", "../a", "a@b", "a b", "a\n", "ä", "a" * 64, "\u0661"]
)
def test_names__no(name: str) -> None:
    with pytest.raises(Problem, match="cannot be the name"):
        check_name(name)


def test_an_unreadable_publication_is_a_problem_that_names_it(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a")
    (registry.root / "glass" / "versions" / "1.0.0" / "publication.json").write_text("{}")
    with pytest.raises(Problem, match=r"versions/1\.0\.0 cannot be read"):
        registry.resolve("glass")


@pytest.mark.parametrize("content", ["", "{nope", '{"aliases": 3}'])
def test_damaged_aliases_are_named_with_the_way_out(registry: Registry, tmp_path: Path, content: str) -> None:
    publish(registry, tmp_path, "a")
    (registry.root / "glass" / "aliases.json").write_text(content)
    with pytest.raises(Problem, match=r"aliases\.json.*models promote glass") as caught:
        registry.champion("glass")
    assert caught.value.code == ExitCode.CONFLICT


def test_a_damaged_version_is_written_again_when_its_bundle_is_published_again(
    registry: Registry, tmp_path: Path
) -> None:
    publish(registry, tmp_path, "a")
    published = registry.resolve("glass@1.0.0")
    (registry.folder(published) / "weights.safetensors").write_text("changed")
    assert registry.publish("glass", tmp_path / "bundle-a", 0.5, EVALUATION).version == "1.0.0"
    assert bundle_digest(registry.folder(published)) == published.digest
