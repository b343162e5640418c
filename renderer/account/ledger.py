"""The account of a frame: what each of its passes does, from shaders that tally and from every call that moves bytes.

While a frame is counted, its scene's programs are those that tally, and the calls of moderngl that draw, clear or
transfer are listened to. So an account is of what is done, whatever a technique says of itself, and there is nothing to
keep in step. Counts are exact, pictures are those of any other frame to the bit; times mean nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import wraps
from typing import TYPE_CHECKING, Any, cast

import moderngl
import numpy as np

from renderer.account.glsl import ATOMIC_BYTES, ATOMICS, FETCHES, INVOCATIONS, LOADED, STORED, SURVIVORS
from renderer.account.programs import TalliedPrograms
from schemas.work import PassWork

if TYPE_CHECKING:
    from renderer.gpu_scene import GpuScene

_ledger: Ledger | None = None


@contextmanager
def counted_pass(name: str) -> Iterator[None]:
    """A pass of a frame; what is done outside of all passes is in no account."""
    if _ledger is None:
        yield
        return
    with _ledger.within(name):
        yield


def geometry_pass() -> None:
    """The layers of a scene are drawn."""
    if _ledger is not None:
        _ledger.add(geometry_passes=1)


def count_frame(gpu: GpuScene, render: Callable[[], object]) -> dict[str, PassWork]:
    """What the passes of a frame do, in the order in which they begin.

    Args:
        gpu: The scene.
        render: Renders it; passes that have run before are in no account.
    """
    global _ledger
    made = Ledger(gpu.tallied)
    _ledger, before = made, _ledger
    gpu.programs, usual = gpu.tallied, gpu.programs
    try:
        with made.listening():
            render()
    finally:
        gpu.programs, _ledger = usual, before
    return made.passes


@dataclass(frozen=True, slots=True)
class _Bound:
    """What a program is drawn with.

    Attributes:
        target_bytes: Of a pixel in all targets that are written.
        blends: Whether they are blended.
        texel_bytes: Of the textures that its samplers fetch from.
    """

    target_bytes: int
    blends: bool
    texel_bytes: tuple[int, ...]


@dataclass(slots=True)
class Ledger:
    """The account of a frame under way.

    Args:
        programs: Of its scene.

    Attributes:
        passes: What they do, in the order in which they began.
    """

    programs: TalliedPrograms
    passes: dict[str, PassWork] = field(default_factory=dict)
    _open: list[str] = field(default_factory=list)
    _bound: dict[int, _Bound] = field(default_factory=dict)
    _units: dict[int, int] = field(default_factory=dict)
    _blends: bool = False
    _is_reading: bool = False

    @contextmanager
    def within(self, name: str) -> Iterator[None]:
        """A pass; one within another is not part of it."""
        self._settle()
        self.passes.setdefault(name, PassWork())
        self._open.append(name)
        try:
            yield
            self._settle()
        finally:
            self._open.pop()

    def add(self, **counts: int) -> None:
        """Add to the pass that is open, if one is."""
        if self._open and not self._is_reading:
            self.passes[self._open[-1]] += PassWork(**counts)

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Hear of every call that binds, draws, clears or transfers."""
        self._reading(self.programs.bind)
        heard: dict[tuple[type, str], Callable[..., None]] = {
            (moderngl.Texture, "use"): self._use,
            (moderngl.Context, "enable_only"): self._enable,
            (moderngl.VertexArray, "render"): self._draw,
            (moderngl.ComputeShader, "run"): self._dispatch,
            (moderngl.ComputeShader, "run_indirect"): self._dispatch,
            (moderngl.Framebuffer, "clear"): self._clear_target,
            (moderngl.Context, "clear"): self._clear_context,
            (moderngl.Buffer, "clear"): self._clear_buffer,
            (moderngl.Buffer, "write"): self._write,
            (moderngl.Buffer, "read"): self._read,
            (moderngl.Buffer, "read_into"): self._read_into,
            (moderngl.Buffer, "read_chunks"): self._read_chunks,
            (moderngl.Context, "buffer"): self._upload,
        }
        with ExitStack() as stack:
            for (owner, name), hear in heard.items():
                original = getattr(owner, name)
                setattr(owner, name, _heard(original, hear))
                stack.callback(setattr, owner, name, original)
            yield

    def _settle(self) -> None:
        """What shaders tallied since the last time, for the pass that is open."""
        rows = self._reading(self.programs.read)
        for known in self.programs.known.values():
            if known.row not in self._bound or not self._open:
                continue
            row, bound = rows[known.row].tolist(), self._bound[known.row]
            written = row[SURVIVORS] * bound.target_bytes
            fetched = sum(bytes_ * row[FETCHES + i] for i, bytes_ in enumerate(bound.texel_bytes))
            counts = {
                "blended_bytes": 2 * written if bound.blends else 0,
                "loaded_bytes": row[LOADED] + fetched,
                "stored_bytes": row[STORED] + (0 if bound.blends else written),
                "atomics": row[ATOMICS],
                "atomic_bytes": 2 * row[ATOMIC_BYTES],
            }
            self.add(**counts, **({known.shades: row[INVOCATIONS]} if known.shades else {}))
        self._bound.clear()

    def _reading(self, act: Callable[[], Any]) -> Any:
        self._is_reading = True
        try:
            return act()
        finally:
            self._is_reading = False

    def _bind(self, program: moderngl.Program | moderngl.ComputeShader, target_bytes: int, blends: bool) -> None:
        if program.glo not in self.programs.known:
            raise RuntimeError("a program is run that is not one of the scene's")
        known = self.programs.known[program.glo]
        texels = tuple(self._texel_bytes(program, name) for name in known.samplers)
        bound = _Bound(target_bytes, blends, texels)
        if self._bound.setdefault(known.row, bound) != bound:
            self._settle()
            self._bound[known.row] = bound

    def _texel_bytes(self, program: moderngl.Program | moderngl.ComputeShader, name: str) -> int:
        """Bytes of a texel of what a sampler reads; those of an array are alike."""
        if name not in program:
            return 0  # the compiler dropped it
        units = cast(moderngl.Uniform, program[name]).value
        sizes = {self._units[unit] for unit in (units if isinstance(units, (tuple, list)) else (units,))}
        if len(sizes) != 1:
            raise RuntimeError(f"{name} reads textures of several formats")
        return sizes.pop()

    def _use(self, texture: moderngl.Texture, location: int = 0) -> None:
        self._units[location] = _pixel_bytes(texture)

    def _enable(self, _: moderngl.Context, flags: int) -> None:
        self._blends = bool(flags & moderngl.BLEND)

    def _draw(self, array: moderngl.VertexArray, *_: object, **__: object) -> None:
        target = array.ctx.fbo
        self._bind(array.program, _target_bytes(target), self._blends)

    def _dispatch(self, program: moderngl.ComputeShader, *_: object, **__: object) -> None:
        self._bind(program, 0, blends=False)

    def _clear_target(self, target: moderngl.Framebuffer, *_: object, **given: Any) -> None:
        cleared = given.get("viewport") or target.scissor or target.size
        self.add(cleared_bytes=_target_bytes(target) * cleared[-2] * cleared[-1])

    def _clear_context(self, ctx: moderngl.Context, *_: object, **given: Any) -> None:
        self._clear_target(ctx.fbo, **given)

    def _clear_buffer(self, buffer: moderngl.Buffer, size: int = -1, offset: int = 0, *_: object, **__: object) -> None:
        self.add(cleared_bytes=size if size >= 0 else buffer.size - offset)

    def _write(self, _: moderngl.Buffer, data: Any, *__: object) -> None:
        self.add(transferred_bytes=_bytes_of(data))

    def _read(self, buffer: moderngl.Buffer, size: int = -1, offset: int = 0) -> None:
        self.add(transferred_bytes=size if size >= 0 else buffer.size - offset)

    def _read_into(
        self, buffer: moderngl.Buffer, _: object, size: int = -1, offset: int = 0, write_offset: int = 0
    ) -> None:
        self._read(buffer, size, offset)

    def _read_chunks(self, _: moderngl.Buffer, chunk_size: int, start: int, step: int, count: int) -> None:
        self.add(transferred_bytes=chunk_size * count)

    def _upload(self, _: moderngl.Context, data: Any = None, *__: object, **___: object) -> None:
        self.add(transferred_bytes=0 if data is None else _bytes_of(data))


def _heard(original: Callable[..., Any], hear: Callable[..., None]) -> Callable[..., Any]:
    @wraps(original)
    def called(*given: Any, **named: Any) -> Any:
        hear(*given, **named)
        return original(*given, **named)

    return called


def _pixel_bytes(texture: moderngl.Texture) -> int:
    """Of a texel; a type of moderngl ends with the bytes of a component."""
    return texture.components * int(texture.dtype[-1])


def _target_bytes(target: moderngl.Framebuffer) -> int:
    """Of a pixel in all attachments, or none where nothing is written to them."""
    textures = [one for one in target.color_attachments if isinstance(one, moderngl.Texture)]
    return sum(map(_pixel_bytes, textures)) if np.any(target.color_mask) else 0


def _bytes_of(data: Any) -> int:
    return int(data.nbytes) if hasattr(data, "nbytes") else len(data)
