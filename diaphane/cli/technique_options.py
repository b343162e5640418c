"""Options that the commands that render with techniques share."""

from __future__ import annotations

from typing import Annotated

import typer

from schemas.tail import DEFAULT_TAIL, DENSITY_G, TAIL_HELP

BudgetOption = Annotated[float, typer.Option("--budget", help="Fragments, as a multiple of width x height.")]
BudgetsOption = Annotated[
    str | None,
    typer.Option(
        "--budgets",
        help="Fragments per frame, as multiples of width x height: .5,1,2. Default: up to three quarters of what the "
        "views hold, from 0.05 to 4.",
    ),
]
TailOption = Annotated[
    str | None, typer.Option("--tail", help=f"{TAIL_HELP} Default: the bundle's, or {DEFAULT_TAIL}.")
]
SteepnessOption = Annotated[
    float | None,
    typer.Option(
        "--g", help=f"Steepness of the density tail; with a bundle, name the tail as well. Default: {DENSITY_G:g}."
    ),
]
InferenceOption = Annotated[str, typer.Option("--inference", help="Run the network of kbuffer-deep as glsl or onnx.")]
VkbOption = Annotated[
    str, typer.Option("--vkb", help="For kbuffer-importance: thesis, no-depth, no-periphery, no-fresnel, no-noise.")
]
NodesOption = Annotated[int | None, typer.Option("--nodes", help="Nodes per pixel of multilayer and adaptive.")]
StochasticSamplesOption = Annotated[
    int | None, typer.Option("--stochastic-samples", help="Depth samples per pixel of stochastic.")
]
