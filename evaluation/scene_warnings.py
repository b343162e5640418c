"""What a scene has and its picture has not, told on the terminal once for each scene."""

from __future__ import annotations

from collections.abc import Sequence

MOST = 6
"""Lines told of one scene."""


def said_warnings(scene: object, warnings: Sequence[str], file: object) -> list[str]:
    """Lines for the terminal.

    Args:
        scene: How it is called.
        warnings: What the loader says (`schemas.scene.SceneArrays.warnings`).
        file: That `diaphane scene inspect` lists all of; None: it is not on this machine.
    """
    shown = warnings if len(warnings) <= MOST + 1 else warnings[:MOST]
    lines = [f"warning: {scene}: {warning}" for warning in shown]
    if rest := len(warnings) - len(shown):
        lists = "" if file is None else f", which `diaphane scene inspect {file}` lists"
        lines.append(f"warning: {scene}: and {rest} more{lists}")
    return lines
