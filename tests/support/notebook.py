"""Runs notebooks as Jupyter does, in one namespace and without a kernel; `python -m support.notebook FILE...` keeps
what they show in them."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

Cell = dict[str, Any]


def run(notebook: dict[str, Any]) -> dict[str, Any]:
    """Runs the code of a notebook, in order, in the current folder.

    Returns:
        The namespace that it leaves; the cells have the outputs that Jupyter would show.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(code, 1):
        cell["outputs"], cell["execution_count"] = _outputs("".join(cell["source"]), number, names), number
    return names


def _outputs(source: str, number: int, names: dict[str, Any]) -> list[Cell]:
    body, shown = ast.parse(source), None
    if body.body and isinstance(last := body.body[-1], ast.Expr):
        body.body.pop()
        shown = ast.Expression(last.value)
    told, found = io.StringIO(), None
    with contextlib.redirect_stdout(told):
        exec(compile(body, f"<cell {number}>", "exec"), names)
        if shown is not None:
            found = eval(compile(shown, f"<cell {number}>", "eval"), names)
    outputs: list[Cell] = []
    if told.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": told.getvalue().splitlines(keepends=True)})
    if found is not None:
        data = {"text/plain": repr(found).splitlines(keepends=True)}
        if hasattr(found, "_repr_html_"):
            data["text/html"] = found._repr_html_().splitlines(keepends=True)
        outputs.append({"output_type": "execute_result", "execution_count": number, "data": data, "metadata": {}})
    return outputs


def main() -> None:
    """Runs notebooks and keeps what they show."""
    for path in map(Path.absolute, map(Path, sys.argv[1:])):
        notebook = json.loads(path.read_text(encoding="utf-8"))
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            run(notebook)
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
