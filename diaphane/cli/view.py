"""`diaphane view`: two techniques on one camera, in a window or as frames."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.scene_options import (
    WHITE,
    AlphaOption,
    BackgroundOption,
    CameraOption,
    ComplexityOption,
    GlassOption,
    RefineOption,
    SceneArgument,
    TimeOption,
    VariantOption,
    WidthOption,
)
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, find_key
from diaphane.cli.state import DEFAULT_STATE, JsonOption, StateOption
from diaphane.cli.technique_options import (
    BudgetOption,
    InferenceOption,
    NodesOption,
    SteepnessOption,
    StochasticSamplesOption,
    TailOption,
    VkbOption,
)
from schemas.glass import DEFAULT_GLASS
from schemas.problem import Problem


def view(
    file: SceneArgument,
    technique: Annotated[
        str | None,
        typer.Option(
            "--technique", "-t", help="Technique on the left. Default: kbuffer-deep with a bundle, else kbuffer."
        ),
    ] = None,
    against: Annotated[str, typer.Option("--against", help="Technique on the right.")] = "sbuffer",
    layout: Annotated[
        str, typer.Option("--layout", help="single, side-by-side, split, difference or k; keys 1 to 5.")
    ] = "side-by-side",
    budget: BudgetOption = 2.0,
    tail: TailOption = None,
    g: SteepnessOption = None,
    model: Annotated[
        str | None,
        typer.Option("--model", help="For kbuffer-deep and -temporal: NAME@ALIAS of the server, fetched and verified."),
    ] = None,
    bundle: Annotated[
        str | None, typer.Option("--bundle", help="Instead: a folder, or NAME@ALIAS of the state folder's registry.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Follow the alias of --model while the window is open.")
    ] = False,
    public_key: Annotated[
        str | None,
        typer.Option("--public-key", help="Signing key of the server of --model, base64. Default: the first one seen."),
    ] = None,
    inference: InferenceOption = "glsl",
    vkb: VkbOption = "",
    nodes: NodesOption = None,
    stochastic_samples: StochasticSamplesOption = None,
    camera: CameraOption = None,
    views: Annotated[Path | None, typer.Option("--views", help="JSON file with views of the scene.")] = None,
    view: Annotated[
        str | None, typer.Option("--view", help="Name of one of --views, or of a camera. Default: the first.")
    ] = None,
    image_width: WidthOption = 960,
    picture_size: Annotated[
        str | None,
        typer.Option("--size", help="WIDTHxHEIGHT of one picture, instead of --imageWidth; a window starts with it."),
    ] = None,
    time: TimeOption = None,
    complexity: ComplexityOption = None,
    refine: RefineOption = None,
    alpha: AlphaOption = None,
    glass: GlassOption = DEFAULT_GLASS,
    variant: VariantOption = None,
    background: BackgroundOption = WHITE,
    frames: Annotated[
        int | None,
        typer.Option(
            "--frames", help="Write this many frames of a full turn instead of opening a window; 1: the view itself."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder of frames, pictures (key P) and statistics.csv (key C).")
    ] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Append rows of statistics to this file.")] = None,
    flip: Annotated[bool, typer.Option("--flip", help="Compute FLIP as well; it takes longer.")] = False,
    readout: Annotated[
        bool | None,
        typer.Option("--readout/--no-readout", help="Show the numbers on the picture. Default: in the window."),
    ] = None,
    state: StateOption = DEFAULT_STATE,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Look at a scene with two techniques: pictures, differences, k, times, bytes and errors. H lists the keys."""
    from evaluation.choices import check_bundle, parse_tail
    from evaluation.progress import make_progress
    from evaluation.render_options import (
        RenderOptions,
        loading,
        parse_background,
        parse_needs,
        parse_techniques,
    )
    from evaluation.viewer.model import Service
    from evaluation.viewer.options import ViewerOptions, parse_layout
    from schemas.flags import parse_size

    check_bundle(model, "--model")
    if model is not None and bundle is not None:
        raise Problem("Both --model and --bundle name a bundle.", "Leave out one of them.")
    if watch and (model is None or frames is not None):
        raise Problem(
            "--watch follows the alias of --model in a window, so it needs --model and no --frames.",
            "Add --model and leave out --frames, or leave out --watch.",
        )
    if public_key is not None and model is None:
        raise Problem(
            "--public-key is the key of the server of --model, and there is no --model.",
            "Add --model, or leave out --public-key.",
        )
    has_bundle = model is not None or bundle is not None
    options = ViewerOptions(
        render=RenderOptions(
            scenes=(file,),
            techniques=parse_techniques([technique or ("kbuffer-deep" if has_bundle else "kbuffer")], has_bundle),
            needs=parse_needs(vkb, inference, nodes, stochastic_samples),
            budget=budget,
            tail=None if tail is None else parse_tail(tail),
            g=g,
            bundle=model or bundle,
            camera=camera,
            views=views,
            image_width=image_width,
            size=None if picture_size is None else parse_size(picture_size),
            frames=() if time is None else (time,),
            load=loading(alpha, glass, variant, complexity, refine),
            background=parse_background(background),
        ),
        against=against,
        layout=parse_layout(layout),
        view=view,
        frames=frames,
        out=out,
        csv=csv,
        readout=frames is None if readout is None else readout,
        perceptual=flip,
    )
    service = None
    if model is not None:
        service = Service(model, url, find_key(url, key_file), state, watch, public_key)
    if out is not None and not as_json:
        output.tell_new_folder(out.parent)
    from diaphane.bundles import bundle_folder
    from evaluation.viewer.run import view as run

    with bundle_folder(bundle, state) as folder:
        rows = run(options, folder, service, make_progress(sys.stderr, silent=as_json))
    if as_json:
        output.print_json({"rows": rows})
    elif frames is not None:
        print(out)
