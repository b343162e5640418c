"""A scene's triangles and textures on the GPU: uploaded once, drawn by every pass of every view."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np

from renderer.programs import Defines, Programs
from schemas.scene import Batch, Layer, SceneArrays, Texture

VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("uv", "<f4", 2), ("colour", "u1", 4)])
"""Interleaved vertex, 36 bytes; the `in` variables of `common/surface.vert`."""

_BINDINGS = "3f 3f 2f 4f1"
_NAMES = ("in_position", "in_normal", "in_uv", "in_colour")

# Texture units: 0..7 belong to the passes, these two to the surface.
_COLOUR_UNIT, _OPACITY_UNIT = 8, 9

TRANSPARENT: tuple[Layer, ...] = ("transparent", "mixed")
OPAQUE: tuple[Layer, ...] = ("opaque", "mixed")


class GpuScene:
    """A scene uploaded to a context.

    Args:
        ctx: The context.
        scene: Triangles and textures; float32 metres relative to the scene's origin.
    """

    def __init__(self, ctx: moderngl.Context, scene: SceneArrays) -> None:
        self.ctx = ctx
        self.scene = scene
        self.programs = Programs(ctx)
        vertices = np.empty(len(scene.positions), dtype=VERTEX)
        vertices["position"] = scene.positions
        vertices["normal"] = scene.normals
        vertices["uv"] = scene.uvs
        vertices["colour"] = scene.colours
        self._vertices = ctx.buffer(vertices)
        self._indices = ctx.buffer(np.ascontiguousarray(scene.indices, dtype=np.uint32))
        self._textures = [_upload(ctx, texture) for texture in scene.textures]
        self._arrays: dict[int, moderngl.VertexArray] = {}

    @property
    def bytes(self) -> int:
        """Bytes of vertices and indices."""
        return int(self._vertices.size + self._indices.size)

    def draw(
        self, fragment: str, layers: Iterable[Layer], uniforms: dict[str, object], defines: Defines | None = None
    ) -> None:
        """Draw the batches of some layers with a fragment shader.

        The shader is compiled for TEXTURED 0 and 1, MIXED 0 and 1 as the batches need it.

        Args:
            fragment: File relative to `renderer/shaders`.
            layers: Which batches.
            uniforms: Set where the program has them (a compiler drops what it does not use).
            defines: Further defines.
        """
        wanted = set(layers)
        for batch in self.scene.batches:
            if batch.layer not in wanted:
                continue
            textured = batch.colour_texture >= 0 or batch.opacity_texture >= 0
            variant = {**(defines or {}), "TEXTURED": int(textured), "MIXED": int(batch.layer == "mixed")}
            program = self.programs.get("common/surface.vert", fragment, variant)
            set_uniforms(program, uniforms)
            if textured:
                self._bind(program, batch)
            self._array(program).render(moderngl.TRIANGLES, vertices=batch.count, first=batch.first)

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program.glo not in self._arrays:
            used = [name in program for name in _NAMES]
            # moderngl wants the stride complete: unused attributes are skipped as padding.
            layout = " ".join(
                part if use else f"{size}x"
                for part, size, use in zip(_BINDINGS.split(), (12, 12, 8, 4), used, strict=True)
            )
            names = [name for name, use in zip(_NAMES, used, strict=True) if use]
            self._arrays[program.glo] = self.ctx.vertex_array(
                program, [(self._vertices, layout, *names)], index_buffer=self._indices
            )
        return self._arrays[program.glo]

    def _bind(self, program: moderngl.Program, batch: Batch) -> None:
        for index, unit in ((batch.colour_texture, _COLOUR_UNIT), (batch.opacity_texture, _OPACITY_UNIT)):
            if index >= 0:
                self._textures[index].use(unit)
        set_uniforms(
            program,
            {
                "colour_texture": _COLOUR_UNIT,
                "opacity_texture": _OPACITY_UNIT,
                "has_colour_texture": batch.colour_texture >= 0,
                "has_opacity_texture": batch.opacity_texture >= 0,
                "colour_is_srgb": batch.colour_texture >= 0 and self.scene.textures[batch.colour_texture].srgb,
                "colour_scale": batch.colour_scale,
                "colour_bias": batch.colour_bias,
                "opacity_channel": batch.opacity_channel,
                "opacity_scale": batch.opacity_scale,
                "opacity_bias": batch.opacity_bias,
                "opacity_threshold": batch.opacity_threshold,
            },
        )


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, uniforms: dict[str, object]) -> None:
    """Set those of `uniforms` that the program has: a compiler drops the unused ones."""
    for name, value in uniforms.items():
        if name in program:
            program[name] = value


def _upload(ctx: moderngl.Context, texture: Texture) -> moderngl.Texture:
    height, width = texture.pixels.shape[:2]
    uploaded = ctx.texture((width, height), 4, np.ascontiguousarray(texture.pixels))
    uploaded.build_mipmaps()
    uploaded.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    # moderngl has repeat and clamp only; mirror is rare and repeats, black clamps.
    uploaded.repeat_x, uploaded.repeat_y = (wrap in ("repeat", "mirror") for wrap in texture.wrap)
    return uploaded
