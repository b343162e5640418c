"""The frame as docs/CLIENTS.md has it, pass by pass with its bindings and defines, is the picture of `kbuffer-deep`."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import random_weights

from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.programs import Defines, expand
from renderer.techniques import Budget, KBufferDeep
from renderer.techniques.chain import one_pass_available
from schemas.bundle import GLSL, HeadName, OutputName, ParityReport, Provenance, TailSpec
from schemas.fragments import FragmentDump
from trainer.bundle import Description, write_bundle

B = 16
CONSTANTS: Defines = {
    "ROOT_SHARE": 0.6,
    "PLAIN_SHARE": 0.4,
    "SHARE_LEVELS": 15,
    "OPTICAL_UNIT": 951,
    "BIN_LIMIT": 65535,
}
LATTICE: Defines = {"BLOCK": 2048, "EDGES": 64, "LAST": 1884160, "SHIFT": 9, "TURNS": 60000}
CURVES: Defines = {**LATTICE, "MOST_GAIN": 1.2676506002282294e30, "LEAST_RATE": 3.1554436208840472e-30}
ONES = 0xFFFFFFFF


class Client:
    """A renderer of somebody who has read the document; geometry and the opaque pass are the frame's.

    Args:
        frame: The view.
        predict: The bundle's GLSL.
        outputs: How many the bundle has.
    """

    def __init__(self, frame: Frame, predict: str, outputs: int) -> None:
        self.frame, self.ctx = frame, frame.ctx
        self.width, self.height, self.pixels = frame.width, frame.height, frame.pixels
        self.texts, self.outputs = {"bundle/predict.glsl": predict}, outputs
        self.groups = self.pixels // 2048 + 1
        self.state = self.words(304 // 4, 0)  # once

    def words(self, count: int, fill: int) -> moderngl.Buffer:
        return self.ctx.buffer(np.full(max(count, 1), fill, np.uint32))

    def texture(self, components: int, dtype: str) -> moderngl.Texture:
        made = self.ctx.texture((self.width, self.height), components, dtype=dtype)
        made.filter = moderngl.NEAREST, moderngl.NEAREST
        self.ctx.framebuffer([made]).clear()
        return made

    def draw(
        self,
        fragment: str,
        targets: list[moderngl.Texture],
        buffers: dict[int, moderngl.Buffer],
        defines: Defines | None = None,
    ) -> None:
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self.frame.draw_transparent(fragment, self.frame.target(targets), defines)
        self.ctx.memory_barrier()

    def run(
        self, name: str, defines: Defines, buffers: dict[int, moderngl.Buffer], groups: int | None, **uniforms: int
    ) -> None:
        program = self.ctx.compute_shader(expand(name, defines, self.texts))
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for uniform, value in uniforms.items():
            program[uniform] = value
        if groups is None:
            program.run_indirect(self.state, 36)
        else:
            program.run(min(groups, 1024), -(-groups // 1024))
        self.ctx.memory_barrier()

    def render(self, budget: int, *, one_pass: bool) -> tuple[np.ndarray, np.ndarray]:
        """The picture, and k of every pixel."""
        size = {"width": self.width, "pixels": self.pixels}
        sixty_fours = -(-self.pixels // 64)
        # 2
        count, z_min, z_max = (self.words(self.pixels, fill) for fill in (0, ONES, 0))
        self.draw("count/count.frag", [], {0: count, 1: z_min, 2: z_max}, {"RANGE": 1})
        # 3
        binned = [self.texture(1, "f4"), *(self.texture(4, "nu2") for _ in range(B // 4))]
        defines: Defines = {"BINS": B, **CONSTANTS}
        self.draw("gather/gather.frag", binned, {1: z_min, 2: z_max}, {**defines, "NEAREST": 0})
        depth_bins = self.words(self.pixels * (1 + B // 8), 7)
        for unit, texture in enumerate(binned):
            texture.use(unit)
        self.run("gather/pack.comp", defines, {0: depth_bins}, sixty_fours, **size)
        # 4
        sums = [self.texture(4, "f2") for _ in range(5)]
        nearest = self.words(self.pixels, ONES)
        places: Defines = {f"SUMS{i}": i for i in range(5)}
        buffers = {1: z_min, 2: z_max, 3: nearest}
        self.draw("gather/gather.frag", sums, buffers, {**places, "BINS": 0, "NEAREST": 1})
        # 5
        blocks, curves = self.words(64 * self.groups, 7), self.words(2 * self.pixels, 7)
        listed = self.words(self.pixels + 1, 7)
        allocation = {0: self.state, 1: count, 2: listed, 3: curves, 4: blocks}
        self.run("allocation/totals.comp", LATTICE, allocation, self.groups, pixels=self.pixels)
        self.run("allocation/begin.comp", LATTICE, allocation, 1, blocks=self.groups, fragments=budget)
        for unit, texture in enumerate([*sums, self.frame.background]):
            texture.use(unit)
        buffers = {0: self.state, 1: z_min, 2: z_max, 3: nearest, 5: curves, 6: count, 7: depth_bins}
        network: Defines = {**CURVES, "MOST_RATE": 4096.0, "TEXELS": 11, "OUTPUTS": self.outputs, **defines}
        self.run("kbuffer-deep/curves.comp", network, buffers, sixty_fours, **size)
        # 6
        self.run("allocation/list.comp", LATTICE, allocation, self.groups, pixels=self.pixels)
        for _ in range(5):
            self.run("allocation/count.comp", LATTICE, allocation, None)
            self.run("allocation/choose.comp", LATTICE, allocation, 1)
        self.run("allocation/blocks.comp", LATTICE, allocation, self.groups, pixels=self.pixels)
        self.run("allocation/scan.comp", LATTICE, allocation, 1, blocks=self.groups)
        self.run("allocation/offsets.comp", LATTICE, allocation, self.groups, pixels=self.pixels)
        offsets = np.frombuffer(listed.read(), np.uint32).astype(np.int64)
        # 7
        tail = {**defines, "TAIL": 4, "MAX_EXPONENT": 60.0}
        tail_colour = self.texture(4, "f4")
        buffers = {0: listed, 3: z_min, 4: z_max, 5: depth_bins}
        slots = self.words((2 if one_pass else 1) * budget, ONES)
        if one_pass:
            self.draw("kbuffer/chain.frag", [tail_colour], {**buffers, 2: slots}, tail)
        else:
            depths = self.words(budget, ONES)
            self.draw("kbuffer/chain_depth.frag", [], {0: listed, 1: depths})
            self.draw("kbuffer/chain_colour.frag", [tail_colour], {**buffers, 1: depths, 2: slots}, tail)
        # 8
        final: Defines = {**defines, "TAIL": 4, "STRIDE": 2 if one_pass else 1}
        program = self.ctx.program(
            vertex_shader=expand("common/fullscreen.vert", {}),
            fragment_shader=expand("kbuffer/resolve.frag", final),
        )
        program["width"], program["first_row"] = self.width, 0
        for binding, buffer in ((0, listed), (2, slots), (5, depth_bins)):
            buffer.bind_to_storage_buffer(binding)
        self.frame.background.use(0)
        tail_colour.use(1)
        image = self.texture(4, "f4")
        self.ctx.framebuffer([image]).use()
        self.ctx.enable_only(moderngl.NOTHING)
        self.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        linear = np.frombuffer(image.read(), np.float32).reshape(self.height, self.width, 4)
        return linear[:, :, :3], np.diff(offsets)


@pytest.mark.parametrize(
    ("one_pass", "head", "outputs"),
    [
        (False, "gain-curve", ("a", "b")),
        (True, "gain-curve", ("a", "b")),
        (False, "gain-curve", ("a", "b", "g")),
        (False, "importance", ("importance",)),
    ],
)
def test_the_documents_frame_is_the_technique(
    ctx: moderngl.Context,
    frame: Frame,
    dump: FragmentDump,
    tmp_path: Path,
    one_pass: bool,
    head: HeadName,
    outputs: tuple[OutputName, ...],
) -> None:
    if one_pass and not one_pass_available(ctx):
        pytest.skip("this driver has no 64-bit atomics")
    provenance = Provenance(scenes={}, code_version="0", seed=0, machine="test")
    described = Description("glass", TailSpec(name="density-16", g=0.75), "display", provenance, {})
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, driver="none")
    network = random_weights(11, head=head, outputs=outputs)
    write_bundle(tmp_path, network, described, derive(gather(dump, bins=B)), lambda: parity)
    deep, client = KBufferDeep(tmp_path), Client(frame, (tmp_path / GLSL).read_text(), len(outputs))
    for budget in (dump.total // 3, dump.total // 2, 100, dump.total + 5):  # the later ones start warm
        expected = deep.render(frame, Budget(budget, "density-16", chain="one-pass" if one_pass else "two-pass"))
        linear, k = client.render(budget, one_pass=one_pass)
        np.testing.assert_array_equal(k, expected.k)
        assert k.sum() == min(budget, dump.total)
        np.testing.assert_allclose(linear, expected.linear, rtol=0.0, atol=1e-6)
