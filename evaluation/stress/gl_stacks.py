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

ILL_CONDITIONED = ("two groups", "one far behind", "both ends")
"""Stacks that the first moments of their depths do not describe: tight groups far apart."""


@dataclass(frozen=True, slots=True)
class Stack:
    """Layers that cover the same pixels.

    Attributes:
        depth: float [n], metres.
        alpha: int [n], 0..255; 0 is nothing and 255 is opaque, both only in a scene with `holes`.
        colour: int [n, 3], stored RGB of the vertices; None: random.
    """

    depth: NDArray[np.float64]
    alpha: NDArray[np.integer]
    colour: NDArray[np.integer] | None = None


def extreme_stacks(layers: int, seed: int = 0) -> dict[str, Stack]:
    """Opacities at both ends of what is stored, equal depths, and depths from near to far over almost four decades."""
    rng = np.random.default_rng(seed + 5)
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


def awkward_stacks(layers: int, seed: int = 0) -> dict[str, Stack]:
    """What is hard for sums: colours that hardly differ, groups of depths, one fragment far behind the others."""
    rng = np.random.default_rng(seed + 6)
    near_equal = 128 + rng.integers(0, 2, (layers, 3))
    groups = np.where(rng.random(layers) < 0.5, 1.0, 30.0) * (1.0 + 1e-5 * rng.random(layers))
    behind = np.where(np.arange(layers) == 0, 900.0, rng.uniform(10.0, 10.5, layers))
    return {
        "near-equal colours": Stack(rng.uniform(10.0, 20.0, layers), rng.integers(1, 20, layers), near_equal),
        "black and white": Stack(
            np.linspace(10.0, 20.0, layers),
            np.full(layers, 128),
            np.repeat(255 * (np.arange(layers) % 2), 3).reshape(-1, 3),
        ),
        "alpha 1 and 254 in turn": Stack(np.linspace(10.0, 20.0, layers), 1 + 253 * (np.arange(layers) % 2)),
        "two groups": Stack(groups, rng.integers(1, 60, layers)),
        "one far behind": Stack(behind, rng.integers(1, 255, layers)),
        "three depths": Stack(rng.integers(10, 13, layers).astype(np.float64), rng.integers(1, 255, layers)),
    }


def size(stacks: int) -> tuple[int, int]:
    """Width and height of the picture of some stacks: side by side, with empty pixels around each."""
    return STRIDE * stacks, STRIDE


def stack_scene(stacks: dict[str, Stack], holes: bool = False, seed: int = 0) -> SceneArrays:
    """The quads in random colours, submitted in random order. In `VIEW` at `size`, stack i is at column i.

    Args:
        stacks: By name.
        holes: Whether alphas of 0 and 255 are no fragments, as where an opacity texture says so.
        seed: Of the colours and the order.
    """
    rng = np.random.default_rng(seed + 9)
    width, height = size(len(stacks))
    column = np.repeat(np.arange(len(stacks)), [len(stack.depth) for stack in stacks.values()])
    depth = np.concatenate([stack.depth for stack in stacks.values()])
    alpha = np.concatenate([stack.alpha for stack in stacks.values()])
    given = [np.full((len(s.depth), 3), -1) if s.colour is None else s.colour for s in stacks.values()]
    order = rng.permutation(len(depth))
    column, depth, alpha, colour = column[order], depth[order], alpha[order], np.concatenate(given)[order]
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    pixels = np.stack([STRIDE * column + (STRIDE - SIDE) // 2, np.full(len(depth), (STRIDE - SIDE) // 2)], axis=1)
    screen = pixels[:, None] + SIDE * corner  # [n, 4, 2]
    clip = 2.0 * screen / np.array([width, height]) - 1.0
    colour = np.where(colour < 0, rng.integers(0, 256, (len(depth), 3)), colour)
    return quads(clip * np.array([width / height, 1.0]), depth, np.concatenate([colour, alpha[:, None]], axis=1), holes)


def screen_of_ties(width: int, height: int, layers: int, depths: int, seed: int = 0) -> SceneArrays:
    """Quads over the whole picture at few depths, every one of them twice: nothing but ties, and equal fragments.

    Args:
        width: Pixels of the picture's side.
        height: Likewise.
        layers: Quads, an even number.
        depths: How many different depths they have.
        seed: Of colours and depths.
    """
    rng = np.random.default_rng(seed + 25)
    half = layers // 2
    colour = np.concatenate([rng.integers(0, 256, (half, 3)), rng.integers(1, 255, (half, 1))], axis=1)
    rays = np.tile(1.1 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / height, 1.0], (layers, 1, 1))
    return quads(rays, np.tile(10.0 + rng.integers(0, depths, half), 2), np.tile(colour, (2, 1)))


def quads(
    rays: NDArray[np.float64], depth: NDArray[np.floating], colour: NDArray[np.integer], holes: bool = False
) -> SceneArrays:
    """Quads that face the eye of `VIEW`; quad q is triangles 2q and 2q + 1.

    Args:
        rays: float64 [n, 4, 2], x/-z and y/-z of the corners, counter-clockwise.
        depth: float [n], metres.
        colour: int [n, 4], stored colour and alpha.
        holes: As `stack_scene` has it.
    """
    positions = np.concatenate(
        [rays * depth[:, None, None], np.tile(-depth[:, None, None], (1, 4, 1))], axis=2
    ).reshape(-1, 3)
    indices = 4 * np.arange(len(depth))[:, None] + np.array([0, 1, 2, 0, 2, 3])
    return SceneArrays(
        name="stacks",
        positions=positions.astype(np.float32),
        normals=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1)),
        uvs=np.zeros((len(positions), 2), np.float32),
        colours=np.repeat(colour, 4, axis=0).astype(np.uint8),
        indices=indices.ravel().astype(np.uint32),
        batches=(Batch(first=0, count=indices.size, layer="mixed" if holes else "transparent"),),
        textures=(),
        origin=np.zeros(3),
        bounds=np.stack([positions.min(axis=0), positions.max(axis=0)]),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )
