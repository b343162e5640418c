"""The figures of the renderer as a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks import markdown
from benchmarks.provenance import said, said_load


def page(found: Mapping[str, Any]) -> str:
    """Markdown of what `benchmarks.renderer` measured."""
    before, after = (found["load_average"][when][0] for when in ("before", "after"))
    parts = [
        "# The renderer, measured\n",
        f"*{said(found)}; {said_load(before, after)}.* "
        "1430x960, milliseconds on the wall clock where nothing else is said, medians of rounds in which everything "
        "takes its turn. "
        "All techniques against each other, on more scenes: [BENCH.md](BENCH.md).\n",
        f"```\n{found['command']}\n```\n",
    ]
    sections = {"capture": _capture, "views": _views, "frames": _frames}
    parts += [write(found[name]) for name, write in sections.items() if found.get(name)]
    return "\n".join(parts)


def _capture(rows: list[dict[str, Any]]) -> str:
    table = markdown.table(
        ("scene", "triangles", "fragments", "empty pass", "capture", "ratio", "least ratio", "M fragments/s", "passes"),
        (
            (
                r["scene"],
                f"{r['triangles']:,}",
                f"{r['fragments']:,}",
                _ms(r["times"]["empty"]["median"]),
                _ms(r["times"]["capture"]["median"]),
                f"{r['ratio']['median']:.2f}",
                f"{r['ratio']['least']:.2f}",
                f"{r['fragments_per_s']['median'] / 1e6:.1f}",
                _passes({name: ms for name, ms in r["passes"].items() if name != "opaque"}),
            )
            for r in rows
        ),
    )
    bounds = "\n".join(
        f"- {r['scene']}: {r['bytes_moved'] / 2**20:.0f} MiB are written or read, "
        f"{1e3 * r['bytes_moved'] / r['copy_bytes_per_s']:.0f} ms at this machine's copy speed of "
        f"{r['copy_bytes_per_s'] / 1e9:.1f} GB/s; {r['hidden']:,} fragments were behind opaque surfaces, "
        f"{r['culled']:,} triangles outside the frustum."
        for r in rows
    )
    return (
        "## Capture\n\nThe whole capture (append pass, readback, counting sort, sort) against rasterising the same "
        f"triangles once with an empty fragment shader; `least` compares the best of each.\n\n{table}\n{bounds}\n"
    )


def _views(rows: list[dict[str, Any]]) -> str:
    table = markdown.table(
        ("scene", "load", "upload", "second view", "its capture alone", "with a new upload"),
        (
            (
                r["scene"],
                _ms(r["load_ms"]),
                _ms(r["upload_ms"]),
                *(_ms(r["times"][name]["median"]) for name in ("second view", "capture alone", "upload and view")),
            )
            for r in rows
        ),
    )
    return (
        "## Many views of one scene\n\nThe second view of a scene that is on the GPU draws its opaque surfaces and "
        f"captures; nothing is read or uploaded again.\n\n{table}"
    )


def _frames(rows: list[dict[str, Any]]) -> str:
    table = markdown.table(
        ("scene", "N / WH", "technique", "frame", "of the S-buffer's", "passes"),
        (
            (
                r["scene"],
                f"{r['fragments_per_pixel']:.1f}",
                name,
                _ms(ms),
                f"{r['ratio'][name]:.2f}",
                _passes(r["passes"][name]),
            )
            for r in rows
            for name, ms in r["frames"].items()
        ),
    )
    return (
        "## Whole frames\n\nEvery pass of a frame at F = W H, without what is read back for statistics; on a software "
        f"driver in milliseconds of processor time, which other work on the machine does not change.\n\n{table}"
    )


def _passes(passes: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {ms:.0f}" for name, ms in passes.items())


def _ms(value: float) -> str:
    return f"{value:.0f}"
