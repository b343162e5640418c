"""Columns of a label shard: what each holds, in which unit. The index of a data set repeats them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict

from renderer.features import FEATURES
from schemas.tail import MOST_BINS

CountType = Literal["uint16", "uint32"]
"""dtype of the columns that count fragments: the wider one where a list is longer than 65,535."""


class Column(BaseModel):
    """A tensor of a shard.

    Attributes:
        name: Of the tensor.
        per: What its first axis counts: rows (pixels), or hull segments of all rows, one row's after another's.
        dtype: numpy's name.
        unit: Of its values.
        meaning: What it holds.
        fields: What the second axis counts: name -> meaning and unit. Empty: there is none.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    per: Literal["row", "segment"]
    dtype: str
    unit: str
    meaning: str
    fields: dict[str, str] = {}


_CHANNELS: Final = {"r": "red", "g": "green", "b": "blue"}


def _rgb(name: str, meaning: str) -> dict[str, str]:
    return {f"{name}_{c}": f"{colour}: {meaning}" for c, colour in _CHANNELS.items()}


FEATURE_MEANINGS: Final[Mapping[str, str]] = {
    "log_n": "log2 of the number of fragments n",
    "optical_depth": "log(1 + D), D = sum of -ln(1 - alpha)",
    **_rgb("background", "of what lies behind, gamma-2 encoded, 0..1"),
    "luma_mean": "mean luma over the fragments, weighted by optical depth, gamma-2 encoded, 0..1",
    "luma_std": "standard deviation of luma over the fragments, weighted by optical depth, gamma-2 encoded, 0..1",
    "depth_extent": "log(1e-4 + (z_far - z_near) / z_far) of the tile's range",
    **{
        f"front_{b}": f"share of D in front of depth bin {b}, counted from 0, 0..1; 0 where the tail has no such bin"
        for b in range(1, MOST_BINS)
    },
    **{
        f"mean_{b}": f"mean position of the optical depth in depth bin {b - 1}, 0..1; 0 where the tail keeps none"
        for b in range(1, MOST_BINS)
    },
}
"""What `renderer.features.FEATURES` hold, in their order."""


def columns(count_type: CountType = "uint16") -> tuple[Column, ...]:
    """The columns of a shard.

    Args:
        count_type: dtype of those that count fragments.
    """
    return (
        Column(
            name="features",
            per="row",
            dtype="float32",
            unit="see fields",
            meaning="order-independent features of the pixel, what a predictor reads",
            fields={name: FEATURE_MEANINGS[name] for name in FEATURES},
        ),
        Column(name="n", per="row", dtype=count_type, unit="fragments", meaning="fragments of the pixel"),
        Column(
            name="bin_counts",
            per="row",
            dtype="uint8",
            unit="fragments",
            meaning="fragments in each depth bin, 255 for that many or more",
            fields={f"bin_{b}": f"depth bin {b}; 0 where the tail has no such bin" for b in range(MOST_BINS)},
        ),
        Column(name="pixel", per="row", dtype="uint32", unit="1", meaning="y * width + x, row 0 at the top, ascending"),
        Column(
            name="hull_segments",
            per="row",
            dtype=count_type,
            unit="segments",
            meaning="segments of the lower hull of the pixel's error curve; 0 where it is exact at k = 0",
        ),
        Column(
            name="hull_length",
            per="segment",
            dtype=count_type,
            unit="fragments",
            meaning="how many more fragments the segment's end keeps than its start; a row's first starts at 0",
        ),
        Column(
            name="hull_error",
            per="segment",
            dtype="float32",
            unit="squared error, summed over RGB, in the metric's space (values 0..1)",
            meaning="error at the segment's start; at the end of a row's last segment it is 0",
        ),
    )


COLUMNS: Final[Mapping[str, Column]] = {column.name: column for column in columns()}
"""By name, with the usual dtypes."""
