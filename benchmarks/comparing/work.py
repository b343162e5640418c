"""The table of what frames do: passes, fragments, bytes and atomics, and the bound that follows."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.markdown import table
from evaluation.bench.account import COLUMNS, said_device
from evaluation.bench.groups import group, said_technique
from schemas.bench import BenchView
from schemas.work import Device


def work(views: Sequence[BenchView], factor: float, device: Device) -> str:
    """Markdown; '' where no frame was counted.

    Args:
        views: That are summed.
        factor: F / WH of the bounded techniques.
        device: What the bound is stated for.
    """
    rows = [row for row in group("", views).rows if row.account and row.key.budget_factor in (None, factor)]
    if not rows:
        return ""
    about = (
        "Counted in a frame of each view after the opaque pass, as the shaders' sources have it "
        "([TECHNIQUES.md](../docs/TECHNIQUES.md)). The bound is the least time of a frame on a device of "
        f"{said_device(device)} that caches nothing; it is no prediction.\n"
    )
    lines = [[said_technique(row.key), *row.account.columns(device)] for row in rows if row.account]
    return f"{about}\n{table(('technique', *COLUMNS), lines)}"
