"""The registry: versions never change, a bundle is published once, the champion moves only to something better."""

from __future__ import annotations

import json
import multiprocessing
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest
import sqlalchemy as sa
from support.bundles import TOLERANCE, make_bundle

from schemas.bundle import FILES, load_manifest
from schemas.bundle_files import bundle_digest, check_name
from schemas.problem import ExitCode, Problem
from services.database import open_database, tables
from services.registry import CANDIDATE, CHAMPION, PUBLICATION, Registry, open_registry
from services.registry.signing import verify
from services.settings import Settings
from services.storage import MissingBlob, Storage, open_storage

EVALUATION = {"scenes": ["a", "b"], "budgets": [1.0, 2.0]}


def registry_at(state: Path, url: str) -> Registry:
    settings = Settings(state=state, database=url)
    return open_registry(open_database(url), open_storage(settings).blobs, settings)


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return registry_at(tmp_path / "state", f"sqlite:///{tmp_path / 'state' / 'test.sqlite'}")


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
    assert registry.models()[0].latest == "1.11.0"


def test_the_same_bundle_is_published_once(registry: Registry, tmp_path: Path) -> None:
    first = registry.publish("glass", make_bundle(tmp_path / "one", "a"), 0.5, EVALUATION)
    again = registry.publish("glass", make_bundle(tmp_path / "two", "a"), 0.7, EVALUATION)
    assert again == first
    assert len(registry.versions("glass")) == 1
    other = registry.publish("crystal", tmp_path / "one", 0.5, EVALUATION)
    assert (other.name, other.version, other.digest) == ("crystal", "1.0.0", first.digest)


