"""The window: shows what a session composes, and turns keys and mouse into another look.

Nothing is rendered while nothing changes. When the camera rests, what learns from frame to frame goes on until it has
settled; then what is shown is compared with the exact picture, in a process of its own: the window goes on meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from evaluation.viewer import statistics
from evaluation.viewer.comparing import Comparer
from evaluation.viewer.controls import KEYS, PICTURES, STATISTICS, Look, Place, pan, turn, zoom
from evaluation.viewer.headless import STATISTICS as FILE
from evaluation.viewer.layout import across
from evaluation.viewer.model import Source, fetched_name
from evaluation.viewer.session import Session
from evaluation.viewer.statistics import Row
from renderer.context import adopt, limit_threads
from schemas.problem import ExitCode, Problem

REST = 0.4
"""Seconds without a change after which what is shown is compared with the exact picture."""
_TICK = 0.02
"""Seconds between two looks at keys and mouse while nothing changes."""
_GRIP = 12
"""Pixels beside the divider within which the mouse takes hold of it."""
_ZOOM = 0.9
"""Of the distance, for a step of the wheel."""
_LEAST_SIDE = 8
_SLOW = 0.1
"""Seconds of a picture from which on the mouse leads the camera by coarse ones."""
_COARSE = 4
"""Pixels of the window for one of a coarse picture, either way."""

_INSTEAD = "Or go without a window: --frames 1 --out FOLDER."

_VERTEX = """#version 450
void main() { gl_Position = vec4(vec2[](vec2(-1, -1), vec2(3, -1), vec2(-1, 3))[gl_VertexID], 0, 1); }
"""
_FRAGMENT = """#version 450
uniform sampler2D image;
uniform int height;
uniform int scale;
out vec4 colour;
void main() {
    ivec2 place = ivec2(gl_FragCoord.x, height - 1 - int(gl_FragCoord.y)) / scale;
    bool inside = all(lessThan(place, textureSize(image, 0)));
    colour = inside ? vec4(texelFetch(image, place, 0).rgb, 1) : vec4(0, 0, 0, 1);
}
"""
"""A picture texel by texel in the window's top left corner; the window counts its rows from below."""


def open_window(size: tuple[int, int], title: str) -> Any:
    """A window, whose context becomes that of this process.

    Args:
        size: Width and height, in the window system's units.
        title: Of the window.

    Returns:
        A `moderngl_window` window.

    Raises:
        Problem: There is no display, no OpenGL 4.5, or moderngl-window is not installed.
    """
    limit_threads()
    try:
        import pyglet

        pyglet.options["shadow_window"] = False  # it would be a second context
        from moderngl_window.context.pyglet.window import Window
    except ModuleNotFoundError as error:
        raise Problem(
            "A window needs moderngl-window, which is not installed.",
            f"Run `pip install 'diaphane[view]'`. {_INSTEAD}",
            ExitCode.CHECK_FAILED,
        ) from error
    try:
        window = Window(title=title, size=size, gl_version=(4, 5), resizable=True, vsync=True, samples=0)
    except Exception as error:  # of pyglet, of the window system, of the driver
        raise Problem(
            f"No window with OpenGL 4.5 could be opened ({error or type(error).__name__}).",
            f"Check the display and its driver. {_INSTEAD}",
            ExitCode.CHECK_FAILED,
        ) from error
    adopt(window.ctx)
    window.exit_key = None  # it would take the context away from under what is still there
    return window


@dataclass(frozen=True, slots=True)
class Files:
    """Where keys write to.

    Attributes:
        out: Folder of the pictures.
        csv: File that rows of statistics are added to; None: one in `out`.
        told: Is told of every file.
    """

    out: Path
    csv: Path | None
    told: Callable[[str], None]


