"""A scene's triangles and textures on the GPU: uploaded once, drawn by every pass of every view."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import moderngl
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from renderer.account.ledger import geometry_pass
from renderer.account.programs import TalliedPrograms
from renderer.culling import Clusters, Ranges
from renderer.fragment_list import FragmentList
from renderer.programs import Defines, Programs
from schemas.scene import Batch, Layer, SceneArrays, Texture

VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("uv", "<f4", 2), ("colour", "u1", 4)])
"""Interleaved vertex, 36 bytes; the `in` variables of `common/surface.vert`."""

_BINDINGS = "3f 3f 2f 4f1"
_NAMES = ("in_position", "in_normal", "in_uv", "in_colour")

# Texture units: 0..7 belong to the passes, these to the surface.
_UNITS = {"colour": 8, "opacity": 9, "emission": 10}

_ACROSS = 1024
"""Groups in the first of two dimensions."""
_RGBA8, _SRGB8_ALPHA8 = 0x8058, 0x8C43
"""OpenGL's internal formats."""

_WRAP_CODES = {"repeat": 0, "clamp": 0, "mirror": 1, "black": 2}
"""Wrap modes as `common/texture.glsl` knows them; 0 is left to the texture unit."""

TRANSPARENT: tuple[Layer, ...] = ("transparent", "mixed")
OPAQUE: tuple[Layer, ...] = ("opaque", "mixed")


