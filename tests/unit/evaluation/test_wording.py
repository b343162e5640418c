from __future__ import annotations

import pytest

from evaluation.wording import counted


@pytest.mark.parametrize(
    ("count", "things", "said"),
    [
        (0, "views", "0 views"),
        (1, "views", "1 view"),
        (1200, "views", "1,200 views"),
        (1, "meshes", "1 mesh"),
        (1, "images", "1 image"),
        (1, "fragments behind opaque surfaces", "1 fragment behind opaque surfaces"),
        (1, "empty tiles", "1 empty tile"),
        (2, "empty tiles", "2 empty tiles"),
    ],
)
def test_a_number_agrees_with_its_noun(count: int, things: str, said: str) -> None:
    assert counted(count, things) == said
