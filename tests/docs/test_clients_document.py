"""docs/CLIENTS.md against the shaders: files, numbers and bindings are theirs, and its defines are all they need."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from support.training import random_weights

from renderer.allocation.gpu import _COUNT_GROUPS, BLOCK, CURVE_DEFINES, STATE
from renderer.features import TEXELS
from renderer.frame import BIN_DEFINES
from renderer.programs import SHADERS, Defines, expand
from schemas.tail import MAX_EXPONENT
from trainer.export_shader import shader_source

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = (ROOT / "docs" / "CLIENTS.md").read_text(encoding="utf-8")
FRAME = DOCUMENT.split("## The frame")[1].split("## What to skip")[0]

CONSTANTS: dict[str, float] = {**CURVE_DEFINES, **BIN_DEFINES, "MAX_EXPONENT": MAX_EXPONENT, "TEXELS": TEXELS}
"""What the document says in numbers."""
LATTICE = ("BLOCK", "EDGES", "LAST", "SHIFT", "TURNS")
CURVES = (*LATTICE, "MOST_GAIN", "LEAST_RATE", "MOST_RATE")
BINS = ("ROOT_SHARE", "PLAIN_SHARE", "SHARE_LEVELS", "OPTICAL_UNIT", "BIN_LIMIT")
ALLOCATION = ("totals", "begin", "list", "count", "choose", "blocks", "scan", "offsets")

SURFACE: Defines = {"TEXTURED": 0, "MIXED": 1, "WRAPPED": 0, "MORE_UVS": 0, "EMISSIVE": 0}
"""Of the renderer's own surfaces, which a client replaces; `MIXED` is the document's."""

IMPORTANCES = random_weights(1, head="importance", outputs=("importance",))

# Shader -> constants, and defines that have no one value.
COMPILED: list[tuple[str, tuple[str, ...], Defines]] = [
    ("count/count.frag", (), {"RANGE": 1}),
    *(("gather/gather.frag", BINS, {"BINS": bins, "NEAREST": 0}) for bins in (8, 16)),
    *(("gather/pack.comp", BINS, {"BINS": bins}) for bins in (8, 16)),
    ("gather/gather.frag", (), {"BINS": 0, "NEAREST": 1, "SUMS1": 0, "SUMS3": 1}),
    ("gather/gather.frag", (), {"BINS": 0, "NEAREST": 0, **{f"SUMS{i}": i for i in range(5)}}),
    *((f"allocation/{name}.comp", LATTICE, {}) for name in ALLOCATION),
    ("kbuffer-deep/curves.comp", (*CURVES, "TEXELS", *BINS), {"BINS": 16, "OUTPUTS": 2}),
    ("kbuffer-deep/curves.comp", (*CURVES, "TEXELS"), {"BINS": 0, "OUTPUTS": 1}),
    ("kbuffer-deep/predict.comp", ("TEXELS", *BINS), {"BINS": 16, "FEATURES_ONLY": 0, "OUTPUTS": 2}),
    ("kbuffer/chain_depth.frag", (), {}),
    ("kbuffer/resolve.frag", BINS, {"TAIL": 4, "BINS": 16, "STRIDE": 2}),
    *(
        (f"kbuffer/{chain}.frag", (*BINS, "MAX_EXPONENT"), {"TAIL": tail, "BINS": 16})
        for chain in ("chain", "chain_colour")
        for tail in (-1, 0, 1, 2, 3, 4)
    ),
]


def said() -> dict[str, set[float]]:
    """Defines that the document gives numbers, in whatever place."""
    found: dict[str, set[float]] = {}
    for name, value in re.findall(r"`([A-Z_]+) (-?[\d.]+(?:e-?\d+)?)`", DOCUMENT):
        found.setdefault(name, set()).add(float(value))
    return found


@pytest.mark.parametrize("name", sorted(CONSTANTS))
def test_constants_are_those_of_the_code(name: str) -> None:
    assert said()[name] == {CONSTANTS[name]}


def test_every_shader_that_is_named_exists() -> None:
    named = set(re.findall(r"`((?!bundle)[\w-]+/[\w-]+\.(?:vert|frag|comp|glsl))`", DOCUMENT))
    assert {name for name in named if not (SHADERS / name).is_file()} == set()
    assert {name for name, _, _ in COMPILED} <= named


@pytest.mark.skipif(shutil.which("glslangValidator") is None, reason="apt-get install glslang-tools")
def test_every_shader_compiles_with_what_is_defined_there(tmp_path: Path) -> None:
    files: list[Path] = []
    for number, (name, constants, others) in enumerate(COMPILED):
        defines = {**others, **{constant: CONSTANTS[constant] for constant in constants}}
        surface = SURFACE if name.endswith(".frag") else {}
        network = IMPORTANCES if defines.get("OUTPUTS") == 1 else random_weights(1)
        file = tmp_path / f"{number}{Path(name).suffix}"
        file.write_text(expand(name, {**surface, **defines}, {"bundle/predict.glsl": shader_source(network)}))
        files.append(file)
    done = subprocess.run(["glslangValidator", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:]


def test_the_state_is_as_large_as_it_says() -> None:
    assert f"{STATE.itemsize} bytes" in DOCUMENT
    assert f"at byte {_COUNT_GROUPS} of State" in DOCUMENT
    assert f"floor(P / {BLOCK})" in DOCUMENT


BUFFERS = {
    "count": "Counts", "z_min": "Nearest", "z_max": "Farthest", "nearest_colour": "NearestColour",
    "DepthBins": "DepthBins", "Curves": "Curves", "State": "State", "List": "List", "Blocks": "Blocks",
    "Offsets": "Offsets", "Slots": "Slots", "Depths": "Depths", "Colours": "Colours",
}  # fmt: skip
"""What the document binds -> the name of its block in the shaders."""


def bindings(shader: str) -> set[tuple[int, str]]:
    text = (SHADERS / shader).read_text(encoding="utf-8")
    return {(int(i), name) for i, name in re.findall(r"binding = (\d+)\)[\w\s]*?buffer (\w+)", text)}


@pytest.mark.parametrize(
    ("number", "shaders"),
    [
        (2, ["count/count.frag"]),
        (4, ["gather/gather.frag"]),
        (5, ["allocation/state.glsl", "allocation/count.comp"]),
        (5, ["allocation/state.glsl", "kbuffer-deep/inputs.glsl", "kbuffer-deep/curves.comp"]),
        (
            7,
            ["kbuffer/chain.frag", "kbuffer/chain_colour.frag", "kbuffer/chain_depth.frag", "kbuffer/tail_weight.glsl"],
        ),
    ],
)
def test_bindings_are_those_of_the_shaders(number: int, shaders: list[str]) -> None:
    part = re.split(r"^\d\. \*\*", FRAME, flags=re.MULTILINE)[number]
    documented = {(int(i), BUFFERS[name]) for i, name in re.findall(r"\[(\d)\]\s(\w+)", part) if name in BUFFERS}
    own = set().union(*(bindings(shader) for shader in shaders))
    assert own - {(4, "NearestFacing")} <= documented
