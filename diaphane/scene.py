"""A scene file that is open: its cameras, pictures of it by any technique, and its fragments."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from diaphane import shown
from diaphane.bundles import bundle_folder
from diaphane.fragments import Fragments
from diaphane.picture import Picture
from evaluation.choices import parse_tail
from evaluation.local_scenes import LocalScene, as_usd
from evaluation.render_options import (
    RenderOptions,
    loading,
    parse_background,
    parse_needs,
    parse_techniques,
)
from evaluation.rendering import size_of, take
from renderer.capture import capture
from renderer.frame import Frame
from renderer.scene import LoadOptions
from schemas.glass import DEFAULT_GLASS


def open(
    scene: str | Path,
    *,
    alpha: float | None = None,
    glass: str = DEFAULT_GLASS,
    variants: Sequence[str] = (),
    refine: int = 0,
) -> Scene:
    """Open a scene file: USD, glTF, OBJ, PLY or STL.

    Args:
        scene: The file.
        alpha: Opacity that every surface is given; None: the materials' own.
        glass: How surfaces that transmit light are read: one of `schemas.glass.GLASS_READINGS`.
        variants: Variants to select, each as `/prim{set=choice}`.
        refine: Levels that subdivision surfaces are refined by.

    Raises:
        Problem: There is no such file, or nothing of it can be drawn.
    """
    return Scene(Path(scene), loading(alpha, glass, variants, None, refine))


class Scene:
    """A scene that is loaded; `open` makes it. What is converted of it is deleted when it is closed.

    Args:
        file: Its file.
        load: How it is read.
    """

    def __init__(self, file: Path, load: LoadOptions) -> None:
        self.file, self.load = file, load
        self._open = ExitStack()
        self._local = LocalScene(file, self._open.enter_context(as_usd(file)), load)
        self._local.at(None)
        self._warm: set[str] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Delete what was converted to open the file."""
        self._open.close()

    @property
    def cameras(self) -> tuple[str, ...]:
        """Paths of the stage's cameras."""
        return tuple(camera.path for camera in self._local.cameras())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the scene has and its pictures have not."""
        return tuple(self._local.now.scene.warnings)

    def render(
        self,
        technique: str = "sbuffer",
        budget: float = 2.0,
        *,
        camera: str | None = None,
        width: int = 960,
        size: tuple[int, int] | None = None,
        time: float | None = None,
        background: str = "#ffffff",
        tail: str | None = None,
        g: float | None = None,
        bundle: str | Path | None = None,
        samples: int = 1,
        compare: bool = False,
        inference: str = "glsl",
        vkb: str = "",
        nodes: int | None = None,
        stochastic_samples: int | None = None,
        state: str | Path = ".diaphane",
    ) -> Picture:
        """Render a picture; arguments mean what the options of `diaphane render` of their names mean.

        Args:
            technique: Name of a technique (docs/TECHNIQUES.md).
            budget: F, fragments, as a multiple of width x height.
            camera: Name or path of a camera; None: as `diaphane render` chooses.
            width: Pixels per row; rows follow from the camera.
            size: Width and height instead, pixels.
            time: Time code; None: the start of the stage.
            background: `#rrggbb`, or linear `red,green,blue`, where nothing opaque is.
            tail: What stands for the fragments beyond the core; None: as the bundle says, or the default.
            g: Steepness of the density tail.
            bundle: Folder, or NAME@ALIAS of the registry, for the techniques that need one.
            samples: Frames that the picture is the mean of.
            compare: Whether `cost` has the errors against the exact picture.
            inference: How the bundle's network is run.
            vkb: Factors of `kbuffer-importance`.
            nodes: Nodes a pixel of `multilayer` and `adaptive`.
            stochastic_samples: Samples a pixel of `stochastic`.
            state: Folder of the registry.

        Raises:
            Problem: An argument cannot be used, or the technique cannot render this view.
        """
        named = None if bundle is None else str(bundle)
        options = RenderOptions(
            scenes=(self.file,),
            techniques=parse_techniques((technique,), named is not None),
            needs=parse_needs(vkb, inference, nodes, stochastic_samples),
            budget=budget,
            tail=None if tail is None else parse_tail(tail),
            g=g,
            bundle=named,
            camera=camera,
            image_width=width,
            size=size,
            frames=() if time is None else (time,),
            load=self.load,
            background=parse_background(background),
            samples=samples,
            compare=compare,
        )
        with bundle_folder(named, Path(state)) as folder:
            cost, shot = take(self._local, options, folder, self._warm)
        return Picture(shot.linear, cost)

    def fragments(
        self,
        *,
        camera: str | None = None,
        width: int = 960,
        size: tuple[int, int] | None = None,
        time: float | None = None,
        background: str = "#ffffff",
    ) -> Fragments:
        """Every transparent fragment of a view, front to back; arguments are those of `render`.

        Args:
            camera: Name or path of a camera.
            width: Pixels per row.
            size: Width and height instead, pixels.
            time: Time code; None: the start of the stage.
            background: Colour where nothing opaque is.

        Raises:
            Problem: There is no such camera, or the view has too many fragments.
        """
        options = RenderOptions((self.file,), image_width=width, size=size, background=parse_background(background))
        self._local.at(time)
        (chosen,) = self._local.views(camera, None)
        frame = Frame(self._local.gpu(), chosen.view, *size_of(options, chosen.aspect), options.background)
        return Fragments.of(capture(frame).dump)

    def __repr__(self) -> str:
        return f"<Scene {self.file}>"

    def _repr_html_(self) -> str:
        scene = self._local.now.scene
        pairs = [
            ("triangles", f"{scene.triangles:,}"),
            ("cameras", ", ".join(self.cameras) or "none: the whole scene is shown"),
            ("warnings", " ".join(self.warnings) or "none"),
        ]
        return shown.facts(self.file.name, pairs)
