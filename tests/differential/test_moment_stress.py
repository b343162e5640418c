"""The shader's arithmetic of `moment` on lists that no scene has, float32 against the float64 twin."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from evaluation.stress.gl_moment import KINDS, ONE_FAR, bound_of, composited, lists, program
from renderer.reference import moment as twin


@pytest.mark.parametrize("n", [1, 2, 3, 5, 20, 300, 4096])
@pytest.mark.parametrize("kind", KINDS)
def test_float32_stays_near_float64(ctx: moderngl.Context, kind: str, n: int) -> None:
    shader = program(ctx)
    for alpha in (1, 128, 254, None):
        dump = lists(kind, n, alpha, seed=n)
        found, expected = composited(ctx, shader, dump), twin.picture(dump)
        error = np.abs(found - expected)
        assert np.isfinite(found).all()
        assert error.max() < bound_of(kind, n)[1].value
        if kind == ONE_FAR:
            # The spread of the near group is less than the bias and the rounding of the moments: they do not say which
            # of it is in front. What remains is an average of its colours.
            assert error.mean() < 5e-2
            assert found.min() > -1e-6
            assert found.max() < 1.0 + 1e-6
