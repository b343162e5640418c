"""The uniform block is laid out as docs/BUNDLE.md says, and that page names every file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.training import random_weights, real_features

from renderer.features import FEATURES
from schemas.bundle import FEATURE_LIMIT, FILES
from trainer.export_ubo import ubo_data, ubo_source
from trainer.weights import activate

PAGE = Path(__file__).parents[3] / "docs" / "BUNDLE.md"


class Words:
    """Reads the words of a block one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, words: int, kind: str) -> NDArray[np.float64]:
        """Numbers of the next words."""
        part = self._data[16 * self._at : 16 * (self._at + words)]
        assert len(part) == 16 * words
        self._at += words
        return np.frombuffer(part, dtype=kind).astype(np.float64)

    @property
    def left(self) -> int:
        """Bytes that were not read."""
        return len(self._data) - 16 * self._at


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize(("inputs", "hidden"), [(1, ()), (5, (3,)), (8, (4, 9)), (26, (32, 16))])
def test_the_block_holds_what_the_page_says(inputs: int, hidden: tuple[int, ...], half: bool) -> None:
    weights, features = random_weights(1, FEATURES[:inputs], hidden), real_features(50, 1)
    words, quads = Words(ubo_data(weights, half=half)), -(-inputs // 4)
    x = np.pad(features[:, weights.columns].astype(np.float64), ((0, 0), (0, -inputs % 4)))
    mean = words.take(quads, "<f4")
    x = np.clip((x - mean) / words.take(quads, "<f4"), -FEATURE_LIMIT, FEATURE_LIMIT)
    for number, size in enumerate((*hidden, len(weights.outputs))):
        last = number == len(hidden)
        outputs = -(-size // 4)
        total = np.tile(words.take(outputs, "<f4"), (len(x), 1))
        for o in range(outputs):
            for i in range(x.shape[1] // 4):
                columns = (words.take(2, "<f2") if half and not last else words.take(4, "<f4")).reshape(4, 4)
                total[:, 4 * o : 4 * o + 4] += x[:, 4 * i : 4 * i + 4] @ columns
        x = total if last else np.maximum(total, 0.0)
    assert words.left == 0
    tolerance = 1e-2 if half else 1e-5
    answers = activate(weights.outputs, x[:, : len(weights.outputs)].astype(np.float32))
    np.testing.assert_allclose(answers, weights.run(features), rtol=tolerance, atol=tolerance)
    declared = re.search(r"diaphane_weights\[(\d+)\]; \}", ubo_source(weights, half=half))
    assert declared is not None
    assert 16 * int(declared[1]) == len(ubo_data(weights, half=half))


def test_another_network_of_the_same_shape_has_the_same_text() -> None:
    for half in (False, True):
        assert ubo_source(random_weights(1), half=half) == ubo_source(random_weights(2), half=half)


def test_the_page_names_every_file_of_a_bundle() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert [name for name in FILES if f"`{name}`" not in page] == []
