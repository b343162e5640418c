"""The card: the same whatever the order, readable whatever a scene states, and honest about what was lost."""

from __future__ import annotations

from pathlib import Path

from support.bundles import make_bundle
from support.runner import measurement

from schemas.bundle import CARD, load_manifest, network_digest, write_card
from schemas.measurement import Measurement
from services.model_card import model_card


def measured(scene: str, deep: float, vkb: float = 2e-5, view: str = "front") -> list[Measurement]:
    errors = {"kbuffer-deep": deep, "kbuffer-importance": vkb, "kbuffer-optimal": 1e-6}
    return [Measurement.model_validate({**measurement(n, e, view=view), "scene": scene}) for n, e in errors.items()]


def test_the_worst_scenes_and_cells_come_first_and_order_does_not_count(tmp_path: Path) -> None:
    manifest = load_manifest(make_bundle(tmp_path / "bundle"))
    found = [*measured("good", 1e-5), *measured("bad", 8e-5), *measured("bad", 4e-5, view="back")]
    card = model_card(manifest, "diaphane build", found)
    assert "In 2 of 3 cells (scene, view, budget) its squared error is more than VKB's." in card
    assert card.index("| bad | 2.83 |") < card.index("| good | 0.500 |")
    assert card.index("| bad | front | 1 | 4.00 |") < card.index("| bad | back | 1 | 2.00 |")
    assert model_card(manifest, "diaphane build", found[::-1]) == card
    for heading in (
        "What it is for",
        "Training scenes",
        "What it was measured on",
        "Where it fails",
        "How it was made",
    ):
        assert f"\n## {heading}\n" in card
    assert "\n## What must not be claimed\n" in card


def test_a_licence_cannot_break_the_table(tmp_path: Path) -> None:
    folder = make_bundle(tmp_path / "bundle", licences={"bottles": "MIT | <b>*x*</b> `y` [z](w)"})
    card = model_card(load_manifest(folder), "diaphane build", ())
    assert "| bottles | MIT \\| \\<b\\>\\*x\\*\\</b\\> \\`y\\` \\[z\\](w) | allowed |" in card


def test_a_card_is_a_file_of_the_bundle_and_leaves_its_network(tmp_path: Path) -> None:
    folder = make_bundle(tmp_path / "bundle")
    before = load_manifest(folder).files
    for text in ("# One\n", "# Two\n"):
        write_card(folder, text)
        files = load_manifest(folder).files
        assert (folder / CARD).read_text(encoding="utf-8") == text
        assert set(files) - set(before) == {CARD}
        named = ({name: file.sha256 for name, file in found.items()} for found in (before, files))
        assert len({network_digest(found) for found in named}) == 1
