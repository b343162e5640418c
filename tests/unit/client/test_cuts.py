"""Cut or killed at 100 random points, a pull never leaves a partial bundle where it can be seen."""

from __future__ import annotations

import functools
import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from support.cut_wire import CutWire
from support.killed_pull import URL, is_whole
from support.release_server import ReleaseServer
from support.releases import publish

from diaphane_client import Unavailable, cached, pull
from diaphane_client import server as client_server

Answers = dict[str, bytes]

POINTS = 100
KILLS = 40
ROOT = Path(__file__).parents[3]


@pytest.fixture
def releases(tmp_path: Path) -> tuple[Answers, Answers, CutWire]:
    """Answers before and after a second version became the champion, and the wire that they come by."""
    server = ReleaseServer()
    publish(server, tmp_path, "1.0.0")
    server.stop()
    first = dict(server.records)
    publish(server, tmp_path, "1.1.0")
    return first, server.records, CutWire(server.records, server.blobs)


@pytest.fixture
def before(releases: tuple[Answers, Answers, CutWire], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a pull of the first version, by that wire."""
    first, _, wire = releases
    monkeypatch.setattr(client_server, "FIRST_WAIT", 0.0)
    monkeypatch.setattr(httpx, "Client", functools.partial(httpx.Client, transport=wire))
    monkeypatch.setattr(os, "fsync", lambda _: None)
    after, wire.records = wire.records, first
    pull("glass", url=URL, key=None, folder=tmp_path / "before")
    wire.records, wire.carried = after, 0
    return tmp_path / "before"


def versions(bundles: Path) -> list[str]:
    """What a reader of the folder sees, after a check that each version is whole."""
    found = sorted((bundles / "glass" / "versions").glob("*"))
    assert all(map(is_whole, found))
    return [path.name for path in found]


def test_a_transport_cut_at_any_byte_leaves_the_old_bundle_and_its_bytes_are_not_fetched_again(
    releases: tuple[Answers, Answers, CutWire], before: Path, tmp_path: Path
) -> None:
    _, after, wire = releases
    drawn = random.Random(1)
    answers = len(after["glass/pointers/champion"]) + len(after["glass/versions/1.1.0"])
    files = json.loads(after["glass/versions/1.1.0"])["files"].values()
    total = answers + sum(file["bytes"] for file in files)
    cuts = sorted(drawn.sample(range(total), POINTS))
    assert cuts[0] < answers < cuts[15]
    for cut in cuts:
        bundles = tmp_path / "bundles"
        shutil.rmtree(bundles, ignore_errors=True)
        shutil.copytree(before, bundles)
        wire.left, wire.carried = cut, 0
        assert pull("glass", url=URL, key=None, folder=bundles).name == "1.0.0"
        assert versions(bundles) == ["1.0.0"]
        assert cached("glass", url=URL, folder=bundles) == bundles / "glass" / "versions" / "1.0.0"
        wire.left = None
        assert pull("glass", url=URL, key=None, folder=bundles).name == "1.1.0"
        assert versions(bundles) == ["1.0.0", "1.1.0"]
        assert wire.carried <= total + answers  # the answers come twice, the files once


def test_a_first_pull_that_is_cut_leaves_nothing_to_be_seen(
    releases: tuple[Answers, Answers, CutWire], before: Path, tmp_path: Path
) -> None:
    _, _, wire = releases
    bundles = tmp_path / "bundles"
    for cut in (0, 300, 5_000, 20_000):
        wire.left = cut
        with pytest.raises(Unavailable):
            pull("glass", url=URL, key=None, folder=bundles)
        assert versions(bundles) == []
    wire.left = None
    assert pull("glass", url=URL, key=None, folder=bundles).name == "1.1.0"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_process_killed_at_any_line_leaves_the_old_bundle_or_the_new_one(
    releases: tuple[Answers, Answers, CutWire], before: Path, tmp_path: Path
) -> None:
    wire = releases[2]
    content = {"records": wire.records, "blobs": wire.blobs}
    text = json.dumps({kind: {name: body.hex() for name, body in part.items()} for kind, part in content.items()})
    (tmp_path / "wire.json").write_text(text)
    path = os.pathsep.join(str(ROOT / part) for part in (".", "tests", "deploy/client/python"))
    done = subprocess.run(
        [sys.executable, "-m", "support.killed_pull", str(tmp_path), str(KILLS)],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    kills = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(kills) == KILLS
    for kill in kills:
        assert kill["ended"] == -9, kill
        assert kill["versions"] in ({"1.0.0": True}, {"1.0.0": True, "1.1.0": True}), kill
        assert kill["offline"] in ("1.0.0", "1.1.0"), kill
        assert (kill["again"], kill["whole"]) == ("1.1.0", True), kill
    assert len({len(kill["versions"]) for kill in kills}) == 2  # some died before the new one was there, some after
