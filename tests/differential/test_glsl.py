"""Every shader that a technique draws with, as it is compiled, against the language's specification.

Drivers accept more than GLSL 4.50 has, each something else; the Khronos reference compiler accepts what all must.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.scenes import VIEW, shells, with_glass
from support.training import export_random, random_weights

from evaluation.stress.gl_stacks import VIEW as STACKS
from evaluation.stress.gl_stacks import extreme_stacks, size, stack_scene
from renderer import programs
from renderer.account.glsl import tallied
from renderer.bin_pass import word_defines
from renderer.capture import capture
from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.hidden import hidden_fragments
from renderer.programs import SHADERS, Defines, expand
from renderer.techniques import TECHNIQUES, Budget, KBufferDeep, Needs, technique
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, MAX_EXPONENT, NO_TAIL, TAIL_NAMES, TAILS, TailKind

STAGES = (".vert", ".frag", ".comp")
FULLSCREEN = ("common/fullscreen.vert", "benchmark/empty.frag")
"""Without defines; the second is the benchmarks'."""

pytestmark = pytest.mark.skipif(
    shutil.which("glslangValidator") is None, reason="there is no glslangValidator: apt-get install glslang-tools"
)


@pytest.fixture(scope="module")
def compiled(gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """Texts of every shader file, by its name."""
    texts: dict[str, set[str]] = {name: {expand(name, {})} for name in FULLSCREEN}

    def recorded(name: str, defines: Defines, includes: Mapping[str, str] | None = None) -> str:
        text = expand(name, defines, includes)
        texts.setdefault(name, set()).add(text)
        return text

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(programs, "expand", recorded)
        frame = Frame(GpuScene(gl, with_glass(shells(subdivisions=1))), VIEW, 32, 24)
        dump = capture(frame).dump
        hidden_fragments(frame)
        stacks = extreme_stacks(300)  # runs that one thread does not sort
        technique("sbuffer").render(Frame(GpuScene(gl, stack_scene(stacks)), STACKS, *size(len(stacks))), Budget(1))
        bundle = tmp_path_factory.mktemp("bundle")
        features = derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0]
        export_random(bundle, random_weights(4), features)
        export_random(bundle / "importances", random_weights(4, head="importance"), features)
        needs = Needs(bundle=bundle, allocate=lambda frame, _: np.minimum(frame.count(), 2).astype(np.int32))
        for folder in (bundle, bundle / "importances"):
            deep, listed = KBufferDeep(folder), np.flatnonzero(dump.counts).astype(np.uint32)
            deep.render(frame, Budget(dump.total // 2))
            # Rows that are read back, as a runtime on the CPU does.
            deep.predict(frame, listed)
            deep.features(frame, listed)
        for tail in BINNED_TAILS:
            for colours in (False, True):
                frame.gather_bins(tail, luma=colours)
        for name in TECHNIQUES:
            for tail in TAIL_NAMES if name == "kbuffer" else (DEFAULT_TAIL,):
                technique(name, needs).render(frame, Budget(dump.total // 2, tail, chain="two-pass"))
    without: Defines = {"TAIL": NO_TAIL, **{f"TAIL_{kind.name}": int(kind) for kind in TailKind}}
    for row in (
        without,
        *(word_defines(tail, luma=False) if tail.bins else tail.defines for tail in TAILS.values()),
    ):  # the driver may lack what it needs
        for surface in ({"TEXTURED": 0, "MIXED": 0, "GLASS": 0}, {"TEXTURED": 1, "MIXED": 1, "GLASS": 1}):
            defines = {**row, "MAX_EXPONENT": MAX_EXPONENT, "WRAPPED": 0, "MORE_UVS": 0, "EMISSIVE": 0}
            recorded("kbuffer/chain.frag", {**defines, **surface})
    return texts


def test_every_shader_file_is_compiled(compiled: dict[str, set[str]]) -> None:
    files = {path.relative_to(SHADERS).as_posix() for path in SHADERS.rglob("*") if path.suffix in STAGES}
    assert set(compiled) == files


def refusals(texts: Mapping[str, set[str]], folder: Path) -> str:
    """What the reference compiler says against shaders, by their files' names; empty if it takes them all."""
    names = []
    for name, each in texts.items():
        for number, text in enumerate(sorted(each)):
            path = folder / f"{name.replace('/', '-').replace('.', f'-{number}.')}"
            path.write_text(text, encoding="utf-8")
            names.append(path.name)
    done = subprocess.run(["glslangValidator", *names], cwd=folder, capture_output=True, text=True)
    return done.stdout[-4000:] if done.returncode or "WARNING" in done.stdout else ""


def test_the_reference_compiler_accepts_every_shader(compiled: dict[str, set[str]], tmp_path: Path) -> None:
    assert refusals(compiled, tmp_path) == ""


def test_it_accepts_every_shader_that_tallies(compiled: dict[str, set[str]], tmp_path: Path) -> None:
    counted = {
        name: {tallied(text, is_fragment=name.endswith(".frag")).text for text in texts}
        for name, texts in compiled.items()
        if not name.endswith(".vert")
    }
    assert refusals(counted, tmp_path) == ""
