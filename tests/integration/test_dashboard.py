"""The dashboard from the server's side: every page with data, empty and failing; sessions, forms, scopes, policy."""

from __future__ import annotations

import io
import json
import re
import time
from itertools import pairwise
from pathlib import Path

import pytest
import sqlalchemy as sa
import structlog
from fastapi.routing import APIRoute
from PIL import Image
from sqlalchemy.exc import OperationalError
from support.api import Api
from support.charts import DATA
from support.dashboard import HOSTILE, ORIGIN, Shown, Visitor, fill
from support.postgres import Postgres
from support.receiver import LOOPBACK, receiver

from services.api.routes import GUARDED, OPEN, routes
from services.dashboard import OPEN_PAGES, PAGES, SESSION_ANSWERS, assets, models, reference
from services.dashboard.page import duration, is_local
from services.dashboard.sessions import form_token
from services.database import Database, tables
from services.engine.progress import STAGES_OF
from services.webhooks.addresses import networks_of
from services.webhooks.deliverer import Deliverer

PARTS = {
    "job_id": "job_" + "0" * 24,
    "scene_id": "scn_" + "0" * 32,
    "name": "glass",
    "version": "1.0.0",
    "file": "model.onnx",
    "key": "0" * 64,
    "kind": "k",
    "webhook_id": "whk_" + "0" * 24,
}
PLACES = [(method, route.path.format_map(PARTS)) for route in routes(PAGES) for method in sorted(route.methods or ())]
EXAMPLES = ("/examples", "/examples/", "/examples/{name}", "/examples/assets/{name}")
LISTS = ("/", "/jobs", "/models", "/scenes")


@pytest.fixture(scope="module")
def admin(api: Api) -> Visitor:
    return Visitor(api)


def _pages(shown: Shown) -> list[str]:
    jobs = [f"/jobs/{job}" for job in (shown.running, shown.failed, shown.built)]
    return [*LISTS, *jobs, "/models/glass", *(f"/scenes/{scene}" for scene in (shown.scene, shown.rejected))]


def test_every_route_of_the_application_is_known(api: Api) -> None:
    """Nothing is reachable but what a test of this file or of the API's walks through."""
    every = (*GUARDED, *OPEN, *PAGES, *SESSION_ANSWERS, *OPEN_PAGES)
    named = {(route.path, name) for route in routes(every) for name in route.methods}
    demo = {"/demo", "/demo/assets/{name}", "/demo/licences.md", "/demo/session"}
    web = {"/clients", "/clients/", "/clients/{name}", *EXAMPLES}
    assert {route.path for route in routes(OPEN_PAGES)} == {"/sign-in", "/static/{digest}/{name}", *demo, *web}
    assert api.app.state.routers == every
    assert [route for route in api.app.routes if isinstance(route, APIRoute)] == []
    assert len(named) == sum(len(route.methods or ()) for route in routes(api.app.state.routers))


@pytest.mark.parametrize(("method", "path"), PLACES)
def test_nothing_is_shown_without_a_session(api: Api, method: str, path: str) -> None:
    nobody, wrong = Visitor(api, None), Visitor(api, None)
    wrong.client.cookies.set("diaphane_session", "a" * 43)
    for visitor in (nobody, wrong):
        answer = visitor.client.request(method, path, headers={**api.headers(), "Origin": ORIGIN})
        assert answer.status_code == 303  # an API key is none here
        assert answer.headers["location"].startswith("/sign-in")
        assert answer.content == b""


def test_where_one_wanted_to_go_is_kept(api: Api, shown: Shown) -> None:
    visitor = Visitor(api, None)
    to = visitor.get("/jobs?state=failed").headers["location"]
    assert to == "/sign-in?next=%2Fjobs%3Fstate%3Dfailed"
    assert 'value="/jobs?state=failed"' in visitor.get(to).text
    assert visitor.sign_in(api.secrets["read"], next="/jobs?state=failed").headers["location"] == "/jobs?state=failed"
    for elsewhere in ("https://evil.example", "//evil.example", "/\\evil.example", "/a\nb", "javascript:x", ""):
        assert visitor.sign_in(api.secrets["read"], next=elsewhere).headers["location"] == "/"
        assert not is_local(elsewhere)


@pytest.mark.parametrize(
    ("page", "to"),
    [
        ("", ""),
        ("http://localhost/", ""),
        ("http://localhost/jobs/x?stage=label#log", "?next=%2Fjobs%2Fx%3Fstage%3Dlabel"),
        ("http://x//evil.example/", ""),
        ("http://[", ""),
    ],
)
def test_a_part_of_a_page_sends_the_whole_page_to_sign_in_and_back(empty: Api, page: str, to: str) -> None:
    answer = Visitor(empty, None).get("/jobs", **{"HX-Request": "true", "HX-Current-URL": page})
    assert (answer.status_code, answer.headers["hx-redirect"]) == (401, f"/sign-in{to}")


