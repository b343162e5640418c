"""Shuts the calling process in before it meets foreign data: no network, no programs, few files, bounded memory.

What is applied, each on its own, so that a kernel without one still has the others:

- `no_new_privs` and no capabilities;
- resource limits: memory that can be written, size of a file, no core dumps;
- Landlock (Linux 5.13 and later): files outside the lists cannot be opened, no TCP, no signals to other processes;
- a seccomp filter: no sockets other than pairs, no `execve`, no namespaces, no look into other processes.

None of it needs a privilege, and none can be undone by the process. OpenGL by software, numba, usd-core, torch and
onnxruntime work inside.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib
import os
import resource
import sys
import sysconfig
import tempfile
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from services.seccomp import install_filter

PR_SET_NO_NEW_PRIVS = 38
SYS_LANDLOCK_CREATE_RULESET = 444
SYS_LANDLOCK_ADD_RULE = 445
SYS_LANDLOCK_RESTRICT_SELF = 446
LANDLOCK_VERSION = 1
LANDLOCK_TSYNC = 1 << 3
RULE_PATH_BENEATH = 1

READ_FILE, READ_DIR, TRUNCATE, IOCTL_DEV = 1 << 2, 1 << 3, 1 << 14, 1 << 15
WRITE_FILE = 1 << 1
FILE_RIGHTS = 1 | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
RIGHTS_OF_VERSION = ((1, 13), (2, 14), (3, 15), (5, 16))
"""From which version of Landlock on how many of the access rights exist."""

SYSTEM = (
    "/usr",
    "/lib",
    "/lib64",
    "/opt",
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/glvnd",
    "/etc/drirc",
    "/etc/vulkan",
    "/etc/OpenCL",
    "/etc/localtime",
    "/etc/mime.types",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    "/proc/version",
    "/proc/filesystems",
    "/proc/sys",
    "/proc/driver",
    "/proc/self",
    "/sys/bus",
    "/sys/class",
    "/sys/dev",
    "/sys/devices",
    "/sys/fs/cgroup",
    "/sys/module",
)
"""What libraries read on their own: themselves, and what machine they are on."""
DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom", "/dev/dri")
OWN_PACKAGES = ("schemas", "renderer", "labeller", "trainer", "evaluation", "stages", "services", "diaphane")
LIBRARIES = ("EGL", "GL")
"""Libraries that are looked for by name later on."""

_libc = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True, slots=True)
class SandboxReport:
    """What holds from now on.

    Attributes:
        no_new_privs: Whether no program can give the process more rights.
        seccomp: Whether sockets and programs are shut off.
        landlock: Version of Landlock that is in force; 0: files are not restricted.
        memory_bytes: Bound of memory that can be written, or None.
        missing: What could not be applied, and why; empty where all is well.
    """

    no_new_privs: bool
    seccomp: bool
    landlock: int
    memory_bytes: int | None
    missing: tuple[str, ...]


class _Ruleset(ctypes.Structure):
    _fields_ = (("fs", ctypes.c_uint64), ("net", ctypes.c_uint64), ("scoped", ctypes.c_uint64))


class _PathBeneath(ctypes.Structure):
    _pack_ = 1
    _layout_ = "ms"
    _fields_ = (("allowed", ctypes.c_uint64), ("folder", ctypes.c_int32))


def enter(
    read: Sequence[Path], write: Sequence[Path], memory_bytes: int | None = None, file_bytes: int = 64 << 30
) -> SandboxReport:
    """Shuts the process in, for good. Called once, as early as possible: threads that run already keep their files.

    Args:
        read: Files and folders, with all that is in them, that may be read.
        write: Folders in which files may be made, changed and removed; temporary files go to the first one unless
            their folder is in one already.
        memory_bytes: Bound of memory that can be written; mapped files that are only read do not count.
        file_bytes: Bound of every file that is written, bytes.

    Returns:
        What could be applied. What could not is left out: whoever needs more than that looks at the report.
    """
    missing: list[str] = []
    _prepare(write)
    _limit(memory_bytes, file_bytes, missing)
    privileges = _libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
    if not privileges:
        missing.append(f"no_new_privs: {os.strerror(ctypes.get_errno())}")
    _drop_capabilities(missing)
    version = _landlock(read, write, missing)
    reason = install_filter()
    if reason:
        missing.append(f"seccomp: {reason}")
    return SandboxReport(privileges, not reason, version, memory_bytes, tuple(missing))


def rss_bytes(pid: int) -> int:
    """Memory that a process holds now, bytes; 0 if there is no such process."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * resource.getpagesize()


