"""Results of benchmarks say where they come from, and the committed pages show the committed figures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks import forgetting, provenance, suite, temporal
from benchmarks.casting import page as raycast
from benchmarks.casting.check import Effort
from benchmarks.chaos import page as chaos
from benchmarks.judging import page as judging
from benchmarks.labelling import page as labelling
from benchmarks.load import page as load
from benchmarks.outputs import write_figures
from benchmarks.render import page as render

BENCHMARKS = Path(provenance.__file__).parent
MACHINE = {"processor": "Abacus", "cores": "2", "memory": "1 GiB", "system": "Wood"}
PAGES: dict[str, tuple[str, Callable[[Any], str]]] = {
    "CHAOS": ("chaos", chaos.page),
    "FORGETTING": ("forgetting", forgetting.page),
    "LABELLER": ("labeller", labelling.page),
    "LOADER": ("loader", judging.page),
    "LOAD": ("service-load", load.page),
    "RAYCAST": ("raycast", lambda found: raycast.page(found, Effort())),
    "RENDERER": ("renderer", render.page),
    "TEMPORAL": ("temporal", temporal.page),
}


@pytest.mark.parametrize("name", PAGES)
def test_a_committed_page_shows_the_committed_figures(name: str) -> None:
    figures, write = PAGES[name]
    found = json.loads((BENCHMARKS / "results" / f"{figures}.json").read_text(encoding="utf-8"))
    assert write(found) == (BENCHMARKS / f"{name}.md").read_text(encoding="utf-8")


def test_the_suites_page_and_figures_show_its_committed_results() -> None:
    text, drawn = suite.published()
    assert text == suite.PAGE.read_text(encoding="utf-8")
    for file, svg in drawn.items():
        assert (BENCHMARKS / file).read_text(encoding="utf-8") == svg


def test_a_command_names_no_folder_of_the_machine() -> None:
    arguments = ["--bundle", "/home/somebody/bundle", "--out", "results/a.json", "--only", "two words"]
    command = provenance.head("benchmarks.renderer", arguments)["command"]
    assert command == "python -m benchmarks.renderer --bundle bundle --out results/a.json --only 'two words'"


def test_a_command_says_not_who_signs_in() -> None:
    command = provenance.head("benchmarks.service_load", ["--postgres", "postgresql://me:secret@here:5432/db"])[
        "command"
    ]
    assert command == "python -m benchmarks.service_load --postgres postgresql://here:5432/db"


def test_what_is_written_of_a_result_can_be_read_and_said(tmp_path: Path) -> None:
    found = provenance.head("benchmarks.renderer", [])
    with provenance.load_around(found):
        found["rows"] = [1, 2]
    write_figures(tmp_path / "new" / "a.json", found, {"a.svg": "<svg/>"})
    read = json.loads((tmp_path / "new" / "a.json").read_text())
    assert set(read) == {"created", "command", "machine", "versions", "commit", "load_average", "rows"}
    assert {len(loads) for loads in read["load_average"].values()} == {3}
    assert (tmp_path / "new" / "a.svg").read_text() == "<svg/>"
    assert provenance.said(read).endswith(f"; {read['created']}")


def test_the_driver_is_said_where_there_is_one() -> None:
    found = {"machine": MACHINE, "created": "today"}
    assert provenance.said(found) == "Abacus, 2 cores, 1 GiB; today"
    assert provenance.said({**found, "driver": "Beads 1.0"}) == "Abacus, 2 cores, 1 GiB; Beads 1.0; today"
