"""A shader's text, changed so that it tallies what it reads and writes; its result is the same to the bit.

Every access in the source is counted where it is evaluated: an index `a[i]` becomes `a[(tally_load(4u), i)]`, and the
sums of an invocation are added to a buffer when it ends. So a count is right whatever a shader's loops and conditions
depend on, and there is nothing to declare that could be wrong. Counted are storage buffers, images, and `texelFetch`
of the frame's own textures; not shared memory, uniforms, vertices or the textures of surfaces.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

BINDING: Final = 8
"""Storage binding of the tallies; passes use those below."""
INVOCATIONS, SURVIVORS, LOADED, STORED, ATOMICS, ATOMIC_BYTES, FETCHES = range(7)
"""Tallies of a program; from the last on there is one for each sampler."""
SAMPLERS: Final = 8
TALLIES: Final = FETCHES + SAMPLERS

_SIZES = {"uint": 4, "int": 4, "float": 4, "bool": 4, "uint64_t": 8, "double": 8, "void": 0} | {
    f"{kind}vec{size}": 4 * size for kind in ("", "u", "i", "b") for size in (2, 3, 4)
}
_IMAGE_BYTES = {
    **{"rgba32f": 16, "rgba32ui": 16, "rgba16": 8, "rgba16f": 8, "rg32f": 8, "rg32ui": 8, "rgba8": 4, "rg16": 4},
    **{"rg16f": 4, "r32ui": 4, "r32i": 4, "r32f": 4, "r16": 2, "r16f": 2, "r8": 1},
}
_TOKEN = re.compile(
    r"(?P<line>^[ \t]*#(?:[^\n]*\\\n)*[^\n]*)|(?P<space>\s+)|(?P<name>[A-Za-z_]\w*)|(?P<number>\d[\w.]*)"
    r"|(?P<sign><<=|>>=|\+\+|--|[-+*/%&|^]=|==|!=|<=|>=|<<|>>|&&|\|\||.)",
    re.MULTILINE,
)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_BLOCK = re.compile(r"\bbuffer\s+\w+\s*\{([^}]*)\}\s*(\w*)\s*;")
_MEMBER = re.compile(r"(\w+)\s+(\w+)\s*(\[[^\]]*\])?\s*;")
_STRUCT = re.compile(r"\bstruct\s+(\w+)\s*\{([^}]*)\}")
_SAMPLER = re.compile(r"\buniform\s+[ui]?sampler\w+\s+(\w+)")
_IMAGE = re.compile(r"layout\(\s*(\w+)\s*[,)][^;]*\buniform\s+[ui]?image\w+\s+(\w+)")
_EXTENSION = re.compile(r"^\s*#extension[^\n]*\n", re.MULTILINE)
_VERSION = re.compile(r"^#version[^\n]*\n")
_CHANGING = {"+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>=", "++", "--"}
_OPENING, _CLOSING = {"(", "[", "{"}, {")", "]", "}"}

_COUNTERS: dict[str, tuple[int, str]] = {
    "tally_load": (LOADED, "uint bytes"),
    "tally_store": (STORED, "uint bytes"),
    "tally_atomic": (ATOMICS, "uint bytes"),
    **{f"tally_fetch_{i}": (FETCHES + i, "") for i in range(SAMPLERS)},
}
"""Function that counts an access -> its tally, and what it is given."""


class UncountedError(ValueError):
    """A shader has an access that cannot be counted as it is written."""


@dataclass(frozen=True, slots=True)
class TalliedText:
    """A shader that tallies.

    Attributes:
        text: GLSL.
        samplers: Whose fetches are counted, in the order of their tallies.
    """

    text: str
    samplers: tuple[str, ...]


@dataclass(slots=True)
class _Names:
    """What a shader declares."""

    members: dict[str, str] = field(default_factory=dict)  # of buffers -> type
    arrays: set[str] = field(default_factory=set)
    structs: dict[str, dict[str, str]] = field(default_factory=dict)
    samplers: list[str] = field(default_factory=list)
    images: dict[str, int] = field(default_factory=dict)

    def bytes_of(self, kind: str) -> int:
        """Of a type."""
        if kind in self.structs:
            return sum(self.bytes_of(part) for part in self.structs[kind].values())
        return _SIZES[kind]

    def is_type(self, word: str) -> bool:
        """Whether a word declares what follows it."""
        return word in _SIZES or word in self.structs


def tallied(text: str, *, is_fragment: bool) -> TalliedText:
    """A shader's text that adds its tallies to row `tally_row`, a uniform, of the buffer at `BINDING`.

    Args:
        text: GLSL with its includes resolved.
        is_fragment: Whether it is a fragment shader: helper invocations tally nothing.

    Raises:
        UncountedError: An access is written in a way that this does not know.
    """
    plain = _COMMENT.sub(" ", text)
    names = _names(plain)
    body = _Rewriter(plain, names).rewritten()
    begin = max([found.end() for pattern in (_VERSION, _EXTENSION) for found in pattern.finditer(body)], default=0)
    prelude, main = _prelude(body), _main(is_fragment)
    return TalliedText(f"{body[:begin]}{prelude}{body[begin:]}{main}", tuple(names.samplers))


def _prelude(body: str) -> str:
    """What counts, and what adds it to the program's row; only what the body asks for, since compilers take time."""
    lines = [f"layout(std430, binding = {BINDING}) buffer Tallies {{ uint tallies[]; }};", "uniform uint tally_row;"]
    adds = [f"tally_add({INVOCATIONS}u, 1u);", f"tally_add({SURVIVORS}u, survives);"]
    used = [name for name in _COUNTERS if re.search(rf"\b{name}\(", body)]
    if "tally_change(" in body:
        used = [*dict.fromkeys([*used, "tally_load", "tally_store"])]
    for name in used:
        tally, given = _COUNTERS[name]
        changes = [(tally, "bytes" if given else "1u")]
        if name == "tally_atomic":
            changes = [(ATOMICS, "1u"), (ATOMIC_BYTES, "bytes")]
        lines += [f"uint tally_{which} = 0u;" for which, _ in changes]
        summed = " ".join(f"tally_{which} += {amount};" for which, amount in changes)
        lines.append(f"uint {name}({given}) {{ {summed} return 0u; }}")
        adds += [f"tally_add({which}u, tally_{which});" for which, _ in changes]
    if "tally_change(" in body:
        lines.append("uint tally_change(uint bytes) { return tally_load(bytes) + tally_store(bytes); }")
    return "\n".join(
        [
            *lines,
            "void tally_add(uint which, uint amount) {",
            "    if (amount == 0u) return;",
            f"    uint at = 2u * (tally_row * {TALLIES}u + which);",
            "    uint before = atomicAdd(tallies[at], amount);",
            "    if (before + amount < before) atomicAdd(tallies[at + 1u], 1u);",
            "}",
            f"void tally_end(uint survives) {{ {' '.join(adds)} }}",
            "",
        ]
    )


