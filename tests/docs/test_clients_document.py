"""docs/CLIENTS.md against the shaders: files, numbers and bindings are theirs, and its defines are all they need."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from support.training import random_weights

from renderer.allocation.gpu import BLOCK, DEFINES, STATE
from renderer.features import TEXELS
from renderer.programs import SHADERS, Defines, expand
from renderer.tile_range import STEPS
from schemas.tail import BIN_CONSTANTS, MAX_EXPONENT, MOST_OPACITY, TAILS, TailKind, TailName
from trainer.export_shader import shader_source

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = (ROOT / "docs" / "CLIENTS.md").read_text(encoding="utf-8")
FRAME = DOCUMENT.split("## The frame")[1].split("## What to skip")[0]

ALLOCATION = ("BLOCK", "RANKS", "FULL", "MOST_CORE")
PRICES = tuple(name for name in DEFINES if name not in ALLOCATION)
KINDS = {f"TAIL_{kind.name}": int(kind) for kind in TailKind}
CONSTANTS: Defines = {
    **{name: DEFINES[name] for name in (*ALLOCATION, *PRICES)},
    **BIN_CONSTANTS,
    **KINDS,
    **{"TAIL": int(TailKind.BINNED), "MAX_EXPONENT": MAX_EXPONENT, "TEXELS": TEXELS, "DEPTH_UNIT": MOST_OPACITY},
}
"""What the document says in numbers."""
BINS = ("TAIL", *KINDS, *BIN_CONSTANTS)
BINNED = [name for name, tail in TAILS.items() if tail.bins]

SURFACE: Defines = {"TEXTURED": 0, "MIXED": 1, "WRAPPED": 0, "MORE_UVS": 0, "EMISSIVE": 0, "GLASS": 0}
"""Of the renderer's own surfaces, which a client replaces; `MIXED` is the document's."""

IMPORTANCES = random_weights(1, head="importance")
NETWORKS = {0: IMPORTANCES} | {TAILS[name].bins: random_weights(1, tail=name) for name in BINNED}
"""Of a tail's bins; 0: of a shader without."""


def row(name: TailName) -> Defines:
    """What the document's table says of a tail."""
    cells = re.search(rf"^\| `{name}`[^|]*\|(.*)\|$", DOCUMENT, flags=re.MULTILINE)
    assert cells is not None
    numbers = [int(cell) for cell in re.findall(r"\d+", cells[1])]
    tail = TAILS[name]
    assert numbers[3:] == [tail.gathered_bytes, tail.kept_bytes]
    return dict(zip(("BINS", "SHARE_LEVELS", "MEAN_LEVELS"), numbers, strict=False))


# Shader -> constants, and defines that have no one value.
COMPILED: list[tuple[str, tuple[str, ...], Defines]] = [
    ("range/range.frag", (), {"STEPS": 2}),
    ("range/fill.comp", (), {}),
    ("common/weighted_mean.frag", ("DEPTH_UNIT",), {}),
]
for _name in BINNED:
    _row, _inputs = {**row(_name), "LUMA": 0}, ("TEXELS", *BINS, *ALLOCATION, *PRICES)
    _row["PIXEL_WORDS"], _gains = _row["BINS"], TAILS[_name].bins + 1
    _luma = {**_row, "LUMA": 1, "PIXEL_WORDS": int(_row["BINS"]) + 1}
    COMPILED += [
        ("gather/bins.frag", BINS, _row),
        ("gather/bins.frag", BINS, _luma),
        ("gather/pack.comp", BINS, _row),
        ("binned/tail.frag", (*BINS, "MAX_EXPONENT"), _row),
        ("kbuffer-deep/prices.comp", _inputs, {**_luma, "OUTPUTS": _gains}),
        ("kbuffer-deep/prices.comp", _inputs, {**_row, "OUTPUTS": 1}),
        ("kbuffer-deep/predict.comp", _inputs, {**_luma, "OUTPUTS": _gains, "FEATURES_ONLY": 0}),
        *(
            (file, (*BINS, "MAX_EXPONENT"), {**_luma, "IN_WORDS": pool, **runs})
            for file, runs in (("kbuffer-deep/capture.frag", {}), ("kbuffer/resolve.frag", {"RUNS": 1}))
            for pool in (0, 1)
        ),
    ]
