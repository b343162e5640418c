"""The k of the k+-buffer (Vasilakis and Fudos 2014): one for all pixels, from the histogram of depth complexity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def dynamic(n: NDArray[np.integer], budget: int) -> NDArray[np.int32]:
    """The largest k for all pixels that a budget holds, clipped to n.

    Args:
        n: [P], fragments of each pixel.
        budget: F, fragments to spend.

    Returns:
        int32 [P], `min(k, n)` with the largest k at which `sum min(k, n) <= F`.
    """
    # At least j fragments have deeper[j] pixels, so going from k = j - 1 to j costs deeper[j].
    histogram = np.bincount(np.asarray(n, dtype=np.int64), minlength=1)
    deeper = histogram[::-1].cumsum()[::-1]
    k = int(np.searchsorted(np.cumsum(deeper[1:]), budget, side="right"))
    return np.asarray(np.minimum(k, n), dtype=np.int32)