def _main(is_fragment: bool) -> str:
    condition = "if (!gl_HelperInvocation) " if is_fragment else ""
    return f"\nvoid main() {{\n    tallied_main();\n    {condition}tally_end(1u);\n}}\n"


def _names(text: str) -> _Names:
    names = _Names()
    for struct in _STRUCT.finditer(text):
        parts: dict[str, str] = {}
        for part in filter(None, (part.strip() for part in struct[2].split(";"))):
            kind, _, listed = part.partition(" ")
            parts |= {name.strip(): kind for name in listed.split(",")}
        names.structs[struct[1]] = parts
    for block in _BLOCK.finditer(text):
        if block[2]:
            raise UncountedError(f"the buffer block {block[2]} has a name of its own")
        for kind, name, is_array in _MEMBER.findall(block[1]):
            if names.members.setdefault(name, kind) != kind:
                raise UncountedError(f"the buffers' {name} has two types")
            if is_array:
                names.arrays.add(name)
    fetched = {name for name in _SAMPLER.findall(text) if re.search(rf"\btexelFetch\s*\(\s*{name}\b", text)}
    names.samplers = list(dict.fromkeys(name for name in _SAMPLER.findall(text) if name in fetched))
    if len(names.samplers) > SAMPLERS:
        raise UncountedError(f"more than {SAMPLERS} samplers are read")
    names.images = {name: _IMAGE_BYTES[kind] for kind, name in _IMAGE.findall(text)}
    return names


