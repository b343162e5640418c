"""`kbuffer-importance` in the frame: each factor of VKB alone, off, and all of them, against the rule on the CPU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer.allocation.fill import budget_fill
from renderer.allocation.importance import VkbOptions, vkb_importance
from renderer.frame import Frame
from renderer.techniques import Budget, KBufferImportance
from schemas.fragments import FragmentDump

ALL = VkbOptions()
NONE = VkbOptions(depth=False, periphery=False, fresnel=False, noise=0.0)
FACTORS: dict[str, tuple[VkbOptions, VkbOptions]] = {
    "depth": (replace(ALL, depth=False), replace(NONE, depth=True)),
    "periphery": (replace(ALL, periphery=False), replace(NONE, periphery=True)),
    "fresnel": (replace(ALL, fresnel=False), replace(NONE, fresnel=True)),
    "noise": (replace(ALL, noise=0.0), replace(NONE, noise=0.1)),
}
"""Without each factor, and with it alone."""


def in_frame(frame: Frame, dump: FragmentDump, options: VkbOptions) -> np.ndarray:
    rendered = KBufferImportance(options).render(frame, Budget(dump.total // 3))
    assert rendered.captured == dump.total // 3
    return rendered.k


@pytest.mark.parametrize("factor", list(FACTORS))
def test_every_factor_can_be_switched(frame: Frame, dump: FragmentDump, factor: str) -> None:
    without, alone = FACTORS[factor]
    assert not np.array_equal(in_frame(frame, dump, without), in_frame(frame, dump, ALL))
    assert not np.array_equal(in_frame(frame, dump, alone), in_frame(frame, dump, NONE))


@pytest.mark.parametrize("options", [ALL, NONE, VkbOptions.thesis(), *(alone for _, alone in FACTORS.values())])
def test_the_frame_allocates_as_the_rule_does_on_the_dump(
    frame: Frame, dump: FragmentDump, options: VkbOptions
) -> None:
    budget = dump.total // 3
    weights = vkb_importance(dump.counts, dump.facing, dump.width, dump.height, options)
    expected = budget_fill(weights, dump.counts, budget)
    assert np.array_equal(in_frame(frame, dump, options), expected)
