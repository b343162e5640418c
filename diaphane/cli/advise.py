"""`diaphane advise`: which technique a scene needs, with which budget."""

from __future__ import annotations

import shlex
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns
from diaphane.cli.scene_options import AlphaOption, ComplexityOption, GlassOption, RefineOption, VariantOption
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from schemas.glass import DEFAULT_GLASS

if TYPE_CHECKING:
    from schemas.advice import Advice

WIDTH: Final = 120
"""Columns that sentences are wrapped to."""


def advise(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="SCENE...", help="Scenes: .usd, .usda, .usdc, .usdz, .glb, .gltf, .obj, .ply, .stl."),
    ],
    memory: Annotated[str, typer.Option("--memory", help="Memory that all buffers of a frame may take.")] = "64MiB",
    picture_size: Annotated[str, typer.Option("--size", help="WIDTHxHEIGHT of the frame in pixels.")] = "1920x1080",
    views: Annotated[
        Path | None,
        typer.Option("--views", help="JSON file with views. Default: the scene's cameras, else views around it."),
    ] = None,
    bundle: Annotated[
        str | None,
        typer.Option(
            "--bundle", help="For kbuffer-deep: a folder, or NAME@ALIAS of the registry. Default: benchmarks/bundle."
        ),
    ] = None,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = DEFAULT_GLASS,
    variant: VariantOption = None,
    target: Annotated[
        Path, typer.Option("--output", "-o", help="The page, HTML; it replaces one of that name.")
    ] = Path("advice.html"),
    state: StateOption = DEFAULT_STATE,
    as_json: JsonOption = False,
) -> None:
    """Say which technique a scene needs within a memory, with which budget, and why."""
    from diaphane.bundles import bundle_folder
    from evaluation.advice.amounts import parse_frame, parse_memory
    from evaluation.advice.options import AdviceOptions
    from evaluation.advice.page import page
    from evaluation.advice.run import advised
    from evaluation.render_options import loading
    from evaluation.scene_warnings import said_warnings
    from evaluation.writing import replacing

    options = AdviceOptions(
        scenes=tuple(files),
        memory=parse_memory(memory),
        size=parse_frame(picture_size),
        views=views,
        load=loading(alpha, glass, variant, complexity, refine),
        bundle=bundle,
    )
    made = []
    with bundle_folder(options.used_bundle, state) as folder:
        for one in advised(options, folder, has_pictures=not as_json):
            made.append(one)
            if not as_json:
                for line in said_warnings(one.file, one.advice.warnings, one.file):
                    output.err().print(line, markup=False)
                show(one.advice)
    if as_json:
        output.print_json({"scenes": [one.advice.model_dump(mode="json") for one in made]})
        return
    with replacing(target) as path:
        path.write_text(
            page([(one.advice, one.sheet) for one in made], shlex.join(["diaphane", *sys.argv[1:]])), encoding="utf-8"
        )
    print(f"\n{target}")


def show(advice: Advice) -> None:
    """Print a piece of advice: sentences, one table, what other sizes need, and what to run next.

    Args:
        advice: What to use, and why.
    """
    from evaluation.advice import words

    show_sentences(advice)
    if advice.best:
        print()
        print_columns(words.HEADINGS, words.table(advice))
        print()
        print_columns(words.SIZE_HEADINGS, words.sizes(advice))
    if advice.work:
        print()
        print_columns(words.WORK_HEADINGS, words.work_rows(advice))
    if advice.commands:
        print("\nNext:")
        for command in advice.commands:
            print(f"  {command}")


def show_sentences(advice: Advice) -> None:
    """Print what to use and why, in words.

    Args:
        advice: What to use, and why.
    """
    print(f"\n{plain(advice.scene.name)}")
    for sentence in advice.text:
        print(textwrap.fill(plain(sentence), WIDTH))