def test_an_address_too_long_to_come_back_to_leads_to_sign_in_all_the_same(empty: Api) -> None:
    nobody = Visitor(empty, None)
    for extra, is_kept in ((1980, True), (1990, False)):
        to = nobody.get("/compare?view=" + "x" * extra).headers["location"]
        assert ("next=" in to) == is_kept
        assert nobody.get(to).status_code == 200


def test_a_session_is_a_secret_of_the_browser(api: Api) -> None:
    visitor = Visitor(api, None)
    cookie = visitor.sign_in(api.secrets["read"]).headers["set-cookie"]
    token = re.match(r"diaphane_session=([A-Za-z0-9_-]{43});", cookie)
    assert token is not None
    assert {"HttpOnly", "SameSite=lax", "Path=/", "Max-Age=43200"} <= set(cookie.split("; "))
    assert "Secure" not in cookie
    answer = visitor.client.post(
        "/sign-in", data={"key": api.secrets["read"]}, headers={"Origin": "https://localhost", "Host": "localhost"}
    )
    assert "Secure" in answer.headers["set-cookie"].split("; ")
    with api.service.database.read() as connection:
        rows = connection.execute(sa.select(tables.sessions)).mappings().all()
    assert token[1] not in str([dict(row) for row in rows])
    visitor.client.cookies.clear()
    for row in rows:  # what the database holds signs nobody in
        visitor.client.cookies.set("diaphane_session", row["digest"])
        assert visitor.get("/jobs").status_code == 303


@pytest.mark.parametrize("end", ["out", "revoked", "expired", "old"])
def test_a_session_ends(empty: Api, end: str) -> None:
    key, secret = empty.service.keys.create("x", ["read"])
    visitor = Visitor(empty, None)
    visitor.sign_in(secret)
    assert visitor.get("/jobs").status_code == 200
    cookie = visitor.client.cookies["diaphane_session"]
    if end == "out":
        assert visitor.post("/sign-out").headers["location"] == "/sign-in"
        assert "diaphane_session" not in visitor.client.cookies
    elif end == "revoked":
        empty.service.keys.revoke(key.id)
    else:
        table, mine = (tables.keys, tables.keys.c.id == key.id) if end == "expired" else (tables.sessions, sa.true())
        with empty.service.database.write() as connection:
            connection.execute(table.update().where(mine).values(expires=time.time() - 1.0))
    visitor.client.cookies.set("diaphane_session", cookie)
    assert visitor.get("/jobs").status_code == 303


def test_wrong_keys_are_refused_and_only_so_many_heard(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.001, burst=8)
    visitor = Visitor(api, None)
    answers = [visitor.sign_in(f"dia_00000000000{n}_{'a' * 43}") for n in range(3)]
    assert [answer.status_code for answer in answers] == [401, 401, 429]
    assert "unknown, expired or revoked" in answers[0].text
    assert "Too many requests" in answers[2].text
    assert answers[2].headers["retry-after"]
    assert "dia_0000" not in answers[0].text


def test_pages_count_for_the_key(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.001, burst=3)
    visitor = Visitor(api, "read")
    assert [visitor.get("/jobs").status_code for _ in range(3)] == [200, 200, 429]
    assert api.get("/v1/jobs", "read").status_code == 429


def _forms(shown: Shown) -> list[tuple[str, str, dict[str, str]]]:
    move = {"version": "1.0.0", "alias": "champion", "reason": "a test"}
    return [
        (f"/jobs/{shown.running}/cancel", "submit", {}),
        (f"/jobs/{shown.failed}/retry", "submit", {}),
        ("/models/glass/promote", "publish", move),
        ("/models/glass/rollback", "publish", {"alias": "champion", "reason": "a test"}),
        ("/sign-out", "read", {}),
        ("/webhooks", "admin", {"url": "https://ci.example.org/", "job.failed": "on"}),
        (f"/webhooks/{PARTS['webhook_id']}/test", "admin", {}),
        (f"/webhooks/{PARTS['webhook_id']}/delete", "admin", {}),
    ]


def test_every_form_needs_its_token_its_origin_and_its_scope(api: Api, shown: Shown) -> None:
    forms = _forms(shown)
    written = {
        (method, re.sub(r"job_[0-9a-f]{24}", PARTS["job_id"], path)) for path, _, _ in forms for method in ["POST"]
    }
    assert written == {place for place in PLACES if place[0] == "POST"}
    visitors = {scope: Visitor(api, scope) for scope in api.secrets}
    before = _state(api)
    for path, scope, fields in forms:
        able = visitors[scope]
        for token in ({"other": "x"}, {"csrf": ""}, {"csrf": "0" * 64}):
            answer = able.client.post(path, data={**fields, **token}, headers={"Origin": ORIGIN})
            assert (answer.status_code, "not of this session" in answer.text) == (403, True)
        for origin in ("https://evil.example", "null", "http://localhost:81", ""):
            assert able.post(path, origin=origin, **fields).status_code == 403
        assert able.client.post(path, json=fields, headers={"Origin": ORIGIN}).status_code == 415
        for other, visitor in visitors.items():
            sufficient = {"read": set(api.secrets), "submit": {"submit", "admin"}, "publish": {"publish", "admin"}}
            sufficient["admin"] = {"admin"}
            if other not in sufficient[scope]:
                assert visitor.post(path, **fields).status_code == 403
    assert _state(api) == before


