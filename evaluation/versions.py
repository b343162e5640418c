"""Which code, which libraries and which machine a result came from."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from functools import lru_cache
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""The folder that the packages lie in."""

LIBRARIES = ("numpy", "numba", "moderngl", "usd-core", "torch", "onnx", "onnxruntime", "safetensors")


@lru_cache(maxsize=256)
def code_version(*sources: str) -> str:
    """Hex sha256 over the bytes of a stage's sources: any change of them is another version.

    Args:
        sources: Dotted names of modules, or of packages (then everything in them but caches: shaders, templates too).

    Raises:
        FileNotFoundError: There is no such module or package.
    """
    digest = hashlib.sha256()
    for source in sorted(set(sources)):
        for path in _files(source):
            content = path.read_bytes()
            digest.update(f"{path.relative_to(ROOT).as_posix()}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()


def _files(source: str) -> list[Path]:
    path = ROOT.joinpath(*source.split("."))
    if path.is_dir():
        return sorted(p for p in path.rglob("*") if p.is_file() and "__pycache__" not in p.parts)
    module = path.with_suffix(".py")
    if not module.is_file():
        raise FileNotFoundError(f"no module or package {source} in {ROOT}")
    return [module]


def diaphane_version() -> str:
    """The installed version of Diaphane; '0' where it runs from a folder without installation."""
    try:
        return metadata.version("diaphane")
    except metadata.PackageNotFoundError:
        return "0"


def library_versions() -> dict[str, str]:
    """Versions of Python and of the installed libraries that can change a result."""
    versions = {"python": platform.python_version(), "diaphane": diaphane_version()}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


@lru_cache(maxsize=1)
def commit() -> str | None:
    """The commit that the sources are at, with `-dirty` if they were changed since; None where it is not known.

    Pages and results of benchmarks are no sources: a benchmark that writes them goes on with the same commit.
    """
    if not (ROOT / ".git").exists():  # installed, perhaps within the folder of something else
        return None
    try:
        head = _git("rev-parse", "HEAD").strip()
        changed = _git("status", "--porcelain", "--untracked-files=no", "--", ".", *_WRITTEN)
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{head}-dirty" if changed else head


_WRITTEN = (":(exclude)benchmarks/*.md", ":(exclude)benchmarks/results")


def _git(*arguments: str) -> str:
    run = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True, timeout=30)
    return run.stdout


def machine() -> dict[str, str]:
    """Processor, cores, memory and operating system, for tables of measurements."""
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return {
        "processor": _processor(),
        "cores": str(len(os.sched_getaffinity(0))),
        "memory": f"{pages / 2**30:.0f} GiB",
        "system": f"{platform.system()} {platform.release()}",
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