class GpuScene:
    """A scene uploaded to a context.

    Args:
        ctx: The context.
        scene: Triangles and textures; float32 metres relative to the scene's origin.

    Attributes:
        programs: Its shaders.
        tallied: The same, where a frame is counted (`renderer.account`).
        clusters: Runs of triangles with their bounds, to leave out what a camera does not see.
        fragment_list: What captures append to, kept between views.
    """

    def __init__(self, ctx: moderngl.Context, scene: SceneArrays) -> None:
        self.ctx = ctx
        self.scene = scene
        self.programs = Programs(ctx)
        self.tallied = TalliedPrograms(ctx)
        vertices = np.empty(len(scene.positions), dtype=VERTEX)
        vertices["position"] = scene.positions
        vertices["normal"] = scene.normals
        vertices["uv"] = scene.uvs
        vertices["colour"] = scene.colours
        self._vertices = ctx.buffer(vertices)
        self._indices = ctx.buffer(oriented(scene))
        more = scene.more_uvs
        self._more_uvs = None if more is None else ctx.buffer(np.ascontiguousarray(more, dtype=np.float32))
        self._textures = [_upload(ctx, texture) for texture in scene.textures]
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self.fragment_list = FragmentList(ctx)
        self.clusters = Clusters(scene)

    @property
    def bytes(self) -> int:
        """Bytes of vertices and indices."""
        more = self._more_uvs.size if self._more_uvs is not None else 0
        return int(self._vertices.size + self._indices.size + more)

    def draw(
        self,
        fragment: str,
        layers: Iterable[Layer],
        uniforms: dict[str, object],
        defines: Defines | None = None,
        ranked: bool = False,
        visible: Sequence[Ranges] | None = None,
    ) -> None:
        """Draw the batches of some layers with a fragment shader.

        The shader is compiled for each of the `surface_defines` that the batches need.

        Args:
            fragment: File relative to `renderer/shaders`.
            layers: Which batches.
            uniforms: Set where the program has them (a compiler drops what it does not use).
            defines: Further defines.
            ranked: Set the uniform `first_triangle` of each run: with it, `first_triangle + gl_PrimitiveID` is a
                triangle's place in the order of submission.
            visible: For every batch of the scene the runs that are drawn; None: all of it.
        """
        wanted = set(layers)
        geometry_pass()
        for number, batch in enumerate(self.scene.batches):
            runs = [(batch.first // 3, batch.count // 3)] if visible is None else visible[number]
            if batch.layer not in wanted or not runs:
                continue
            variant = {**(defines or {}), **surface_defines(batch, self.scene.textures)}
            program = self.programs.get("common/surface.vert", fragment, variant)
            set_uniforms(program, uniforms)
            if not batch.is_plain:
                self._bind(program, batch)
            if batch.reflectance is not None:
                set_uniforms(program, _glass(batch))
            for first, triangles in runs:
                if ranked:
                    set_uniforms(program, {"first_triangle": first})
                self._array(program).render(moderngl.TRIANGLES, vertices=3 * triangles, first=3 * first)

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program.glo not in self._arrays:
            used = [name in program for name in _NAMES]
            # moderngl wants the stride complete: unused attributes are skipped as padding.
            layout = " ".join(
                part if use else f"{size}x"
                for part, size, use in zip(_BINDINGS.split(), (12, 12, 8, 4), used, strict=True)
            )
            names = [name for name, use in zip(_NAMES, used, strict=True) if use]
            content: list[tuple[object, ...]] = [(self._vertices, layout, *names)]
            if "in_more_uvs" in program:
                content.append((self._more_uvs, "4f", "in_more_uvs"))
            self._arrays[program.glo] = self.ctx.vertex_array(program, content, index_buffer=self._indices)
        return self._arrays[program.glo]

    def _bind(self, program: moderngl.Program, batch: Batch) -> None:
        uniforms: dict[str, object] = {
            "has_colour_texture": batch.colour_texture >= 0,
            "has_opacity_texture": batch.opacity_texture >= 0,
            "colour_scale": batch.colour_scale,
            "colour_bias": batch.colour_bias,
            "opacity_channel": batch.opacity_channel,
            "opacity_scale": batch.opacity_scale,
            "opacity_bias": batch.opacity_bias,
            "opacity_threshold": batch.opacity_threshold,
            "cut_out_alpha": batch.cut_out_alpha,
            "emission_scale": batch.emission_scale,
            "emission_bias": batch.emission_bias,
            "uv_sets": (batch.colour_uv, batch.opacity_uv, batch.emission_uv),
        }
        roles = {"colour": batch.colour_texture, "opacity": batch.opacity_texture, "emission": batch.emission_texture}
        for role, index in roles.items():
            uniforms[f"{role}_texture"] = _UNITS[role]
            if index >= 0:
                self._textures[index].use(_UNITS[role])
                uniforms[f"{role}_wrap"] = tuple(_WRAP_CODES[wrap] for wrap in self.scene.textures[index].wrap)
        set_uniforms(program, uniforms)


def _glass(batch: Batch) -> dict[str, object]:
    """Uniforms of `common/glass.glsl`."""
    return {
        "reflectance": batch.reflectance,
        "transmittance": -1.0 if batch.transmittance is None else batch.transmittance,
        "presence": batch.presence,
        "has_presence_texture": batch.has_presence_texture,
    }


def surface_defines(batch: Batch, textures: tuple[Texture, ...]) -> dict[str, int]:
    """What of `common/surface.glsl` a batch needs, as defines of 0 or 1."""
    wraps = {wrap for index in batch.textures for wrap in textures[index].wrap}
    return {
        "TEXTURED": int(not batch.is_plain),
        "MIXED": int(batch.layer == "mixed"),
        "WRAPPED": int(any(_WRAP_CODES[wrap] for wrap in wraps)),
        "MORE_UVS": int(max(batch.colour_uv, batch.opacity_uv, batch.emission_uv) > 0),
        "EMISSIVE": int(batch.emission_texture >= 0),
        "GLASS": int(batch.reflectance is not None),
    }


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, uniforms: dict[str, object]) -> None:
    """Set those of `uniforms` that the program has: a compiler drops the unused ones."""
    for name, value in uniforms.items():
        if name in program:
            program[name] = value


def run_for(program: moderngl.ComputeShader, pixels: int) -> None:
    """Run a shader of 64 threads a group for every pixel: groups are in two dimensions, which hold any picture."""
    groups = -(-pixels // 64)
    program.run(min(groups, _ACROSS), -(-groups // _ACROSS))


def _upload(ctx: moderngl.Context, texture: Texture) -> moderngl.Texture:
    height, width = texture.pixels.shape[:2]
    # Decoded by the texture unit, colours are filtered and averaged as light; decoded later they would come out dark.
    kind = _SRGB8_ALPHA8 if texture.srgb else _RGBA8
    uploaded = ctx.texture((width, height), 4, np.ascontiguousarray(texture.pixels), internal_format=kind)
    uploaded.build_mipmaps()
    uploaded.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    # The shader folds and masks coordinates for the other modes, over clamping.
    uploaded.repeat_x, uploaded.repeat_y = (wrap == "repeat" for wrap in texture.wrap)
    return uploaded


def oriented(scene: SceneArrays) -> NDArray[np.uint32]:
    """The scene's indices with every triangle wound as its normals say: uint32 [3*T].

    So `gl_FrontFacing` tells a shader on which side of a surface the eye is, also where a file winds its faces the
    other way. The interpolated normal alone does not: near a silhouette it may already point away from the eye.
    """
    indices = np.array(scene.indices, dtype=np.uint32)
    _orient(scene.positions, scene.normals, indices)
    return indices


@njit(parallel=True, cache=True, nogil=True)
def _orient(positions: NDArray[np.float32], normals: NDArray[np.float32], indices: NDArray[np.uint32]) -> None:
    for triangle in prange(len(indices) // 3):
        i, j, k = indices[3 * triangle], indices[3 * triangle + 1], indices[3 * triangle + 2]
        agreement = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            one_b, one_c = positions[j, b] - positions[i, b], positions[j, c] - positions[i, c]
            two_b, two_c = positions[k, b] - positions[i, b], positions[k, c] - positions[i, c]
            normal = normals[i, a] + normals[j, a] + normals[k, a]
            agreement += normal * (one_b * two_c - one_c * two_b)
        if agreement < 0.0:
            indices[3 * triangle + 1], indices[3 * triangle + 2] = k, j
