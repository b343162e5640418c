"""What every technique takes and gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

from renderer.allocation.importance import VkbOptions
from renderer.frame import Frame
from schemas.tail import DEFAULT_TAIL, DENSITY_G, TailName

Family = Literal["exact", "bounded", "approximate"]
"""`exact`: every fragment in order; `bounded`: core fragments within a budget, and a tail; `approximate`: sums or a few
nodes for each pixel, whatever the budget."""

Inference = Literal["glsl", "onnx"]
"""How a bundle's network is run."""

ChainForm = Literal["auto", "one-pass", "two-pass"]
"""How the bounded techniques find the nearest fragments: `auto` is one pass where the driver has 64-bit atomics."""


@dataclass(frozen=True, slots=True)
class Budget:
    """How much a technique may spend, and how it fills in the rest.

    Attributes:
        fragments: F, slots of 8 bytes in the fragment pool.
        tail: How fragments beyond the core are approximated (METHOD.md section 2).
        g: The density tail's constant.
        chain: Form of the chain; tests and benchmarks force one.
    """

    fragments: int
    tail: TailName = DEFAULT_TAIL
    g: float = DENSITY_G
    chain: ChainForm = "auto"


Allocate = Callable[[Frame, Budget], NDArray[np.int32]]
"""Gives k(p), int32 [P], for a frame and a budget."""


@dataclass(frozen=True, slots=True)
class Needs:
    """What some techniques need besides a frame and a budget.

    Attributes:
        bundle: Folder of a bundle (`kbuffer-deep`, `kbuffer-temporal`).
        allocate: The allocation to render (`kbuffer-optimal`); the labeller's, which the renderer does not know.
        vkb: Factors of `kbuffer-importance`.
        inference: How `kbuffer-deep` runs its network.
        nodes: Nodes a pixel of `multilayer` and `adaptive`; None: 4 and 8, as in their papers.
        samples: Samples a pixel of `stochastic`; None: 8.
    """

    bundle: Path | None = None
    allocate: Allocate | None = None
    vkb: VkbOptions = field(default_factory=VkbOptions)
    inference: Inference = "glsl"
    nodes: int | None = None
    samples: int | None = None


@dataclass(frozen=True, slots=True)
class Rendered:
    """A finished picture, and what it cost.

    Attributes:
        linear: float32 [H, W, 3], linear RGB, row 0 at the top.
        k: int32 [P], fragments of each pixel that are kept apart (clipped to n); 0 where all are blended into sums.
        passes: Milliseconds of each pass, in order; shared passes (opaque, count, gather) as first measured.
        captured: Sum of k.
        pool_bytes: Bytes of storage that depend on the number of fragments or slots.
        pixel_bytes: Bytes a pixel of all other buffers that live beside the pool. The picture itself is not counted.
        early_bytes: Bytes a pixel at most before there is a pool, where that is known to be more than none.
        node_bytes: Bytes a pixel of a technique that keeps nodes in place where a device has fragment-shader interlock,
            as its authors count them, or of an engine's pool and heads; what is allocated here is its emulation. None:
            the technique is what is here.
        skips: What was not needed and is exact without it: words -> how often. See `renderer.techniques.skips`.
    """

    linear: NDArray[np.float32]
    k: NDArray[np.int32]
    passes: dict[str, float]
    captured: int
    pool_bytes: int
    pixel_bytes: int
    early_bytes: int = 0
    node_bytes: int | None = None
    skips: Mapping[str, int] = field(default_factory=dict)

    @property
    def total_bytes(self) -> int:
        """The peak of the frame: the pool and what lives beside it, or what was there before."""
        return max(self.pool_bytes + self.pixel_bytes * len(self.k), self.early_bytes * len(self.k))

    @property
    def compared_bytes(self) -> int:
        """What a technique's memory is compared by: the peak of the frame, or its nodes where those are emulated."""
        return self.total_bytes if self.node_bytes is None else self.node_bytes * len(self.k)

    @property
    def milliseconds(self) -> float:
        """Sum of the passes."""
        return sum(self.passes.values())


@dataclass(frozen=True, slots=True)
class Twin:
    """Where a technique is computed plainly in float64.

    Attributes:
        module: In `renderer.reference`, with a function `picture`; None: the hybrid of core and tail in
            `labeller.reference`.
        takes: `sorted`: a view's fragments, front to back; `submitted`: in the order in which they are drawn.
        slots: Fragments per pixel that an engine's pool has room for: the others are lost; None: all are kept.
    """

    module: str | None
    takes: Literal["sorted", "submitted"] = "sorted"
    slots: int | None = None


HYBRID: Final = Twin(None)


class Technique(ABC):
    """A way to render transparency.

    Attributes:
        name: The same in shaders, tests, manifests, commands and reports.
        family: See `Family`.
        about: One line for lists.
        twin: What its pictures are compared with.
        needs_bundle: Whether it runs a bundle's network.
        settles: Frames of a still camera after which its picture is what it is measured by; 1: every frame is by
            itself.
    """

    name: ClassVar[str]
    family: ClassVar[Family]
    about: ClassVar[str]
    twin: ClassVar[Twin]
    needs_bundle: ClassVar[bool] = False
    settles: ClassVar[int] = 1

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """The technique, with what it takes of some needs.

        Raises:
            Problem: What it needs was not given.
        """
        return cls()

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """What its twin is given beside a frame's fragments.

        Args:
            frame: The frame.
        """
        return {}

    @abstractmethod
    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame within a budget; a technique without one does not read it."""
