"""Jobs that really flow: `diaphane serve` with all roles works them off, while others read, submit and listen."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any

from benchmarks.load import traffic
from benchmarks.load.figures import Tally
from benchmarks.load.http import ClientError, Connection
from benchmarks.load.phases import Plan, run
from benchmarks.load.seed import Seed
from services.settings import Settings
from services.storage import open_storage

SCENE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "Pane" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    color3f[] primvars:displayColor = [(0.2, 0.5, 0.9)]
    float[] primvars:displayOpacity = [0.4]
}
"""
CHECK_SECONDS = 60.0


def prepare(port: int, seed: Seed, settings: Settings) -> Seed:
    """Registers a scene that can be rendered, and runs one job on it: all others find its artifacts.

    Raises:
        RuntimeError: The scene is refused, or the job fails.
    """
    sha256 = open_storage(settings).blobs.put_bytes(SCENE.encode()).sha256
    return replace(seed, scene=asyncio.run(_prepare(port, seed, sha256)))


def run_flowing(port: int, seed: Seed, plan: Plan) -> tuple[Tally, dict[str, Any]]:
    """Submits jobs, which are worked off; what happened, and counts.

    Args:
        port: Of the service.
        seed: What it holds, with a scene that can be rendered.
        plan: What is done; `seconds` is also how long the jobs may take in all, and then they are cancelled.
    """
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        reads = pool.submit(run, traffic.read_all, port, seed, plan.mix, plan.seconds)
        others = pool.submit(run, _submit_and_listen, port, seed, plan)
        tally, counts = others.result()
        tally.add(reads.result())
    return tally, counts


async def _prepare(port: int, seed: Seed, sha256: str) -> str:
    document = {"name": "pane", "root": "pane.usda", "files": {"pane.usda": sha256}}
    async with Connection(port, seed.key) as connection:
        answer = await connection.request("POST", "/v1/scenes", document=document)
        scene = await _until(connection, f"/v1/scenes/{answer.json()['id']}", ("accepted", "rejected"))
        if scene["state"] != "accepted":
            raise RuntimeError(f"the scene is refused: {scene['problem']}")
        found = str(scene["id"])
        answer = await connection.request("POST", "/v1/jobs", document=replace(seed, scene=found).spec())
        job = await _until(connection, f"/v1/jobs/{answer.json()['id']}", traffic.FINAL)
        if job["state"] != "succeeded":
            raise RuntimeError(f"the first job ended {job['state']}: {job['problem']}")
    return found


async def _until(connection: Connection, path: str, states: Sequence[str]) -> dict[str, Any]:
    end = time.monotonic() + CHECK_SECONDS
    while time.monotonic() < end:
        answer = await connection.request("GET", path)
        record: dict[str, Any] = answer.json()
        if record.get("state") in states:
            return record
        await asyncio.sleep(0.2)
    raise RuntimeError(f"{path} did not come to {' or '.join(states)} within {CHECK_SECONDS:g} s")


async def _submit_and_listen(port: int, seed: Seed, plan: Plan) -> tuple[Tally, dict[str, Any]]:
    tally, begun = Tally(), time.perf_counter()
    end = begun + plan.seconds
    # The jobs that are followed are submitted last, so that they wait behind all others.
    first = asyncio.create_task(
        traffic.submit_all(port, seed, [seed.spec()] * (plan.jobs - plan.followed), plan.per_second, tally)
    )
    listened: list[str] = []
    submitted = await first
    listened = await traffic.submit_all(port, seed, [seed.spec()] * plan.followed, plan.per_second, tally)
    took = time.perf_counter() - begun
    listening = [listened[number % len(listened)] for number in range(plan.listeners)]
    streams = asyncio.create_task(traffic.listen_all(port, seed.key, listening, tally, end + 60.0))
    ids = set(submitted) | set(listened)
    counts, drained = await _drain(port, seed, ids, end)
    if drained is None:
        await _cancel(port, seed)
    ended = await streams
    failed = counts["failed"] + (counts["cancelled"] if drained is not None else 0)
    if failed:
        tally.wrong("job", f"{failed} did not succeed")
    figures = {
        "jobs_submitted": len(ids),
        "submitted_within_seconds": round(took, 1),
        "jobs_succeeded": counts["succeeded"],
        "jobs_failed": counts["failed"],
        "all_ended_after_seconds": None if drained is None else round(drained - begun, 1),
        "jobs_per_minute": round(60.0 * counts["succeeded"] / ((drained or time.perf_counter()) - begun), 1),
        "streams_ended_well": ended,
    }
    return tally, figures


async def _drain(port: int, seed: Seed, ids: set[str], end: float) -> tuple[Counter[str], float | None]:
    """States of the jobs, and when all had ended; None if they had not at the end."""
    async with Connection(port, seed.key) as connection:
        while True:
            waiting = await connection.request("GET", "/v1/workers")
            queues = waiting.json()["queues"]
            left = sum(queue["queued"] + queue["running"] for queue in queues)
            now = time.perf_counter()
            if not left or now > end:
                records = await traffic.pages(connection, "/v1/jobs?limit=200")
                counts = Counter(job["state"] for job in records if job["id"] in ids)
                if sum(counts.values()) != len(ids):
                    raise ClientError(f"{len(ids) - sum(counts.values())} jobs are not in the list")
                return counts, now if sum(counts[state] for state in traffic.FINAL) == len(ids) else None
            await asyncio.sleep(0.5)


async def _cancel(port: int, seed: Seed) -> None:
    async with Connection(port, seed.key) as connection:
        for state in ("queued", "running"):
            for job in await traffic.pages(connection, f"/v1/jobs?state={state}&limit=200"):
                await connection.request("POST", f"/v1/jobs/{job['id']}/cancel")