def test_concurrent_publishers_get_versions_of_their_own(database_url: str, tmp_path: Path) -> None:
    registry = registry_at(tmp_path / "state", database_url)
    bundles = [make_bundle(tmp_path / f"b{i}", str(i // 2)) for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        versions = list(pool.map(lambda b: registry.publish("glass", b, 0.5, EVALUATION).version, bundles))
    assert sorted(set(versions)) == ["1.0.0", "1.1.0", "1.2.0", "1.3.0"]
    assert versions[0::2] == versions[1::2]


def _publish_all(state: Path, url: str, bundles: list[Path]) -> None:
    registry = registry_at(state, url)
    for bundle in bundles:
        publication = registry.publish("glass", bundle, 0.5, EVALUATION)
        registry.consider(publication, 0.5, 0.6)


def test_two_processes_publish_every_bundle_once(database_url: str, tmp_path: Path) -> None:
    state = tmp_path / "state"
    registry = registry_at(state, database_url)
    bundles = [make_bundle(tmp_path / f"b{i}", str(i)) for i in range(6)]
    context = multiprocessing.get_context("spawn")
    arguments = ((state, database_url, bundles), (state, database_url, bundles[::-1]))
    processes = [context.Process(target=_publish_all, args=args) for args in arguments]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
        assert process.exitcode == 0
    versions = registry.versions("glass")
    assert [p.version for p in versions] == [f"1.{i}.0" for i in range(6)]
    assert {p.digest for p in versions} == {bundle_digest(bundle) for bundle in bundles}
    assert len(registry.public_keys()) == 1


def test_the_published_files_are_the_bundles_files(registry: Registry, tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "bundle", "a")
    (bundle / "meta.json").write_text("the store's, not part of the bundle")
    (bundle / "facts.json").write_text("the pipeline's")
    publication = registry.publish("glass", bundle, 0.5, EVALUATION)
    folder = registry.folder(publication)
    assert sorted(p.name for p in folder.iterdir()) == sorted(["manifest.json", PUBLICATION, *FILES])
    assert bundle_digest(folder) == publication.digest
    assert load_manifest(folder).name == "glass"
    assert json.loads((folder / PUBLICATION).read_text())["version"] == "1.0.0"


def test_what_one_machine_publishes_another_checks_out(machine: Callable[[str], Storage], tmp_path: Path) -> None:
    database = open_database(f"sqlite:///{tmp_path / 'test.sqlite'}")
    one, two = (
        open_registry(database, machine(name).blobs, Settings(state=tmp_path / f"state-{name}"))
        for name in ("one", "two")
    )
    bundle = make_bundle(tmp_path / "bundle")
    publication = one.publish("glass", bundle, 0.5, EVALUATION)
    assert bundle_digest(two.folder(two.resolve("glass@1.0.0"))) == bundle_digest(bundle)
    assert two.record(publication) == one.record(publication)


def _truncate(folder: Path) -> None:
    (folder / FILES[0]).write_bytes(b"")


def _remove_file(folder: Path) -> None:
    (folder / FILES[0]).unlink()


def _remove_folder(folder: Path) -> None:
    shutil.rmtree(folder)


def _add_file(folder: Path) -> None:
    (folder / "other").write_bytes(b"")


@pytest.mark.parametrize("damage", [_truncate, _remove_file, _remove_folder, _add_file])
def test_a_damaged_checkout_is_written_again(
    damage: Callable[[Path], None], registry: Registry, tmp_path: Path
) -> None:
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle"), 0.5, EVALUATION)
    before = {path.name: path.read_bytes() for path in registry.folder(publication).iterdir()}
    damage(registry.folder(publication))
    after = {path.name: path.read_bytes() for path in registry.folder(publication).iterdir()}
    assert after == before
    assert [path.name for path in registry.folder(publication).parent.iterdir()] == ["1.0.0"]


def test_publishing_again_heals_a_version_whose_files_are_lost(registry: Registry, tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "bundle")
    publication = registry.publish("glass", bundle, 0.5, EVALUATION)
    shutil.rmtree(tmp_path / "state" / "store" / "blobs")
    with pytest.raises(MissingBlob, match="publish the same bundle again"):
        registry.folder(publication)
    assert registry.publish("glass", bundle, 0.5, EVALUATION) == publication
    assert load_manifest(registry.folder(publication)).name == "glass"


def test_a_folder_without_manifest_is_refused(registry: Registry, tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"no manifest\.json"):
        registry.publish("glass", tmp_path, 0.5, EVALUATION)
    assert registry.names() == []


def test_a_bundle_that_does_not_match_its_manifest_is_refused(registry: Registry, tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "bundle")
    (bundle / FILES[0]).write_text("other weights")
    with pytest.raises(Problem, match="not the file that the manifest lists"):
        registry.publish("glass", bundle, 0.5, EVALUATION)
    assert registry.names() == []


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
    assert (CANDIDATE in registry.aliases("glass").aliases) == (champion == "1.0.0")


def test_what_is_not_promoted_is_the_candidate(registry: Registry, tmp_path: Path) -> None:
    for weights, score in (("a", 0.5), ("b", 0.6), ("c", 0.7)):
        publish(registry, tmp_path, weights, score)
    assert registry.aliases("glass").aliases == {"champion": "1.0.0", "candidate": "1.2.0"}


@pytest.mark.parametrize(("score", "expected"), [(1.0, CHAMPION), (1.01, CANDIDATE)])
def test_a_first_version_that_is_worse_than_vkb_is_no_champion(
    registry: Registry, tmp_path: Path, score: float, expected: str
) -> None:
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle"), score, EVALUATION)
    promoted, reason = registry.consider(publication, score, None)
    assert registry.aliases("glass").aliases == {expected: "1.0.0"}
    assert ("worse than VKB" in reason) is not promoted


def test_a_better_version_stays_a_candidate_where_that_was_asked(registry: Registry, tmp_path: Path) -> None:
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle"), 0.1, EVALUATION)
    promoted, reason = registry.consider(publication, 0.1, None, promote=False)
    assert not promoted
    assert "as was asked" in reason
    assert registry.aliases("glass").aliases == {"candidate": "1.0.0"}


def test_a_version_whose_forms_do_not_agree_is_not_promoted(registry: Registry, tmp_path: Path) -> None:
    for parity, expected in ((TOLERANCE * 1.01, False), (TOLERANCE, True)):
        bundle = make_bundle(tmp_path / str(parity), parity=parity)
        publication = registry.publish("glass", bundle, 0.1, EVALUATION)
        promoted, reason = registry.consider(publication, 0.1, None)
        assert promoted is expected
        assert ("do not agree" in reason) is not expected


def test_a_champion_that_cannot_be_measured_stays(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle", "b"), 0.1, EVALUATION)
    moved, reason = registry.consider(publication, 0.1, None)
    assert not moved
    assert "1.0.0 was trained on a scene of these views, or could not be measured" in reason


def test_a_champion_that_moved_while_it_was_compared_is_not_replaced(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for weights, score in (("a", 0.5), ("b", 0.4)):
        publish(registry, tmp_path, weights, score)
    stale = registry.resolve("glass@1.0.0")
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle", "c"), 0.45, EVALUATION)
    monkeypatch.setattr(registry, "champion", lambda _: stale)
    promoted, reason = registry.consider(publication, 0.45, 0.5)
    assert not promoted
    assert "moved to 1.1.0 meanwhile" in reason
    assert registry.aliases("glass").aliases == {"champion": "1.1.0", "candidate": "1.2.0"}


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
    registry.promote("glass", "1.1.0", "again")
    move = registry.aliases("glass").history[-1]
    assert (move.alias, move.before, move.after) == ("champion", "1.0.0", "1.1.0")
    assert move.why == "looks better in motion"
    assert move.who
    assert move.when
    registry.promote("glass", "1.0.0", "back", who="key_0123456789ab")
    assert registry.moves("glass")[-1].who == "key_0123456789ab"


def test_rolling_back_goes_back_step_by_step_and_never_forth(registry: Registry, tmp_path: Path) -> None:
    for weights in "abcd":
        registry.publish("glass", make_bundle(tmp_path / weights, weights), 0.5, EVALUATION)
    for version in ("1.0.0", "1.1.0", "1.3.0"):
        registry.promote("glass", version, "better")
    assert registry.rollback("glass", "flickers", who="key_1").version == "1.1.0"
    assert registry.champion("glass") == registry.resolve("glass@1.1.0")
    registry.promote("glass", "1.2.0", "fixed")
    assert [registry.rollback("glass", "flickers").version for _ in range(2)] == ["1.1.0", "1.0.0"]
    with pytest.raises(Problem, match=r"no version before 1\.0\.0 to go back to") as caught:
        registry.rollback("glass", "flickers")
    assert caught.value.code == ExitCode.CONFLICT
    assert [move.after for move in registry.moves("glass")] == [f"1.{minor}.0" for minor in (0, 1, 3, 1, 2, 1, 0)]


def test_concurrent_rollbacks_go_back_once(database_url: str, tmp_path: Path) -> None:
    registry = registry_at(tmp_path / "state", database_url)
    for weights in "abc":
        registry.publish("glass", make_bundle(tmp_path / weights, weights), 0.5, EVALUATION)
    for version in ("1.0.0", "1.1.0", "1.2.0"):
        registry.promote("glass", version, "better")

    def roll_back(_: int) -> None:
        with suppress(Problem):  # the other one was faster
            registry.rollback("glass", "flickers")

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(roll_back, range(2)))
    moves = registry.moves("glass")
    assert [move.before for move in moves[1:]] == [move.after for move in moves[:-1]]
    assert registry.aliases("glass").aliases["champion"] == moves[-1].after


def test_an_alias_that_is_not_there_cannot_be_rolled_back(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a")
    with pytest.raises(Problem) as caught:
        registry.rollback("glass", "why", alias="staging")
    assert caught.value.code == ExitCode.NOT_FOUND
    with pytest.raises(Problem, match="cannot be the name"):
        registry.promote("glass", "1.0.0", "why", alias="../champion")


def test_references_resolve__yes(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    publish(registry, tmp_path, "b", 0.6)
    references = ("glass", "glass@champion", "glass@1.1.0", "glass@candidate")
    assert [registry.resolve(r).version for r in references] == ["1.0.0", "1.0.0", "1.1.0", "1.1.0"]


@pytest.mark.parametrize("reference", ["other", "glass@2.0.0", "glass@candidate", "glass@../x"])
def test_references_resolve__no(reference: str, registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a")
    with pytest.raises(Problem) as caught:
        registry.resolve(reference)
    assert caught.value.code == ExitCode.NOT_FOUND


def test_names_lists_what_is_published(registry: Registry, tmp_path: Path) -> None:
    assert registry.names() == []
    assert registry.models() == []
    publish(registry, tmp_path, "a")
    registry.publish("crystal", tmp_path / "bundle-a", None, EVALUATION)
    assert registry.names() == ["crystal", "glass"]
    assert [model.model_dump() for model in registry.models()] == [
        {"name": "crystal", "latest": "1.0.0", "aliases": {}, "versions": 1},
        {"name": "glass", "latest": "1.0.0", "aliases": {"champion": "1.0.0"}, "versions": 1},
    ]


def test_a_record_is_signed_and_says_all(database_url: str, tmp_path: Path) -> None:
    registry = registry_at(tmp_path / "state", database_url)
    bundle = make_bundle(tmp_path / "bundle")
    publication = registry.publish(
        "glass", bundle, 0.5, EVALUATION, artifacts=[f"train/{'0' * 64}"], job_id="job_" + "0" * 24
    )
    registry.promote("glass", "1.0.0", "first")
    record = registry.record(publication)
    assert (record.aliases, record.job_id, record.evaluation) == (("champion",), "job_" + "0" * 24, EVALUATION)
    assert record.parity["tolerance"] == TOLERANCE
    assert record.provenance["scenes"] == {"bottles": "0" * 64}
    statement = json.loads(record.statement)
    assert statement == {
        "format": "diaphane-release/1",
        "name": "glass",
        "version": "1.0.0",
        "digest": publication.digest,
        "created": publication.created,
        "files": {name: file.model_dump() for name, file in record.files.items()},
    }
    assert record.public_key in registry.public_keys()
    assert verify(record.public_key, record.statement, record.signature)
    assert not verify(record.public_key, record.statement.replace("1.0.0", "1.0.1"), record.signature)
    assert not verify(record.public_key, record.statement, "AAAA")
    assert not verify("no base64", record.statement, record.signature)


def test_records_of_several_versions_are_those_of_each(registry: Registry, tmp_path: Path) -> None:
    for weights in "abc":
        publish(registry, tmp_path, weights)
    registry.promote("glass", "1.2.0", "a trial", alias="trial")
    chosen = [registry.resolve(f"glass@{version}") for version in ("1.2.0", "1.0.0")]
    records = registry.records("glass", chosen)
    assert records == [registry.record(publication) for publication in chosen]
    assert [record.aliases for record in records] == [(CANDIDATE, "trial"), (CHAMPION,)]
    assert registry.records("glass", []) == []


def test_a_version_never_changes(registry: Registry, tmp_path: Path) -> None:
    publish(registry, tmp_path, "a", 0.5)
    before = _rows(tmp_path)
    publish(registry, tmp_path, "b", 0.4)
    registry.publish("glass", tmp_path / "bundle-a", 0.1, {}, artifacts=["render/" + "1" * 64], job_id="other")
    registry.rollback("glass", "back")
    registry.promote("glass", "1.1.0", "forth")
    assert _rows(tmp_path)[:1] == before


def _rows(tmp_path: Path) -> list[tuple[object, ...]]:
    with open_database(f"sqlite:///{tmp_path / 'state' / 'test.sqlite'}").read() as connection:
        return [tuple(row) for row in connection.execute(sa.select(tables.versions))]


def test_names_are_checked_without_a_database_or_an_object_store() -> None:
    code = "import sys, services.registry as r; r.CHAMPION; print({'sqlalchemy', 'obstore'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("name", ["glass", "a", "0", "car-2", "a" * 63])
def test_names__yes(name: str) -> None:
    assert check_name(name) == name


@pytest.mark.parametrize(
    "name", ["", "-a", "a-", "A", "a_b", "a/b", "..", "../a", "a@b", "a b", "a\n", "ä", "a" * 64, "\u0661"]
)
def test_names__no(name: str) -> None:
    with pytest.raises(Problem, match="cannot be the name"):
        check_name(name)
