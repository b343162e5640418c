"""`diaphane dump`: the fragments of a view."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import print_columns, size
from diaphane.cli.scene_options import (
    WHITE,
    AlphaOption,
    BackgroundOption,
    CameraOption,
    ComplexityOption,
    GlassOption,
    RefineOption,
    SizeOption,
    TimeOption,
    VariantOption,
    WidthOption,
)
from diaphane.cli.state import JsonOption
from evaluation.wording import counted
from schemas.glass import DEFAULT_GLASS

if TYPE_CHECKING:
    from evaluation.dumping import Dumped


def dump(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A scene, or a deep OpenEXR file to import.")],
    target: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Write the dump to this folder, or to a deep OpenEXR file if it ends in .exr."
        ),
    ],
    is_deep: Annotated[bool, typer.Option("--exr", help="Also write a deep OpenEXR file into the folder.")] = False,
    camera: CameraOption = None,
    time: TimeOption = None,
    image_width: WidthOption = 960,
    picture_size: SizeOption = None,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = DEFAULT_GLASS,
    variant: VariantOption = None,
    background: BackgroundOption = WHITE,
    as_json: JsonOption = False,
) -> None:
    """Write every transparent fragment of a view: a zarr group, and deep OpenEXR for other tools."""
    from evaluation.dumping import DumpOptions
    from evaluation.dumping import dump as run
    from evaluation.render_options import loading, parse_background
    from evaluation.scene_warnings import said_warnings
    from schemas.flags import parse_size

    load = loading(alpha, glass, variant, complexity, refine)
    if not as_json:
        output.tell_new_folder(target.parent)
    dumped = run(
        DumpOptions(
            file=file,
            output=target,
            deep=is_deep,
            camera=camera,
            time=time,
            load=load,
            image_width=image_width,
            size=None if picture_size is None else parse_size(picture_size),
            background=parse_background(background),
        )
    )
    for line in said_warnings(file, dumped.warnings, file) if not as_json else ():
        output.err().print(line, markup=False)
    if as_json:
        files = [{**asdict(each), "path": str(each.path)} for each in dumped.written]
        output.print_json({**asdict(dumped), "written": files})
    else:
        _show(dumped)


def _show(dumped: Dumped) -> None:
    pixels = dumped.width * dumped.height
    print(f"{dumped.width}x{dumped.height}, view {dumped.view[0] or '–'} ({dumped.view[1]})")
    print(
        f"{counted(dumped.fragments, 'fragments')} in {dumped.occupied:,} of {counted(pixels, 'pixels')}, "
        f"{dumped.fragments / pixels:.2f} per pixel, at most {dumped.most}"
    )
    if dumped.passes:
        print(f"ms: {', '.join(f'{name} {ms:.1f}' for name, ms in dumped.passes.items())}")
    millions = dumped.fragments / 1e6
    rows = [(f.path, size(f.bytes), f"{f.ms:.0f}", f"{1e3 * millions / max(f.ms, 1e-6):.2g}") for f in dumped.written]
    print_columns(("file", "size", "ms", "million fragments/s"), rows)
