"""Writes what documents and `deploy/retrain` say of options from the commands themselves.

    python -m diaphane.cli.tables

`tests/docs/test_documents.py` holds the files to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import typer

from diaphane.cli.app import app
from diaphane.cli.retrain import OWN, VARIABLES
from schemas.flags import Flag, flags
from schemas.job import JobSpec
from schemas.options import Options

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = "docs/CLI.md"
ACTION = "deploy/retrain/action.yml"
BEGIN, END = "options of the command", "end of options of the command"


def build_table() -> str:
    """The options of `diaphane build`: name, default, meaning."""
    command: Any = typer.main.get_command(app)
    made = {flag.names[0]: flag for flag in flags(Options)}
    rows = ["| option | default | meaning |", "|---|---|---|"]
    for option in command.commands["build"].params:
        name = option.opts[0]
        if name in made:
            rows.append(_row(made[name]))
        elif name.startswith("--"):
            words, _, default = option.help.partition(" Default: ")
            usual = default.rstrip(".") or ("required" if option.required else _literal(option.default))
            rows.append(f"| `{name}` | {usual} | {words} |")
    return "\n".join(rows)


def action_inputs() -> str:
    """The inputs of the action that are options of `diaphane retrain`, YAML."""
    parts = []
    for flag in retrain_flags():
        words = flag.help.replace('"', '\\"')
        parts.append(f'  {flag.names[0].removeprefix("--")}:\n    description: "{words}"\n    default: ""')
    return "\n".join(parts)


def action_environment() -> str:
    """Their way into the command, YAML."""
    return "\n".join(
        f"        {VARIABLES}{flag.parameter.upper()}: ${{{{ inputs.{flag.names[0].removeprefix('--')} }}}}"
        for flag in retrain_flags()
    )


def retrain_flags() -> list[Flag]:
    """The options of `diaphane retrain` that a variable gives too."""
    return [flag for flag in flags(JobSpec, OWN) if flag.kind is not bool]


FILES: Mapping[str, tuple[Callable[[], str], ...]] = {
    DOCUMENT: (build_table,),
    ACTION: (action_inputs, action_environment),
}
"""File -> what stands between its marks, in their order."""


def rewritten(name: str, text: str) -> str:
    """A file with its tables as they have to be.

    Args:
        name: Of the file.
        text: What it says.
    """
    lines, parts, inside = [], iter(FILES[name]), False
    for line in text.splitlines():
        if END in line:
            inside = False
        if not inside:
            lines.append(line)
        if BEGIN in line and END not in line:
            inside = True
            lines.append(next(parts)())
    assert next(parts, None) is None, f"{name} lacks a mark"
    return "\n".join(lines) + "\n"


def _row(flag: Flag) -> str:
    default = f"`{flag.default}`" if flag.default else flag.absent
    return f"| `{flag.names[0]}` | {default} | {flag.words}{f' {_sentence(flag.range)}' if flag.range else ''} |"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _literal(default: Any) -> str:
    return "" if default in (None, False) else f"`{default}`"


if __name__ == "__main__":
    for _name in FILES:
        (ROOT / _name).write_text(rewritten(_name, (ROOT / _name).read_text(encoding="utf-8")), encoding="utf-8")
