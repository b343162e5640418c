"""What a key with `submit` may ask for, so that others are served as well."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from support.api import SCENE, Api, build_spec
from support.dashboard import Visitor

from schemas.job import JobSpec
from schemas.service import JobBounds
from services.api.bounds import USUAL_STEPS, pixels_of
from trainer.config import SIZES, TrainConfig

VIEW = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 45}


@pytest.fixture
def api(tmp_path: Path) -> Api:
    return Api(tmp_path, job_pixels=3 * 1430 * 960, job_steps=20_000, jobs=2)


def _key(api: Api, *scopes: Any, **bounds: int) -> dict[str, str]:
    return {"Authorization": f"Bearer {api.service.keys.create('a key', scopes, None, JobBounds(**bounds))[1]}"}


def _submit(api: Api, headers: dict[str, str], **more: Any) -> Any:
    return api.post("/v1/jobs", None, headers=headers, json=build_spec(api.scene(), **more))


def test_only_an_administrator_is_served_before_all_others(api: Api) -> None:
    for scopes in (["submit"], ["submit", "publish"]):
        refused = _submit(api, _key(api, *scopes), priority="high")
        assert (refused.status_code, refused.json()["type"]) == (403, "/v1/problems/forbidden")
        assert _submit(api, _key(api, *scopes), priority="low").status_code == 202
    assert _submit(api, api.headers("admin"), priority="high").status_code == 202


@pytest.mark.parametrize("change", ["cancel", "retry"])
def test_a_job_is_changed_by_its_own_key_or_an_administrator(api: Api, change: str) -> None:
    job = api.job()
    api.move(job, "failed" if change == "retry" else "queued")
    refused = api.post(f"/v1/jobs/{job}/{change}", None, headers=_key(api, "submit", "publish"))
    assert (refused.status_code, refused.json()["type"]) == (403, "/v1/problems/not-own")
    assert api.post(f"/v1/jobs/{job}/{change}", "admin").status_code == 200
    api.move(job, "failed" if change == "retry" else "queued")
    assert api.post(f"/v1/jobs/{job}/{change}", "submit").status_code == 200


def test_the_dashboard_offers_and_does_the_same(api: Api) -> None:
    job = api.job()
    own, other = Visitor(api, "submit"), Visitor(api, None)
    other.sign_in(api.service.keys.create("other", ["submit"])[1])
    assert 'id="cancel"' not in other.get(f"/jobs/{job}").text
    refused = other.post(f"/jobs/{job}/cancel")
    assert refused.status_code == 403
    assert "belongs to another key" in refused.text
    assert 'id="cancel"' in own.get(f"/jobs/{job}").text
    assert own.post(f"/jobs/{job}/cancel").status_code == 303


def test_an_upload_is_changed_by_its_own_key_or_an_administrator(api: Api) -> None:
    upload = api.post("/v1/uploads", json={"sha256": "1" * 64, "bytes": 100}).json()["id"]
    part = {"Upload-Offset": "0", "Content-Type": "application/octet-stream"}
    for method, more in (("PATCH", {"content": b"x"}), ("DELETE", {})):
        refused = api.request(method, f"/v1/uploads/{upload}", None, headers=_key(api, "submit") | part, **more)
        assert (refused.status_code, refused.json()["type"]) == (403, "/v1/problems/not-own")
    assert api.request("DELETE", f"/v1/uploads/{upload}", "admin").status_code == 204


def test_a_job_is_no_larger_than_its_key_may_submit(api: Api) -> None:
    assert _submit(api, _key(api, "submit")).status_code == 202
    for more in ({"views_per_scene": 4}, {"width": 1431}, {"steps": 20_001}):
        refused = _submit(api, _key(api, "submit"), **more)
        assert (refused.status_code, refused.json()["type"]) == (413, "/v1/problems/too-large")
        assert "administrator" in refused.json()["remedy"]
        assert _submit(api, api.headers("admin"), **more).status_code == 202
    views = [{"scene": api.scene(), "views": [VIEW] * 4}]
    assert _submit(api, _key(api, "submit"), scenes=views).status_code == 413


@pytest.mark.parametrize("scope", ["submit", "admin"])
def test_an_administrator_sets_the_bounds_of_a_key(api: Api, scope: str) -> None:
    bounds = {"job_pixels": 1430 * 960, "job_steps": 1000, "jobs": 1}
    made = api.post("/v1/keys", "admin", json={"name": "ci", "scopes": [scope], "bounds": bounds}).json()
    assert made["key"]["bounds"] == bounds
    headers = {"Authorization": f"Bearer {made['secret']}"}
    small = {"views_per_scene": 1, "steps": 1000}
    assert _submit(api, headers, **{**small, "views_per_scene": 2}).status_code == 413
    assert _submit(api, headers, **{**small, "steps": 1001}).status_code == 413
    assert _submit(api, headers, views_per_scene=1).status_code == 413  # the trainer's own number of steps
    assert _submit(api, headers, **small).status_code == 202
    assert _submit(api, headers, **small).status_code == 413  # the first one has not ended
    wide = _key(api, "submit", job_pixels=10**12)
    assert _submit(api, wide, views_per_scene=4).status_code == 202


def test_a_key_has_so_many_jobs_under_way(api: Api) -> None:
    headers = _key(api, "submit")
    jobs = [_submit(api, headers).json()["id"] for _ in range(2)]
    refused = _submit(api, headers)
    assert (refused.status_code, refused.json()["type"]) == (413, "/v1/problems/too-large")
    assert _submit(api, _key(api, "submit")).status_code == 202
    api.move(jobs[0], "failed")
    assert _submit(api, headers).status_code == 202
    assert api.post(f"/v1/jobs/{jobs[0]}/retry", None, headers=headers).status_code == 413


def test_of_many_jobs_at_once_no_more_are_taken(database_url: str, tmp_path: Path) -> None:
    api = Api(tmp_path, database_url, jobs=2)
    spec, headers = build_spec(api.scene()), _key(api, "submit")

    def submit(_: int) -> int:
        return int(api.post("/v1/jobs", None, headers=headers, json=spec).status_code)

    with ThreadPoolExecutor(8) as pool:
        statuses = list(pool.map(submit, range(8)))
    assert sorted(statuses) == [202] * 2 + [413] * 6


def test_a_request_that_is_repeated_is_answered_however_many_jobs_there_are(api: Api) -> None:
    headers = _key(api, "submit") | {"Idempotency-Key": "k"}
    spec = build_spec(api.scene())
    answers = [api.post("/v1/jobs", None, headers=headers, json=spec) for _ in range(4)]
    assert [answer.status_code for answer in answers] == [202, 200, 200, 200]


def test_the_pixels_of_a_job(api: Api) -> None:
    first, second = api.scene(), api.scene(f"{SCENE}# another\n")
    scenes = api.service.scenes.many([first, second])
    sides = {"kind": "render", "width": 100, "height": 50}

    def pixels(**more: Any) -> int:
        return pixels_of(JobSpec.model_validate(sides | more), scenes)

    assert pixels(scenes=[{"scene": first}, {"scene": second}], views_per_scene=5) == 10 * 5000
    assert pixels(scenes=[{"scene": first, "views": [VIEW] * 7}]) == 7 * 5000
    scenes[first] = scenes[first].model_copy(update={"facts": {"cameras": 2}})
    assert pixels(scenes=[{"scene": first}], views_per_scene=5) == 2 * 5000
    assert pixels(scenes=[{"scene": first}], views_per_scene=1) == 5000
    assert pixels(kind="train", name="a", dataset=f"dst_{'0' * 32}") == 0


def test_no_network_trains_longer_by_itself_than_is_looked_up() -> None:
    assert max(TrainConfig.sized(size).steps for size in SIZES) <= USUAL_STEPS
