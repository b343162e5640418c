"""What drives an input of a surface: a constant, a primvar or a texture, times a factor plus an offset."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from renderer.usd.textures import ImageFile
from schemas.scene import Wrap

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]

ONES: Vec4 = (1.0, 1.0, 1.0, 1.0)
ZEROS: Vec4 = (0.0, 0.0, 0.0, 0.0)
IDENTITY: tuple[Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True, slots=True)
class Sampler:
    """A texture read by a material.

    Attributes:
        file: The image.
        wrap: Wrap modes of s and t.
        uv: Name of the texture coordinates' primvar.
        transform: Two rows (a, b, c) between primvar and texture: u' = a u + b v + c.
        missing_uv: Texture coordinates where that primvar is missing; None: any others that the prim has.
    """

    file: ImageFile
    wrap: tuple[Wrap, Wrap]
    uv: str = "st"
    transform: tuple[Vec3, Vec3] = IDENTITY
    missing_uv: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Driver:
    """source * scale + bias, RGBA, linear; a constant has no source.

    Attributes:
        primvar: Name of the primvar that is the source.
        sampler: The texture that is the source.
        channel: 0..3, which channel of the source is meant where one number is wanted, and what a colour repeats;
            None: R, G and B.
        scale: RGBA factor.
        bias: RGBA offset, and the value of a constant.
        missing: RGBA of the primvar where a prim has none.
    """

    primvar: str | None = None
    sampler: Sampler | None = None
    channel: int | None = None
    scale: Vec4 = ONES
    bias: Vec4 = ZEROS
    missing: Vec4 = ONES

    @property
    def is_constant(self) -> bool:
        """Whether nothing varies over the surface."""
        return self.primvar is None and self.sampler is None

    @property
    def rgb(self) -> Vec3:
        """Linear RGB of a constant."""
        return self.bias[0], self.bias[1], self.bias[2]

    @property
    def number_channel(self) -> int:
        """The channel of the source that serves as one number."""
        return 0 if self.channel is None else self.channel

    @property
    def number_scale(self) -> float:
        """The factor of that number."""
        return self.scale[0]

    @property
    def number_bias(self) -> float:
        """The offset of that number; the number itself if this is a constant."""
        return self.bias[0]

    def only(self, channel: int) -> Driver:
        """One channel of this, as a number."""
        scale, bias = self.scale[channel], self.bias[channel]
        if self.channel is not None:
            # The source is one number already, repeated.
            return replace(self, scale=_four(scale), bias=_four(bias))
        missing = _four(self.missing[channel])
        return replace(self, channel=channel, scale=_four(scale), bias=_four(bias), missing=missing)

    def times(self, factor: Vec4) -> Driver:
        """This, multiplied by a constant."""
        return replace(self, scale=_product(self.scale, factor), bias=_product(self.bias, factor))

    def plus(self, offset: Vec4) -> Driver:
        """This, with a constant added."""
        return replace(self, bias=_sum(self.bias, offset))


def constant(value: Vec4) -> Driver:
    """A value that is the same everywhere."""
    return Driver(bias=value)


def number(value: float) -> Driver:
    """One number that is the same everywhere."""
    return Driver(bias=_four(value))


def product(a: Driver, b: Driver) -> Driver | None:
    """Product of two drivers; None where both vary."""
    if b.is_constant:
        return a.times(b.bias)
    return b.times(a.bias) if a.is_constant else None


def total(a: Driver, b: Driver) -> Driver | None:
    """Sum of two drivers; None where both vary."""
    if b.is_constant:
        return a.plus(b.bias)
    return b.plus(a.bias) if a.is_constant else None


def floats_of(value: Any, size: int) -> list[float] | None:
    """A number or vector as `size` finite floats (a number is repeated); None if it is none."""
    try:
        array = np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        return None
    if array.size == 1:
        array = np.repeat(array, size)
    return [float(x) for x in array[:size]] if array.size >= size and np.isfinite(array).all() else None


def number_of(value: Any, default: float) -> float:
    """A finite number, else the default."""
    floats = floats_of(value, 1)
    return floats[0] if floats else default


def vec4_of(value: Any, default: Vec4) -> Vec4:
    """Four finite numbers: a vector of four, a colour with alpha 1, a number four times; else the default."""
    floats = floats_of(value, 4)
    if floats is None:
        colour = floats_of(value, 3)
        floats = [*colour, 1.0] if colour else None
    return (floats[0], floats[1], floats[2], floats[3]) if floats else default


def _four(x: float) -> Vec4:
    return x, x, x, x


def _product(a: Vec4, b: Vec4) -> Vec4:
    return a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]


def _sum(a: Vec4, b: Vec4) -> Vec4:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]
