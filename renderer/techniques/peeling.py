"""What `depth-peeling` and `dual-depth-peeling` share: the loop of geometry passes, and the state between them.

Both take fragments in the order of the keys (depth, packed colour) of the sorted dump. A pass gathers, at the depth
being taken, the next colour and how many fragments are left there, and the next depth. Where one fragment is left, as
nearly everywhere, the pixel goes on to the next depth after one pass; of several, one colour is taken a pass, and how
often it occurs is what the next pass finds missing. So a pixel needs at most one pass a fragment, ties included. Depths
are compared by the bits of the float32 view depth with atomic minima, since depth buffers of few bits make ties.

What is peeled from the front is blended into the picture itself. A count pass finds the first depths and max(n), which
is read back: so many passes are enough. From both sides half as many are, but where fragments tie: one word that is
read after them says whether some are left, and then half of what remains follows, and so on.
"""

from __future__ import annotations

import moderngl
import numpy as np

from renderer.frame import Clock, Frame
from renderer.prefix import totals
from renderer.screen import ANY, BACKGROUND, NO_FRAGMENTS, OCCUPIED, draw_tiles, read_linear
from renderer.techniques.bands import Part, check_most, counted_pixels, equal_parts, read_counts
from renderer.techniques.base import Rendered
from renderer.techniques.skips import frame_skips
from renderer.tiles import Tiles, tiles_of

_OVER, _NONE = 0xFFFFFFFF, 0
_FRESH = np.array([_OVER, _NONE, _OVER, _OVER], dtype=np.uint32)
"""`Side` of depth-peeling/side.glsl where nothing is yet."""
SIDE_BYTES = 16 + 4
"""A `Side` and its counts."""
BACK_BYTES = 12
"""What is composited from the back, float32 RGB."""

# Storage bindings of */begin.frag, */peel.frag, */step.frag and */resolve.frag.
_SIDES, _COUNTS, _BACK, _LEFT = range(4)


def render_peeled(frame: Frame, shaders: str, sides: int) -> Rendered:
    """Peel every pixel until nothing is left.

    Args:
        frame: The view.
        shaders: Folder of the shaders.
        sides: 1: from the front; 2: from both sides.

    Returns:
        The exact picture.

    Raises:
        Problem: A pixel has too many fragments.
    """
    clock = Clock(frame.ctx)
    image = frame.ctx.texture((frame.width, frame.height), 4, dtype="f4")
    for part in equal_parts(frame, sides, _FRESH.nbytes):
        peeling = _Peeling(frame, clock, shaders, sides, part, image)
        peeling.begin()
        peeling.peel()
        peeling.resolve()
    linear = read_linear(frame, image)
    counted = counted_pixels(frame)  # the picture is finished, and its counts are gone
    n = read_counts(frame, counted.counts)
    return Rendered(
        linear=linear,
        k=n,
        passes={**frame.passes("opaque"), **clock.passes},
        captured=int(n.sum(dtype=np.int64)),
        pool_bytes=0,
        pixel_bytes=sides * SIDE_BYTES + (sides - 1) * BACK_BYTES,
        skips=frame_skips(frame, counted.tiles),
    )


class _Peeling:
    """The passes over a band of rows."""

    def __init__(
        self, frame: Frame, clock: Clock, shaders: str, sides: int, part: Part, image: moderngl.Texture
    ) -> None:
        self._frame, self._clock, self._shaders, self._sides = frame, clock, shaders, sides
        self._part, self._image = part, image
        pixels = part.rows * frame.width
        sides_buffer = frame.ctx.buffer(reserve=_FRESH.nbytes * sides * pixels)
        sides_buffer.clear(chunk=_FRESH.tobytes())
        self._buffers = {_SIDES: sides_buffer, _COUNTS: frame.buffer(sides * pixels, 0)}
        if sides > 1:
            self._buffers |= {_BACK: frame.buffer(3 * pixels, None), _LEFT: frame.buffer(1, 0)}
        self._tiles: Tiles | None = None
        self._most = 0

    def begin(self) -> None:
        """Count, and find the first depths."""
        frame, counts = self._frame, self._buffers[_COUNTS]
        with self._clock.measure("count"):
            self._draw("depth-peeling/begin.frag")
            pixels = self._part.rows * frame.width
            _, self._most = totals(frame.ctx, frame.gpu.programs, counts, pixels).read()
            self._tiles = tiles_of(frame.ctx, frame.gpu.programs, counts, frame.width, self._part.rows)
            counts.clear()
        check_most(self._most)

    def peel(self) -> None:
        """Geometry passes with a step after each, until nothing is left."""
        self._use_picture()
        self._frame.ctx.clear(0.0, 0.0, 0.0, 1.0, viewport=self._viewport)
        done = 0
        while done < self._most:
            passes = -(-(self._most - done) // self._sides)
            for number in range(done, done + passes):
                with self._clock.measure("peel"):
                    self._draw(f"{self._shaders}/peel.frag")
                with self._clock.measure("step"):
                    if number == done + passes - 1 and _LEFT in self._buffers:
                        self._buffers[_LEFT].write(bytes(4))
                    self._step(number)
            done += passes
            if self._sides > 1 and done < self._most and not self._is_left():
                return

    def resolve(self) -> None:
        """The background behind what was peeled from the front, or what was peeled from the back over it."""
        with self._clock.measure("resolve"):
            self._use_picture()
            self._frame.background.use(0)
            if self._sides == 1:
                self._over_tiles(BACKGROUND, (0, ANY))
            else:
                self._over_tiles(BACKGROUND, NO_FRAGMENTS)
                self._over_tiles(f"{self._shaders}/resolve.frag", OCCUPIED)

    @property
    def _viewport(self) -> tuple[int, int, int, int]:
        return 0, self._part.first, self._frame.width, self._part.rows

    def _draw(self, fragment: str) -> None:
        """Draw the transparent layers of the band into the buffers."""
        self._bind()
        first, rows = self._part.first, self._part.rows
        target, defines = self._frame.target([]), {"SIDES": self._sides}
        self._frame.draw_transparent(fragment, target, defines, scissor=(first, rows), first_row=first)
        self._frame.ctx.memory_barrier()

    def _step(self, number: int) -> None:
        """Composite what a pass found. Tiles whose pixels all have fewer fragments than there were passes are done."""
        self._use_picture()
        self._frame.background.use(0)
        self._over_tiles(f"{self._shaders}/step.frag", (number + 1, ANY), is_first=number == 0)
        self._frame.ctx.memory_barrier()

    def _use_picture(self) -> None:
        """What is drawn is blended behind what the picture has: (premultiplied RGB, transmittance)."""
        ctx = self._frame.ctx
        target = ctx.framebuffer([self._image])
        target.use()
        target.viewport = self._viewport
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_func = moderngl.DST_ALPHA, moderngl.ONE, moderngl.ZERO, moderngl.SRC_ALPHA  # type: ignore[assignment]

    def _over_tiles(self, fragment: str, most: tuple[int, int], **uniforms: object) -> None:
        assert self._tiles is not None, "begin is before"
        self._bind()
        defines = {"SIDES": self._sides}
        draw_tiles(self._frame, self._tiles, fragment, defines, most, first_row=self._part.first, **uniforms)

    def _is_left(self) -> bool:
        """Whether the last step left fragments: one word is read back."""
        return bool(np.frombuffer(self._buffers[_LEFT].read(), dtype=np.uint32)[0])

    def _bind(self) -> None:
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
