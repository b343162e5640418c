"""One view of a scene on the GPU, and the passes that every technique shares: opaque, count, gather."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.gpu_scene import OPAQUE, TRANSPARENT, GpuScene, run_for, set_uniforms
from renderer.programs import Defines
from renderer.tiles import Tiles, tiles_of
from schemas.colour import encode_gamma2
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import BIN_LIMIT, OPTICAL_UNIT, PLAIN_SHARE, ROOT_SHARE, SHARE_LEVELS
from schemas.view import View

RGB = tuple[float, float, float]

Gather = Literal["gather-tail", "gather-nearest", "gather"]
"""What a gather pass leaves: the tail's sums; also the nearest fragment; what a predictor reads. Names of passes."""

NEAREST = 5
"""The texel of `renderer.features.SUMS` that is the nearest fragment; those before it are sums by blending."""
BIN_DEFINES: Defines = {
    **{"ROOT_SHARE": ROOT_SHARE, "PLAIN_SHARE": PLAIN_SHARE, "SHARE_LEVELS": SHARE_LEVELS},
    **{"OPTICAL_UNIT": OPTICAL_UNIT, "BIN_LIMIT": BIN_LIMIT},
}
"""What `shaders/common/depth_bins.glsl` and its users need beside BINS."""
ALL_TEXELS = frozenset(range(NEAREST + 1))
_TEXELS: dict[Gather, frozenset[int]] = {
    "gather-tail": frozenset({0}),
    "gather-nearest": frozenset({0, NEAREST}),
    "gather": ALL_TEXELS,
}

# Shader storage bindings that several passes share.
COUNT, Z_MIN, Z_MAX, NEAREST_COLOUR, NEAREST_FACING = range(5)


@dataclass(slots=True)
class Gathered:
    """Order-independent sums of a frame, on the GPU.

    Attributes:
        name: Of the pass.
        sums: RGBA32F textures, with bins RGBA16F, five: `gather/gather.frag` says what each holds. Where one was not
            asked for, another stands in its place.
        nearest_colour: uint32 [P], packed colour of the nearest fragment, all ones where none; None if not gathered.
        nearest_facing: uint32 [P], its |n . e| * 255; None if not gathered.
        bins: Depth bins of `front`; 0: none.
        front: uint32 [P, 1 + bins / 8], the optical depth and its shares in front of the bins, as
            `shaders/common/depth_bins.glsl` says; None without bins.
    """

    name: Gather
    sums: list[moderngl.Texture]
    nearest_colour: moderngl.Buffer | None = None
    nearest_facing: moderngl.Buffer | None = None
    bins: int = 0
    front: moderngl.Buffer | None = None

    @property
    def pixel_bytes(self) -> int:
        """Bytes a pixel of all this."""
        sums = sum({texture.glo: _SUM_BYTES.get(texture.dtype, 0) for texture in self.sums}.values())
        nearest = sum(4 for buffer in (self.nearest_colour, self.nearest_facing) if buffer is not None)
        return sums + nearest + front_bytes(self.bins)

    @property
    def pass_bytes(self) -> int:
        """Bytes a pixel while it is gathered.

        Bins are gathered first, two bytes each and D with four; when all else is, they are packed.
        """
        return max(self.pixel_bytes, front_bytes(self.bins) + 2 * self.bins + 4 if self.bins else 0)


_SUM_BYTES = {"f4": 16, "f2": 8}


def front_bytes(bins: int) -> int:
    """Bytes a pixel of packed depth bins."""
    return 4 + bins // 2 if bins else 0


@dataclass(slots=True)
class Clock:
    """Milliseconds of each pass on the finished host clock; `renderer.timing` has more where somebody listens."""

    ctx: moderngl.Context
    passes: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time a block, the GPU's work included."""
        self.ctx.finish()
        start = time.perf_counter()
        with timing.gpu_pass(name):
            yield
        self.ctx.finish()
        taken = 1e3 * (time.perf_counter() - start)
        self.passes[name] = self.passes.get(name, 0.0) + taken
        timing.host_pass(name, taken)


