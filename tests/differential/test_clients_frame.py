"""The frame as docs/CLIENTS.md has it, pass by pass with its bindings and defines, is the picture of the techniques."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import random_weights

from renderer.bin_pass import TARGETS
from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import TRANSPARENT
from renderer.programs import Defines, expand
from renderer.techniques import Binned, Budget, KBufferDeep
from schemas.bundle import GLSL, HeadName, OutputName, ParityReport, Provenance, TailSpec
from schemas.fragments import FragmentDump
from schemas.tail import TailName
from trainer.bundle import Description, write_bundle

KINDS: Defines = {
    "TAIL_EXACT_COVERAGE": 0,
    "TAIL_DENSITY": 1,
    "TAIL_WEIGHTED_AVERAGE": 2,
    "TAIL_PAPER": 3,
    "TAIL_BINNED": 4,
}
CONSTANTS: Defines = {
    **{"TAIL": 4, **KINDS, "MAX_EXPONENT": 60.0, "ROOT_SHARE": 0.6, "PLAIN_SHARE": 0.4, "OPTICAL_UNIT": 951},
    **{"BIN_LIMIT": 65535, "RANGE_TILE": 8, "LEAST_OTHERS": 0.001, "LEAST_SPREAD": 0.001},
    **{"LUMA_R": 0.2126, "LUMA_G": 0.7152, "LUMA_B": 0.0722},
}
ROWS: dict[TailName, Defines] = {
    "binned-8": {"BINS": 8, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "binned-12": {"BINS": 12, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "binned-16": {"BINS": 16, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "density-16": {"BINS": 16, "SHARE_LEVELS": 15, "MEAN_LEVELS": 0},
}
ALLOCATION: Defines = {"BLOCK": 2048, "HALF_BITS": 11, "DROPPED_BITS": 10, "FULL": 255, "MOST_CORE": 1023}
LIMITS: Defines = {
    "MOST_GAIN": 1.152921504606847e18,
    "LEAST_FALL": 0.000244140625,
    "MOST_FALL": 1.152921504606847e18,
}
ONES = 0xFFFFFFFF
FOUND, RANGES = 0, 7


class Client:
    """A renderer of somebody who has read the document; geometry and the opaque pass are the frame's.

    Args:
        frame: The view.
        tail: What is rendered.
    """

    def __init__(self, frame: Frame, tail: TailName) -> None:
        self.frame, self.ctx = frame, frame.ctx
        self.width, self.height, self.pixels = frame.width, frame.height, frame.pixels
        self.texts: dict[str, str] = {}
        self.row = ROWS[tail]
        self.tail: Defines = {**CONSTANTS, **self.row}
        self.bins = int(self.row["BINS"])
        self.size = {"width": self.width, "pixels": self.pixels}
        self.sixty_fours, self.blocks = -(-self.pixels // 64), -(-self.pixels // 2048)

    def words(self, count: int, fill: int) -> moderngl.Buffer:
        return self.ctx.buffer(np.full(max(count, 1), fill, np.uint32))

    def texture(self, components: int, dtype: str) -> moderngl.Texture:
        made = self.ctx.texture((self.width, self.height), components, dtype=dtype)
        made.filter = moderngl.NEAREST, moderngl.NEAREST
        self.ctx.framebuffer([made]).clear()
        return made

    def draw(
        self, fragment: str, targets: list[moderngl.Texture], buffers: dict[int, moderngl.Buffer], defines: Defines
    ) -> None:
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self.frame.draw_transparent(fragment, self.frame.target(targets), defines)
        self.ctx.memory_barrier()

    def run(
        self, name: str, defines: Defines, buffers: dict[int, moderngl.Buffer], groups: int, **uniforms: int
    ) -> None:
        program = self.ctx.compute_shader(expand(name, defines, self.texts))
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for uniform, value in uniforms.items():
            if uniform in program:
                program[uniform] = value
        program.run(min(groups, 1024), -(-groups // 1024))
        self.ctx.memory_barrier()

    def gather(self, *, colours: bool, counts: bool) -> None:
        """Passes 2 and 3."""
        columns, rows = -(-self.width // 8), -(-self.height // 8)
        found = self.ctx.buffer(np.tile(np.array([ONES, 0], np.uint32), columns * rows))
        self.ranges = self.words(2 * columns * rows, 0)
        found.bind_to_storage_buffer(FOUND)
        window = self.ctx.framebuffer([self.ctx.texture((2 * columns, 2 * rows), 1, dtype="f1")])
        window.use()
        self.ctx.enable_only(moderngl.NOTHING)
        scaled = np.array(self.frame.uniforms["projection"], dtype=np.float64).reshape(4, 4)
        for axis, share in enumerate((self.width / (8 * columns), self.height / (8 * rows))):
            scaled[:, axis] = share * scaled[:, axis] + (share - 1.0) * scaled[:, 3]
        uniforms = {**self.frame.uniforms, "projection": tuple(scaled.ravel().tolist()), "width": columns}
        self.frame.gpu.draw("range/range.frag", TRANSPARENT, uniforms, {"STEPS": 2})
        self.ctx.memory_barrier()
        self.run("range/fill.comp", {}, {0: found, 1: self.ranges}, 1, columns=columns, rows=rows)

        self.kept = [self.texture(4, "nu2") for _ in range(self.bins // 4)]
        means = [self.texture(4, "nu2") for _ in range(self.bins // 4)] if self.row["MEAN_LEVELS"] else []
        self.sums = [self.texture(4, "f2") for _ in range(2)] if colours else []
        self.counts = self.words(self.pixels * self.bins // 4, 0)
        together = len(self.kept) + len(means) + len(self.sums) <= TARGETS
        passes = [(0, [*self.kept, *means, *self.sums])] if together else [(0, [*self.kept, *means]), (1, self.sums)]
        for alone, targets in passes:
            own = {"ALONE": alone, "COLOURS": int(colours and (together or alone)), "COUNTS": int(counts and not alone)}
            self.draw("gather/bins.frag", targets, {RANGES: self.ranges, 6: self.counts}, {**self.tail, **own})
        self.frame.target([]).use()
        for unit, texture in enumerate(self.kept):
            texture.bind_to_image(unit, read=True, write=True)
        for unit, texture in enumerate(means):
            texture.use(unit)
        self.run("gather/pack.comp", self.tail, {}, self.sixty_fours, **self.size)

    def blend(self, fragment: str, buffers: dict[int, moderngl.Buffer]) -> list[moderngl.Texture]:
        """Pass 4 or 7; the tail's sums."""
        targets = [self.texture(4, "f4"), self.texture(1, "f4")]
        for unit, texture in enumerate(self.kept, 3):
            texture.use(unit)
        self.draw(fragment, targets, {RANGES: self.ranges, **buffers}, self.tail)
        return targets

    def resolve(
        self, fragment: str, textures: list[moderngl.Texture], defines: Defines, buffers: dict[int, moderngl.Buffer]
    ) -> np.ndarray:
        """Pass 9."""
        program = self.ctx.program(
            vertex_shader=expand("common/fullscreen.vert", {}), fragment_shader=expand(fragment, defines)
        )
        for name, value in (("width", self.width), ("first_row", 0)):
            if name in program:
                program[name] = value
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for unit, texture in enumerate([self.frame.background, *textures]):
            texture.use(unit)
        image = self.texture(4, "f4")
        self.ctx.framebuffer([image]).use()
        self.ctx.enable_only(moderngl.NOTHING)
        self.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        return np.frombuffer(image.read(), np.float32).reshape(self.height, self.width, 4)[:, :, :3]

    def binned(self) -> np.ndarray:
        """The picture of `binned`."""
        self.gather(colours=False, counts=False)
        return self.resolve("common/weighted_mean.frag", self.blend("binned/tail.frag", {}), {}, {})

    def deep(self, budget: int, predict: str, outputs: int, *, colours: bool) -> tuple[np.ndarray, np.ndarray]:
        """The picture of `kbuffer-deep`, and k of every pixel."""
        self.texts = {"bundle/predict.glsl": predict}
        self.gather(colours=colours, counts=True)
        # 5
        state, curves = self.words(8220 // 4, 0), self.words(2 * self.pixels, 7)
        state.write(np.uint32(budget).tobytes())
        blocks, offsets = self.words(2 * self.blocks, 7), self.words(self.pixels, 7)
        shared = {0: state, 1: self.counts, 2: curves, 3: blocks, 4: offsets}
        defines: Defines = {**ALLOCATION, "BINS": self.bins}
        numbers = {"pixels": self.pixels, "blocks": self.blocks}

        def allocate(name: str, groups: int, **own: int) -> None:
            self.run(f"allocation/{name}.comp", {**defines, **own}, shared, groups, **numbers)

        allocate("totals", self.blocks)
        allocate("choose", 1, STEP=0)
        for unit, texture in enumerate([self.frame.background, *self.sums]):
            texture.use(unit)
        for unit, texture in enumerate(self.kept, 3):
            texture.use(unit)
        network: Defines = {"TEXELS": 12, "COLOURS": int(colours), "OUTPUTS": outputs, **self.tail, **defines, **LIMITS}
        inputs = {0: state, 1: self.counts, 2: curves, RANGES: self.ranges}
        self.run("kbuffer-deep/curves.comp", network, inputs, self.sixty_fours, **self.size)
        # 6
        for low in (0, 1):
            allocate("count", self.blocks, LOW=low)
            allocate("choose", 1, STEP=1 + low)
        allocate("blocks", self.blocks)
        allocate("scan", 1)
        allocate("place", self.blocks)
        # 7, 8, 9
        pool = self.words(2 * budget, 7)
        targets = self.blend("kbuffer-deep/capture.frag", {1: self.counts, 2: pool})
        buffers = {0: offsets, 1: self.counts, 2: pool}
        self.run("kbuffer-deep/sort.comp", {"BINS": self.bins}, buffers, self.sixty_fours, pixels=self.pixels)
        final: Defines = {**self.tail, "STRIDE": 2, "CURSOR": self.bins // 4}
        linear = self.resolve("kbuffer/resolve.frag", targets, final, buffers)
        ends = np.frombuffer(self.counts.read(), np.uint32).reshape(self.pixels, -1)[:, 1]
        return linear, (ends - np.frombuffer(offsets.read(), np.uint32)).astype(np.int32)


@pytest.mark.parametrize("tail", ROWS)
def test_the_documents_binned_is_the_technique(ctx: moderngl.Context, frame: Frame, tail: TailName) -> None:
    expected = Binned(tail).render(frame, Budget(0))
    np.testing.assert_allclose(Client(frame, tail).binned(), expected.linear, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("tail", "head", "outputs"),
    [
        ("binned-12", "gain-curve", ("a", "b")),
        ("binned-16", "gain-curve", ("a", "b", "g")),
        ("density-16", "importance", ("importance",)),
    ],
)
def test_the_documents_frame_is_kbuffer_deep(
    ctx: moderngl.Context,
    frame: Frame,
    dump: FragmentDump,
    tmp_path: Path,
    tail: TailName,
    head: HeadName,
    outputs: tuple[OutputName, ...],
) -> None:
    provenance = Provenance(scenes={}, code_version="0", seed=0, machine="test")
    described = Description("glass", TailSpec(name=tail, g=0.75), "display", provenance, {})
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    network = random_weights(11, head=head, outputs=outputs)
    write_bundle(tmp_path, network, described, derive(gather(dump, tail)), lambda: parity)
    deep, client = KBufferDeep(tmp_path), Client(frame, tail)
    for budget in (dump.total // 3, dump.total // 2, 100, dump.total + 5):
        expected = deep.render(frame, Budget(budget, tail))
        linear, k = client.deep(budget, (tmp_path / GLSL).read_text(), len(outputs), colours=True)
        np.testing.assert_array_equal(k, expected.k)
        assert k.sum() <= budget
        np.testing.assert_allclose(linear, expected.linear, rtol=0.0, atol=1e-6)