def _state(api: Api) -> object:
    with api.service.database.read() as connection:
        jobs = connection.execute(sa.select(tables.jobs.c.id, tables.jobs.c.state)).all()
    return sorted(jobs), api.service.registry.aliases("glass").aliases


def test_a_form_without_origin_needs_the_word_of_the_browser(empty: Api) -> None:
    visitor = Visitor(empty, None)
    for site, status in (("same-origin", 303), ("cross-site", 403), ("none", 403)):
        answer = visitor.client.post("/sign-in", data={"key": empty.secrets["read"]}, headers={"Sec-Fetch-Site": site})
        assert answer.status_code == status


def test_forms_do_what_they_say(tmp_path: Path) -> None:
    api = Api(tmp_path / "state")
    shown = fill(api, tmp_path)
    admin, own = Visitor(api), next(key.id for key in api.service.keys.list() if key.name == "admin")
    answers = [admin.post(path, **fields) for path, _, fields in _forms(shown)[:4]]
    assert [answer.status_code for answer in answers] == [303] * 4
    assert [api.service.jobs.get(job).state for job in (shown.running, shown.failed)] == ["cancelling", "queued"]
    moves = api.service.registry.moves("glass")[-2:]
    assert [(move.after, move.who, move.why) for move in moves] == [("1.0.0", own, "a test"), ("1.2.0", own, "a test")]
    repeated = admin.post(f"/jobs/{shown.failed}/retry")
    assert repeated.status_code == 409
    assert "Retry a job that has failed" in repeated.text
    assert admin.post("/models/glass/promote", version="9.9.9", alias="champion", reason="x").status_code == 404
    assert admin.post("/models/glass/promote", version="1.0.0", alias="Bad Alias", reason="x").status_code == 422
    assert admin.post("/models/glass/rollback", alias="champion", reason="  ").status_code == 422


def test_a_webhook_is_made_tested_and_removed_in_the_dashboard(tmp_path: Path) -> None:
    api = Api(tmp_path, webhook_networks=LOOPBACK)
    admin = Visitor(api)
    for scope in ("read", "submit", "publish"):
        visitor = Visitor(api, scope)
        assert visitor.get("/webhooks").status_code == 403
        assert 'href="/webhooks"' not in visitor.get("/jobs").text
    assert 'href="/webhooks"' in admin.get("/jobs").text
    assert "There is no webhook yet." in admin.get("/webhooks").text
    with receiver() as there:
        url = f"{there.url}/<script>"
        made = admin.post("/webhooks", url=url, **{"job.failed": "on", "model.champion": "on"})
        secret = re.search(r"whsec_[\w+/=]+", made.text)
        assert (made.status_code, made.headers["cache-control"], secret is not None) == (200, "no-store", True)
        (hook,) = api.service.webhooks.list()
        assert (hook.url, hook.events) == (url, ("job.failed", "model.champion"))
        tested = admin.post(f"/webhooks/{hook.id}/test")
        assert (tested.status_code, tested.headers["location"]) == (303, f"/webhooks#{hook.id}")
        waiting = admin.get("/webhooks").text
        assert 'hx-trigger="every 2s"' in waiting
        assert ("s-waiting" in waiting, "whsec_" in waiting, "<script>" in waiting) == (True, False, False)
        there.answers.append(500)
        assert Deliverer(api.service.database, networks_of(LOOPBACK)).deliver() == 1
        page = admin.get("/webhooks").text
        assert ("every 2s" in page, "The receiver answered 500." in page) == (False, True)
        assert secret is not None
        assert there.messages[0].verified(secret[0])["type"] == "webhook.test"
    assert admin.post("/webhooks", url="http://10.0.0.1/", **{"job.failed": "on"}).status_code == 422
    assert "at least one event" in admin.post("/webhooks", url="https://ci.example.org/").text
    assert admin.post(f"/webhooks/{hook.id}/delete").headers["location"] == "/webhooks"
    assert admin.post(f"/webhooks/{hook.id}/delete").status_code == 404
    assert api.service.webhooks.list() == []


