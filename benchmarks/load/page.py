"""The figures as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.markdown import row
from benchmarks.provenance import said, said_load

Figures = Mapping[str, Any]


def page(found: Figures) -> str:
    """Markdown."""
    lines = ["# The service under load", "", *_head(found)]
    if "blobs" in found:
        lines += ["", "## Speed of blobs", "", *_blobs(found["blobs"])]
    if "ready" in found:
        lines += ["", "## Time until it is ready", "", *_ready(found["ready"])]
    for name, run in found.get("queued", {}).items():
        lines += ["", f"## Jobs stay queued: {name}", "", *_run(run)]
    for name, run in found.get("flow", {}).items():
        lines += ["", f"## Jobs flow: {name}", "", *_flow(run), "", *_run(run)]
    return "\n".join(lines) + "\n"


def _head(found: Figures) -> Iterator[str]:
    yield (
        f"*{said(found)}; {_load(found)}.* Python {found['versions']['python']}; server and clients share the machine."
    )
    yield ""
    yield "Errors in all: " + str(found["errors"]) + "."
    yield ""
    yield "```"
    yield found["command"]
    yield "```"
    yield ""
    yield (
        "Every answer is checked: status, length, the hash of a part of the blobs, filter and order of measurements, "
        "gapless numbers of events (every fifth listener leaves and comes back with `Last-Event-ID`). A reader that is "
        "paced waits 1 s on average after each answer; one that is flat out waits for nothing, so that its latency is "
        "the number of readers over the throughput. The seconds of an `event` go from its writing to its arrival; the "
        "service looks for news every 0.25 s."
    )


def _blobs(blobs: Figures) -> Iterator[str]:
    yield f"One file of {blobs['bytes'] >> 20} MiB over loopback, {blobs['rounds']} rounds in turns; MiB/s:"
    yield ""
    yield "| server | median | least | most | service / it, median of rounds | least |"
    yield "|---|---:|---:|---:|---:|---:|"
    for name, figures in blobs["mib_per_second"].items():
        share = blobs["share"].get(name, {"median": "", "least": ""})
        yield row((name, figures["median"], figures["least"], figures["most"], share["median"], share["least"]))
    small = blobs["parallel_64_kib"]
    yield ""
    yield f"{small['bytes'] >> 10} KiB over {small['connections']} connections at once; requests a second:"
    yield ""
    yield "| server | median | least | most |"
    yield "|---|---:|---:|---:|"
    for name, figures in small["per_second"].items():
        yield row((name, figures["median"], figures["least"], figures["most"]))
    yield ""
    yield _when(blobs)
    if "note" in blobs:
        yield ""
        yield f"Note: {blobs['note']}."


def _ready(ready: Figures) -> Iterator[str]:
    yield "`diaphane serve`, all roles, SQLite; from the start of the process to the first 200 of `/v1/health/ready`:"
    yield ""
    yield "| state folder | median s | processor s | all |"
    yield "|---|---:|---:|---|"
    for name in ("new", "old"):
        figures = ready[f"{name}_state"]
        every = " ".join(f"{seconds:.2f}" for seconds in figures["seconds"])
        yield row((name, figures["median_seconds"], figures["median_cpu_seconds"], every))
    yield ""
    imports = ready["imports"]
    dearest = ", ".join(f"{name} {ms:.0f}" for name, ms in list(imports["packages_ms"].items())[:12])
    yield f"Imports: {imports['count']} modules, {imports['total_ms']:.0f} ms traced; own ms by package: {dearest}."
    yield ""
    yield _when(ready)


def _flow(run: Figures) -> Iterator[str]:
    after = run["all_ended_after_seconds"]
    yield (
        f"`diaphane serve` with all roles works off {run['jobs_submitted']} `render` jobs whose artifacts exist: "
        f"{run['jobs_succeeded']} succeeded, {run['jobs_failed']} failed, {run['jobs_per_minute']:.0f} a minute, "
        + ("not all in the time given." if after is None else f"all after {after:.0f} s.")
    )


def _run(run: Figures) -> Iterator[str]:
    server = run["server"]
    yield (
        f"{run['readers']} readers, {run['listeners']} listeners ({run['streams_ended_well']} streams ended well), "
        f"{run['jobs_submitted']} jobs, {run['seconds']:.0f} s: **{run['errors']} errors**. Server: resident "
        f"{server['rss_first_mib']:.0f} MiB at first, {server['rss_max_mib']:.0f} at most, slope of the second half "
        f"{server['rss_slope_mib_per_minute']:+.1f} MiB/min; {server['cpu']:.2f} cores. Database "
        f"{run['database_mib']:.0f} MiB. {_when(run)}"
    )
    yield ""
    yield "| operation | count | per s | p50 ms | p95 ms | p99 ms | most ms |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    for name, figures in run["operations"].items():
        keys = ("count", "per_second", "p50_ms", "p95_ms", "p99_ms", "max_ms")
        yield row((name, *(figures[key] for key in keys)))


def _when(part: Figures) -> str:
    return f"Measured {part['created']}; {_load(part)}."


def _load(part: Figures) -> str:
    load = part["load_average"]
    return said_load(load["before"][0], load["after"][0])