COMPILED += [("kbuffer-deep/sort.comp", BINS, {**_luma, "IN_WORDS": pool}) for pool in (0, 1)]
COMPILED += [
    (f"allocation/{name}.comp", (*BINS, *ALLOCATION), _luma)
    for name in ("totals", "complete", "count", "choose", "blocks", "scan", "place")
]


@pytest.mark.parametrize("name", BINNED)
def test_tails_are_those_of_the_table(name: TailName) -> None:
    assert row(name).items() <= TAILS[name].defines.items()


def said() -> dict[str, set[float]]:
    """Defines that the document gives numbers, in whatever place."""
    found: dict[str, set[float]] = {}
    for name, value in re.findall(r"`([A-Z_]+)\s+(-?[\d.]+(?:e-?\d+)?)`", DOCUMENT):
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
        network = IMPORTANCES if defines.get("OUTPUTS") == 1 else NETWORKS[defines.get("BINS", 0)]
        file = tmp_path / f"{number}{Path(name).suffix}"
        file.write_text(expand(name, {**surface, **defines}, {"bundle/predict.glsl": shader_source(network)}))
        files.append(file)
    done = subprocess.run(["glslangValidator", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:]


def test_the_state_is_as_large_as_it_says() -> None:
    assert f"{STATE.itemsize:,} bytes" in DOCUMENT
    assert f"ceil(P / {BLOCK})" in DOCUMENT
    assert f"`STEPS {STEPS}`" in DOCUMENT


BUFFERS = {
    "found": {"TileRange", "Found"}, "ranges": {"TileRange"}, "bins": {"Words"}, "State": {"State"},
    "Blocks": {"Blocks"}, "Pool": {"Pool"},
    "the": {"Pixels"}, "answers": {"Answers", "Features"},
}  # fmt: skip
"""What the document binds -> the names of its block in the shaders."""


def bindings(shader: str) -> set[tuple[int, str]]:
    text = (SHADERS / shader).read_text(encoding="utf-8")
    return {(int(i), name) for i, name in re.findall(r"binding = (\d+)\)[\w\s]*?buffer (\w+)", text)}


@pytest.mark.parametrize(
    ("number", "shaders"),
    [
        (2, ["range/range.frag", "range/fill.comp"]),
        (3, ["gather/bins.frag", "gather/pack.comp", "common/bin_words.glsl", "common/tile_range.glsl"]),
        (4, ["common/bin_words.glsl", "common/tile_range.glsl"]),
        (5, ["allocation/state.glsl", "allocation/bins.glsl", "common/bin_words.glsl"]),
        (5, ["kbuffer-deep/inputs.glsl", "kbuffer-deep/prices.comp", "common/tile_range.glsl"]),
        (5, ["allocation/count.comp", "allocation/blocks.comp", "allocation/scan.comp", "allocation/place.comp"]),
        (7, ["kbuffer-deep/capture.frag", "common/bin_words.glsl", "common/pool.glsl", "common/tile_range.glsl"]),
        (8, ["kbuffer-deep/sort.comp", "common/bin_words.glsl", "common/pool.glsl"]),
        (9, ["common/bin_words.glsl", "common/pool.glsl"]),  # of kbuffer/resolve.frag, with RUNS
        (9, ["kbuffer-deep/predict.comp", "common/bin_words.glsl", "common/tile_range.glsl"]),
    ],
)
def test_bindings_are_those_of_the_shaders(number: int, shaders: list[str]) -> None:
    part = re.split(r"^\d\. \*\*", FRAME, flags=re.MULTILINE)[number]
    documented = {
        (int(i), block) for i, name in re.findall(r"\[(\d)\]\s(\w+)", part) for block in BUFFERS.get(name, set())
    } | {(7, "TileRange") for _ in re.findall(r"\[7\] and the texture as there", part)}
    own = set().union(*(bindings(shader) for shader in shaders))
    assert own <= documented
