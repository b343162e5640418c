"""A server of the REST interface in memory: jobs end at once, and requests fail when they are told to."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

from schemas.job import JobSpec

KEY = "dia_0123456789ab_" + "k" * 43
NOW = "2026-03-01T12:00:00.000000Z"
PART_BYTES = 1000
PAGE = 2

JSON = dict[str, Any]
Outcome = Callable[[JSON], JSON]


@dataclass
class Fault:
    """What goes wrong with some requests.

    Attributes:
        method: Of the requests.
        path: Pattern that their paths match.
        times: How many of them.
        status: Answered instead of serving them; 0: the connection is cut after they were served, before the answer.
        headers: Of that answer.
        document: Members of that answer.
    """

    method: str
    path: str
    times: int = 1
    status: int = 0
    headers: dict[str, str] = field(default_factory=dict)
    document: JSON = field(default_factory=dict)


@dataclass
class Asked:
    """A request that came."""

    method: str
    path: str
    query: dict[str, str]
    headers: dict[str, str]
    body: bytes


class FakeServer:
    """The state behind the requests. Jobs end as `outcome` of their spec says: fields of the job's record."""

    def __init__(self) -> None:
        self.url = ""
        self.asked: list[Asked] = []
        self.faults: list[Fault] = []
        self.blobs: dict[str, bytes] = {}
        self.uploads: dict[str, JSON] = {}
        self.scenes: dict[str, JSON] = {}
        self.rejected: dict[str, JSON] = {}
        self.checks = 0
        self.jobs: dict[str, JSON] = {}
        self.keys_of_jobs: dict[str, str] = {}
        self.events: dict[str, list[JSON]] = {}
        self.cut_after: list[int] = []
        self.tasks: list[JSON] = []
        self.versions: list[JSON] = []
        self.moves: list[JSON] = []
        self.api_keys: list[JSON] = []
        self.outcome: Outcome = lambda spec: {"state": "succeeded", "result": {}}

    def count(self, method: str, path: str) -> int:
        """How many requests of a kind came."""
        return sum(1 for asked in self.asked if asked.method == method and re.fullmatch(path, asked.path))

    def fault(self, asked: Asked) -> Fault | None:
        """What goes wrong with this request."""
        for fault in self.faults:
            if fault.times > 0 and fault.method == asked.method and re.fullmatch(fault.path, asked.path):
                fault.times -= 1
                return fault
        return None

    def serve(self, asked: Asked) -> tuple[int, Any]:
        """Status and answer."""
        for method, pattern, handler in ROUTES:
            match = re.fullmatch(pattern, asked.path)
            if match and method == asked.method:
                return handler(self, asked, *match.groups())
        return problem(404, "not-found", f"There is no {asked.path}.")

    def alias(self, name: str, alias: str) -> str | None:
        """The version that an alias means."""
        return next((m["after"] for m in reversed(self.moves) if (m["name"], m["alias"]) == (name, alias)), None)

    def move(self, name: str, alias: str, version: str, why: str) -> None:
        """Points an alias at a version."""
        entry = {
            "alias": alias,
            "before": self.alias(name, alias),
            "after": version,
            "at": f"2026-03-01T12:00:{len(self.moves):02d}+00:00",
            "who": "key",
            "why": why,
        }
        self.moves.append({"name": name, **entry})

    def publish(self, name: str, score: float | None, job_id: str | None = None) -> str:
        """Adds a version."""
        version = f"1.{sum(v['name'] == name for v in self.versions)}.0"
        parity = {"torch_onnx": 1e-7, "torch_glsl": 1e-6, "tolerance": 1e-4}
        record = {"name": name, "version": version, "digest": "d" * 64, "score": score, "created": NOW}
        record |= {"provenance": {"scenes": {"vase": "0" * 64}, "licences": {"vase": "CC-BY-NC-4.0"}}, "files": {}}
        self.versions.append({**record, "parity": parity, "job_id": job_id, "aliases": []})
        return version


def problem(status: int, slug: str, detail: str, **more: Any) -> tuple[int, JSON]:
    """A problem document."""
    document = {"type": f"/v1/problems/{slug}", "title": "A title.", "status": status, "detail": detail}
    return status, {**document, "remedy": "Do something.", **more}


