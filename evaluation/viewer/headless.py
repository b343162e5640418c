"""Frames of an orbit as files, without a window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from evaluation.pictures import write_png
from evaluation.progress import Progress
from evaluation.viewer import statistics
from evaluation.viewer.camera import orbit
from evaluation.viewer.controls import Place
from evaluation.viewer.session import Session
from evaluation.viewer.statistics import Row
from evaluation.writing import replacing

STATISTICS = "statistics.csv"


def frames(
    session: Session, place: Place, count: int, out: Path, csv: Path | None, progress: Progress
) -> Iterator[list[Row]]:
    """Write the frames of a full turn around what the camera looks at; the first one is the view itself.

    Args:
        session: What is rendered, from where the turn begins.
        place: The scene's axes and bounds.
        count: Frames.
        out: Folder of `frame-0000.png`, ... and of the statistics, which replace what is there.
        csv: File that the rows are added to instead; None: none.
        progress: Is told of each frame.

    Yields:
        Rows of each frame, when its picture is on disk.

    Raises:
        Problem: A technique cannot render this, or the folder cannot be written.
    """
    start = session.look.view
    rows: list[Row] = []
    try:
        with progress.stage("render frames", count) as stage:
            for number in range(count):
                session.show(orbit(start, place.up, place.bounds, number, count))
                while session.go_on():
                    pass
                made = session.rows(number)
                with replacing(out / f"frame-{number:04}.png") as path:
                    write_png(path, session.screen())
                rows += made
                yield made
                stage.advance(1, f"frame {number}")
    finally:
        # What was rendered before an interrupt has its numbers as well.
        if rows:
            _write(rows, out, csv)


def _write(rows: list[Row], out: Path, csv: Path | None) -> None:
    if csv is None:
        statistics.write(out / STATISTICS, rows)
    else:
        statistics.append(csv, rows)
