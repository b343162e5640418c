"""Stacks of transparent quads, thousands of layers over the same few pixels: what compositing does at its limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.scene import Batch, SceneArrays
from schemas.view import View

VIEW = View(name="stacks", eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), up=(0.0, 1.0, 0.0), fov=90.0)
STRIDE, SIDE = 6, 2
"""Pixels from stack to stack, and of a quad's side."""


@dataclass(frozen=True, slots=True)
class Stack:
    """Layers that cover the same pixels.

    Attributes:
        depth: float [n], metres.
        alpha: int [n], 1..254.
    """

    depth: NDArray[np.float64]
    alpha: NDArray[np.integer]


def extreme_stacks(layers: int) -> dict[str, Stack]:
    """Opacities at both ends of what is stored, equal depths, and depths from near to far over almost four decades."""
    rng = np.random.default_rng(5)
    apart = np.linspace(10.0, 20.0, layers)
    any_alpha = rng.integers(1, 255, layers)
    return {
        "alpha 1": Stack(apart, np.full(layers, 1)),
        "alpha 128": Stack(apart, np.full(layers, 128)),
        "alpha 254": Stack(apart, np.full(layers, 254)),
        "any alpha": Stack(rng.uniform(10.0, 20.0, layers), any_alpha),
        "equal depths": Stack(np.full(layers, 15.0), rng.integers(1, 8, layers)),
        "near to far": Stack(np.geomspace(0.2, 1000.0, layers), rng.choice([1, 2, 128, 254], layers)),
    }


def size(stacks: int) -> tuple[int, int]:
    """Width and height of the picture of some stacks: side by side, with empty pixels around each."""
    return STRIDE * stacks, STRIDE


def stack_scene(stacks: dict[str, Stack]) -> SceneArrays:
    """The quads in random colours, submitted in random order. In `VIEW` at `size`, stack i is at column i."""
    rng = np.random.default_rng(9)
    width, height = size(len(stacks))
    column = np.repeat(np.arange(len(stacks)), [len(stack.depth) for stack in stacks.values()])
    depth = np.concatenate([stack.depth for stack in stacks.values()])
    alpha = np.concatenate([stack.alpha for stack in stacks.values()])
    order = rng.permutation(len(depth))
    column, depth, alpha = column[order], depth[order], alpha[order]
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    pixels = np.stack([STRIDE * column + (STRIDE - SIDE) // 2, np.full(len(depth), (STRIDE - SIDE) // 2)], axis=1)
    screen = pixels[:, None] + SIDE * corner  # [n, 4, 2]
    clip = 2.0 * screen / np.array([width, height]) - 1.0
    positions = np.concatenate(
        [clip * np.array([width / height, 1.0]) * depth[:, None, None], np.tile(-depth[:, None, None], (1, 4, 1))],
        axis=2,
    ).reshape(-1, 3)
    colours = np.concatenate([rng.integers(0, 256, (len(depth), 3)), alpha[:, None]], axis=1)
    indices = 4 * np.arange(len(depth))[:, None] + np.array([0, 1, 2, 0, 2, 3])
    return SceneArrays(
        name="stacks",
        positions=positions.astype(np.float32),
        normals=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1)),
        uvs=np.zeros((len(positions), 2), np.float32),
        colours=np.repeat(colours, 4, axis=0).astype(np.uint8),
        indices=indices.ravel().astype(np.uint32),
        batches=(Batch(first=0, count=indices.size, layer="transparent"),),
        textures=(),
        origin=np.zeros(3),
        bounds=np.stack([positions.min(axis=0), positions.max(axis=0)]),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )
