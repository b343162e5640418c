"""benchmarks/CHAOS.md, from the figures."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Mapping
from typing import Any

from benchmarks.markdown import table
from benchmarks.provenance import said, said_load

Figures = Mapping[str, Any]

_ABOUT = """\
{builds} builds of {families} pairs of scenes run twice on PostgreSQL and an S3-compatible store (moto), each time on an
empty one: once undisturbed, and once while processes are killed. The builds are real and small: scenes are uploaded,
checked, rendered at {width}x{height}, labelled, trained on for {steps} steps and more, exported, evaluated, published
and reported. Builds of a pair share its dumps and labels. {at_once} builds are under way at once, submitted to two API
servers with idempotency keys. The processes are {processes}; heartbeats ({heartbeat:g} s) and time to live ({ttl:g} s)
are the defaults.

A SIGKILL hits an API server, a worker of any role, or the child process that a task runs in, mostly one that is at
work. What was killed is started again at once, as a supervisor does. No task is hit more than twice, since one whose
process is killed three times is given up by design. The store and then PostgreSQL are away for {away:g} s, and a server
and a worker are killed meanwhile.

*Recovery* is the time from a kill until all that the process did is being done by another one, or is done; for an API
server, until the one started in its place is ready. It contains the wait for a free worker, and the start of a Python
process where no other one of the kind is free. After an outage it counts from the return.
"""

_CHECKED = """\
Afterwards every job has succeeded without a retry and has one version, no bundle has two, no task is left, every
artifact is read and matches its hashes, events are numbered without gaps. When all processes have been asked to end,
none is left, nor a room, a claim, a row of a process that has ended, or a temporary file that retention would not
remove.
"""


def page(found: Figures) -> str:
    """Markdown."""
    load = found["load_average"]
    parts = [
        "# Kills while builds run",
        f"*{said(found)}; {said_load(load['before'][0], load['after'][0])}.*",
        f"```\n{found['command']}\n```",
        _about(found["settings"]),
        table(("", "undisturbed", "disturbed"), _results(found)),
        _CHECKED,
        "Faults: " + ("none." if not found["faults"] else f"{', '.join(found['faults'])} (see the figures)."),
        "## Recovery, seconds",
        table(("what was hit", "kills", "at work", "p50", "p95", "max"), _recovery(found)),
        f"The slowest: {'; '.join(map(_slow, found['slowest'][:5]))}.",
    ]
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def _about(settings: Figures) -> str:
    counted: Counter[str] = Counter(settings["processes"])
    width, height = settings["size"]
    text = _ABOUT.format(
        builds=settings["builds"],
        families=settings["families"],
        width=width,
        height=height,
        steps=settings["steps"],
        at_once=settings["builds_at_once"],
        processes=", ".join(f"{count} {kind}" for kind, count in counted.items()),
        heartbeat=settings["heartbeat_seconds"],
        ttl=settings["ttl_seconds"],
        away=settings["away_seconds"],
    )
    return "\n\n".join(textwrap.fill(paragraph, 120) for paragraph in text.split("\n\n"))


def _results(found: Figures) -> list[tuple[Any, ...]]:
    builds, bundles = found["settings"]["builds"], found["bundles"]
    return [
        ("SIGKILLs", 0, sum(count for what, count in found["kills"].items() if what not in ("store", "database"))),
        ("builds", builds, found["jobs"]["submitted"]),
        ("lost", 0, found["jobs"]["lost"]),
        ("bundles published twice", 0, bundles["published_twice"]),
        ("bundles with the same digest", "", f"{bundles['equal']} of {builds}"),
        ("requests repeated", "", found["requests_repeated"]),
        ("seconds", found["seconds"]["undisturbed"], found["seconds"]["disturbed"]),
    ]


def _recovery(found: Figures) -> list[tuple[Any, ...]]:
    times = found["recovery_seconds"]
    counts = {"all": sum(found["kills"].values()), **found["kills"]}
    return [
        (what, counts[what], group["count"], *(f"{group[name]:.1f}" for name in ("p50", "p95", "max")))
        for what, group in times.items()
    ]


def _slow(kill: Figures) -> str:
    return f"{kill['what']} ({kill['doing']}) {kill['seconds']:.1f} s"
