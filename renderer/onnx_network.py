"""A bundle's network in onnxruntime on the CPU: the renderer's second way to run it, besides GLSL."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import onnxruntime

ROWS = 8192
"""Pixels of one run: their activations stay in the cache."""


class OnnxNetwork:
    """The network of a bundle.

    Args:
        model: `model.onnx`.
    """

    def __init__(self, model: Path) -> None:
        import onnxruntime  # takes a second; only who asks for this inference pays

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = len(os.sched_getaffinity(0))
        self._session: onnxruntime.InferenceSession = onnxruntime.InferenceSession(
            model.read_bytes(), options, providers=["CPUExecutionProvider"]
        )

    def run(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """float32 [M, 2], a and b of every row of float32 [M, features]."""
        gain = np.empty((len(features), 2), dtype=np.float32)
        for first in range(0, len(features), ROWS):
            part = slice(first, first + ROWS)
            gain[part, 0], gain[part, 1] = self._session.run(["a", "b"], {"features": features[part]})
        return gain
