"""What a pass of a frame does, counted: geometry passes, fragments, bytes, atomics; and the bound that follows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from schemas.option import Option


class PassWork(BaseModel):
    """What one pass of a frame does, as its shaders' source and its calls have it: nothing is cached.

    Attributes:
        geometry_passes: How often the transparent layers are drawn.
        fragments: Fragments that are shaded in them.
        pixels: Fragments that are shaded by passes over pixels.
        blended_bytes: Read and written in targets by blending.
        loaded_bytes: Read by shaders from storage buffers, images, and textures that the frame has made.
        stored_bytes: Written by shaders to storage buffers, images, and targets without blending.
        cleared_bytes: Written by clears of buffers and targets.
        atomics: Atomic operations on storage buffers.
        atomic_bytes: Read and written by them.
        transferred_bytes: Between host and device.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    geometry_passes: int = Field(default=0, ge=0)
    fragments: int = Field(default=0, ge=0)
    pixels: int = Field(default=0, ge=0)
    blended_bytes: int = Field(default=0, ge=0)
    loaded_bytes: int = Field(default=0, ge=0)
    stored_bytes: int = Field(default=0, ge=0)
    cleared_bytes: int = Field(default=0, ge=0)
    atomics: int = Field(default=0, ge=0)
    atomic_bytes: int = Field(default=0, ge=0)
    transferred_bytes: int = Field(default=0, ge=0)

    def __add__(self, other: PassWork) -> PassWork:
        """Both of them."""
        return PassWork(**{name: getattr(self, name) + getattr(other, name) for name in PassWork.model_fields})

    @property
    def moved_bytes(self) -> int:
        """All bytes that are read and written on the device."""
        return self.blended_bytes + self.loaded_bytes + self.stored_bytes + self.cleared_bytes + self.atomic_bytes

    @property
    def shaded(self) -> int:
        """All fragments that are shaded."""
        return self.fragments + self.pixels


class Device(BaseModel):
    """What a bound is stated for."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    bandwidth: Annotated[
        float, Field(gt=0.0), Option("GB/s (1e9 bytes) at which bounds of frame times have the device read and write.")
    ] = 500.0
    fill_rate: Annotated[
        float, Field(gt=0.0), Option("Gfragments/s that bounds of frame times have it shade and write.")
    ] = 50.0

    def bound(self, passes: Iterable[PassWork]) -> float:
        """Milliseconds that a frame takes at least if nothing is cached; passes follow each other.

        It is a bound and no prediction: latency, occupancy, sorting in registers and contention come on top, and caches
        serve some of the bytes faster than memory does.
        """
        return sum(
            1e3 * max(work.moved_bytes / (1e9 * self.bandwidth), work.shaded / (1e9 * self.fill_rate))
            for work in passes
        )


def total_work(passes: Iterable[PassWork]) -> PassWork:
    """Of a whole frame."""
    return sum(passes, PassWork())
