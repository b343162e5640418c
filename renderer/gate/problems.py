"""Why an uploaded scene is refused: a slug for programs, a sentence and a remedy for people.

Nothing here quotes what a file contains: only names of uploaded files, in a printable form.
"""

from __future__ import annotations

from typing import Literal

from schemas.problem import ExitCode, Problem

Slug = Literal[
    "scene-path-outside",
    "scene-url",
    "scene-expression",
    "scene-symlink",
    "scene-file-name",
    "scene-archive",
    "scene-too-large",
    "scene-too-many-layers",
    "scene-format",
    "scene-damaged",
    "scene-texture",
    "scene-no-geometry",
]

REMEDIES: dict[Slug, str] = {
    "scene-path-outside": "Keep everything in one folder, and name it by relative paths that do not leave it.",
    "scene-url": "Put the file into the upload and name it by a relative path.",
    "scene-expression": "Replace variable expressions by plain relative paths; `usdcat --flatten` does that.",
    "scene-symlink": "Upload plain files.",
    "scene-file-name": "Rename the file; letters, digits, spaces and the signs .-_+()#,'!&=^~ can be used.",
    "scene-archive": "Make the package with `usdzip`.",
    "scene-too-large": "Split the scene, or leave out what is not seen.",
    "scene-too-many-layers": "Flatten the scene with `usdcat --flatten`.",
    "scene-format": "Export the scene as .usdz, .usdc, .usda or .glb with PNG or JPEG images.",
    "scene-damaged": "Check it with `usdchecker` and export it again.",
    "scene-texture": "Convert the image to a PNG or JPEG of moderate size.",
    "scene-no-geometry": "Check that it has visible meshes or gprims of purpose default or render.",
}
"""Every slug, and what helps."""

LIMIT_SLUGS: tuple[Slug, ...] = ("scene-too-large", "scene-too-many-layers")


class RejectedScene(Problem):
    """An uploaded scene that is not accepted.

    Args:
        slug: Names the problem.
        title: What is wrong, one sentence, without any of the file's content.
        remedy: What to do about it; None: what usually helps.

    Attributes:
        slug: Names the problem.
    """

    def __init__(self, slug: Slug, title: str, remedy: str | None = None) -> None:
        code = ExitCode.LIMIT if slug in LIMIT_SLUGS else ExitCode.USAGE
        super().__init__(title, remedy or REMEDIES[slug], code)
        self.slug: Slug = slug

    def __reduce__(self) -> tuple[type[RejectedScene], tuple[Slug, str, str]]:
        return RejectedScene, (self.slug, self.title, self.remedy)


def ended(root: str, timed_out: bool) -> RejectedScene:
    """The problem of a scene whose process was ended by its limits, or ended itself.

    Args:
        root: Name of the file that is the scene.
        timed_out: Whether it was the clock.
    """
    if timed_out:
        return RejectedScene("scene-too-large", f"{shown(root)} takes longer to read than a scene may take.")
    return RejectedScene("scene-damaged", f"Reading {shown(root)} ended its process.")


def shown(name: str) -> str:
    """An uploaded file's name as a message may show it: printable ASCII, at most 80 characters."""
    text = name.encode("ascii", "backslashreplace").decode("ascii")
    text = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return text if len(text) <= 80 else f"{text[:38]}...{text[-38:]}"
