from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path

from services.sources import YOUNG_SECONDS, materialise, sweep_sources
from services.storage import Blobs
from stages.tasks import Source


def test_a_source_is_laid_out_once_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    blobs, cache = Blobs(tmp_path / "store"), tmp_path / "cache"
    files = {"a.usda": blobs.put_bytes(b"a").sha256, "below/b.png": blobs.put_bytes(b"b").sha256}
    folder = materialise(Source(digest="d" * 64, root="a.usda", files=files), blobs, cache)
    assert (folder / "below" / "b.png").read_bytes() == b"b"
    assert materialise(Source(digest="d" * 64, root="a.usda", files={}), blobs, cache) == folder
    assert [path.name for path in (cache / "sources").iterdir()] == ["d" * 64]


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_makes_stays(tmp_path: Path) -> None:
    sources = tmp_path / "sources"
    (sources / ("d" * 64)).mkdir(parents=True)
    left, made = sources / f".{'e' * 64}-1", sources / f".{'f' * 64}-2"
    for folder in (left, made):
        folder.mkdir()
        (folder / "a.usda").write_text("a")
    living = os.open(made, os.O_RDONLY)
    fcntl.flock(living, fcntl.LOCK_EX)
    assert sweep_sources(tmp_path, time.time()) == 0, "they may just be about to be locked"
    assert sweep_sources(tmp_path, time.time() + 2 * YOUNG_SECONDS) == 1
    assert {path.name for path in sources.iterdir()} == {"d" * 64, made.name}
    os.close(living)
    assert sweep_sources(tmp_path, time.time() + 2 * YOUNG_SECONDS) == 1
