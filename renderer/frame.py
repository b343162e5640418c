"""One view of a scene on the GPU, and the passes that techniques share: opaque, count, range, and additive ones."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.account.ledger import counted_pass
from renderer.bin_pass import Binned, gather_bins
from renderer.gpu_scene import OPAQUE, TRANSPARENT, GpuScene, set_uniforms
from renderer.programs import Defines
from renderer.tile_range import STEPS, tile_grid
from renderer.tiles import Tiles, tiles_of
from schemas.colour import encode_gamma2
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import RANGE_TILE, TailName
from schemas.view import View

RGB = tuple[float, float, float]

# Shader storage bindings that several passes share.
COUNT, Z_MIN, Z_MAX, NEAREST_FACING = range(4)


@dataclass(slots=True)
class Clock:
    """Milliseconds of each pass on the finished host clock; `renderer.timing` has more where somebody listens."""

    ctx: moderngl.Context
    passes: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time a block, the GPU's work included."""
        self.ctx.finish()
        start, listened = time.perf_counter(), timing.now()
        with timing.gpu_pass(name), counted_pass(name):
            yield
        self.ctx.finish()
        listened = timing.now() - listened
        taken = 1e3 * (time.perf_counter() - start)
        self.passes[name] = self.passes.get(name, 0.0) + taken
        timing.pass_over(name, 1e3 * listened)