class Frame:
    """A view being rendered. Makes the opaque background at once; count and gather on demand, once.

    Args:
        gpu: The uploaded scene.
        view: The camera.
        width: Pixels per row.
        height: Rows; row 0 is at the top.
        clear: Linear RGB where no opaque surface is.

    Attributes:
        culled_triangles: Triangles outside the frustum, which no pass draws.
        tiles: By their fullest pixel, once `depth_range` has counted; None before.
    """

    def __init__(self, gpu: GpuScene, view: View, width: int, height: int, clear: RGB = (1.0, 1.0, 1.0)) -> None:
        if width < 1 or height < 1 or width * height > LIMITS.pixels:
            raise Problem(
                f"A picture of {width}x{height} pixels is outside the limits.",
                f"Ask for 1x1 up to {LIMITS.pixels:,} pixels.",
                ExitCode.LIMIT,
            )
        self.gpu, self.ctx, self.view = gpu, gpu.ctx, view
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
        self._gathered: dict[tuple[Gather, frozenset[int], int], Gathered] = {}
        self._count_array: NDArray[np.uint32] | None = None
        self._spare: list[moderngl.Texture] = []
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
        return self._zeroed(
            [
                self._spare.pop()
                if count == 4 and self._spare
                else self.ctx.texture((self.width, self.height), count, dtype="f4")
                for count in components
            ]
        )

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

    def gather(self, what: Gather, texels: frozenset[int] | None = None, bins: int = 0) -> Gathered:
        """The order-independent sums of every pixel, by one additive pass.

        Args:
            what: Which pass.
            texels: Of a `gather`: which texels of `renderer.features.SUMS` are read; None: all. The first is always
                there without bins.
            bins: Depth bins that a tail needs (`schemas.tail.DENSITY_BINS`). With them the first texel is there only
                if it is asked for: the count pass has n, and the bins have the optical depth.
        """
        wanted = _TEXELS[what] if texels is None else texels & _TEXELS[what]
        if not bins:
            wanted |= {0}
        elif texels is None and what != "gather":
            wanted -= {0}
        if (what, wanted, bins) not in self._gathered:
            _, z_min, z_max = self.depth_range()
            self.clock.passes.pop(what, None)
            with self.clock.measure(what):
                self._gathered[what, wanted, bins] = self._gather(what, wanted, bins, z_min, z_max)
        return self._gathered[what, wanted, bins]

    def retire(self, gathered: Gathered) -> Gathered:
        """Give back what only a predictor reads of a gather pass: two of its textures become the next targets.

        Returns:
            What a tail reads: the packed bins, or the first texture. The pass runs again if somebody asks for all of
            it again.
        """
        self._gathered = {key: kept for key, kept in self._gathered.items() if kept is not gathered}
        first = gathered.sums[0] if gathered.front is None else self.background
        others = {t.glo: t for t in gathered.sums if t.glo != first.glo and t.dtype == "f4"}
        self._spare = [*self._spare, *others.values()][:2]
        return Gathered(gathered.name, [first] * len(gathered.sums), bins=gathered.bins, front=gathered.front)

    def _gather(
        self, what: Gather, texels: frozenset[int], bins: int, z_min: moderngl.Buffer, z_max: moderngl.Buffer
    ) -> Gathered:
        gathered = Gathered(what, [], bins=bins)
        z_min.bind_to_storage_buffer(Z_MIN)
        z_max.bind_to_storage_buffer(Z_MAX)
        blended = sorted(texels - {NEAREST})
        nearest: Defines = {"NEAREST": 2 if what == "gather-nearest" else int(NEAREST in texels)}
        if bins:
            # Before all else, which need not be there yet: together they would be the peak of the frame.
            gathered.front = self._gather_bins(bins)
        # With bins no tail reads these sums, only a network, and half floats serve it as well (PREDICTORS.md).
        targets = self._zero_targets(len(blended), "f2") if bins else self.float_targets(*[4] * len(blended))
        if texels:
            if NEAREST in texels:
                gathered.nearest_colour = self.buffer(self.pixels, 0xFFFFFFFF)
                gathered.nearest_colour.bind_to_storage_buffer(NEAREST_COLOUR)
            if what == "gather-nearest":
                gathered.nearest_facing = self.buffer(self.pixels, 0)
                gathered.nearest_facing.bind_to_storage_buffer(NEAREST_FACING)
            places: Defines = {f"SUMS{texel}": place for place, texel in enumerate(blended)}
            self.draw_transparent("gather/gather.frag", self.target(targets), {**places, **nearest, "BINS": 0})
        made = dict(zip(blended, targets, strict=True))
        # Where nothing is blended, a shader gets a texture that it does not read.
        first = next(iter(made.values()), self.background)
        gathered.sums = [made.get(texel, first) for texel in range(NEAREST)]
        self.ctx.memory_barrier()
        self.target([]).use()  # a context keeps alive what is bound: the targets, long after the last use of them
        return gathered

    def _gather_bins(self, bins: int) -> moderngl.Buffer:
        """Depth bins by blending, packed; their targets are gone when this returns."""
        targets = self._bin_targets(bins)
        defines: Defines = {"NEAREST": 0, "BINS": bins, **BIN_DEFINES}
        self.draw_transparent("gather/gather.frag", self.target(targets), defines)
        self.target([]).use()
        return self._pack(bins, targets)

    def _zero_targets(self, count: int, dtype: str) -> list[moderngl.Texture]:
        """Textures of four components, zero."""
        return self._zeroed([self.ctx.texture((self.width, self.height), 4, dtype=dtype) for _ in range(count)])

    def _bin_targets(self, bins: int) -> list[moderngl.Texture]:
        """The optical depth, float32, and the depth bins, 16 bits each that blending adds and clamps exactly; zero."""
        return [*self.float_targets(1), *self._zero_targets(bins // 4, "nu2")]

    def _pack(self, bins: int, binned: list[moderngl.Texture]) -> moderngl.Buffer:
        """The gathered depth bins as words."""
        packed = self.buffer(self.pixels * front_bytes(bins) // 4, 0)
        program = self.gpu.programs.compute("gather/pack.comp", {"BINS": bins, **BIN_DEFINES})
        packed.bind_to_storage_buffer(0)
        for unit, texture in enumerate(binned):
            texture.use(unit)
        set_uniforms(program, {"width": self.width, "pixels": self.pixels})
        run_for(program, self.pixels)
        return packed