def test_moves_of_aliases_name_the_key_that_made_them(tmp_path: Path) -> None:
    api = Api(tmp_path / "state")
    api.version(tmp_path / "bundle")
    key, secret = api.service.keys.create("Ada's <laptop>", ["publish"])
    visitor = Visitor(api, None)
    visitor.sign_in(secret)
    visitor.post("/models/glass/promote", version="1.0.0", alias="champion", reason="a look at it")
    api.service.keys.revoke(key.id)
    api.service.registry.promote("glass", "1.0.0", "by hand", "stable", who="root")
    page = Visitor(api, "read").get("/models/glass").text
    rows = re.findall(r"<tr><th[^>]*>(\w+)</th>.*?</time></td>(.*?)</tr>", page[page.index('id="aliases"') :])
    cells = [
        (alias, *(re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", rest)))
        for alias, rest in rows
    ]
    assert cells == [
        ("stable", "root", "–", "1.0.0", "by hand"),
        ("champion", f"Ada&#39;s &lt;laptop&gt; {key.id}", "–", "1.0.0", "a look at it"),
    ]


def test_buttons_are_there_for_those_who_may(api: Api, shown: Shown) -> None:
    for scope, submits, publishes in (("read", False, False), ("submit", True, False), ("publish", False, True)):
        visitor = Visitor(api, scope)
        assert ("/cancel" in visitor.get(f"/jobs/{shown.running}").text) == submits
        assert ("/retry" in visitor.get(f"/jobs/{shown.failed}").text) == submits
        model = visitor.get("/models/glass").text
        assert ("/promote" in model, "/rollback" in model) == (publishes, publishes)


def test_pages_with_data(admin: Visitor, shown: Shown) -> None:
    said = {path: admin.get(path) for path in _pages(shown)}
    assert {path: answer.status_code for path, answer in said.items()} == dict.fromkeys(said, 200)
    text = {path: answer.text for path, answer in said.items()}
    assert "1 min 15 s</strong> of work saved" in text["/"]  # found by one job, made by another
    assert re.search(r"Nobody works for render, train:", text["/"])
    assert re.search(r'data-stream="/changes\?seen=[0-9a-f]{16}"', text["/"])
    job = text[f"/jobs/{shown.running}"]
    assert [re.findall(r"<h3>(\w+)</h3>", job)] == [list(STAGES_OF["build"])]
    assert "1 quarantined" in job
    assert "after label and export" in job
    assert f"/jobs/{shown.running}/events?after=" in job
    assert "Add scenes." in text[f"/jobs/{shown.failed}"]
    assert text[f"/jobs/{shown.failed}"].count("s-unreached") == 2 * len(STAGES_OF["build"])
    assert "data-stream" not in text[f"/jobs/{shown.failed}"]
    assert f"/jobs/{shown.built}/report" in text[f"/jobs/{shown.built}"]
    model = text["/models/glass"]
    assert len(re.findall(r'class="worse"', model)) == 1
    assert "1.20 times the version before" in model
    assert len(DATA.findall(model)) == 3
    assert "<dd>73, " in model  # weights: 1 -> 4 -> 13 with biases
    assert "56 per pixel" in model
    assert "Commercial use is NOT CLEARED: 1 of 1 training scenes have no licence" in model
    assert '<pre class="card"># Model card: glass' in model
    scene = text[f"/scenes/{shown.scene}"]
    assert "1 234 567" in scene
    assert "<td>0.250</td><td>0.200</td><td>2.00e-01</td>" in scene
    assert "<dt>F = 1 W H</dt><dd><strong>bundle (kbuffer-deep)</strong></dd>" in scene
    assert "Pack the file." in text[f"/scenes/{shown.rejected}"]


def test_the_overview_counts_all_jobs_and_shows_those_that_ended_last(tmp_path: Path) -> None:
    """However many wait: a job may have been submitted before all of them, and have ended just now."""
    api = Api(tmp_path)
    first = api.job(name="glass")
    with api.service.database.write() as connection:
        row = dict(connection.execute(sa.select(tables.jobs)).mappings().one())
        others = [row | {"id": f"job_{n:024x}", "name": f"m-{n}", "created": row["created"] + n} for n in range(1, 61)]
        for n in (3, 4, 5, 6, 7, 8):  # and six that were submitted later, and ended before
            others[n] |= {"state": "succeeded", "finished": row["created"] + n}
        for n in range(30, 55):
            others[n] |= {"state": "running", "started": row["created"]}
        connection.execute(tables.jobs.insert(), others)
        ended = tables.jobs.update().where(tables.jobs.c.id == first)
        connection.execute(ended.values(state="failed", finished=row["created"] + 99.0))
    page = Visitor(api, "read").get("/").text
    lines = re.findall(r'<li id="ended-[^"]+"><span[^>]*>(\w+)</span> <a[^>]*>build ([\w-]+)', page)
    assert lines == [("failed", "glass"), *(("succeeded", f"m-{n}") for n in (9, 8, 7, 6, 5))]
    assert 'data-say="25 jobs running, 29 waiting"' in page
    assert 'The latest of 25. <a href="/jobs?state=running">' in page
    assert 'The latest of 29. <a href="/jobs?state=queued">' in page


def test_a_job_says_what_it_was_asked_for_and_what_came_of_it(tmp_path: Path) -> None:
    api = Api(tmp_path)
    api.version(tmp_path / "bundle")
    asked = {"kind": "evaluate", "name": None, "model": "glass@1.0.0", "alpha": 0.25, "replay": False}
    evaluate, render = api.job(**asked), api.job(kind="render")
    views = [{"scene": HOSTILE, "view": "front", "fragments": n, "artifact": "x"} for n in (1000, 234)]
    per_scene = {HOSTILE: {"score": 0.5, "rival": 0.625}, "bare": {"score": None}}
    advice = {"bare": ["Use the S-buffer.", "By memory: <b>."]}
    with api.service.database.write() as connection:
        for job, result in ((evaluate, {"per_scene": per_scene, "advice": advice}), (render, {"views": views})):
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == job).values(result=result))
    visitor = Visitor(api, "read")
    page = visitor.get(f"/jobs/{evaluate}").text
    for said in ("<h1>evaluate glass@1.0.0</h1>", "<dt>Alpha</dt><dd>0.25</dd>", "<dt>Replay</dt><dd>no</dd>"):
        assert said in page
    assert "<dd>0.500 against 0.625 of the champion before</dd>" in page
    assert "<dt>Advice on bare</dt><dd>Use the S-buffer. By memory: &lt;b&gt;.</dd>" in page
    assert "Score on bare" not in page
    assert "<dt>Seed</dt>" not in page  # as it is by default
    assert "<script>" not in page
    assert "<dt>Views</dt><dd>2 with 1 234 fragments</dd>" in visitor.get(f"/jobs/{render}").text
    assert ">evaluate glass@1.0.0</a>" in visitor.get("/jobs").text


