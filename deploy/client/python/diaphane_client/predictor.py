"""A bundle's network on numpy, for those without a GPU: from features and a budget to the core of each pixel."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from diaphane_client.allocation import Cuts, allocate
from diaphane_client.constants import BINS, SHARE_LEVELS
from diaphane_client.errors import Refused
from diaphane_client.manifest import MANIFEST, MAX_MANIFEST_BYTES, WEIGHTS, Manifest, parse_manifest
from diaphane_client.network import Network, read_network
from diaphane_client.prices import Bins, gain_ranks, importance_ranks

SELF_TEST_TOLERANCE: Final = 1e-4
"""Largest difference of an answer to the manifest's rows, relative to its scale: another order of sums passes."""


@dataclass(frozen=True)
class Predictor:
    """A bundle that was read, and whose answers to its own test rows are right.

    Attributes:
        manifest: What it reads and answers, and the tail that has to be rendered behind its cores.
        network: Its weights.
    """

    manifest: Manifest
    network: Network

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Reads a bundle.

        Args:
            folder: As `pull` returns it.

        Raises:
            Refused: Manifest and weights are not valid, do not belong together, or fail the manifest's self-test.
            OSError: They cannot be read.
        """
        try:
            with (Path(folder) / MANIFEST).open("rb") as stream:
                manifest = parse_manifest(stream.read(MAX_MANIFEST_BYTES + 1))
            with (Path(folder) / WEIGHTS).open("rb") as stream:
                content = stream.read(manifest.files[WEIGHTS].bytes + 1)
            if hashlib.sha256(content).hexdigest() != manifest.files[WEIGHTS].sha256:
                raise ValueError(f"{WEIGHTS} is not the file that the manifest lists")
            predictor = cls(manifest, read_network(content, manifest))
            predictor._check()
        except ValueError as error:
            raise Refused(f"The bundle {folder} cannot be used: {error}.", "Pull it again.") from error
        return predictor

    @property
    def features(self) -> tuple[str, ...]:
        """Names of the inputs, in order; docs/BUNDLE.md says how each is made of a pixel's fragments."""
        return tuple(feature.name for feature in self.manifest.features)

    def answer(self, features: NDArray[np.floating]) -> NDArray[np.float32]:
        """What the network answers.

        Args:
            features: [P, C], columns `features`, not normalised.

        Returns:
            float32 [P, outputs], columns `manifest.outputs`.

        Raises:
            ValueError: There are more or fewer columns, or a number is not finite.
        """
        inputs = np.asarray(features)
        if inputs.ndim != 2 or inputs.shape[1] != len(self.features):
            raise ValueError(f"the network reads {len(self.features)} columns: {', '.join(self.features)}")
        if not np.isfinite(inputs).all():
            raise ValueError("features must be finite")
        return self.network.answer(inputs)

    def ranks(self, features: NDArray[np.floating], bins: Bins) -> NDArray[np.uint8]:
        """Ranks of the prices from which bins are worth their fragments.

        Args:
            features: [P, C], columns `features`, not normalised; zeros where a pixel has no fragments.
            bins: Of the same pixels, of the tail of the manifest.

        Returns:
            uint8 [P, bins], as the Python renderer has them, for `allocate`.

        Raises:
            ValueError: An argument is not as described.
        """
        tail = self.manifest.tail
        bins.check(BINS[tail])
        answers = self.answer(features)
        if len(answers) != len(bins.counts):
            raise ValueError("features and bins must be of the same pixels")
        if self.manifest.head == "importance":
            return importance_ranks(answers[:, 0], bins.counts)
        return gain_ranks(answers, bins, SHARE_LEVELS[tail])

    def predict(self, features: NDArray[np.floating], F: int, bins: Bins) -> Cuts:
        """The whole bins to keep exactly in each pixel, from the nearest; the tail holds the others.

        Args:
            features: [P, C], columns `features`, not normalised; zeros where a pixel has no fragments.
            F: Fragments to spend on all pixels together.
            bins: Of the same pixels, of the tail of the manifest.

        Returns:
            The cuts of the Python renderer, `sum k <= F`.

        Raises:
            ValueError: An argument is not as described.
        """
        return allocate(self.ranks(features, bins), bins.counts, F)

    def _check(self) -> None:
        test = self.manifest.self_test
        if not test.features:
            return
        difference = self.network.answer(np.array(test.features)) - np.array(test.outputs)
        if not (np.abs(difference) <= SELF_TEST_TOLERANCE * np.array(test.scale)).all():
            raise ValueError("the network does not answer its own test rows as it should")
