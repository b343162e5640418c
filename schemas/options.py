"""The options of a build, each written once: type, range, default, and what it means in words.

A plan has them, a job is them, and `schemas.flags` makes of them what a command line says. The help of the commands,
the schema of the REST API, the inputs of `deploy/retrain` and the tables of the documents follow.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from schemas.glass import DEFAULT_GLASS, GLASS_HELP, GlassReading
from schemas.limits import LIMITS
from schemas.network import DEFAULT_NETWORK, NetworkSize
from schemas.option import Option
from schemas.pixel_weights import DEFAULT_WEIGHTS, PixelWeights
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, DENSITY_G, TailName

_SIZE = "Width and height of the pictures, in pixels."


class Options(BaseModel):
    """What decides the outcome of a build, beside its scenes.

    Budgets are ascending, without duplicates. Seeds end where every JSON reader still has the same whole number.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    budgets: Annotated[
        tuple[Annotated[float, Field(gt=0.0, le=LIMITS.budget)], ...] | None,
        Field(min_length=1, max_length=LIMITS.budgets),
        Option(
            "Fragments per frame, as multiples of width x height.",
            absent="by the captured views, up to three quarters of what they hold, from 0.05 to 4",
            example=".5,1,2",
        ),
    ] = None
    alpha: Annotated[
        float | None,
        Field(gt=0.0, lt=1.0),
        Option("Opacity of every surface, so that opaque scenes can be used as well.", absent="the materials' own"),
    ] = None
    glass: Annotated[GlassReading, Option(GLASS_HELP)] = DEFAULT_GLASS
    views_per_scene: Annotated[
        int, Field(ge=1, le=LIMITS.views), Option("Views sampled around the bounds of a scene that has no cameras.")
    ] = 3
    width: Annotated[
        int, Field(ge=LIMITS.min_side, le=LIMITS.max_side), Option("Pixels per row.", flags=("--size",), joint=_SIZE)
    ] = 1430
    height: Annotated[
        int, Field(ge=LIMITS.min_side, le=LIMITS.max_side), Option("Rows of pixels.", flags=("--size",), joint=_SIZE)
    ] = 960
    tail: Annotated[
        TailName,
        Option(
            "Approximation of the fragments beyond k; labels and bundles need depth bins, as the first "
            f"{len(BINNED_TAILS)} have."
        ),
    ] = DEFAULT_TAIL
    g: Annotated[float, Field(ge=0.0, le=10.0), Option("Steepness of the density tail, which no bundle uses.")] = (
        DENSITY_G
    )
    network: Annotated[NetworkSize, Option("Size of the network; a pretrained one keeps its own.")] = DEFAULT_NETWORK
    seed: Annotated[
        int, Field(ge=0, le=2**53 - 1), Option("Seed of everything random: views, pixels, weights, batches.")
    ] = 0
    steps: Annotated[int | None, Field(ge=1, le=LIMITS.steps), Option("Optimiser steps.", absent="the trainer's")] = (
        None
    )
    patience: Annotated[
        int,
        Field(ge=0, le=LIMITS.steps),
        Option(
            "Stop after this many validations without a better score on a fifth of the training scenes, kept out for "
            "that; 0: never."
        ),
    ] = 0
    weights: Annotated[
        PixelWeights,
        Option("Weight of a pixel's errors in training; none: all alike; flip: by FLIP.", example="flip"),
    ] = DEFAULT_WEIGHTS

    @field_validator("budgets", mode="after")
    @classmethod
    def _ascending(cls, budgets: tuple[float, ...] | None) -> tuple[float, ...] | None:
        return None if budgets is None else tuple(sorted(set(budgets)))

    @model_validator(mode="after")
    def _can_be_rendered(self) -> Self:
        if self.pixels > LIMITS.pixels:
            raise ValueError(f"{self.width} x {self.height} is more than {LIMITS.pixels} pixels")
        if self.budgets is not None and self.budgets[0] * self.pixels < 1.0:
            raise ValueError("a budget is below one fragment")
        return self

    @property
    def pixels(self) -> int:
        """Of a picture."""
        return self.width * self.height
