"""The frame as docs/CLIENTS.md has it, pass by pass with its bindings and defines, is the picture of the techniques."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells
from support.training import random_weights

from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import TRANSPARENT, GpuScene
from renderer.programs import Defines, expand
from renderer.techniques import Binned, Budget, KBufferDeep
from schemas.bundle import GLSL, HeadName, ParityReport, Provenance, TailSpec, load_manifest
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
    **{"TAIL": 4, **KINDS, "MAX_EXPONENT": 60.0, "ROOT_SHARE": 0.6, "PLAIN_SHARE": 0.4, "OPTICAL_UNIT": 253},
    **{"BIN_LIMIT": 4095, "COUNT_LIMIT": 255, "RANGE_TILE": 8, "MOST_OPACITY": 16.0},
    **{"LEAST_OTHERS": 0.001, "LEAST_SPREAD": 0.001},
    **{"LUMA_R": 54, "LUMA_G": 183, "LUMA_B": 19, "LUMA_SHIFT": 6, "LUMA_SQUARE_SHIFT": 14},
}
ROWS: dict[TailName, Defines] = {
    "binned-8": {"BINS": 8, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "binned-12": {"BINS": 12, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "binned-16": {"BINS": 16, "SHARE_LEVELS": 255, "MEAN_LEVELS": 255},
    "density-16": {"BINS": 16, "SHARE_LEVELS": 15, "MEAN_LEVELS": 0},
}
ALLOCATION: Defines = {"BLOCK": 2048, "RANKS": 256, "FULL": 255, "MOST_CORE": 1023}
PRICES: Defines = {
    **{"LEAST_PRICE": -4.0, "PRICE_STEPS": 8.0, "LEAST_PRIOR": -40.0, "LEAST_COVERED": 0.0001},
    **{"LEAST_ALONE": 0.001, "MOST_ALONE": 0.5, "LEAST_IMPORTANCE": 9.313225746154785e-10},
}
ONES = 0xFFFFFFFF
STATE, FOUND, POOL, BLOCKS, BINS, RANGES = 0, 0, 2, 3, 5, 7


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context) -> Frame:
    """With sums in the document's formats."""
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE)


class Client:
    """A renderer of somebody who has read the document; geometry and the opaque pass are the frame's.

    Args:
        frame: The view.
        tail: What is rendered.
        luma: Whether the network reads luma.
    """

    def __init__(self, frame: Frame, tail: TailName, luma: int = 0) -> None:
        self.frame, self.ctx = frame, frame.ctx
        self.width, self.height, self.pixels = frame.width, frame.height, frame.pixels
        self.texts: dict[str, str] = {}
        self.row = ROWS[tail]
        self.bins = int(self.row["BINS"])
        self.pixel_words = self.bins + luma
        self.tail: Defines = {**CONSTANTS, **self.row, "LUMA": luma, "PIXEL_WORDS": self.pixel_words}
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

    def gather(self) -> None:
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

        self.found = self.words(self.pixel_words * self.pixels, 0)
        self.inputs = {BINS: self.found, RANGES: self.ranges}
        self.draw("gather/bins.frag", [], self.inputs, self.tail)
        self.run("gather/pack.comp", self.tail, {BINS: self.found}, self.sixty_fours, pixels=self.pixels)

    def blend(self, fragment: str, buffers: dict[int, moderngl.Buffer], **defines: int) -> list[moderngl.Texture]:
        """Pass 4 or 7; the tail's sums."""
        targets = [self.texture(4, "f2"), self.texture(1, "nu2")]
        self.draw(fragment, targets, {**self.inputs, **buffers}, {**self.tail, **defines})
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
        self.gather()
        targets = self.blend("binned/tail.frag", {})
        return self.resolve("common/weighted_mean.frag", targets, {"DEPTH_UNIT": 16.0}, {})

    def deep(self, budget: int, predict: str, outputs: int) -> tuple[np.ndarray, np.ndarray]:
        """The picture of `kbuffer-deep`, and k of every pixel."""
        self.texts = {"bundle/predict.glsl": predict}
        self.gather()
        # 5
        state, blocks = self.words(1048 // 4, 0), self.words(2 * self.blocks, 7)
        state.write(np.uint32(budget).tobytes())
        shared = {STATE: state, BLOCKS: blocks, BINS: self.found}
        defines: Defines = {**self.tail, **ALLOCATION}
        numbers = {"pixels": self.pixels, "blocks": self.blocks}

        def allocate(name: str, groups: int) -> None:
            self.run(f"allocation/{name}.comp", defines, shared, groups, **numbers)

        allocate("totals", self.blocks)
        allocate("complete", 1)
        self.frame.background.use(0)
        network: Defines = {"TEXELS": 11, "OUTPUTS": outputs, **defines, **PRICES}
        self.run("kbuffer-deep/prices.comp", network, {STATE: state, **self.inputs}, self.sixty_fours, **self.size)
        # 6
        allocate("count", self.blocks)
        allocate("choose", 1)
        allocate("blocks", self.blocks)
        allocate("scan", 1)
        allocate("place", self.blocks)
        # 7, 8, 9
        in_words = int(budget <= self.pixels * ((self.pixel_words - self.bins // 2 - 2) // 2))
        buffers = {BINS: self.found, **({} if in_words else {POOL: self.words(2 * budget, 7)})}
        targets = self.blend("kbuffer-deep/capture.frag", buffers, IN_WORDS=in_words)
        held: Defines = {**self.tail, "IN_WORDS": in_words}
        self.run("kbuffer-deep/sort.comp", held, buffers, self.sixty_fours, pixels=self.pixels)
        linear = self.resolve("kbuffer/resolve.frag", targets, {**held, "RUNS": 1}, buffers)
        words = np.frombuffer(self.found.read(), np.uint32).reshape(self.pixels, -1)[:, self.bins // 2 :]
        return linear, ((words[:, 1] & (2**27 - 1)).astype(np.int64) - words[:, 0]).astype(np.int32)


@pytest.mark.parametrize("tail", ROWS)
def test_the_documents_binned_is_the_technique(ctx: moderngl.Context, frame: Frame, tail: TailName) -> None:
    expected = Binned(tail).render(frame, Budget(0))
    np.testing.assert_allclose(Client(frame, tail).binned(), expected.linear, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("tail", "head"), [("binned-12", "bin-gains"), ("density-16", "bin-gains"), ("binned-16", "importance")]
)
def test_the_documents_frame_is_kbuffer_deep(
    ctx: moderngl.Context,
    frame: Frame,
    dump: FragmentDump,
    tmp_path: Path,
    tail: TailName,
    head: HeadName,
) -> None:
    provenance = Provenance(scenes={}, code_version="0", seed=0, machine="test")
    described = Description("glass", TailSpec(name=tail, g=0.75), "display", provenance, {})
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    network = random_weights(11, head=head, tail=tail)
    write_bundle(tmp_path, network, described, derive(gather(dump, tail)), lambda: parity)
    manifest = load_manifest(tmp_path)
    luma = int(any(feature.name.startswith("luma_") for feature in manifest.features))
    deep, client = KBufferDeep(tmp_path), Client(frame, tail, luma)
    for budget in (dump.total // 3, dump.total // 2, 100, dump.total + 5):
        expected = deep.render(frame, Budget(budget, tail))
        linear, k = client.deep(budget, (tmp_path / GLSL).read_text(), len(manifest.outputs))
        np.testing.assert_array_equal(k, expected.k)
        assert k.sum() <= budget
        np.testing.assert_allclose(linear, expected.linear, rtol=0.0, atol=1e-6)