class Frame:
    """A view being rendered. Makes the opaque background at once; count and gather on demand, once.

    Args:
        gpu: The uploaded scene.
        view: The camera.
        width: Pixels per row.
        height: Rows; row 0 is at the top.
        clear: Linear RGB where no opaque surface is.
        float_sums: Sum what a binned tail blends in float32 instead of half floats and 16-bit whole numbers: to tell
            what its arithmetic is wrong by from what the sums lose.

    Attributes:
        culled_triangles: Triangles outside the frustum, which no pass draws.
        tiles: By their fullest pixel, once `depth_range` has counted; None before.
    """

    def __init__(
        self,
        gpu: GpuScene,
        view: View,
        width: int,
        height: int,
        clear: RGB = (1.0, 1.0, 1.0),
        *,
        float_sums: bool = False,
    ) -> None:
        if width < 1 or height < 1 or width * height > LIMITS.pixels:
            raise Problem(
                f"A picture of {width}x{height} pixels is outside the limits.",
                f"Ask for 1x1 up to {LIMITS.pixels:,} pixels.",
                ExitCode.LIMIT,
            )
        self.gpu, self.ctx, self.view, self.float_sums = gpu, gpu.ctx, view, float_sums
        self.width, self.height, self.pixels = width, height, width * height
        self.clock = Clock(self.ctx)
        self.uniforms, projection, to_view = self._camera()
        self._visible, self.culled_triangles = gpu.clusters.visible(projection, to_view)
        self.background = self.ctx.texture((width, height), 4)
        self.background.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.depth = self.ctx.depth_renderbuffer((width, height))
        self.tiles: Tiles | None = None
        self._counts: moderngl.Buffer | None = None
        self._range: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        self._tile_range: moderngl.Buffer | None = None
        self._kept: dict[TailName, Binned] = {}
        self._density: moderngl.Texture | None = None
        self._count_array: NDArray[np.uint32] | None = None
        with self.clock.measure("opaque"):
            self._draw_opaque(clear)

    def _camera(self) -> tuple[dict[str, object], NDArray[np.float64], NDArray[np.float64]]:
        """What every geometry pass gets, view to clip space, and world to view space."""
        to_view = self.view.world_to_view()
        near, far = self.view.clip_range(self.gpu.scene.bounds)
        projection = self.view.projection(self.width / self.height, near, far)
        projection[1] *= -1.0  # row 0 at the top
        up = to_view[:3, :3] @ np.array(self.gpu.scene.up)
        uniforms: dict[str, object] = {
            "world_to_view": tuple(to_view.T.astype(np.float32).ravel().tolist()),
            "projection": tuple(projection.T.astype(np.float32).ravel().tolist()),
            "eye_ray": self._eye_ray(projection),
            "up_view": tuple(up.tolist()),
            "width": self.width,
        }
        return uniforms, projection, to_view

    def _eye_ray(self, projection: NDArray[np.float64]) -> tuple[float, float, float, float]:
        """Scale and offset from window coordinates to x/-z and y/-z in view space; all 0 for parallel rays.

        With it a shader knows where the eye is without an interpolated position.
        """
        if self.view.ortho_height is not None:
            return 0.0, 0.0, 0.0, 0.0
        scale = 2.0 / (np.array([self.width, self.height]) * np.diag(projection)[:2])
        offset = (projection[:2, 2] - 1.0) / np.diag(projection)[:2]
        return float(scale[0]), float(scale[1]), float(offset[0]), float(offset[1])

    def target(self, colours: list[moderngl.Texture]) -> moderngl.Framebuffer:
        """A framebuffer with these attachments and the opaque depth."""
        return self.ctx.framebuffer(color_attachments=colours, depth_attachment=self.depth)

    def _draw_opaque(self, clear: RGB) -> None:
        target = self.target([self.background])
        target.use()
        stored = encode_gamma2(np.array(clear)) / 255.0
        red, green, blue = stored.tolist()
        target.clear(red, green, blue, 1.0, depth=1.0)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        target.depth_mask = True
        self.gpu.draw("opaque/opaque.frag", OPAQUE, self.uniforms, visible=self._visible)

    def draw_transparent(
        self,
        fragment: str,
        target: moderngl.Framebuffer,
        defines: Defines | None = None,
        scissor: tuple[int, int] | None = None,
        ranked: bool = False,
        **uniforms: object,
    ) -> None:
        """Draw the transparent layers against the opaque depth, blending additively where there are attachments.

        Args:
            fragment: Shader file.
            target: From `target`.
            defines: Shader defines.
            scissor: First row and number of rows, or all.
            ranked: As `GpuScene.draw` has it: the shader reads the order of submission.
            uniforms: Added to the camera's.
        """
        target.use()
        first, rows = scissor or (0, self.height)
        target.scissor = (0, first, self.width, rows)
        target.depth_mask = False
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self.ctx.blend_func = moderngl.ONE, moderngl.ONE
        self.gpu.draw(fragment, TRANSPARENT, {**self.uniforms, **uniforms}, defines, ranked, self._visible)
        self.ctx.enable_only(moderngl.NOTHING)

    def float_targets(self, *components: int) -> list[moderngl.Texture]:
        """Float32 textures of the frame's size, zero, one for each number of components."""
        return self._zeroed([self.ctx.texture((self.width, self.height), count, dtype="f4") for count in components])

    def tail_sums(self) -> list[moderngl.Texture]:
        """Targets for the sums of a binned tail, zero: weighted colour and weight, optical depth."""
        size, kinds = (self.width, self.height), ("f4", "f4") if self.float_sums else ("f2", "nu2")
        return self._zeroed([self.ctx.texture(size, 4, dtype=kinds[0]), self.ctx.texture(size, 1, dtype=kinds[1])])

    def _zeroed(self, made: list[moderngl.Texture]) -> list[moderngl.Texture]:
        """The same textures, of the frame's size, as targets."""
        for texture in made:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self.zero(texture)
        return made

    def zero(self, texture: moderngl.Texture) -> None:
        """Clear a texture of the frame's size to zero, all of it: what is bound last may have left a scissor."""
        target = self.ctx.framebuffer([texture])
        target.use()
        target.clear(0.0, 0.0, 0.0, 0.0)

    def buffer(self, words: int, fill: int | None) -> moderngl.Buffer:
        """A storage buffer of uint32, every word set to `fill`; None: to anything.

        Raises:
            Problem: It would be larger than a storage buffer may be.
        """
        size = 4 * max(words, 1)
        if size > LIMITS.buffer_bytes:
            raise Problem(
                f"A buffer of {size / 2**20:.0f} MiB is above the limit of {LIMITS.buffer_bytes / 2**20:.0f} MiB.",
                "Ask for a smaller picture or budget.",
                ExitCode.LIMIT,
            )
        made = self.ctx.buffer(reserve=size)
        if fill is not None:
            made.clear(chunk=np.uint32(fill).tobytes())
        return made

    def passes(self, *names: str) -> dict[str, float]:
        """Milliseconds of the shared passes of these names, each as it was when it ran."""
        return {name: self.clock.passes[name] for name in names}

    def count(self) -> NDArray[np.uint32]:
        """uint32 [P], n(p): the count pass, its result read back."""
        if self._count_array is None:
            buffer = self.depth_range()[0]
            with self.clock.measure("count"), timing.readback(self.ctx):
                self._count_array = np.frombuffer(buffer.read(4 * self.pixels), dtype=np.uint32)
        return self._count_array

    @property
    def counted(self) -> bool:
        """Whether n(p) has been read back."""
        return self._count_array is not None

    def depth_range(self) -> tuple[moderngl.Buffer, moderngl.Buffer, moderngl.Buffer]:
        """Buffers of n, z_min and z_max (float bits), uint32 [P] each, on the GPU."""
        if self._counts is None or self._range is None:
            with self.clock.measure("count"):
                self._counts = self.buffer(self.pixels, 0)
                self._range = self.buffer(self.pixels, 0xFFFFFFFF), self.buffer(self.pixels, 0)
                for binding, buffer in ((COUNT, self._counts), (Z_MIN, self._range[0]), (Z_MAX, self._range[1])):
                    buffer.bind_to_storage_buffer(binding)
                self.draw_transparent("count/count.frag", self.target([]), {"RANGE": 1})
                self.ctx.memory_barrier()
                self.tiles = tiles_of(self.ctx, self.gpu.programs, self._counts, self.width, self.height)
        return self._counts, *self._range

    def tile_range(self) -> moderngl.Buffer:
        """Between which depths each tile's depth bins lie: uint32 [T, 2], float bits (`renderer.tile_range`)."""
        if self._tile_range is None:
            with self.clock.measure("range"):
                self._tile_range = self._estimated_range()
        return self._tile_range

    def _estimated_range(self) -> moderngl.Buffer:
        columns, rows = tile_grid(self.width, self.height)
        tiles = columns * rows
        found, ranges = self.ctx.buffer(np.tile(np.array([2**32 - 1, 0], np.uint32), tiles)), self.buffer(2 * tiles, 0)
        found.bind_to_storage_buffer(0)
        # Whole tiles: the picture's last ones may reach beyond it.
        target = self.ctx.framebuffer([self.ctx.texture((columns * STEPS, rows * STEPS), 1, dtype="f1")])
        target.color_mask = (False,) * 4
        target.use()
        self.ctx.enable_only(moderngl.NOTHING)
        scale = self.width / (columns * RANGE_TILE), self.height / (rows * RANGE_TILE)
        uniforms = {**self.uniforms, "projection": _widened(self.uniforms["projection"], scale), "width": columns}
        self.gpu.draw("range/range.frag", TRANSPARENT, uniforms, {"STEPS": STEPS}, visible=self._visible)
        self.ctx.memory_barrier()
        program = self.gpu.programs.compute("range/fill.comp")
        found.bind_to_storage_buffer(0)
        ranges.bind_to_storage_buffer(1)
        set_uniforms(program, {"columns": columns, "rows": rows})
        program.run(1)
        self.ctx.memory_barrier()
        self.target([]).use()
        return ranges

    def gather_bins(self, tail: TailName, *, luma: bool = False) -> Binned:
        """The depth bins of a tail, with sums of luma on demand; packed, and the caller's to change."""
        self.tile_range()
        self.clock.passes.pop("bins", None)
        with self.clock.measure("bins"):
            return gather_bins(self, tail, luma=luma)

    def kept_bins(self, tail: TailName) -> Binned:
        """The same for who only reads them, gathered once."""
        if tail not in self._kept:
            self._kept[tail] = self.gather_bins(tail)
        return self._kept[tail]

    def gather_density(self) -> moderngl.Texture:
        """RGBA32F, what the `density` tail reads of every pixel: n, sum a, sum a^2, sum -ln(1-a)."""
        if self._density is None:
            with self.clock.measure("gather"):
                (self._density,) = self.float_targets(4)
                self.draw_transparent("gather/density.frag", self.target([self._density]))
        return self._density

    def gather_facing(self) -> moderngl.Buffer:
        """uint32 [P], |n . e| * 255 of the nearest fragment of every pixel, of all of equal depth the greatest."""
        _, z_min, _ = self.depth_range()
        with self.clock.measure("facing"):
            facing = self.buffer(self.pixels, 0)
            z_min.bind_to_storage_buffer(Z_MIN)
            facing.bind_to_storage_buffer(NEAREST_FACING)
            self.draw_transparent("gather/facing.frag", self.target([]))
            self.ctx.memory_barrier()
        return facing


def _widened(projection: object, scale: tuple[float, float]) -> tuple[float, ...]:
    """A projection, as uniform, to a target that reaches beyond the picture at its right and lower edge.

    Args:
        projection: Column by column.
        scale: Width and height of the picture as shares of the target's.
    """
    matrix = np.array(projection, dtype=np.float64).reshape(4, 4).T
    for axis in range(2):
        matrix[axis] = scale[axis] * matrix[axis] + (scale[axis] - 1.0) * matrix[3]
    return tuple(matrix.T.ravel().tolist())
