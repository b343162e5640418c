"""Allocations of a view by every rule at every budget, on disk: all of one rule, or all rules of one pixel.

Reading needs no labeller: pages do it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.abc.store import Store
from zarr.codecs import BloscCodec

from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from labeller.allocation import Allocation, RuleName

GROUP = "allocations.zarr"
"""Folder of the group."""
_CHUNK = 1 << 17
"""Pixels of a chunk, with all rules of a budget: 2 MiB, of which neighbouring pixels share most."""
_MOST = 65_535
"""k rarely exceeds 255, never this at any budget that is not exact; 16 bits halve the artifact."""


def write_allocations(folder: Path, made: Mapping[RuleName, Sequence[Allocation]]) -> None:
    """Writes `folder/allocations.zarr`: uint16 [rules, budgets, P], and the names of rules and budgets.

    Args:
        folder: An existing folder.
        made: For every rule its allocations, at the same budgets in the same order, each once; there may be none.
    """
    rules, budgets = list(made), [found.budget for found in next(iter(made.values()))]
    group = zarr.open_group(folder / GROUP, mode="w")
    group.attrs.update({"rules": list(rules), "budgets": budgets})
    if not budgets:
        return
    pixels = len(made[rules[0]][0].k)
    codec = BloscCodec(cname="zstd", clevel=3, shuffle="shuffle", typesize=2)
    shape, chunks = (len(rules), len(budgets), pixels), (len(rules), 1, min(pixels, _CHUNK))
    stored = group.create_array("k", shape=shape, chunks=chunks, dtype=np.uint16, compressors=codec)
    for number in range(len(budgets)):
        k = np.stack([made[rule][number].k for rule in rules])
        stored[:, number] = np.minimum(k, _MOST).astype(np.uint16)


def read_allocation(folder: Path, rule: RuleName, fragments: int) -> NDArray[np.int32]:
    """int32 [P], the allocation of a rule.

    Args:
        folder: Where `write_allocations` wrote.
        rule: The rule.
        fragments: F, one of the budgets.

    Raises:
        Problem: There is no such allocation.
    """
    stored, rules, number = _budget(folder, fragments)
    return np.asarray(stored[rules.index(rule), number], dtype=np.int32)


def pixel_allocations(source: Path | Store, fragments: int, p: int) -> dict[str, int]:
    """Rule -> k of one pixel; only the chunk that holds it is read.

    Args:
        source: Folder that `write_allocations` wrote to, or a store whose root is the group.
        fragments: F, one of the budgets.
        p: Index of the pixel.

    Raises:
        Problem: There are no allocations of that budget.
    """
    stored, rules, number = _budget(source, fragments)
    k: list[int] = np.asarray(stored[:, number, p]).tolist()
    return dict(zip(rules, k, strict=True))


def _budget(source: Path | Store, fragments: int) -> tuple[zarr.Array[Any], list[str], int]:
    """The array, the names along its first axis, and the place of a budget along its second."""
    place = source / GROUP if isinstance(source, Path) else source
    try:
        group = zarr.open_group(place, mode="r", zarr_format=3)
        rules, budgets = group.attrs["rules"], group.attrs["budgets"]
        stored = group["k"]
        if not (isinstance(stored, zarr.Array) and isinstance(rules, list) and isinstance(budgets, list)):
            raise ValueError("these are no allocations")
        return stored, [str(rule) for rule in rules], budgets.index(fragments)
    except (KeyError, FileNotFoundError, ValueError) as reason:
        raise Problem(
            f"{place} has no allocations of {fragments} fragments.",
            "Remove it: the allocations are made again.",
            ExitCode.CONFLICT,
        ) from reason
