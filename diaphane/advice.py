"""Which technique a scene needs within a memory, with which budget, and why."""

from __future__ import annotations

from pathlib import Path

from diaphane import shown
from diaphane.bundles import bundle_folder
from diaphane.scene import Scene
from evaluation.advice import run, words
from evaluation.advice.amounts import DEFAULT_MEMORY, DEFAULT_SIZE, parse_frame, parse_memory
from evaluation.advice.options import AdviceOptions
from evaluation.advice.page import page
from evaluation.writing import replacing
from renderer.scene import LoadOptions


class Advised(run.Advised):
    """Advice on a scene that shows itself: `advice` has the numbers, `sheet` pictures of its worst views."""

    __slots__ = ()

    def save(self, path: str | Path) -> None:
        """Write the advice as a page, with its charts and pictures.

        Args:
            path: The HTML file.
        """
        with replacing(Path(path)) as file:
            file.write_text(page([(self.advice, self.sheet)], "diaphane.advise"), encoding="utf-8")

    def __str__(self) -> str:
        return "\n".join(self.advice.text)

    def _repr_html_(self) -> str:
        table = shown.table(words.HEADINGS, words.table(self.advice)) if self.advice.best else ""
        return shown.paragraphs(self.advice.text) + table


def advise(
    scene: Scene | str | Path,
    memory: str = DEFAULT_MEMORY,
    size: str = DEFAULT_SIZE,
    *,
    views: str | Path | None = None,
    bundle: str | Path | None = None,
    state: str | Path = ".diaphane",
) -> Advised:
    """Advice on a scene; arguments mean what the options of `diaphane advise` of their names mean.

    Args:
        scene: The scene, or its file.
        memory: That all buffers of a frame may take, such as `64MiB`.
        size: WIDTHxHEIGHT of the frame, pixels.
        views: JSON file with views; None: the scene's cameras, else views around it.
        bundle: For `kbuffer-deep`: a folder, or NAME@ALIAS of the registry; None: benchmarks/bundle.
        state: Folder of the registry.

    Raises:
        Problem: The scene cannot be loaded, or an argument cannot be used.
    """
    options = AdviceOptions(
        scenes=(scene.file if isinstance(scene, Scene) else Path(scene),),
        memory=parse_memory(memory),
        size=parse_frame(size),
        views=None if views is None else Path(views),
        load=scene.load if isinstance(scene, Scene) else LoadOptions(),
        bundle=None if bundle is None else str(bundle),
    )
    with bundle_folder(options.used_bundle, Path(state)) as folder:
        (found,) = run.advised(options, folder)
    return Advised(found.file, found.advice, found.sheet)
