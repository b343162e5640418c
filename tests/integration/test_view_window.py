"""`diaphane view` in a real window, on a display without a screen, with keys and mouse of xdotool."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab

from renderer.samples import SAMPLES

ROOT = Path(__file__).resolve().parents[2]
WIDTH, HEIGHT = 160, 120
SECONDS = 120.0

pytestmark = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="apt-get install xvfb xdotool"
)


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A display of the tests' own."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x400x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read, encoding="ascii") as stream:
        number = stream.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


class Viewed:
    """A `diaphane view` of a scene in a process of its own."""

    def __init__(self, display: str, folder: Path, *arguments: str) -> None:
        self.display, self.folder, self._window = display, folder, ""
        self._environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-c", "from diaphane.cli import main; main()", "view", *arguments]
        self._process = subprocess.Popen(
            command, cwd=folder, env=self._environment, stderr=subprocess.PIPE, text=True, errors="replace"
        )
        self._window = self.until(lambda: self._tool("search", "--name", "Diaphane$"))

    def until(self, found: Callable[[], str]) -> str:
        """Waits until there is something."""
        end = time.monotonic() + SECONDS
        while not (what := found()):
            assert self._process.poll() is None, self._process.communicate()[1]
            assert time.monotonic() < end, self.title
            time.sleep(0.05)
        return what

    @property
    def title(self) -> str:
        return self._tool("getwindowname", self._window)

    def key(self, name: str, title: str = "") -> None:
        """Presses a key, and waits until the title says so."""
        self._tool("windowfocus", self._window, "key", name)
        self.until(lambda: self.title if title in self.title else "")

    def written(self, key: str, pattern: str) -> Path:
        """Presses a key that writes a file of such a name."""
        there = set(self.folder.glob(pattern))
        self.key(key)
        return Path(self.until(lambda: next((str(path) for path in set(self.folder.glob(pattern)) - there), "")))

    def mouse(self, *words: str) -> None:
        self._tool("mousemove", "--window", self._window, *words)

    def seen(self) -> np.ndarray:
        """What is on the screen: uint8 [HEIGHT, 2 WIDTH, 3]."""
        return np.asarray(ImageGrab.grab(xdisplay=self.display))[:HEIGHT, : 2 * WIDTH]

    def end(self) -> tuple[int, str]:
        """Presses Escape; exit status, and what was said."""
        self._tool("windowfocus", self._window, "key", "Escape")
        _, said = self._process.communicate(timeout=SECONDS)
        return self._process.returncode, said

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def _tool(self, *words: str) -> str:
        done = subprocess.run(["xdotool", *words], env=self._environment, capture_output=True, text=True)
        return done.stdout.strip().partition("\n")[0]


@pytest.fixture
def viewed(display: str, tmp_path: Path) -> Iterator[Viewed]:
    scene = SAMPLES["nested_shells"](tmp_path)
    found = Viewed(display, tmp_path, str(scene), "--size", f"{WIDTH}x{HEIGHT}", "--budget", "1", "--out", "out")
    yield found
    found.kill()


def test_keys_and_mouse_reach_the_picture_and_the_files(viewed: Viewed) -> None:
    viewed.until(lambda: viewed.title if "kbuffer | sbuffer - 1 fragments" in viewed.title else "")
    viewed.key("i")
    files = "out/nested_shells-*-left-kbuffer.png"
    left = viewed.written("p", files)
    picture = pixels(left)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    # On the screen is what was written; any key takes the message about it away, the help's twice changes nothing.
    viewed.key("h")
    viewed.key("h")
    both = pixels(viewed.folder / "out" / "nested_shells-001.png")
    assert np.array_equal(both[:, :WIDTH], picture)
    viewed.until(lambda: "same" if np.array_equal(viewed.seen(), both) else "")
    viewed.key("b", "1.5 fragments")
    viewed.key("Right")
    turned = viewed.written("p", files)
    assert not np.array_equal(pixels(turned), picture)
    viewed.mouse("40", "60", "mousedown", "1", "mousemove_relative", "20", "0", "mouseup", "1")
    viewed.mouse("40", "60", "click", "4")
    led = viewed.written("p", files)
    assert not np.array_equal(pixels(led), pixels(turned))
    viewed.key("w", "kbuffer | depth-peeling")
    viewed.key("1", "nested_shells - kbuffer - 1.5")
    with viewed.written("c", "out/statistics.csv").open(encoding="utf-8", newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["technique"], row["budget_factor"], row["width"]) == ("kbuffer", "1.5", str(2 * WIDTH))
    assert int(row["captured"]) <= int(row["budget"]) == int(1.5 * 2 * WIDTH * HEIGHT)
    assert float(row["mse"]) > 0.0
    status, said = viewed.end()
    assert status == 0
    assert "Traceback" not in said
    assert "statistics.csv" in said


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)