class _Rewriter:
    """Puts tallies into the bodies of a shader's functions."""

    def __init__(self, text: str, names: _Names) -> None:
        self._names = names
        self._tokens = [found[0] for found in _TOKEN.finditer(text)]
        kinds = [found.lastgroup for found in _TOKEN.finditer(text)]
        self._told = [i for i, kind in enumerate(kinds) if kind not in ("space", "line")]
        self._words = [self._tokens[i] for i in self._told]
        self._is_name = [kinds[i] == "name" for i in self._told]
        self._before: dict[int, list[str]] = {}
        self._after: dict[int, list[str]] = {}

    def rewritten(self) -> str:
        """The text with tallies."""
        for first, begin, end in self._functions():
            shadowed = self._declared(first, end)
            if self._words[first - 1] == "main":
                self._tokens[self._told[first - 1]] = "tallied_main"
            for at in range(begin, end):
                self._visit(at, shadowed)
        out = []
        for place, token in enumerate(self._tokens):
            out += [*self._before.get(place, ()), token, *self._after.get(place, ())]
        return "".join(out)

    def _functions(self) -> Iterator[tuple[int, int, int]]:
        """Where parameters, body, and the end of each function lie."""
        at = 0
        while at < len(self._words):
            if self._words[at] != "{":
                at += 1
                continue
            end = self._closing(at)
            if at and self._words[at - 1] == ")":
                yield self._opening(at - 1), at, end
            at = end + 1

    def _visit(self, at: int, shadowed: set[str]) -> None:
        word = self._words[at]
        if word == "discard":
            self._put(self._before, at, "{ tally_end(0u); ")
            self._put(self._after, at + 1, " }")
        elif word in ("texelFetch", "imageLoad", "imageStore"):
            self._count_texel(at)
        elif self._is_name[at] and word in self._names.members and word not in shadowed and self._words[at - 1] != ".":
            self._count_access(at)

    def _count_texel(self, at: int) -> None:
        call, name = self._words[at], self._words[at + 2]
        if call == "texelFetch":
            if name not in self._names.samplers:
                raise UncountedError(f"texelFetch of {name}, which is no uniform")
            tally = f"tally_fetch_{self._names.samplers.index(name)}()"
        else:
            what = "load" if call == "imageLoad" else "store"
            tally = f"tally_{what}({self._names.images[name]}u)"
        self._wrap(self._next_comma(at + 2) + 1, tally)

    def _count_access(self, at: int) -> None:
        name = self._words[at]
        kind, end = self._names.members[name], at
        if name in self._names.arrays:
            if self._words[at + 1] != "[":
                raise UncountedError(f"{name} is not read by an index")
            end = self._closing(at + 1)
        size, end = self._part(kind, end)
        tally = self._tally(at, end, size)
        if name in self._names.arrays:
            self._put(self._after, at + 1, f"({tally}, ")
            self._put(self._before, self._closing(at + 1), ")")
        elif tally.startswith("tally_load"):
            self._put(self._before, at, f"({tally}, ")
            self._put(self._after, end, ")")
        else:  # what is given is evaluated once, as the access is
            self._wrap(end + 2, tally)

    def _part(self, kind: str, end: int) -> tuple[int, int]:
        """Bytes of an access with the members that follow it, and where it ends."""
        while end + 1 < len(self._words) and self._words[end + 1] == ".":
            part, end = self._words[end + 2], end + 2
            if kind not in self._names.structs:
                return 4 * len(part), end
            kind = self._names.structs[kind][part]
        return self._names.bytes_of(kind), end

    def _tally(self, at: int, end: int, size: int) -> str:
        follows = self._words[end + 1]
        if self._words[at - 1] == "(" and self._words[at - 2].startswith("atomic"):
            return f"tally_atomic({size}u)"
        if follows in _CHANGING or self._words[at - 1] in ("++", "--"):
            if self._words[at] not in self._names.arrays and follows != "=":
                raise UncountedError(f"{self._words[at]} is changed in place")
            return f"tally_change({size}u)"
        return f"tally_store({size}u)" if follows == "=" else f"tally_load({size}u)"

    def _wrap(self, first: int, tally: str) -> None:
        """Count where the expression that begins here is evaluated."""
        end, depth = first, 0
        while depth > 0 or self._words[end] not in (",", ")", ";"):
            depth += (self._words[end] in _OPENING) - (self._words[end] in _CLOSING)
            end += 1
        self._put(self._before, first, f"({tally}, ")
        self._put(self._after, end - 1, ")")

    def _next_comma(self, at: int) -> int:
        depth = 0
        while depth > 0 or self._words[at] != ",":
            depth += (self._words[at] in _OPENING) - (self._words[at] in _CLOSING)
            at += 1
        return at

    def _declared(self, first: int, end: int) -> set[str]:
        """Names of a function's parameters and variables."""
        found = set()
        for at in range(first, end):
            if not (self._names.is_type(self._words[at]) and self._is_name[at + 1]):
                continue
            found.add(self._words[at + 1])
            depth, next_ = 0, at + 2
            while depth >= 0 and (depth > 0 or self._words[next_] != ";"):
                word = self._words[next_]
                depth += (word in _OPENING) - (word in _CLOSING)
                if depth == 0 and word == "," and not self._names.is_type(self._words[next_ + 1]):
                    found.add(self._words[next_ + 1])
                next_ += 1
        return found

    def _closing(self, at: int) -> int:
        depth = 0
        while True:
            depth += (self._words[at] in _OPENING) - (self._words[at] in _CLOSING)
            if depth == 0:
                return at
            at += 1

    def _opening(self, at: int) -> int:
        depth = 0
        while True:
            depth += (self._words[at] in _CLOSING) - (self._words[at] in _OPENING)
            if depth == 0:
                return at
            at -= 1

    def _put(self, places: dict[int, list[str]], at: int, text: str) -> None:
        places.setdefault(self._told[at], []).append(text)
