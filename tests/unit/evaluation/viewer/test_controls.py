"""Keys: each changes what it says, nothing else, and comes to no place that cannot be rendered."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from evaluation.viewer.controls import FACTORS, KEYS, Look, Place, key_help
from evaluation.viewer.layout import LAYOUTS
from schemas.tail import TAIL_NAMES
from schemas.view import View

VIEWS = tuple(View(name=name, eye=(x, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)) for name, x in
              (("front", 0.0), ("side", 3.0)))  # fmt: skip
PLACE = Place(("kbuffer", "sbuffer", "moment"), VIEWS, (0.0, 1.0, 0.0), np.array([[-1.0] * 3, [1.0] * 3]))
LOOK = Look(VIEWS[0], (40, 30), "kbuffer", "sbuffer", 2.0, "density-16")


def pressed(*names: str, look: Look = LOOK) -> Look:
    for name in names:
        look = KEYS[name].change(look, PLACE)
    return look


def changed(look: Look) -> set[str]:
    return {field.name for field in fields(Look) if getattr(look, field.name) != getattr(LOOK, field.name)}


@pytest.mark.parametrize(
    ("name", "what"),
    [
        *((name, "view") for name in KEYS if any(part in name for part in ("LEFT", "RIGHT", "UP", "DOWN", "PAGE"))),
        ("N", "view"),
        *((name, "left") for name in "QA"),
        *((name, "right") for name in "WS"),
        *((name, "factor") for name in "BV"),
        *((name, "tail") for name in ("T", "shift+T")),
        *((f"NUMBER_{number}", "layout") for number in (1, 3, 4, 5)),
        *((name, "split") for name in ("COMMA", "PERIOD")),
        *((name, "gain") for name in ("G", "shift+G")),
        ("F", "perceptual"),
        ("I", "readout"),
        ("H", "help"),
    ],
)
def test_a_key_changes_one_thing(name: str, what: str) -> None:
    assert changed(pressed(name)) == {what}


def test_techniques_and_tails_go_round() -> None:
    assert [pressed(*"Q" * n).left for n in range(4)] == ["kbuffer", "sbuffer", "moment", "kbuffer"]
    assert pressed("A").left == "moment"
    assert pressed("W", "S") == LOOK
    assert pressed(*["T"] * len(TAIL_NAMES)) == LOOK
    assert pressed("shift+T").tail == TAIL_NAMES[TAIL_NAMES.index("density-16") - 1]


def test_budgets_stay_in_their_range_and_hold_a_fragment() -> None:
    assert pressed("B").factor == 3.0
    assert pressed("V").factor == 1.5
    assert pressed(*"B" * 30).factor == FACTORS[-1]
    assert pressed(*"V" * 30).factor == FACTORS[0]
    odd = Look(VIEWS[0], (1, 1), "kbuffer", "sbuffer", 1.25, "paper")
    assert pressed("V", look=odd).factor == 1.0
    assert pressed("V", "V", look=odd).factor == 1.0  # .75 of one pixel is no fragment


def test_layouts_divider_and_amplification() -> None:
    assert [pressed(f"NUMBER_{n}").layout for n in range(1, 6)] == list(LAYOUTS)
    assert pressed(*["PERIOD"] * 100).split == 1.0
    assert pressed(*["COMMA"] * 100).split == 0.0
    assert pressed(*["G"] * 20).gain == 1024.0
    assert pressed(*["shift+G"] * 20).gain == 1.0


def test_cameras_follow_each_other_and_home_is_the_one_as_it_was() -> None:
    assert pressed("N").view == VIEWS[1]
    assert pressed("N", "N").view == VIEWS[0]
    led = pressed("N", "LEFT", "shift+UP", "PAGE_UP")
    assert led.view.name == "side"
    assert led.view != VIEWS[1]
    assert pressed("HOME", look=led).view == VIEWS[1]


def test_arrows_and_their_opposites_undo_each_other() -> None:
    for one, other in (("LEFT", "RIGHT"), ("UP", "DOWN"), ("PAGE_UP", "PAGE_DOWN"), ("shift+UP", "shift+DOWN")):
        back = pressed(one, other).view.world_to_view()
        assert back == pytest.approx(LOOK.view.world_to_view(), abs=1e-9)


def test_right_is_where_the_camera_goes() -> None:
    assert pressed("RIGHT").view.eye[0] > 0.0
    assert pressed("UP").view.eye[1] > 1.0
    assert pressed("shift+RIGHT").view.eye[0] > 0.0
    assert np.linalg.norm(pressed("PAGE_UP").view.eye) < np.linalg.norm(LOOK.view.eye)


def test_every_line_of_the_help_has_a_key_and_a_meaning() -> None:
    lines = key_help()
    assert all(len(line.split("\t")) == 2 and all(line.split("\t")) for line in lines)
    assert len(set(lines)) == len(lines)