def _prepare(write: Sequence[Path]) -> None:
    """Does what libraries could not do later."""
    # Modules that are found later are looked for in their package's folder, not in the folder above it.
    for name in OWN_PACKAGES:
        with suppress(ImportError):
            importlib.import_module(name)
    # Libraries are found by running `ldconfig`.
    found = {name: ctypes.util.find_library(name) for name in LIBRARIES}
    setattr(ctypes.util, "find_library", found.get)  # noqa: B010 (for a type checker it has no second type)
    given = Path(tempfile.gettempdir()).resolve()
    if write and not any(given.is_relative_to(folder.resolve()) for folder in write):
        tempfile.tempdir = os.environ["TMPDIR"] = os.environ["XDG_CACHE_HOME"] = str(write[0])
    # Without /dev/shm there are no semaphores between processes; nothing is shared here.
    warnings.filterwarnings("ignore", message="(?s).*multiprocessing lock")


def _limit(memory_bytes: int | None, file_bytes: int, missing: list[str]) -> None:
    # Address space says little: llvmpipe, torch and thread stacks reserve gigabytes that they never touch.
    bounds = {resource.RLIMIT_CORE: 0, resource.RLIMIT_FSIZE: file_bytes}
    if memory_bytes is not None:
        bounds[resource.RLIMIT_DATA] = memory_bytes
    for which, bound in bounds.items():
        _, hard = resource.getrlimit(which)
        bound = bound if hard == resource.RLIM_INFINITY else min(bound, hard)
        try:
            resource.setrlimit(which, (bound, bound))
        except (OSError, ValueError) as error:
            missing.append(f"resource limit {which}: {error}")


def _drop_capabilities(missing: list[str]) -> None:
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)  # _LINUX_CAPABILITY_VERSION_3, this thread
    nothing = (ctypes.c_uint32 * 6)()
    if _libc.capset(header, nothing) != 0:
        missing.append(f"capabilities: {os.strerror(ctypes.get_errno())}")


def _landlock(read: Sequence[Path], write: Sequence[Path], missing: list[str]) -> int:
    """Restricts files; the version of Landlock, or 0."""
    version = int(_libc.syscall(SYS_LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), LANDLOCK_VERSION))
    if version < 1:
        missing.append(f"landlock: {os.strerror(ctypes.get_errno())}")
        return 0
    everything = (1 << next(bits for first, bits in reversed(RIGHTS_OF_VERSION) if version >= first)) - 1
    handled = _Ruleset(everything, 3 if version >= 4 else 0, 3 if version >= 6 else 0)
    size = 24 if version >= 6 else 16 if version >= 4 else 8
    ruleset = int(_libc.syscall(SYS_LANDLOCK_CREATE_RULESET, ctypes.byref(handled), ctypes.c_size_t(size), 0))
    if ruleset < 0:
        missing.append(f"landlock: {os.strerror(ctypes.get_errno())}")
        return 0
    try:
        reading = everything & (READ_FILE | READ_DIR)
        for path in (*map(Path, SYSTEM), *_interpreter(), *read):
            _allow(ruleset, path, reading)
        for path in (*map(Path, DEVICES), *Path("/dev").glob("nvidia*")):
            _allow(ruleset, path, everything & (READ_FILE | READ_DIR | WRITE_FILE | IOCTL_DEV))
        for path in write:
            # All but programs (the lowest bit) and devices.
            _allow(ruleset, path, everything & ~(1 | IOCTL_DEV | 1 << 6 | 1 << 11))
        flags = LANDLOCK_TSYNC if version >= 8 else 0
        if _libc.syscall(SYS_LANDLOCK_RESTRICT_SELF, ruleset, flags) != 0:
            missing.append(f"landlock: {os.strerror(ctypes.get_errno())}")
            return 0
    finally:
        os.close(ruleset)
    if not flags and _threads() > 1:
        missing.append(f"landlock: {_threads() - 1} threads ran already and are not restricted")
    return version


def _allow(ruleset: int, path: Path, rights: int) -> None:
    """Adds a rule; a path that does not exist needs none."""
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    try:
        if not path.is_dir():
            rights &= FILE_RIGHTS
        rule = _PathBeneath(rights, handle)
        _libc.syscall(SYS_LANDLOCK_ADD_RULE, ruleset, RULE_PATH_BENEATH, ctypes.byref(rule), 0)
    finally:
        os.close(handle)


def _interpreter() -> Iterator[Path]:
    """Where Python, its packages and this project's code lie."""
    yield from {Path(folder) for folder in (sys.prefix, sys.base_prefix, *sysconfig.get_paths().values())}
    for name in OWN_PACKAGES:
        if name in sys.modules:
            yield from (Path(folder) for folder in sys.modules[name].__path__)
    # What an installation that can be edited says of its version.
    yield from Path(__file__).resolve().parents[1].glob("*.egg-info")
    yield from (Path(entry) for entry in sys.path if "site-packages" in entry or "dist-packages" in entry)


def _threads() -> int:
    try:
        return len(list(Path("/proc/self/task").iterdir()))
    except OSError:
        return threading.active_count()
