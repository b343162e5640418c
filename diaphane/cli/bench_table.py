"""The tables of `diaphane bench`."""

from __future__ import annotations

from diaphane.cli.lines import print_columns, size
from evaluation.bench.account import COLUMNS, said_device
from evaluation.bench.groups import Group, Row, offline, said_budget, said_technique
from evaluation.summary import UNFIT, e5, number, said_unfit
from evaluation.wording import counted
from schemas.work import Device


def show(shown: Group, device: Device) -> None:
    """Print the views of a group: techniques, offline allocations, the time of each pass, and what frames do.

    Args:
        shown: The group.
        device: What bounds of frame times are stated for.
    """
    print(f"\n{shown.title}: {counted(len(shown.views), 'views')}, N = {shown.depth:.1f} WH")
    with_path = any(row.flicker is not None for row in shown.rows)
    headings = ("technique", "budget", "ms", "MSE e-5", "linear e-5", "occupied e-5", "q", "/ optimum")
    headings += ("PSNR", "SSIM", "FLIP", "captured", "k", "pool", "total", *(("flicker e-3",) if with_path else ()))
    print_columns(
        headings,
        [[said_technique(row.key), said_budget(row.key), *_cells(row, with_path)] for row in shown.rows],
    )
    if not all(row.fits for row in shown.rows):
        print(f"{UNFIT} {said_unfit()}")
    if marks := offline(shown):
        print()
        print_columns(
            ("offline allocation", "budget", "MSE e-5", "gap", "captured", "k"),
            [
                [
                    mark.rule,
                    f"F = {mark.budget_factor:g} WH",
                    e5(mark.mse),
                    None if mark.gap is None else f"{mark.gap:.1e}",
                    f"{mark.captured:,.0f}",
                    f"{mark.k[0]}..{mark.k[1]}",
                ]
                for mark in marks
            ],
        )
    print("\nms of each pass")
    print_columns(
        ("technique", "budget", "passes"),
        [
            [said_technique(row.key), said_budget(row.key), ", ".join(f"{n} {ms:.1f}" for n, ms in row.passes.items())]
            for row in shown.rows
            if row.passes
        ],
    )
    if any(row.account for row in shown.rows):
        _show_work(shown, device)


def _show_work(shown: Group, device: Device) -> None:
    print(f"\nwork of a frame, counted; bound: its least time without caches at {said_device(device)}, no prediction")
    print_columns(
        ("technique", "budget", *COLUMNS),
        [
            [said_technique(row.key), said_budget(row.key), *row.account.columns(device)]
            for row in shown.rows
            if row.account
        ],
    )


def _cells(row: Row, with_path: bool) -> list[str | None]:
    if row.problem is not None:
        said = "no room" if row.key.basis == "memory" else row.problem
        return [said, *[None] * 10, *_bytes(row), *[None] * with_path]
    spread = f" ±{50.0 * row.spread:.0f} %" if row.spread else ""
    time = None if row.ms is None else f"{row.ms:.1f}{spread}"
    errors: list[str | None] = [
        e5(row.mse),
        e5(row.mse_linear),
        e5(row.mse_occupied),
        number(row.score),
        number(row.over_optimum),
    ]
    if row.family == "exact":
        errors = ["exact", None, None, None, None]
    elif row.views and row.exact_views == row.views:
        errors = ["F ≥ N", None, None, None, None]  # not always exact: the fixed k-buffer's F is spread evenly
    kept = None if row.captured is None or row.k is None or not row.k[1] else f"{row.captured:,.0f}"
    return [
        time,
        *errors,
        None if row.psnr is None else f"{row.psnr:.1f}",
        None if row.ssim is None else f"{row.ssim:.4f}",
        None if row.flip is None else f"{row.flip:.4f}",
        kept,
        None if kept is None or row.k is None else f"{row.k[0]}..{row.k[1]}",
        *_bytes(row),
        *([None if row.flicker is None else number(1e3 * row.flicker)] if with_path else []),
    ]


def _bytes(row: Row) -> tuple[str | None, str | None]:
    """Pool and total."""
    mark = "" if row.fits else f" {UNFIT}"
    return (
        None if row.pool_bytes is None else size(row.pool_bytes) + mark,
        None if row.total_bytes is None else size(row.total_bytes),
    )
