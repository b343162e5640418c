"""Label shards against other ways to keep the same rows: size, write, whole read, range read, threads.

python -m benchmarks.dataset FOLDER --out benchmarks/results/dataset.json

FOLDER is a data set, as `diaphane build` leaves it in `.diaphane/datasets/NAME`. Parquet is measured where pyarrow is
installed; Diaphane does not need it. Times are the least of several runs with the files in the page cache.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from benchmarks import provenance
from benchmarks.markdown import table
from benchmarks.outputs import add_outputs, write_figures
from labeller.columns import COLUMNS
from labeller.dataset import Dataset, open_dataset
from labeller.shard_file import BLOCK_ROWS, Columns, open_columns, write_columns
from stages.store import sync
from trainer.dataset import load_shards

RANGE = 2000
"""Rows of a range read: fewer than a block, and across the end of one."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a format costs, over all shards of the data set.

    Attributes:
        format: In words.
        checked: Whether reading finds damage.
        bytes_per_row: Of the files.
        write_ms: A whole shard, until it is on the disk.
        read_ms: A whole shard.
        range_ms: `RANGE` rows in the middle of a shard.
    """

    format: str
    checked: bool
    bytes_per_row: float
    write_ms: float
    read_ms: float
    range_ms: float


class Format:
    """A way to keep columns in a file; `read` gives the rows `start <= r < stop` and their segments."""

    name = ""
    checked = False

    def write(self, path: Path, columns: Columns, view: dict[str, Any]) -> None:
        """Writes the columns."""
        raise NotImplementedError

    def read(self, path: Path, start: int, stop: int) -> Columns:
        """Reads a range, which may be all rows."""
        raise NotImplementedError


class Shards(Format):
    """What Diaphane writes."""

    name = f"shard, verified by blocks of {BLOCK_ROWS} rows"
    checked = True

    def write(self, path: Path, columns: Columns, view: dict[str, Any]) -> None:
        """See `Format`."""
        write_columns(path, columns, view)

    def read(self, path: Path, start: int, stop: int) -> Columns:
        """See `Format`."""
        with open_columns(path) as file:
            return file.read(start, stop)


class Plain(Format):
    """The same tensors without sums, read by safetensors itself; a range needs all counts, to find its segments."""

    name = "plain safetensors"

    def write(self, path: Path, columns: Columns, view: dict[str, Any]) -> None:
        """See `Format`."""
        save_file(columns, path)
        sync(path)

    def read(self, path: Path, start: int, stop: int) -> Columns:
        """See `Format`."""
        with safe_open(path, framework="numpy") as file:
            if stop - start == file.get_slice("n").get_shape()[0]:
                return dict(load_file(path))
            ends = np.cumsum(file.get_tensor("hull_segments"), dtype=np.int64)
            parts = {"row": (start, stop), "segment": (int(ends[start - 1]) if start else 0, int(ends[stop - 1]))}
            return {name: file.get_slice(name)[slice(*parts[column.per])] for name, column in COLUMNS.items()}


class Parquet(Format):
    """Each feature a column, hulls as lists, row groups as long as a shard's blocks, checksums of pages.

    Args:
        compression: `none` or `zstd`.
    """

    checked = True

    def __init__(self, compression: str) -> None:
        self._arrow, self._parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        self._compression = compression
        self.name = f"Parquet, {compression}"

    def write(self, path: Path, columns: Columns, view: dict[str, Any]) -> None:
        """See `Format`."""
        starts = np.concatenate([[0], np.cumsum(columns["hull_segments"])]).astype(np.int32)
        table = {f"f{i}": np.ascontiguousarray(column) for i, column in enumerate(columns["features"].T)}
        table |= {"n": columns["n"], "pixel": columns["pixel"]}
        for name in ("hull_length", "hull_error"):
            table[name] = self._arrow.ListArray.from_arrays(starts, columns[name])
        self._parquet.write_table(
            self._arrow.table(table),
            path,
            compression=self._compression,
            row_group_size=BLOCK_ROWS,
            write_page_checksum=True,
        )
        sync(path)

    def read(self, path: Path, start: int, stop: int) -> Columns:
        """See `Format`."""
        with self._parquet.ParquetFile(path, page_checksum_verification=True) as file:
            first, last = start // BLOCK_ROWS, -(-stop // BLOCK_ROWS)
            groups = file.read_row_groups(range(first, last), use_threads=False)
        table = groups.slice(start - first * BLOCK_ROWS, stop - start).combine_chunks()
        lists = table["hull_length"].combine_chunks()
        return {
            "features": np.stack([table[f"f{i}"].to_numpy() for i in range(len(COLUMNS["features"].fields))], axis=1),
            **{name: table[name].to_numpy() for name in ("n", "pixel")},
            "hull_segments": lists.value_lengths().to_numpy().astype(np.uint16),
            **{name: table[name].combine_chunks().flatten().to_numpy() for name in ("hull_length", "hull_error")},
        }


def main() -> int:
    """Measures and prints; 1 if a format does not give back what was written."""
    arguments = _parse()
    dataset = open_dataset(arguments.folder)
    formats: list[Format] = [Shards(), Plain()]
    if find_spec("pyarrow") is None:
        print("pyarrow is not installed: no Parquet", file=sys.stderr)
    else:
        formats += [Parquet("none"), Parquet("zstd")]
    found = provenance.head("benchmarks.dataset")
    with provenance.load_around(found):
        costs = [_cost(dataset, wanted, arguments.repeat) for wanted in formats]
        threads = {count: _threads(dataset, count, arguments.repeat) for count in (1, 2, 4)}
    rows, segments = (sum(getattr(entry, name) for entry in dataset.index.shards) for name in ("rows", "segments"))
    print(f"{len(dataset.index.shards)} shards, {rows:,} rows, {segments / rows:.2f} segments a row\n")
    heads = ("format", "damage found", "bytes a row", "write, ms", "whole read, ms", "2,000 rows, ms")
    print(table(heads, map(_shown, costs)))
    for count, (read, load) in threads.items():
        print(f"{count} threads: all shards read in {read:.0f} ms, ready to train on in {load:.0f} ms")
    found |= {
        "shards": len(dataset.index.shards),
        "rows": rows,
        "segments": segments,
        "formats": [asdict(cost) for cost in costs],
        "threads": {str(n): {"read_ms": read, "load_ms": load} for n, (read, load) in threads.items()},
    }
    write_figures(arguments.out, found)
    return 0


def _shown(cost: Cost) -> tuple[str, ...]:
    times = f"{cost.write_ms:.1f}", f"{cost.read_ms:.1f}", f"{cost.range_ms:.2f}"
    return cost.format, "yes" if cost.checked else "no", f"{cost.bytes_per_row:.1f}", *times


def _cost(dataset: Dataset, wanted: Format, repeat: int) -> Cost:
    sizes, times = 0, np.zeros(3)
    with tempfile.TemporaryDirectory(prefix="diaphane-dataset-") as name:
        path = Path(name) / "rows"
        for entry in dataset.index.shards:
            with open_columns(dataset.folder / entry.file) as file:
                columns, view = file.read(0, entry.rows), file.layout.view
            start = max(0, min(entry.rows // 2 // BLOCK_ROWS * BLOCK_ROWS - RANGE // 2, entry.rows - RANGE))
            stop = min(start + RANGE, entry.rows)
            write = _least(lambda: wanted.write(path, columns, view), repeat)  # noqa: B023 - called at once
            whole = _least(lambda: wanted.read(path, 0, entry.rows), repeat)  # noqa: B023
            part = _least(lambda: wanted.read(path, start, stop), repeat)  # noqa: B023
            _require_equal(wanted.read(path, 0, entry.rows), columns, slice(None))
            _require_equal(wanted.read(path, start, stop), columns, slice(start, stop))
            sizes += path.stat().st_size
            times += (write, whole, part)
    count, rows = len(dataset.index.shards), sum(entry.rows for entry in dataset.index.shards)
    write_ms, read_ms, range_ms = (times / count).tolist()
    return Cost(wanted.name, wanted.checked, sizes / rows, write_ms, read_ms, range_ms)


def _threads(dataset: Dataset, count: int, repeat: int) -> tuple[float, float]:
    """Milliseconds to read all shards, and until they are training data."""
    paths = [dataset.folder / entry.file for entry in dataset.index.shards]
    assets = [entry.asset for entry in dataset.index.shards]
    read = _least(lambda: sum(len(shard.n) for _, shard in dataset.shards(threads=count)), repeat)
    return read, _least(lambda: load_shards(paths, assets, count), repeat)


def _require_equal(found: Columns, expected: Columns, rows: slice) -> None:
    for name in ("features", "n", "pixel", "hull_segments"):
        _require(np.array_equal(found[name], expected[name][rows]), name)
    ends: NDArray[np.int64] = np.concatenate([[0], np.cumsum(expected["hull_segments"], dtype=np.int64)])
    first, last, _ = rows.indices(len(expected["n"]))
    for name in ("hull_length", "hull_error"):
        _require(np.array_equal(found[name], expected[name][ends[first] : ends[last]]), name)


def _require(holds: bool, name: str) -> None:
    if not holds:
        raise AssertionError(f"{name} is not what was written")


def _least(run: Callable[[], object], repeat: int) -> float:
    """Milliseconds of the quickest of several runs."""
    times = []
    for _ in range(repeat):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return 1e3 * min(times)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of a data set")
    add_outputs(parser, has_page=False)
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the quickest counts")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
