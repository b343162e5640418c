from __future__ import annotations

import pytest
from support.api import HASH, measurement, shard

from schemas.problem import Problem
from services.database import open_database
from services.measured import Measured, MeasurementFilter

DIGESTS = {"bottles": HASH, "lamp": "1" * 64}


@pytest.fixture
def measured(database_url: str) -> Measured:
    return Measured(open_database(database_url))


def test_an_artifact_is_recorded_once(measured: Measured) -> None:
    found = [measurement(), measurement(technique="kbuffer-deep")]
    for job in ("job_1", "job_2"):
        measured.record("evaluate/a", found, DIGESTS, "glass@1.0.0", job)
    records = measured.query(MeasurementFilter())
    assert [record.measurement for record in records] == found[::-1]
    assert {(record.job_id, record.model, record.scene_digest) for record in records} == {
        ("job_1", "glass@1.0.0", HASH)
    }
    measured.record("evaluate/b", [], DIGESTS, None, None)


def test_filters_choose(measured: Measured) -> None:
    measured.record("evaluate/a", [measurement(), measurement(budget_factor=2.0)], DIGESTS, "glass@1.0.0", "job_1")
    measured.record("evaluate/b", [measurement(scene="lamp")], DIGESTS, "glass_x@1.0.0", "job_2")
    measured.record("evaluate/c", [measurement(technique="moment")], DIGESTS, None, "job_2")
    everything = measured.query(MeasurementFilter())
    assert len(everything) == 4

    def count(**wanted: object) -> int:
        return len(measured.query(MeasurementFilter.model_validate(wanted)))

    assert count(scene="lamp") == count(scene=DIGESTS["lamp"]) == 1
    assert count(technique="moment") == 1
    assert count(budget=2.0) == 1
    assert count(model="glass") == count(model="glass@1.0.0") == 2
    assert count(model="glas_") == count(model="glass@2.0.0") == 0
    assert count(job="job_2") == 2
    assert count(since=0.0, until=1e10) == 4
    assert count(until=1.0) == count(since=1e10) == 0


def test_pages_do_not_move_while_more_is_recorded(measured: Measured) -> None:
    measured.record("evaluate/a", [measurement(view=str(n)) for n in range(5)], DIGESTS, None, None)
    first = measured.query(MeasurementFilter(), 2)
    measured.record("evaluate/b", [measurement(view="new")], DIGESTS, None, None)
    rest = measured.query(MeasurementFilter(), 10, first[-1].id)
    assert [record.measurement.view for record in [*first, *rest]] == ["4", "3", "2", "1", "0"]


def test_the_same_shards_are_the_same_data_set(measured: Measured) -> None:
    one = measured.record_dataset({"budgets": [1.0]}, [shard(), shard("side")], "job_1")
    again = measured.record_dataset({"budgets": [1.0]}, [shard(), shard("side")], "job_2")
    assert again == one
    assert measured.record_dataset({"budgets": [2.0]}, [shard(), shard("side")], "job_1").id != one.id
    assert measured.dataset(one.id).shards == (shard(), shard("side"))
    newest = measured.datasets(1)
    assert len(newest) == 1
    assert len(measured.datasets()) == 2
    with pytest.raises(Problem, match="no data set"):
        measured.dataset("dst_0")
