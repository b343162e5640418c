"""The account of work of a technique over some views: what tables and pages show of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evaluation.summary import number
from schemas.bench import BenchCell, BenchView
from schemas.work import Device, PassWork, total_work

COLUMNS = (
    *("geometry passes", "shaded / pixel", "B / pixel", "blended", "loaded", "stored", "cleared", "atomics / pixel"),
    *("B / fragment", "atomics / fragment", "bound, ms"),
)
"""Of a table; bytes by kind are a pixel's, too."""


@dataclass(frozen=True, slots=True)
class Account:
    """What the frames of a technique do, summed over views.

    Attributes:
        passes: Pass -> its work.
        views: How many.
        pixels: Of their pictures.
        fragments: N, transparent fragments.
    """

    passes: Mapping[str, PassWork]
    views: int
    pixels: int
    fragments: int

    @property
    def total(self) -> PassWork:
        """Of all passes."""
        return total_work(self.passes.values())

    def bound(self, device: Device, name: str | None = None) -> float:
        """Milliseconds of a frame, or of a pass, at least: mean over the views."""
        counted = self.passes.values() if name is None else [self.passes[name]]
        return device.bound(counted) / self.views

    def a_pixel(self, amount: int) -> float:
        """An amount over the pixels."""
        return amount / self.pixels

    def a_fragment(self, amount: int) -> float:
        """An amount over the transparent fragments."""
        return amount / max(self.fragments, 1)

    def columns(self, device: Device) -> list[str]:
        """Cells of `COLUMNS`."""
        work = self.total
        moved = (work.moved_bytes, work.blended_bytes, work.loaded_bytes, work.stored_bytes, work.cleared_bytes)
        amounts = [
            *(work.geometry_passes / self.views, self.a_pixel(work.shaded), *map(self.a_pixel, moved)),
            *(self.a_pixel(work.atomics), self.a_fragment(work.moved_bytes), self.a_fragment(work.atomics)),
            self.bound(device),
        ]
        return [number(amount) for amount in amounts]


def account_of(found: Sequence[tuple[BenchView, BenchCell]]) -> Account | None:
    """Of the cells that were counted; None without any."""
    counted = [(view, cell) for view, cell in found if cell.work]
    if not counted:
        return None
    passes: dict[str, PassWork] = {}
    for _, cell in counted:
        for name, work in cell.work.items():
            passes[name] = passes.get(name, PassWork()) + work
    pixels = sum(view.width * view.height for view, _ in counted)
    return Account(passes, len(counted), pixels, sum(view.fragments for view, _ in counted))


def said_device(device: Device) -> str:
    """What bounds are stated for, in words."""
    return f"{device.bandwidth:g} GB/s and {device.fill_rate:g} Gfragments/s"
