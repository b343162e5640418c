"""The system calls that a sandboxed process may not make, as a classic BPF program."""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct

PR_SET_SECCOMP = 22
SECCOMP_MODE_FILTER = 2
SECCOMP_SET_MODE_FILTER = 1
SECCOMP_FILTER_FLAG_TSYNC = 1

ALLOW = 0x7FFF0000
KILL_PROCESS = 0x80000000
REFUSE = 0x00050000
"""Low 16 bits: the error number that the call answers."""

LOAD, JUMP_EQUAL, JUMP_GREATER_EQUAL, JUMP_ANY_BIT, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
OFFSET_NUMBER, OFFSET_ARCHITECTURE, OFFSET_ARGUMENT = 0, 4, 16

NEW_NAMESPACES = 0x7E020080
"""Flags of `clone`: any new namespace."""
TIOCSTI, TIOCLINUX = 0x5412, 0x541C
"""Requests of `ioctl` that type into the terminal."""

ARCHITECTURES = {"x86_64": (0xC000003E, 0), "aarch64": (0xC00000B7, 1)}
"""Audit number and column of the table below."""

CALLS: dict[str, tuple[int | None, int | None]] = {
    # No network: pairs of sockets remain, and what was inherited.
    "socket": (41, 198),
    "connect": (42, 203),
    "accept": (43, 202),
    "accept4": (288, 242),
    "bind": (49, 200),
    "listen": (50, 201),
    # No programs.
    "execve": (59, 221),
    "execveat": (322, 281),
    # Rings make calls that no filter sees.
    "io_uring_setup": (425, 425),
    "io_uring_enter": (426, 426),
    "io_uring_register": (427, 427),
    # No other process.
    "ptrace": (101, 117),
    "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271),
    "process_madvise": (440, 440),
    "kcmp": (312, 272),
    "pidfd_open": (434, 434),
    "pidfd_getfd": (438, 438),
    "pidfd_send_signal": (424, 424),
    "tkill": (200, 130),
    "rt_sigqueueinfo": (129, 138),
    "rt_tgsigqueueinfo": (297, 240),
    # No other view of the machine.
    "unshare": (272, 97),
    "setns": (308, 268),
    "chroot": (161, 51),
    "pivot_root": (155, 41),
    "mount": (165, 40),
    "umount2": (166, 39),
    "open_tree": (428, 428),
    "move_mount": (429, 429),
    "fsopen": (430, 430),
    "fsconfig": (431, 431),
    "fsmount": (432, 432),
    "fspick": (433, 433),
    "mount_setattr": (442, 442),
    "name_to_handle_at": (303, 264),
    "open_by_handle_at": (304, 265),
    "mknod": (133, None),
    "mknodat": (259, 33),
    # Parts of the kernel that nothing here needs.
    "bpf": (321, 280),
    "perf_event_open": (298, 241),
    "userfaultfd": (323, 282),
    "add_key": (248, 217),
    "request_key": (249, 218),
    "keyctl": (250, 219),
    "personality": (135, 92),
    "kexec_load": (246, 104),
    "kexec_file_load": (320, 294),
    "init_module": (175, 105),
    "finit_module": (313, 273),
    "delete_module": (176, 106),
    "reboot": (169, 142),
    "swapon": (167, 224),
    "swapoff": (168, 225),
    "acct": (163, 89),
    "quotactl": (179, 60),
    "vmsplice": (278, 75),
    "ioperm": (173, None),
    "iopl": (172, None),
    "modify_ldt": (154, None),
}
"""Calls that are refused whatever their arguments: numbers on x86-64 and on 64-bit ARM."""

CLONE, CLONE3, IOCTL, KILL, TGKILL, PRLIMIT = (56, 220), (435, 435), (16, 29), (62, 129), (234, 131), (302, 261)


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("code", ctypes.c_char_p))


def install_filter() -> str:
    """Refuses the calls in all threads of the process from now on; why it could not, or nothing."""
    machine = platform.machine()
    if machine not in ARCHITECTURES:
        return f"no table of system calls for {machine}"
    architecture, column = ARCHITECTURES[machine]
    code = b"".join(_program(architecture, column))
    program = _Program(len(code) // 8, code)
    libc = ctypes.CDLL(None, use_errno=True)
    seccomp = 317 if column == 0 else 277
    done = libc.syscall(seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, ctypes.byref(program))
    if done != 0:
        return os.strerror(ctypes.get_errno()) if done < 0 else "a thread has another filter"
    return ""


def _program(architecture: int, column: int) -> list[bytes]:
    code = [
        _load(OFFSET_ARCHITECTURE),
        _jump(JUMP_EQUAL, architecture, 1, 0),
        _return(KILL_PROCESS),
        _load(OFFSET_NUMBER),
    ]
    if column == 0:
        # The 32-bit pointer ABI has the same architecture and other numbers.
        code += [_jump(JUMP_GREATER_EQUAL, 0x40000000, 0, 1), _return(REFUSE | errno.ENOSYS)]
    for numbers in CALLS.values():
        number = numbers[column]
        if number is not None:
            code += [_jump(JUMP_EQUAL, number, 0, 1), _return(REFUSE | errno.EPERM)]
    # The C library then takes `clone`, whose flags can be seen.
    code += [_jump(JUMP_EQUAL, CLONE3[column], 0, 1), _return(REFUSE | errno.ENOSYS)]
    code += _unless(CLONE[column], 0, JUMP_ANY_BIT, NEW_NAMESPACES, refuse_if=True)
    code += _unless(IOCTL[column], 1, JUMP_EQUAL, TIOCSTI, refuse_if=True)
    code += _unless(IOCTL[column], 1, JUMP_EQUAL, TIOCLINUX, refuse_if=True)
    # Signals to itself only, so that `abort` works; limits of itself only.
    code += _unless(KILL[column], 0, JUMP_EQUAL, os.getpid(), refuse_if=False)
    code += _unless(TGKILL[column], 0, JUMP_EQUAL, os.getpid(), refuse_if=False)
    code += _unless(PRLIMIT[column], 0, JUMP_EQUAL, 0, refuse_if=False)
    return [*code, _return(ALLOW)]


def _unless(number: int, argument: int, test: int, value: int, *, refuse_if: bool) -> list[bytes]:
    """Refuses a call if the test of the low half of an argument says `refuse_if`."""
    return [
        _jump(JUMP_EQUAL, number, 0, 4),
        _load(OFFSET_ARGUMENT + 8 * argument),
        _jump(test, value, *((0, 1) if refuse_if else (1, 0))),
        _return(REFUSE | errno.EPERM),
        _load(OFFSET_NUMBER),
    ]


def _load(offset: int) -> bytes:
    return struct.pack("=HBBI", LOAD, 0, 0, offset)


def _jump(test: int, value: int, if_true: int, if_false: int) -> bytes:
    return struct.pack("=HBBI", test, if_true, if_false, value)


def _return(value: int) -> bytes:
    return struct.pack("=HBBI", RETURN, 0, 0, value)
