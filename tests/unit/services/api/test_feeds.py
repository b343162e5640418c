from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from support.api import Api

from services.api import feeds as module

STREAM = {"Accept": "text/event-stream"}


@contextmanager
def _listening(api: Api, url: str, job: str, last: int | None = None) -> Iterator[Iterator[str]]:
    headers = {**STREAM, **api.headers("read")} | ({} if last is None else {"Last-Event-ID": str(last)})
    with (
        httpx.Client(timeout=20.0) as client,
        client.stream("GET", f"{url}/v1/jobs/{job}/events", headers=headers) as answer,
    ):
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield answer.iter_lines()


def _numbers(lines: Iterator[str]) -> list[int]:
    return [int(line.removeprefix("id: ")) for line in lines if line.startswith("id: ")]


def _until(condition: object) -> None:
    end = time.monotonic() + 20.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_page_of_events_and_the_next(api: Api) -> None:
    job = api.job()
    api.log(job, *"abcdef")
    page = api.get(f"/v1/jobs/{job}/events?limit=4")
    assert [event["number"] for event in page.json()["items"]] == [1, 2, 3, 4]
    rest = api.get(page.links["next"]["url"])
    assert rest.json()["items"][0]["number"] == 5
    assert "next" not in rest.links
    assert api.get(f"/v1/jobs/{job}/events?after=2").json()["items"][0]["number"] == 3


def test_a_stream_begins_after_the_last_event_and_ends_with_the_job(api: Api) -> None:
    job = api.job()
    api.log(job, "a", "b")
    with api.served() as url, _listening(api, url, job, 1) as lines:
        # As another process would: straight into the database.
        threading.Timer(0.3, api.log, [job, "c"]).start()
        threading.Timer(0.6, api.move, [job, "succeeded"]).start()
        texts = list(lines)
    assert _numbers(iter(texts)) == list(range(2, _last(api, job) + 1))
    data = [json.loads(text.removeprefix("data: ")) for text in texts if text.startswith("data: ")]
    assert data[-1]["kind"] == "state"
    assert data[-1]["data"] == {"state": "succeeded"}


def _last(api: Api, job: str) -> int:
    state = api.app.state.feeds.state(job)
    assert state is not None
    return int(state[0])


def test_a_stream_of_a_job_that_has_ended(api: Api) -> None:
    job = api.job()
    api.move(job, "failed")
    last = _last(api, job)
    with api.served() as url:
        with _listening(api, url, job) as lines:
            assert _numbers(lines) == list(range(1, last + 1))
        headers = {**STREAM, **api.headers("read")}
        path = f"{url}/v1/jobs/{job}/events"
        done = httpx.get(path, headers={**headers, "Last-Event-ID": str(last)})
        assert done.status_code == 204
        assert httpx.get(path, headers={**headers, "Last-Event-ID": "x"}).status_code == 400
        none = httpx.get(f"{url}/v1/jobs/job_{'0' * 24}/events", headers=headers)
        assert none.status_code == 404


def test_fifty_listeners_cost_what_one_costs(api: Api) -> None:
    jobs = [api.job(), api.job()]
    feeds = api.app.state.feeds
    received: dict[int, list[int]] = {}

    def listen(index: int) -> None:
        with _listening(api, url, jobs[index % 2]) as lines:
            received[index] = _numbers(lines)

    with api.served() as url:
        threads = [threading.Thread(target=listen, args=(index,)) for index in range(50)]
        for thread in threads:
            thread.start()
        _until(lambda: feeds.listeners == 50)
        looks, begun = feeds.looks, time.monotonic()
        for text in "abcdefghij":
            for job in jobs:
                api.log(job, text)
            time.sleep(0.05)
        for job in jobs:
            api.move(job, "cancelled")
        for thread in threads:
            thread.join(20.0)
        ticks = (time.monotonic() - begun) / module.TICK_SECONDS
        assert feeds.looks - looks <= ticks + 3
    assert {tuple(numbers) for numbers in received.values()} == {tuple(range(1, _last(api, jobs[0]) + 1))}
    assert len(received) == 50
    _until(lambda: feeds.listeners == 0)


def test_a_listener_that_leaves_is_noticed(api: Api) -> None:
    job = api.job()
    with api.served() as url:
        with _listening(api, url, job) as lines:
            next(lines)
            assert api.app.state.feeds.listeners == 1
        _until(lambda: api.app.state.feeds.listeners == 0)


def test_a_server_that_stops_ends_its_streams(api: Api) -> None:
    job = api.job()
    ended = threading.Event()

    def listen() -> None:
        with _listening(api, url, job) as lines:
            list(lines)
        ended.set()

    with api.served() as url:
        threading.Thread(target=listen, daemon=True).start()
        _until(lambda: api.app.state.feeds.listeners == 1)
        begun = time.monotonic()
    assert time.monotonic() - begun < 3.0
    assert ended.wait(5.0)


async def _collect(feeds: module.Feeds, job: str, after: int = 0) -> list[str]:
    state = feeds.state(job)
    assert state is not None
    return [piece.decode() async for piece in feeds.listen(job, after, state)]


def test_silence_is_broken_by_comments(api: Api) -> None:
    job = api.job()
    feeds = module.Feeds(api.service.database, tick=0.01, heartbeat=0.05)
    threading.Timer(0.4, api.move, [job, "failed"]).start()
    pieces = asyncio.run(_collect(feeds, job))
    assert pieces.count(": still here\n\n") >= 2


def test_a_listener_far_behind_reads_pages_until_it_has_caught_up(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PAGE", 7)
    monkeypatch.setattr(module, "_KEPT", 5)
    job = api.job()
    api.log(job, *map(str, range(50)))
    feeds = module.Feeds(api.service.database, tick=0.01)

    def go_on() -> None:
        api.log(job, *map(str, range(50)))
        api.move(job, "failed")

    threading.Timer(0.2, go_on).start()
    text = "".join(asyncio.run(_collect(feeds, job, 3)))
    assert _numbers(iter(text.splitlines())) == list(range(4, _last(api, job) + 1))


def test_a_job_that_is_removed_ends_its_streams(api: Api) -> None:
    job = api.job()
    feeds = module.Feeds(api.service.database, tick=0.01)

    def remove() -> None:
        from services.database import tables

        with api.service.database.write() as connection:
            connection.execute(tables.jobs.delete().where(tables.jobs.c.id == job))

    threading.Timer(0.2, remove).start()
    assert asyncio.run(asyncio.wait_for(_collect(feeds, job), 10.0))
