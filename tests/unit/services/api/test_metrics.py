"""The metrics as they are documented, and the board that asks for them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families
from support.api import Api

ROOT = Path(__file__).resolve().parents[4]
BOARD = ROOT / "deploy/grafana/diaphane.json"
DOCUMENT = ROOT / "docs/METRICS.md"


@pytest.fixture(scope="module")
def families(shared: Api) -> dict[str, Metric]:
    """What a server answers that has answered before, by name."""
    assert shared.get("/v1/jobs").status_code == 200
    text = shared.get("/v1/metrics").text
    return {family.name: family for family in text_string_to_metric_families(text)}


@pytest.fixture(scope="module")
def samples(families: dict[str, Metric]) -> dict[str, set[str]]:
    """Name of a sample -> its labels."""
    return {sample.name: set(sample.labels) for family in families.values() for sample in family.samples}


def _expressions() -> list[str]:
    board = json.loads(BOARD.read_text(encoding="utf-8"))
    return [target["expr"] for panel in board["panels"] for target in panel["targets"]]


@pytest.mark.parametrize("expression", _expressions())
def test_the_board_asks_for_what_there_is(expression: str, samples: dict[str, set[str]]) -> None:
    names = set(re.findall(r"\bdiaphane_\w+", expression))
    assert names
    assert names <= set(samples)
    asked = {label for group in re.findall(r"by \(([^)]*)\)", expression) for label in group.split(", ")}
    asked |= set(re.findall(r"[{,]\s*(\w+)\s*(?:=~|!=|=)", expression))
    assert all(asked <= samples[name] for name in names)
    assert expression.count("(") == expression.count(")")


def test_values_that_the_board_selects_exist(families: dict[str, Metric]) -> None:
    chosen = {value for one in _expressions() for value in re.findall(r'state=~?"([^"]+)"', one)}
    known = {
        sample.labels["state"] for family in families.values() for sample in family.samples if "state" in sample.labels
    }
    assert chosen
    assert {state for value in chosen for state in value.split("|")} <= known


def test_every_metric_is_on_the_board(families: dict[str, Metric]) -> None:
    shown = " ".join(_expressions())
    assert [name for name in families if name not in shown] == []


def test_every_metric_is_documented_with_its_type_and_labels(families: dict[str, Metric]) -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(diaphane_\w+)` \| (\w+) \| ([^|]*?) ?\|", text, re.MULTILINE)
    documented = {name: (kind, set(re.findall(r"`(\w+)`", labels))) for name, kind, labels in rows}
    found = {
        f"{name}_total" if family.type == "counter" else name: (
            family.type,
            {label for sample in family.samples for label in sample.labels} - {"le"},
        )
        for name, family in families.items()
    }
    assert documented == found
