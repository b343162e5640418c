"""Pictures against the exact one: at once, or in a process beside this one, so that a window goes on meanwhile.

It is a process and no thread: compiled loops and FLIP hold the interpreter, and no two threads may run such loops at
once.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.exact import Exact
from renderer import metrics
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

_NICE = 5
"""What the process gives way by: the window, and a driver that renders on the CPU, come first."""


@dataclass(frozen=True, slots=True)
class Picture:
    """What is compared.

    Attributes:
        linear: float32 [H, W, 3], linear RGB.
        k: int32 [P], fragments that were kept apart.
        perceptual: Whether FLIP is computed, which takes longer than all else.
    """

    linear: NDArray[np.float32]
    k: NDArray[np.int32]
    perceptual: bool


@dataclass(frozen=True, slots=True)
class Compared:
    """A picture against the exact one of its camera; see `evaluation.bench.subject.Errors`.

    Attributes:
        mse: Of 8-bit sRGB, values in [0,1].
        mse_display: Of sRGB values before rounding.
        psnr: dB, of `mse`; None for no error.
        flip: Mean LDR-FLIP; None if it was not asked for.
        fragments: N of the view.
        k: Least and greatest k of a pixel that has fragments.
    """

    mse: float
    mse_display: float
    psnr: float | None
    flip: float | None
    fragments: int
    k: tuple[int, int]


def compare(exact: Exact, picture: Picture) -> Compared:
    """A picture against the exact one."""
    image, counts = display8(picture.linear), exact.counts
    error = metrics.mse(image, exact.image)
    k = picture.k[counts > 0]
    return Compared(
        mse=error,
        mse_display=exact.display_error(picture.linear.reshape(-1, 3)),
        psnr=None if error == 0.0 else metrics.psnr(error),
        flip=metrics.flip(image, exact.image)[0] if picture.perceptual else None,
        fragments=int(counts.sum(dtype=np.int64)),
        k=(int(k.min()), int(k.max())) if len(k) else (0, 0),
    )


class Comparer:
    """Compares one picture at a time in another process, which begins with the first one.

    Attributes:
        is_busy: Whether there is an answer to come.
    """

    def __init__(self) -> None:
        self.is_busy = False
        self._process: Any = None
        self._pipe: Any = None
        self._sender: threading.Thread | None = None
        self._view: Hashable = None

    def ask(self, view: Hashable, dump: FragmentDump, picture: Picture) -> None:
        """Have a picture compared.

        Args:
            view: Tells views apart: the dump of the same one as the last time is not sent again.
            dump: Its fragments.
            picture: The picture.

        Raises:
            RuntimeError: The answer to the last one has not been taken.
        """
        if self.is_busy:
            raise RuntimeError("one picture is compared at a time")
        if self._process is None or not self._process.is_alive():
            self._start()
        # A new process reads nothing until it has loaded all that it needs, which takes seconds: a thread waits for it.
        asked = (None if view == self._view else dump, picture)
        self._sender = threading.Thread(target=_send, args=(self._pipe, asked), name="compare", daemon=True)
        self._sender.start()
        self._view, self.is_busy = view, True

    def answer(self) -> Compared | Problem | None:
        """What came of the picture, or why there is nothing; None: it is not there yet."""
        if not self.is_busy:
            return None
        try:
            if not self._pipe.poll():
                return None
            found: Compared = self._pipe.recv()
        except (EOFError, OSError):
            self.close()
            return Problem(
                "The comparison with the exact picture ended before it was done.",
                "Look whether there is enough memory, or make the window smaller.",
                ExitCode.CHECK_FAILED,
            )
        self.is_busy = False
        return found

    def close(self) -> None:
        """End the process, whatever it does."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            if self._sender is not None:
                self._sender.join()  # at once: there is no one who reads
            self._pipe.close()
        self._process = self._pipe = self._sender = self._view = None
        self.is_busy = False

    def _start(self) -> None:
        self.close()
        spawning = multiprocessing.get_context("spawn")  # a fork would take the OpenGL context along
        self._pipe, theirs = spawning.Pipe()
        self._process = spawning.Process(target=_serve, args=(theirs,), name="compare", daemon=True)
        self._process.start()
        theirs.close()


def _send(pipe: Any, asked: tuple[FragmentDump | None, Picture]) -> None:
    with suppress(OSError):  # it has ended: so says the answer
        pipe.send(asked)


def _serve(pipe: Any) -> None:
    """Answers until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the window, which ends this
    os.nice(_NICE)
    exact: Exact | None = None
    with suppress(EOFError, ConnectionError):
        while True:
            dump, picture = pipe.recv()
            if dump is not None:
                exact = Exact(dump)
            assert exact is not None
            pipe.send(compare(exact, picture))
