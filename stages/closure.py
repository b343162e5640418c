"""What decides the result of a module: itself, whatever it imports of this project, and the files that those load.

Rules:
- imports count wherever they stand, in functions too; those under `if TYPE_CHECKING` are not run and do not count;
- a module counts with the packages that it lies in, because importing it runs them;
- a name that a package imports when it is first asked for (`__getattr__`) counts as all that the package so imports;
- a folder beside a module that it names with `Path(__file__)` counts: the files in it, and those of its folders that
  one of the modules names (`"folder/file"`; in the same package also `"folder"`) or one of the files includes.

Imports are found by their lines, in a tenth of the time of a parser; the tests compare the two over the whole project.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Final

from evaluation.versions import ROOT

PACKAGES: Final = ("schemas", "renderer", "labeller", "trainer", "evaluation", "stages", "services")

_OWN = rf"(?:{'|'.join(PACKAGES)})(?:\.\w+)*"
_NOT_RUN = re.compile(r"^([ \t]*)if TYPE_CHECKING:\n(?:\1[ \t]+.*\n|[ \t]*\n)*", re.MULTILINE)
_FROM = re.compile(rf"from ({_OWN}) import (\([^)]*\)|[^\n]*)")
_IMPORT = re.compile(rf"import ({_OWN})\b")
_COMMENT = re.compile(r"#[^\n]*")
_TAKEN = re.compile(r"(\w+)(?:\s+as\s+\w+)?")
_LATE = re.compile(rf'"({_OWN})"')
_LOADED = re.compile(r'__file__\)(?:\.resolve\(\))?((?:\.parent)+) / "([\w-]+)"')
_ALONE = re.compile(r'"([\w-]+)"')
_WITH_FILE = re.compile(r'"([\w-]+)/')


class Tree:
    """The sources of the project as they are when they are first read.

    Args:
        root: The folder that the packages lie in.
    """

    def __init__(self, root: Path = ROOT) -> None:
        self._root = root
        self._content: dict[Path, bytes] = {}
        self._files = dict(self._found())
        self.imports: Callable[[str], frozenset[str]] = cache(self._imports)
        self._text = cache(self._decoded)
        self._digest = cache(self._hashed)
        self._named = cache(self._quoted)

    def modules(self, *names: str) -> frozenset[str]:
        """Dotted names of modules and of all that they import of the project, themselves included."""
        seen: set[str] = set()
        ahead = [package for name in names for package in _with_packages(name)]
        while ahead:
            name = ahead.pop()
            if name not in seen:
                seen.add(name)
                ahead += self.imports(name)
        return frozenset(seen)

    def files(self, *names: str) -> list[Path]:
        """Every file that decides the result of modules, in order."""
        modules = self.modules(*names)
        paths = [self._files[name] for name in modules if name in self._files]
        return sorted({*paths, *self._loaded(paths)})

    def version(self, *names: str) -> str:
        """Hex sha256 over the files that decide the result of modules: a change of any is another version.

        Args:
            names: Dotted names of modules.

        Raises:
            FileNotFoundError: There is no such module.
        """
        for name in names:
            if name not in self._files:
                raise FileNotFoundError(f"no module {name} in {self._root}")
        digest = hashlib.sha256()
        for path in self.files(*names):
            digest.update(self._digest(path))
        return digest.hexdigest()

    def _found(self) -> Iterator[tuple[str, Path]]:
        """Dotted names of all modules, and their files."""
        for package in PACKAGES:
            for folder, _, names in os.walk(self._root / package):
                dotted = os.path.relpath(folder, self._root).replace(os.sep, ".")
                for name in names:
                    if name.endswith(".py"):
                        module = dotted if name == "__init__.py" else f"{dotted}.{name[:-3]}"
                        yield module, Path(folder, name)

    def _bytes(self, path: Path) -> bytes:
        if path not in self._content:
            self._content[path] = path.read_bytes()
        return self._content[path]

    def _decoded(self, path: Path) -> str:
        return self._bytes(path).decode("utf-8", errors="replace")

    def _hashed(self, path: Path) -> bytes:
        content = self._bytes(path)
        return hashlib.sha256(f"{path.relative_to(self._root).as_posix()}\0".encode() + content).digest()

    def _quoted(self, path: Path) -> tuple[list[str], list[str]]:
        """Names in a text that could be folders: those that a file follows, and those that stand alone."""
        return _WITH_FILE.findall(self._text(path)), _ALONE.findall(self._text(path))

    def _imports(self, name: str) -> frozenset[str]:
        path = self._files.get(name)
        if path is None:  # a folder without code
            return frozenset()
        text = _run(self._text(path))
        found: set[str] = set(_IMPORT.findall(text))
        for module, taken in _taken(text):
            found.add(module)
            for each in taken:
                inner = f"{module}.{each}"
                found.update([inner] if inner in self._files else self._late(module, each))
        return frozenset(package for each in found for package in _with_packages(each))

    def _late(self, package: str, name: str) -> Iterable[str]:
        """What a package imports when a name is first taken from it; nothing, if it has the name from the beginning."""
        path = self._files.get(package)
        text = "" if path is None else self._text(path)
        if "def __getattr__" not in text:
            return ()
        at_once = {each for _, taken in _taken(_run(text)) for each in taken}
        return () if name in at_once else _LATE.findall(text)

    def _beside(self, path: Path) -> list[Path]:
        """Folders that a module names with `Path(__file__)`."""
        text = self._text(path)
        found = _LOADED.findall(text) if "__file__" in text else ()
        folders = (path.parents[steps.count(".parent") - 1] / name for steps, name in found)
        return [folder for folder in folders if folder.is_dir()]

    def _loaded(self, modules: Iterable[Path]) -> Iterator[Path]:
        """The files that modules load beside themselves: shaders and templates."""
        paths = list(modules)
        folders = {folder for path in paths for folder in self._beside(path)}
        for folder in folders:
            package = str(self._root / folder.relative_to(self._root).parts[0])
            named = {name for path in paths for name in self._named(path)[0]}
            named.update(name for path in paths if str(path).startswith(package) for name in self._named(path)[1])
            inner = {path.name: path for path in folder.iterdir() if path.is_dir() and path.name != "__pycache__"}
            files = [path for path in folder.iterdir() if path.is_file()]
            ahead = sorted(named & inner.keys())
            while ahead or files:
                while files:
                    path = files.pop()
                    yield path
                    ahead += [name for name in self._named(path)[0] if name in inner]
                while ahead:
                    taken = inner.pop(ahead.pop(), None)
                    files += [] if taken is None else [path for path in taken.rglob("*") if path.is_file()]


def _with_packages(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:end]) for end in range(1, len(parts) + 1)]


def _taken(text: str) -> Iterator[tuple[str, list[str]]]:
    """Module and names of every `from module import names`."""
    for module, names in _FROM.findall(text):
        yield module, _TAKEN.findall(_COMMENT.sub("", names))


def _run(text: str) -> str:
    """A module without what only type checkers read."""
    return _NOT_RUN.sub("", text) if "if TYPE_CHECKING" in text else text