def _page(asked: Asked, items: list[Any]) -> tuple[int, JSON]:
    start, limit = int(asked.query.get("cursor", 0)), min(PAGE, int(asked.query.get("limit", PAGE)))
    answer: JSON = {"items": items[start : start + limit]}
    if start + limit < len(items):
        # As behind a proxy: the host of the link is not one that a client could reach.
        answer["_link"] = f"http://inside{asked.path}?" + urlencode({**asked.query, "cursor": start + limit})
    return 200, answer


def _missing(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    return 200, {"missing": [h for h in json.loads(asked.body)["sha256"] if h not in server.blobs]}


def _begin(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    body = json.loads(asked.body)
    if body["sha256"] in server.blobs:
        return 200, {"complete": True, "received": body["bytes"], "bytes": body["bytes"]}
    upload_id = "upl_" + body["sha256"][:24]
    server.uploads.setdefault(upload_id, {"sha256": body["sha256"], "data": b"", "bytes": body["bytes"]})
    return 201, {"id": upload_id, "part_bytes": PART_BYTES, **_state(server.uploads[upload_id])}


def _state(upload: JSON) -> JSON:
    received = len(upload["data"])
    return {"received": received, "bytes": upload["bytes"], "complete": upload.get("complete", False)}


def _append(server: FakeServer, asked: Asked, upload_id: str) -> tuple[int, JSON]:
    upload = server.uploads[upload_id]
    if int(asked.headers["upload-offset"]) != len(upload["data"]):
        return problem(409, "wrong-offset", "Not there.", received=len(upload["data"]))
    if len(asked.body) > PART_BYTES:
        return problem(413, "too-large", "The part is too large.")
    upload["data"] += asked.body
    if len(upload["data"]) == upload["bytes"]:
        if hashlib.sha256(upload["data"]).hexdigest() != upload["sha256"]:
            return problem(422, "check-failed", "The hash is another.")
        server.blobs[upload["sha256"]] = upload["data"]
        upload["complete"] = True
    return 200, _state(upload)


def _create_scene(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    body = json.loads(asked.body)
    missing = [h for h in body["files"].values() if h not in server.blobs]
    if missing:
        return problem(409, "blobs-missing", "Files are missing.", missing=missing)
    text = json.dumps([body["root"], body["files"]], sort_keys=True).encode()
    scene_id = "scn_" + hashlib.sha256(text).hexdigest()[:32]
    if scene_id in server.scenes:
        return 200, server.scenes[scene_id]
    files = {name: {"sha256": h, "bytes": len(server.blobs[h])} for name, h in body["files"].items()}
    size = sum(file["bytes"] for file in files.values())
    scene = {"id": scene_id, "name": body["name"], "root": body["root"], "files": files, "bytes": size}
    server.scenes[scene_id] = {**scene, "state": "checking", "problem": None, "facts": None, "created": NOW, "looks": 0}
    return 202, server.scenes[scene_id]


def _scene(server: FakeServer, _: Asked, scene_id: str) -> tuple[int, JSON]:
    scene = server.scenes.get(scene_id)
    if scene is None:
        return problem(404, "not-found", f"There is no scene {scene_id}.")
    scene["looks"] += 1
    if scene["looks"] > server.checks:
        reason = server.rejected.get(scene["name"])
        scene |= (
            {"state": "rejected", "problem": reason} if reason else {"state": "accepted", "facts": {"triangles": 12}}
        )
    return 200, scene


def _submit(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    spec = JobSpec.model_validate_json(asked.body).model_dump(mode="json")
    key = asked.headers["idempotency-key"]
    if key in server.keys_of_jobs:
        return 200, server.jobs[server.keys_of_jobs[key]]
    job_id = f"job_{len(server.jobs):024x}"
    server.keys_of_jobs[key] = job_id
    job = {"id": job_id, "kind": spec["kind"], "name": spec["name"], "spec": spec, "state": "queued", "attempt": 1}
    job |= {"stage": None, "stages": [], "fraction": 0.0, "eta_seconds": None, "priority": "normal", "created": NOW}
    job |= {"problem": None, "result": None, "skipped": {}}
    server.jobs[job_id] = job
    _run(server, job)
    return 202, {**job, "state": "queued"}


def _run(server: FakeServer, job: JSON) -> None:
    """The job runs while its events are read: only then it ends."""
    notes: list[tuple[str, JSON]] = [("state", {"state": "running"}), ("log", {"text": "Rendering. \u2028Still."})]
    notes += [("task", {"name": f"view {i}"}) for i in range(4)]
    known = server.events.setdefault(job["id"], [])
    known += [
        {"number": len(known) + i, "at": NOW, "kind": kind, "data": data} for i, (kind, data) in enumerate(notes, 1)
    ]
    job |= {"state": "running"}


def _finish(server: FakeServer, job: JSON) -> None:
    if job["state"] == "running":
        stage = {"stage": "render", "total": 4, "done": 3, "skipped": 1, "running": 0, "queued": 0, "quarantined": 0}
        job |= {"stages": [{**stage, "fraction": 1.0, "eta_seconds": 0.0}], "fraction": 1.0}
        job |= server.outcome(job["spec"])
        known = server.events[job["id"]]
        known.append({"number": len(known) + 1, "at": NOW, "kind": "state", "data": {"state": job["state"]}})


def _job(server: FakeServer, _: Asked, job_id: str) -> tuple[int, JSON]:
    found = server.jobs.get(job_id)
    return (200, found) if found else problem(404, "not-found", f"There is no job {job_id}.")


def _retry(server: FakeServer, _: Asked, job_id: str) -> tuple[int, JSON]:
    job = server.jobs[job_id]
    if job["state"] not in ("failed", "cancelled"):
        return problem(409, "conflict", f"The job {job_id} is {job['state']}.")
    job["attempt"] += 1
    _run(server, job)
    return 200, job


def _cancel(server: FakeServer, _: Asked, job_id: str) -> tuple[int, JSON]:
    server.jobs[job_id]["state"] = "cancelled"
    return 200, server.jobs[job_id]


def _events(server: FakeServer, asked: Asked, job_id: str) -> tuple[int, JSON]:
    after = int(asked.query.get("after", 0))
    return 200, {"items": [event for event in server.events[job_id] if event["number"] > after][:3]}


def _tasks(server: FakeServer, asked: Asked, _: str) -> tuple[int, JSON]:
    return _page(asked, [t for t in server.tasks if asked.query.get("state", t["state"]) == t["state"]])


def _jobs(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    wanted = {name: asked.query[name] for name in ("state", "kind", "name") if name in asked.query}
    return _page(asked, [j for j in server.jobs.values() if all(j[name] == value for name, value in wanted.items())])


def _models(server: FakeServer, asked: Asked) -> tuple[int, JSON]:
    counts = Counter(version["name"] for version in server.versions)
    models = []
    for name, count in counts.items():
        champion = server.alias(name, "champion")
        aliases = {"champion": champion} if champion else {}
        models.append({"name": name, "latest": f"1.{count - 1}.0", "aliases": aliases, "versions": count})
    return _page(asked, models)


def _versions(server: FakeServer, asked: Asked, name: str) -> tuple[int, JSON]:
    return _page(asked, [version for version in reversed(server.versions) if version["name"] == name])


def _version(server: FakeServer, _: Asked, name: str, selector: str) -> tuple[int, JSON]:
    wanted = server.alias(name, selector) or selector
    found = next((v for v in server.versions if (v["name"], v["version"]) == (name, wanted)), None)
    return (200, found) if found else problem(404, "not-found", f"'{name}' has no version or alias '{selector}'.")


def _aliases(server: FakeServer, _: Asked, name: str) -> tuple[int, JSON]:
    history = [{k: v for k, v in move.items() if k != "name"} for move in server.moves if move["name"] == name]
    return 200, {"aliases": {move["alias"]: move["after"] for move in history}, "history": history[::-1]}


def _put_alias(server: FakeServer, asked: Asked, name: str, alias: str) -> tuple[int, JSON]:
    body = json.loads(asked.body)
    server.move(name, alias, body["version"], body["reason"])
    return _aliases(server, asked, name)


def _roll_back(server: FakeServer, asked: Asked, name: str, alias: str) -> tuple[int, JSON]:
    before = next(m["before"] for m in reversed(server.moves) if m["alias"] == alias)
    server.move(name, alias, before, json.loads(asked.body)["reason"])
    return _aliases(server, asked, name)


ROUTES: list[tuple[str, str, Callable[..., tuple[int, Any]]]] = [
    ("POST", "/v1/blobs/missing", _missing),
    ("POST", "/v1/uploads", _begin),
    ("PATCH", "/v1/uploads/([^/]+)", _append),
    ("GET", "/v1/uploads/([^/]+)", lambda server, _, upload_id: (200, _state(server.uploads[upload_id]))),
    ("POST", "/v1/scenes", _create_scene),
    ("GET", "/v1/scenes", lambda server, asked: _page(asked, list(server.scenes.values()))),
    ("GET", "/v1/scenes/([^/]+)", _scene),
    ("POST", "/v1/jobs", _submit),
    ("GET", "/v1/jobs", _jobs),
    ("GET", "/v1/jobs/([^/]+)", _job),
    ("POST", "/v1/jobs/([^/]+)/retry", _retry),
    ("POST", "/v1/jobs/([^/]+)/cancel", _cancel),
    ("GET", "/v1/jobs/([^/]+)/events", _events),
    ("GET", "/v1/jobs/([^/]+)/tasks", _tasks),
    ("GET", "/v1/models", _models),
    ("GET", "/v1/models/([^/]+)/versions", _versions),
    ("GET", "/v1/models/([^/]+)/versions/([^/]+)", _version),
    ("GET", "/v1/models/([^/]+)/aliases", _aliases),
    ("PUT", "/v1/models/([^/]+)/aliases/([^/]+)", _put_alias),
    ("POST", "/v1/models/([^/]+)/aliases/([^/]+)/rollback", _roll_back),
]


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # head and body go in two pieces, and the second would wait for an answer
    fake: FakeServer

    def log_message(self, *_: Any) -> None:
        pass

    def _serve(self) -> None:
        parts = urlsplit(self.path)
        query = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        body = self.rfile.read(int(self.headers.get("content-length", 0)))
        headers = {name.lower(): value for name, value in self.headers.items()}
        asked = Asked(self.command, parts.path, query, headers, body)
        self.fake.asked.append(asked)
        fault = self.fake.fault(asked)
        if fault is not None and fault.status:
            document = {**problem(fault.status, "fault", "Not now.")[1], **fault.document}
            self._answer(fault.status, document, fault.headers)
            return
        if headers.get("authorization") != f"Bearer {KEY}":
            self._answer(*problem(401, "unauthenticated", "The request needs a valid API key."))
            return
        if headers.get("accept") == "text/event-stream":
            self._stream(parts.path.split("/")[3], int(headers.get("last-event-id", 0)))
            return
        status, answer = self.fake.serve(asked)
        if fault is not None:
            self.close_connection = True
            return
        self._answer(status, answer)

    do_GET = do_POST = do_PATCH = do_PUT = do_DELETE = _serve

    def _answer(self, status: int, answer: Any, headers: dict[str, str] | None = None) -> None:
        link = answer.pop("_link", None) if isinstance(answer, dict) else None
        data = json.dumps(answer).encode()
        self.send_response(status)
        kind = "application/json" if status < 400 else "application/problem+json"
        for name, value in {"Content-Type": kind, "Content-Length": str(len(data)), **(headers or {})}.items():
            self.send_header(name, value)
        if link:
            self.send_header("Link", f'<{link}>; rel="next"')
        self.end_headers()
        self.wfile.write(data)

    def _stream(self, job_id: str, after: int) -> None:
        """Events until the job ends, or until the connection is cut as `cut_after` says."""
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        self.wfile.write(b": events of a job\r\n\r\n")
        left = self.fake.cut_after.pop(0) if self.fake.cut_after else -1
        sent = after
        while True:
            for event in [e for e in self.fake.events[job_id] if e["number"] > sent]:
                if left == 0:
                    return
                left -= 1
                sent = event["number"]
                data = json.dumps(event, ensure_ascii=False)
                self.wfile.write(f"id: {sent}\nevent: {event['kind']}\ndata: {data}\n\n".encode())
            if self.fake.jobs[job_id]["state"] != "running":
                return
            _finish(self.fake, self.fake.jobs[job_id])


@contextmanager
def fake_server() -> Iterator[FakeServer]:
    """A fake server that listens."""
    fake = FakeServer()
    handler = type("Handler", (_Handler,), {"fake": fake})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    fake.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield fake
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