def test_the_log_of_a_job_can_be_read_to_its_beginning(tmp_path: Path) -> None:
    api = Api(tmp_path)
    job = api.job()
    api.log(job, *(f"line {n}" for n in range(450)))
    visitor, seen, path = Visitor(api, "read"), list[str](), f"/jobs/{job}"
    while path:
        page = visitor.get(path).text
        seen += re.findall(r"line \d+", page)
        assert ("Latest events" in page) == ("until" in path)
        earlier = re.search(r'href="([^"#]+)#log">Earlier events', page)
        path = earlier[1] if earlier else ""
    assert seen == [f"line {n}" for n in reversed(range(450))]
    assert visitor.get(f"/jobs/{job}?until=0").status_code == 422
    assert "line 449" in visitor.get(f"/jobs/{job}?until=999999").text


def test_a_model_says_how_much_of_its_past_is_shown(
    admin: Visitor, shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = ("The last 2 of 3 versions.", "The last 2 of 3 moves.")
    assert not any(one in admin.get("/models/glass").text for one in said)
    monkeypatch.setattr(models, "_VERSIONS_COMPARED", 2)
    monkeypatch.setattr(models, "_MOVES", 2)
    assert all(one in admin.get("/models/glass").text for one in said)


def test_names_are_text_and_never_markup(admin: Visitor, shown: Shown) -> None:
    for path in (*_pages(shown), "/jobs?name=glass", f"/scenes/{shown.scene}?view=%3Cscript%3E"):
        page = admin.get(path).text
        assert "<script>" not in page
        assert "<img src=x" not in page
        assert not re.search(r"\son\w+=", re.sub(r"&lt;.*?&gt;", "", DATA.sub("", page)))
    assert "&lt;script&gt;" in admin.get("/models/glass").text
    for bad in ("/jobs?state=%3Cscript%3E", "/sign-in?next=%22%3E%3Cscript%3E"):
        assert "<script>" not in admin.get(bad).text


@pytest.mark.parametrize("path", LISTS)
def test_empty_pages_say_what_to_do(empty: Api, path: str) -> None:
    answer = Visitor(empty, "read").get(path)
    assert answer.status_code == 200
    assert 'class="empty"' in answer.text
    assert "diaphane " in answer.text


def test_what_does_not_exist_is_a_page_as_well(admin: Visitor) -> None:
    for path in ("/jobs/job_" + "0" * 24, "/jobs/nothing", "/models/nothing", "/scenes/scn_" + "0" * 32):
        answer = admin.get(path)
        assert (answer.status_code, "What to do:" in answer.text) == (404, True)
    assert admin.get("/jobs?state=odd").status_code == 422
    assert admin.get("/jobs?cursor=odd").status_code == 422
    assert admin.client.put("/jobs").headers["allow"] == "GET"


BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"


@pytest.mark.parametrize(
    ("accept", "is_page"),
    [
        (BROWSER, True),
        ("TEXT/HTML", True),
        ("text/html, application/json", True),
        ("text/html;q=0.5, application/json", False),
        ("application/problem+json, text/html;q=0.9", False),
        ("text/html;q=0", False),
        ("text/html;q=nan", False),
        ("text/html;q=a, */*", False),
        ("application/json", False),
        ("*/*", False),
        ("", False),
    ],
)
def test_an_address_that_leads_nowhere_is_a_page_for_a_browser_only(empty: Api, accept: str, is_page: bool) -> None:
    nobody = Visitor(empty, None)
    for path in ("/nowhere", "/jobs/", "/static/0000000000000000/none.css", "/%3Cscript%3E/%00%ff"):
        answer = nobody.get(path, Accept=accept)
        assert answer.status_code == 404
        kind = "text/html; charset=utf-8" if is_page else "application/problem+json"
        assert answer.headers["content-type"] == kind
        if is_page:
            assert "What to do: Check the address" in answer.text
            assert answer.headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'")
            assert "<script>" not in answer.text
            assert all(f'<a href="{place}">' in answer.text for place in LISTS)


def test_addresses_of_the_api_answer_programs_whatever_they_accept(empty: Api) -> None:
    for path in ("/v1", "/v1/", "/v1/nowhere", "/v1/jobs"):
        answer = Visitor(empty, None).get(path, Accept=BROWSER)
        assert answer.headers["content-type"] == "application/problem+json"


def test_a_method_that_an_address_has_not_got(empty: Api) -> None:
    nobody = Visitor(empty, None)
    for path, allowed in (("/jobs/job_" + "0" * 24 + "/cancel", "POST"), ("/sign-out", "POST")):
        answer = nobody.get(path, Accept=BROWSER)
        assert (answer.status_code, answer.headers["allow"]) == (405, allowed)
        assert "go back to its page" in answer.text
        assert "Try again" not in answer.text
    assert nobody.client.put("/jobs", headers={"Accept": "application/json"}).json()["status"] == 405


def test_a_name_that_the_server_has_not_got_is_a_page_without_links_to_it(empty: Api) -> None:
    answer = Visitor(empty, None).get("//evil.example/", Accept=BROWSER, Host="evil.example")
    assert answer.status_code == 421
    assert "Use the address that the server printed" in answer.text
    assert "evil.example" not in answer.text


def test_problem_pages_say_what_to_do_in_the_browser(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.01, burst=3)
    visitor = Visitor(api, "read")
    refused = visitor.post("/jobs/job_" + "0" * 24 + "/cancel")
    assert refused.status_code == 403
    assert "lacks the scope &#39;submit&#39;" in refused.text
    assert "What to do: Sign out, and sign in with a key that has the scope" in refused.text
    assert "Try again" not in refused.text
    visitor.get("/jobs")
    often = visitor.get("/jobs?state=failed")
    assert often.status_code == 429
    assert f"What to do: Wait {often.headers['retry-after']} seconds" in often.text
    assert '<a href="/jobs?state=failed">Try again</a>' in often.text


def test_a_fault_outside_the_pages_is_a_page_for_a_browser(empty: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: str) -> str:
        raise RuntimeError("secret")

    monkeypatch.setattr(assets, "address", fail)  # of a route that is no page
    path = f"/static/{'0' * 16}/icon.svg"
    answer = Visitor(empty, None).get(path, Accept=BROWSER)
    assert (answer.status_code, answer.headers["content-type"]) == (500, "text/html; charset=utf-8")
    assert "secret" not in answer.text
    assert f'<a href="{path}">Try again</a>' in answer.text
    assert Visitor(empty, None).get(path).json()["status"] == 500


def test_a_database_that_fails_is_a_page_with_the_problem(
    api: Api, shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    visitor = Visitor(api)

    def fail(_: object) -> None:
        raise OperationalError("select secret", {}, Exception("secret"))

    for path in (*_pages(shown), f"/jobs/{shown.running}/events", "/changes"):
        with monkeypatch.context() as broken:
            broken.setattr(Database, "read", fail)
            answer = visitor.get(path)
        assert (answer.status_code, "The database cannot be reached." in answer.text) == (503, True)
        assert answer.headers["content-type"].startswith("text/html")
        assert "secret" not in answer.text
        assert "Traceback" not in answer.text


def test_an_unexpected_error_is_a_page_without_a_stack(
    admin: Visitor, api: Api, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> None:
        raise RuntimeError("secret")

    monkeypatch.setattr(type(api.service.registry), "models", fail)
    answer = admin.get("/models", **{"X-Request-ID": "r-7"})
    assert answer.status_code == 500
    assert "r-7" in answer.text
    assert "secret" not in answer.text


def test_the_policy_forbids_what_is_inline_and_pages_have_none(admin: Visitor, shown: Shown) -> None:
    for path in (*_pages(shown), "/jobs/nothing"):
        answer = admin.get(path)
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'; script-src 'self'; style-src 'self'" in policy
        assert "unsafe" not in policy
        assert answer.headers["cache-control"] == "no-store"
        assert answer.headers["referrer-policy"] == "same-origin"
        assert not re.search(r"<style|\sstyle=|<script(?! src=\"/static/)|javascript:", DATA.sub("", answer.text))
        assert '"allowEval":false' in answer.text
        assert not re.search(r"(?:src|href)=\"(?:https?:)?//", answer.text)


def test_pages_are_made_for_every_reader(admin: Visitor, shown: Shown) -> None:
    for path in (*_pages(shown), "/jobs/nothing"):
        page = admin.get(path).text
        assert (page.count("<h1"), page.count("<main"), page.count('lang="en"')) == (1, 1, 1)
        assert 'class="skip" href="#main"' in page
        assert not re.search(r"<th(?![^>]*scope=)[ >]", page)
        assert not re.search(r"<img(?![^>]* alt=)", page)
        ids = re.findall(r'\sid="([^"]*)"', page)
        assert len(ids) == len(set(ids))
        assert all(re.fullmatch(r"\S+", one) for one in ids)
        assert set(re.findall(r'aria-labelledby="([^"]+)"', page)) <= set(ids)
        assert set(re.findall(r'<label for="([^"]+)"', page)) <= set(ids)
        levels = [int(level) for level in re.findall(r"<h([1-6])", page)]
        assert all(after - before <= 1 for before, after in pairwise(levels))


def test_static_files_are_for_ever(empty: Api) -> None:
    nobody = Visitor(empty, None)
    page = nobody.get("/sign-in").text
    addresses = set(re.findall(r'"(/static/[^"]+)"', page))
    assert {address.rpartition("/")[2] for address in addresses} == {
        *("dashboard.css", "dashboard.js", "htmx.min.js", "icon.svg", "idiomorph-ext.min.js")
    }
    for address in (
        *addresses,
        *map(assets.address, ("htmx.LICENSE.txt", "idiomorph.LICENSE.txt", "vega.LICENSE.txt")),
    ):
        answer = nobody.get(address)
        assert (answer.status_code, answer.headers["cache-control"]) == (200, "public, max-age=31536000, immutable")
        assert nobody.get(address, **{"If-None-Match": answer.headers["etag"]}).status_code == 304
        assert nobody.get(address.replace(address.split("/")[2], "0" * 16)).status_code == 404
    assert nobody.get(assets.address("htmx.min.js").replace("htmx.min.js", "..%2Fpage.py")).status_code == 404


def test_vendored_scripts_are_the_versions_that_are_said_and_may_be_passed_on() -> None:
    assert f'version:"{assets.HTMX}"'.encode() in assets.content("htmx.min.js")[0]
    released = {"0.8.0": "5811b9a7eda14878b7dab4378bf60432e1bb6f11fcfb970cc26540642650181e"}  # it does not say its own
    assert assets.content("idiomorph-ext.min.js")[1] == released[assets.IDIOMORPH]
    for name in ("htmx", "idiomorph"):
        assert assets.content(f"{name}.LICENSE.txt")[0].startswith(b"Zero-Clause BSD")


def test_secrets_of_browsers_are_not_logged(empty: Api) -> None:
    with structlog.testing.capture_logs() as lines:
        visitor = Visitor(empty, "read")
        visitor.get("/jobs?name=secretname")
        visitor.post("/jobs/job_" + "0" * 24 + "/cancel")
    assert [line["status"] for line in lines if line["event"] == "request"] == [303, 200, 200, 403]
    token = visitor.client.cookies["diaphane_session"]
    for secret in (empty.secrets["read"], token, form_token(token), "secretname"):
        assert secret not in str(lines)


def test_the_same_pages_come_from_postgresql(postgres: Postgres, tmp_path: Path) -> None:
    api = Api(tmp_path / "state", postgres.new_database(), ttl=1e6)
    shown, visitor = fill(api, tmp_path), Visitor(api)
    text = {path: visitor.get(path) for path in _pages(shown)}
    assert {path: answer.status_code for path, answer in text.items()} == dict.fromkeys(text, 200)
    assert "1 min 15 s</strong> of work saved" in text["/"].text
    assert len(re.findall(r'class="worse"', text["/models/glass"].text)) == 1
    assert "2.00e-01" in text[f"/scenes/{shown.scene}"].text
    assert api.app.state.watch.look()


def test_lists_have_filters_and_pages(admin: Visitor, shown: Shown) -> None:
    assert f"/jobs/{shown.failed}" in admin.get("/jobs?state=failed&kind=&name=").text
    assert f"/jobs/{shown.failed}" not in admin.get("/jobs?state=running").text
    assert "No job is like that" in admin.get("/jobs?name=other").text
    seen, path = [], "/jobs?limit=1&kind=build"
    while path:
        page = admin.get(path).text
        seen += re.findall(r'<th class="text" scope="row"><a href="/jobs/(job_\w+)"', page)
        following = re.search(r'href="([^"]+)" rel="next"', page)
        path = following[1].replace("&amp;", "&") if following else ""
    assert seen == [shown.built, shown.failed, shown.running]
    tasks = admin.get(f"/jobs/{shown.running}?state=quarantined").text
    assert re.findall(r'<td class="text">(\w+)</td><th class="text wrap" scope="row">([\w ]+)', tasks) == [
        ("label", "bottles side")
    ]
    assert "No task is like that" in admin.get(f"/jobs/{shown.running}?stage=train").text


def test_files_of_versions_are_downloads(admin: Visitor) -> None:
    answer = admin.get("/models/glass/1.1.0/files/model.onnx")
    assert (answer.status_code, answer.content) == (200, b"model.onnx b")
    assert answer.headers["content-disposition"] == 'attachment; filename="glass-1.1.0-model.onnx"'
    assert admin.get("/models/glass/1.1.0/files/nothing").status_code == 404


def test_a_report_cannot_reach_the_session(admin: Visitor, shown: Shown) -> None:
    answer = admin.get(f"/jobs/{shown.built}/report")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert answer.headers["content-security-policy"].startswith("sandbox allow-scripts; default-src 'none'")
    assert admin.get(f"/jobs/{shown.failed}/report").status_code == 404


def test_pictures_of_counts_are_heat_maps(admin: Visitor, shown: Shown) -> None:
    page = admin.get(f"/scenes/{shown.scene}").text
    addresses = [found.replace("&amp;", "&") for found in re.findall(r'<img src="(/scenes/[^"]+)"', page)]
    assert len(addresses) == 5  # exact, depth complexity, and k of three techniques
    for address in addresses:
        answer = admin.get(address)
        assert answer.headers["content-type"] == "image/png"
        assert Image.open(io.BytesIO(answer.content)).size == (12, 8)
        assert admin.get(address, **{"If-None-Match": answer.headers["etag"]}).status_code == 304
    assert admin.get(addresses[0].replace(shown.scene, shown.rejected)).status_code == 404
    assert admin.get(addresses[0].replace("exact", "meta")).status_code == 404


def test_streams_tell_of_changes(api: Api, shown: Shown) -> None:
    events = Visitor(api).get(f"/jobs/{shown.built}/events?after=0")  # it has ended, so its stream does
    assert events.headers["content-type"].startswith("text/event-stream")
    assert "event: state" in events.text
    assert Visitor(api).get(f"/jobs/{shown.built}/events", **{"Last-Event-ID": "2"}).status_code == 204


def test_signs_that_hide_others_are_written_out_on_every_page(tmp_path: Path) -> None:
    """`gpj.exe` after U+202E reads as a picture."""
    api = Api(tmp_path, rate=1e6, burst=10**6)
    shown = fill(api, tmp_path, "bottle\u202egpj.exe \u2066\u200b\x9b")
    admin = Visitor(api)
    texts = [admin.get(path).text for path in _pages(shown)]
    assert not any(sign in text for text in texts for sign in "\u202e\u2066\u200b\x9b")
    assert sum("bottle\\u202egpj.exe \\u2066\\u200b\\x9b" in text for text in texts) >= 3


def test_durations_and_addresses() -> None:
    assert [duration(s) for s in (None, -1.0, 0.4, 61.0, 3600.0, 90061.0)] == [
        *("–", "0 s", "0 s", "1 min 1 s", "1 h", "1 d 1 h")
    ]
    assert is_local("/jobs?a=b&c=%20")
    assert HOSTILE.startswith("<script>")


def test_every_operation_and_schema_of_the_api_has_its_place_on_the_docs_page(empty: Api) -> None:
    document = json.loads(empty.app.state.document())
    page = Visitor(empty).get("/docs")
    assert page.status_code == 200
    places = set(re.findall(r'<details id="([^"]+)"', page.text))
    operations = {one["operationId"] for path in document["paths"].values() for one in path.values()}
    assert places == operations | {f"schema-{name}" for name in document["components"]["schemas"]}
    submit = page.text.partition('<details id="submit_job">')[2].partition("</details>")[0]
    for part in ("<strong>POST</strong>", "/v1/jobs", "submit", "idempotency-key", "Body: JobSpec", "202 JobRecord"):
        assert part in submit


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"$ref": "#/components/schemas/JobSpec"}, "JobSpec"),
        ({"anyOf": [{"type": "string"}, {"type": "null"}]}, "string or null"),
        ({"type": "array", "items": {"enum": ["a", "b"]}}, 'list of "a" | "b"'),
        ({"type": "object", "additionalProperties": {"type": "number"}}, "map to number"),
        ({"const": "build"}, '"build"'),
        ({}, "any"),
    ],
)
def test_a_type_in_words(schema: dict[str, object], words: str) -> None:
    assert reference.type_in_words(schema) == words


def test_attributes_of_a_docstring_become_the_meanings_of_properties() -> None:
    text = "A key.\n\nAttributes:\n    name: For people;\n        any: text.\n    scopes: What it may."
    assert reference.attributes(text) == ("A key.", {"name": "For people; any: text.", "scopes": "What it may."})
    assert reference.attributes("A key.") == ("A key.", {})
    assert reference.prose("a `<b>` <c>") == "a <code>&lt;b&gt;</code> &lt;c&gt;"
