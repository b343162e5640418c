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

        (answers,) = self._session.get_outputs()
        self._output, self._columns = answers.name, int(answers.shape[1])

    def run(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """float32 [M, outputs], what the network answers to every row of float32 [M, features].

        Args:
            features: float32 [M, F], one row per pixel, not normalised, in the order of the bundle's features.
        """
        answers = np.empty((len(features), self._columns), dtype=np.float32)
        for first in range(0, len(features), ROWS):
            part = slice(first, first + ROWS)
            answers[part] = self._session.run([self._output], {"features": features[part]})[0]
        return answers
