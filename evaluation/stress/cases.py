"""Fragment lists that are hard on floating point: every extreme that METHOD section 6 names, and found ones.

A case is a small fragment dump. Alpha 0 and 255 never are in a dump that the renderer makes, but the arithmetic must
survive both, so they are here as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.fragments import FragmentDump
from schemas.tail import PLAIN_SHARE, ROOT_SHARE

LONGEST: Final = 4096
"""Fragments of the longest list."""

Stored = NDArray[np.uint8]
List = tuple[Stored, NDArray[np.float32]]
"""Stored colour and alpha uint8 [n, 4], depth float32 [n] in metres, of one pixel; in any order."""


@dataclass(frozen=True, slots=True)
class Case:
    """A dump and what it stresses.

    Attributes:
        name: As in the table.
        dump: The fragments.
    """

    name: str
    dump: FragmentDump


def dump_of(lists: Sequence[List], backgrounds: NDArray[np.integer] | Sequence[int] = (255, 0, 77)) -> FragmentDump:
    """A dump one pixel high: lists sorted front to back, ties by the packed colour.

    Args:
        lists: One for each pixel.
        backgrounds: Stored background colours [P, 3], or one for all.
    """
    ordered = [(rgba[order], depth[order]) for rgba, depth in lists for order in [_front_to_back(rgba, depth)]]
    counts = [len(depth) for _, depth in ordered]
    return FragmentDump(
        width=len(lists),
        height=1,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        rgba=np.concatenate([np.empty((0, 4), np.uint8), *(rgba for rgba, _ in ordered)]),
        depth=np.concatenate([np.empty(0, np.float32), *(depth for _, depth in ordered)]),
        background=np.broadcast_to(np.asarray(backgrounds, np.uint8), (len(lists), 3)).copy(),
        facing=np.where(np.array(counts) > 0, 255, 0).astype(np.uint8),
    )


def _front_to_back(rgba: Stored, depth: NDArray[np.float32]) -> NDArray[np.int64]:
    return np.lexsort((np.ascontiguousarray(rgba).view("<u4")[:, 0], depth))


def some_list(
    rng: np.random.Generator,
    n: int,
    alpha: int | Sequence[int] | None = None,
    depth: tuple[float, float] = (1.0, 10.0),
    spread: int = 255,
) -> List:
    """A list of random fragments.

    Args:
        rng: Where colours, depths and alphas come from.
        n: Fragments.
        alpha: Stored alpha of all of them, the alphas to choose from, or None for 1..254.
        depth: Nearest and farthest; logarithmic between them where they are decades apart.
        spread: Largest difference of the stored colours; 0 makes them equal.
    """
    rgba = np.empty((n, 4), np.uint8)
    base = rng.integers(0, 256 - spread, 3)
    rgba[:, :3] = base + rng.integers(0, spread + 1, (n, 3))
    rgba[:, 3] = rng.integers(1, 255, n) if alpha is None else rng.choice(np.atleast_1d(alpha), n)
    near, far = depth
    share = rng.random(n)
    metres = near * (far / near) ** share if far > 100.0 * near else near + (far - near) * share
    return rgba, metres.astype(np.float32)


def random_dump(rng: np.random.Generator, pixels: int, most: int, ties: bool = False) -> FragmentDump:
    """Pixels with 0 to `most` random fragments, all at one depth if `ties`."""
    depth = (2.0, 2.0) if ties else (1.0, 10.0)
    lists = [some_list(rng, int(rng.integers(0, most + 1)), depth=depth) for _ in range(pixels)]
    return dump_of(lists, rng.integers(0, 256, (pixels, 3)))


def curve_cases(quick: bool, seed: int) -> list[Case]:
    """What error curves, pictures, hulls, allocations and features are made of.

    Args:
        quick: Fewer pixels, and one long list instead of four.
        seed: Of colours, depths and alphas.
    """
    rng = np.random.default_rng(seed)
    times = 1 if quick else 4
    cases = [
        Case("n 0 to 40", dump_of([some_list(rng, n) for n in range(0, 41, 4 if quick else 1)])),
        Case("alpha 0 to 1 mixed, n 48", dump_of([some_list(rng, 48, (0, 1, 128, 254, 255)) for _ in range(times)])),
    ]
    for name, alpha in (("0", 0), ("1/255", 1), (".5", 128), ("254/255", 254), ("1", 255)):
        cases.append(Case(f"alpha {name}, n 48", dump_of([some_list(rng, 48, alpha) for _ in range(times)])))
    for name, depth in (
        ("equal depths", (3.0, 3.0)),
        ("depths 1 ulp apart", (1.0, 1.0000005)),
        ("denormal depths", (1e-45, 4e-44)),
        ("huge depths", (1e30, 3.3e38)),
        ("depths from denormal to huge", (1e-44, 3.3e38)),
        ("near/far 1e7", (1e-3, 1e4)),
    ):
        cases.append(Case(f"{name}, n 32", dump_of([some_list(rng, 32, depth=depth) for _ in range(2 * times)])))
    cases.append(Case("depth ties across an image", random_dump(rng, 32 * times, 9, ties=True)))
    cases += [
        Case("near-equal colours, n 32", dump_of([some_list(rng, 32, spread=1) for _ in range(2 * times)])),
        Case("equal colours, n 32", dump_of([some_list(rng, 32, spread=0) for _ in range(2 * times)])),
        Case("black on black, n 32", dump_of([_grey(0, 32, rng)], (0, 0, 0))),
        Case("white on white, n 32", dump_of([_grey(255, 32, rng)], (255, 255, 255))),
        Case("white below black, n 256", dump_of([_layers(256)], (0, 0, 0))),
    ]
    for name, alpha in (("1/255", 1), *(() if quick else ((".5", 128), ("254/255", 254), ("0 to 1", None)))):
        cases.append(Case(f"alpha {name}, n {LONGEST}", dump_of([some_list(rng, LONGEST, alpha)])))
    return cases + bin_cases() + found_cases()


def bin_cases() -> list[Case]:
    """What is hard for depth bins, 8 and 16: their edges, ties of shares, full bins."""
    edge = np.arange(17) / 16.0
    # x of `y = p x + r sqrt(x)`, by the quadratic formula in sqrt(x).
    x = ((np.sqrt(ROOT_SHARE**2 + 4.0 * PLAIN_SHARE * edge) - ROOT_SHARE) / (2.0 * PLAIN_SHARE)) ** 2
    edges = np.add.outer(np.arange(-2, 3) * 2.0**-23, 1.0 + x).clip(1.0, 2.0).ravel()
    # One of 30 equal fragments in front: a share of 1/30, as near to 0 as to 1/15; so with all odd numbers of them.
    ties = [np.where(np.arange(30) < ahead, 1.0, 2.0) for ahead in range(1, 30, 2)]
    full = [np.where(np.arange(64) < ahead, 1.0, 2.0) for ahead in (0, 13, 32, 51, 64)]
    return [
        Case("depths at the edges of bins, n 85", dump_of([_equal(edges, level) for level in (1, 128, 254)])),
        Case("shares halfway between two steps, n 30", dump_of([_equal(depth, 64) for depth in ties])),
        Case("more than a bin holds, n 64", dump_of([_equal(depth, 254) for depth in full])),
    ]


def _equal(depth: NDArray[np.float64], alpha: int) -> List:
    """Fragments of one alpha, each of another colour."""
    rgba = np.full((len(depth), 4), alpha, np.uint8)
    rgba[:, :3] = (np.arange(3 * len(depth)) * 37 % 256).reshape(-1, 3)
    return rgba, depth.astype(np.float32)


def _grey(level: int, n: int, rng: np.random.Generator) -> List:
    rgba, depth = some_list(rng, n)
    rgba[:, :3] = level
    return rgba, depth


def _layers(n: int) -> List:
    # Black layers of 1/255 over one white fragment: all light passes through a long product.
    rgba = np.zeros((n, 4), np.uint8)
    rgba[:, 3], rgba[-1] = 1, 254
    rgba[-1, :3] = 255
    return rgba, np.linspace(1.0, 2.0, n, dtype=np.float32)


def found_cases() -> list[Case]:
    """The worst lists that searches came up with, spelled out."""
    return [
        Case(name, dump_of([(_bytes(rgba), np.array(depth, np.float32))], back)) for name, rgba, depth, back in FOUND
    ]


def _bytes(text: str) -> Stored:
    return np.frombuffer(bytes.fromhex(text), np.uint8).reshape(-1, 4).copy()


FOUND: Final[tuple[tuple[str, str, tuple[float, ...], tuple[int, int, int]], ...]] = (
    # hypothesis, 4000 examples: errors whose float32 rounding is as large as it can be, among depths of 1e-3 to 3e38.
    (
        "found: rounding of errors, n 24",
        "01ffff3f0162cb01fffea96c01e0004f6601effecf8000850044fe69ee01e08001e0004f011a0080"
        "0001000100950029a600aa56010bff3e01ffff3f0162cb01fefff86d01e0004f6601effea7830085"
        "0015fe69ee01e08001e0004f011a0080",
        (
            *(1.0, 204.86924743652344, 3e38, 1035.0, 389.7688293457031, 0.5, 0.0009765625, 2.0, 1035.0, 2.0, 2.0),
            *(0.05000000074505806, 379.7688293457031, 30.273435592651367, 1.0, 204.86924743652344, 3e38, 1035.0),
            *(1024.768798828125, 0.5, 0.0009765625, 2.0, 9355.0, 2.0),
        ),
        (0, 1, 0),
    ),
    # Climb 333 of seed 0: the same with three fragments, two of one depth, over nearly black.
    (
        "found: rounding of errors, n 3",
        "222901561e90ca814bff1eb3",
        (0.8053423166275024, 1.7192614078521729, 1.7192614078521729),
        (20, 1, 0),
    ),
    # hypothesis found 5 equal fragments, a search of all levels and counts then these: the mean of equal numbers is not
    # the number, so that the difference of squares is nothing but rounding.
    ("found: 89 equal fragments", "e3e3e3fe" * 89, (2.0,) * 89, (0, 0, 0)),
)
"""Name, stored RGBA as hex, depths, stored background."""