class Viewer:
    """A session in a window.

    Args:
        window: From `open_window`.
        session: What is shown.
        place: What movements are relative to.
        source: The bundle and its successors.
        files: Where keys write to.
        comparer: Compares with the exact picture; `run` closes it.

    Attributes:
        rows: Statistics that were written.
    """

    def __init__(
        self, window: Any, session: Session, place: Place, source: Source, files: Files, comparer: Comparer
    ) -> None:
        self.window, self.session, self.rows = window, session, list[Row]()
        self._place, self._source, self._files, self._comparer = place, source, files, comparer
        self._drawn: tuple[Look, int, str] | None = None
        self._changed, self._is_done = time.monotonic(), False
        self._holds_divider, self._is_led = False, False
        self._seconds, self._scale = 0.0, 1
        ctx: moderngl.Context = window.ctx
        self._program = ctx.program(_VERTEX, _FRAGMENT)
        self._screen = ctx.vertex_array(self._program, [])
        self._texture: moderngl.Texture | None = None
        self._keys = {
            getattr(window.keys, name.removeprefix("shift+")): name.removeprefix("shift+")
            for name in (*KEYS, PICTURES, STATISTICS, "ESCAPE")
        }
        window.key_event_func = self.on_key
        window.mouse_press_event_func = self.on_press
        window.mouse_release_event_func = self.on_release
        window.mouse_drag_event_func = self.on_drag
        window.mouse_scroll_event_func = self.on_scroll

    def run(self) -> None:
        """Show it until the window is closed."""
        try:
            while not (self._is_done or self.window.is_closing):
                if not self.step():
                    time.sleep(_TICK)
        finally:
            self._comparer.close()

    def step(self) -> bool:
        """Render what changed, show it, and take what keys and mouse did meanwhile; whether anything changed."""
        self._follow()
        self._fit()
        session = self.session
        state = session.look, session.studio.edition, session.message
        is_new = state != self._drawn
        if is_new:
            self.window.title, session.is_computing = session.title, False
            self._upload()
            self._drawn, self._changed = state, time.monotonic()
        elif self._compare():
            is_new = True
            self._upload()
        self._show()
        return is_new

    def on_key(self, key: Any, action: Any, modifiers: Any) -> None:
        """A key went down, or up."""
        name = self._keys.get(key)
        if action != self.window.keys.ACTION_PRESS or name is None:
            return
        self.session.message = ""
        if name == "ESCAPE":
            self._is_done = True
        elif name == PICTURES:
            self._write(self._save_pictures)
        elif name == STATISTICS:
            self._write(self._save_statistics)
        else:
            control = KEYS.get(f"shift+{name}" if modifiers.shift else name) or KEYS[name]
            self.session.look = control.change(self.session.look, self._place)

    def on_press(self, x: int, _y: int, _button: int) -> None:
        """A button of the mouse went down."""
        look = self.session.look
        divider = look.split * self.window.width
        self._holds_divider = look.layout == "split" and abs(x - divider) <= _GRIP

    def on_release(self, _x: int, _y: int, _button: int) -> None:
        """A button of the mouse went up."""
        self._holds_divider, self._is_led = False, False

    def on_drag(self, x: int, _y: int, dx: int, dy: int) -> None:
        """The mouse moved with a button down; rows count downwards."""
        look, window = self.session.look, self.window
        if self._holds_divider:
            self.session.look = replace(look, split=min(max(x / window.width, 0.0), 1.0))
            return
        self._is_led = True
        if window.mouse_states.right or window.mouse_states.middle or window.modifiers.shift:
            self.session.look = pan(look, self._place, -dx / window.height, dy / window.height)
        else:
            self.session.look = turn(look, self._place, -np.pi * dx / window.width, np.pi * dy / window.height)

    def on_scroll(self, _dx: float, dy: float) -> None:
        """The wheel turned."""
        self.session.look = zoom(self.session.look, self._place, _ZOOM**dy)

    def _compare(self) -> bool:
        """Have what is shown settle and be compared while nothing changes; whether there is anything new of it."""
        session, before = self.session, self.session.is_computing
        has_come = session.take(self._comparer)
        if not self._is_led and time.monotonic() - self._changed > REST:
            if session.go_on():
                return True
            session.is_computing = session.ask(self._comparer)
        return has_come or session.is_computing != before

    def _follow(self) -> None:
        """Take a bundle that has come meanwhile."""
        newer = self._source.newest()
        if newer is None:
            return
        try:
            self.session.load(newer, fetched_name(self._source.name, newer))
        except Problem as problem:
            self.session.message = f"{problem.title} {problem.remedy}"

    def _fit(self) -> None:
        """Pictures are as large as there is room for, but for those that are too slow to lead the camera by."""
        look = self.session.look
        if not self._is_led:
            self._scale = 1
        elif self._seconds > _SLOW:
            self._scale = _COARSE
        width, height = (side // self._scale for side in self.window.buffer_size)
        size = max(width // across(look.layout), _LEAST_SIDE), max(height, _LEAST_SIDE)
        if size != look.size:
            self.session.look = replace(look, size=size)

    def _upload(self) -> None:
        begun = time.perf_counter()
        # Text upon coarse pixels cannot be read.
        image = self.session.screen() if self._scale == 1 else self.session.image()
        if self._scale == 1:
            self._seconds = time.perf_counter() - begun
        size = image.shape[1], image.shape[0]
        if self._texture is None or self._texture.size != size:
            self._texture = self.window.ctx.texture(size, 3, alignment=1)
        self._texture.write(np.ascontiguousarray(image), alignment=1)

    def _show(self) -> None:
        window = self.window
        window.use()
        window.ctx.enable_only(moderngl.NOTHING)
        window.fbo.viewport = (0, 0, *window.buffer_size)
        window.fbo.scissor = None
        assert self._texture is not None
        self._texture.use(0)
        self._program["image"] = 0
        self._program["height"] = window.buffer_size[1]
        self._program["scale"] = self._scale
        self._screen.render(moderngl.TRIANGLES, vertices=3)
        window.swap_buffers()

    def _write(self, save: Callable[[], list[Path]]) -> None:
        try:
            paths = save()
        except Problem as problem:
            self.session.message = f"{problem.title} {problem.remedy}"
            return
        self.session.message = f"Wrote {', '.join(path.name for path in paths)}."
        for path in paths:
            self._files.told(str(path))

    def _save_pictures(self) -> list[Path]:
        return self.session.save(self._files.out)

    def _save_statistics(self) -> list[Path]:
        path = self._files.csv or self._files.out / FILE
        number = len({row["frame"] for row in self.rows})
        rows = self.session.rows(number)
        statistics.append(path, rows)
        self.rows += rows
        return [path]
