"""The table of tails: what follows from a row, and that no shader numbers tails by itself."""

from __future__ import annotations

import re

import pytest

from renderer.programs import SHADERS
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, MOST_BINS, NO_TAIL, TAIL_NAMES, TAILS, TailKind, TailName


def test_names_are_listed_once_and_the_default_has_bins() -> None:
    assert tuple(TAILS) == TAIL_NAMES
    assert len(set(TAIL_NAMES)) == len(TAIL_NAMES)
    assert DEFAULT_TAIL in BINNED_TAILS
    assert {name for name, row in TAILS.items() if row.kind == TailKind.BINNED} == set(BINNED_TAILS)
    assert {row.kind for row in TAILS.values()} == set(TailKind)


@pytest.mark.parametrize("name", BINNED_TAILS)
def test_what_is_kept_of_bins_fits_into_its_bits(name: TailName) -> None:
    row = TAILS[name]
    assert row.bins % 4 == 0, "four to a texture"
    assert 0 < row.bins <= MOST_BINS
    assert 0 < row.share_levels <= 255
    assert 0 <= row.mean_levels <= 255
    assert row.kept_bytes <= row.gathered_bytes
    defines = row.defines
    assert (defines["BINS"], defines["SHARE_LEVELS"]) == (row.bins, row.share_levels)
    assert defines["MEAN_LEVELS"] == row.mean_levels


@pytest.mark.parametrize("name", TAIL_NAMES)
def test_a_shader_gets_every_kind_by_name(name: TailName) -> None:
    defines = TAILS[name].defines
    assert defines["TAIL"] == int(TAILS[name].kind)
    assert {f"TAIL_{kind.name}": int(kind) for kind in TailKind}.items() <= defines.items()
    assert ("BINS" in defines) == (name in BINNED_TAILS)


def test_no_shader_numbers_tails_by_itself() -> None:
    # `TAIL >= 0` asks whether there is any: NO_TAIL is below all kinds.
    assert min(TailKind) > NO_TAIL
    numbered = re.compile(r"\bTAIL\s*(==|!=|<|<=|>)\s*-?\d|\bTAIL\s*>=\s*[1-9]|#define\s+TAIL_[A-Z_]+\s+\d")
    paths = [path for path in SHADERS.rglob("*") if path.is_file()]
    assert len(paths) > 50
    assert [str(path) for path in paths if numbered.search(path.read_text(encoding="utf-8"))] == []
