"""Options that the commands on local scene files share; the words are usdrecord's where it has them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.glass import GLASS_HELP

SceneArgument = Annotated[
    Path, typer.Argument(metavar="FILE", help="A scene: .usd, .usda, .usdc, .usdz, .glb, .gltf, .obj, .ply or .stl.")
]
LicenceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--licence",
        metavar="[SCENE=]TEXT",
        help="Licence of all scenes, or of one, and whom to name for it; repeatable. Default: what each stage states.",
    ),
]
AlphaOption = Annotated[
    float | None, typer.Option("--alpha", help="Opacity that every surface gets, in (0, 1]. Default: its own.")
]
GlassOption = Annotated[str, typer.Option("--glass", help=GLASS_HELP)]
VariantOption = Annotated[
    list[str] | None,
    typer.Option("--variant", help="Selection SET=CHOICE, or /PRIM:SET=CHOICE for one prim; repeatable."),
]
ComplexityOption = Annotated[
    str | None,
    typer.Option("--complexity", "-c", help="Refinement of subdivision meshes: low (none), medium, high, veryhigh."),
]
RefineOption = Annotated[
    int | None, typer.Option("--refine", help="The same in levels of subdivision: 0 (low) to 3 (veryhigh) and more.")
]
TimeOption = Annotated[
    float | None, typer.Option("--time", help="Time code to read at. Default: the start of the stage.")
]
CameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera",
        "-cam",
        help="Name or path of a camera. Default: the render settings', main_cam, the first; else the whole scene.",
    ),
]
WidthOption = Annotated[
    int, typer.Option("--imageWidth", "-w", help="Pixels per row; rows follow from the camera's aspect.")
]
SizeOption = Annotated[str | None, typer.Option("--size", help="WIDTHxHEIGHT in pixels, instead of --imageWidth.")]
BackgroundOption = Annotated[
    str, typer.Option("--background", help="Colour behind everything: '#rrggbb', or linear red,green,blue.")
]
WHITE = "#ffffff"
