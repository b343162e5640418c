"""What strace writes, and what is read from it."""

from __future__ import annotations

import pytest
from attacks.calls import Call, read_calls


def _one(*lines: str) -> Call:
    (call,) = read_calls(lines)
    return call


def test_a_file_that_is_opened_has_the_name_that_was_asked_for_and_the_one_that_was_found() -> None:
    call = _one('openat(AT_FDCWD</room/empty>, "/lib/a.so", O_RDONLY|O_CLOEXEC) = 3</usr/lib/a.so.1>')
    assert (call.name, call.paths, call.done) == ("openat", ("/lib/a.so", "/usr/lib/a.so.1"), True)


@pytest.mark.parametrize(
    "line",
    [
        'openat(AT_FDCWD</room>, "/out/canary.png", O_RDONLY) = -1 EACCES (Permission denied)',
        'open("/out/canary.png", O_RDONLY)       = -1 ENOENT (No such file or directory)',
        'openat2(AT_FDCWD</room>, "/out/canary.png", {flags=O_RDONLY, resolve=RESOLVE_BENEATH}, 24) = -1 EXDEV (x)',
        'newfstatat(AT_FDCWD</room>, "/out/canary.png", 0x7ffd, AT_SYMLINK_NOFOLLOW) = -1 ENOENT (No such file)',
        'stat("/out/canary.png", 0x7ffd)         = -1 EACCES (Permission denied)',
        'lstat("/out/canary.png", 0x7ffd)        = -1 EACCES (Permission denied)',
        'statx(AT_FDCWD</room>, "/out/canary.png", AT_STATX_SYNC_AS_STAT, STATX_ALL, 0x7ffd) = -1 EACCES (x)',
        'access("/out/canary.png", R_OK)         = -1 EACCES (Permission denied)',
        'faccessat2(AT_FDCWD</room>, "/out/canary.png", R_OK, AT_EACCESS) = -1 EACCES (Permission denied)',
        'readlink("/out/canary.png", 0x7ffd, 4096) = -1 EINVAL (Invalid argument)',
        'chdir("/out/canary.png")                = -1 ENOTDIR (Not a directory)',
        'execve("/out/canary.png", ["/out/other"], 0x7ffd /* 3 vars */) = -1 EACCES (Permission denied)',
    ],
)
def test_what_is_refused_was_asked_for_by_whatever_call(line: str) -> None:
    call = _one(line)
    assert (call.paths, call.done, call.text) == (("/out/canary.png",), False, line)


def test_what_is_only_looked_at_counts_with_its_name() -> None:
    found = _one('stat("/out/canary.png", {st_mode=S_IFREG|0644, st_size=71, ...}) = 0')
    assert (found.paths, found.done) == (("/out/canary.png",), True)
    found = _one('newfstatat(3</out/canary.png>, "", {st_mode=S_IFREG|0644, st_size=71, ...}, AT_EMPTY_PATH) = 0')
    assert found.paths == ("/out/canary.png",)
    assert _one('newfstatat(1<pipe:[7]>, "", {st_mode=S_IFIFO|0600, st_size=0, ...}, AT_EMPTY_PATH) = 0').paths == ()


@pytest.mark.parametrize("place", ["</room/tmp/#42>(deleted)", "</room/tmp/#42 (deleted)>"])
def test_a_file_that_is_removed_has_its_name(place: str) -> None:
    found = _one(f'openat(AT_FDCWD</room>, "/room/tmp", O_RDWR|O_TMPFILE, 0600) = 3{place}')
    assert found.paths == ("/room/tmp", "/room/tmp/#42")
    assert _one(f'newfstatat(3{place}, "", {{st_size=0, ...}}, AT_EMPTY_PATH) = 0').paths == ("/room/tmp/#42",)


def test_a_relative_path_counts_from_the_folder_that_it_is_relative_to() -> None:
    lines = [
        'stat("canary.png", 0x7ffd)              = -1 ENOENT (No such file or directory)',
        'openat(AT_FDCWD</server>, "./canary.png", O_RDONLY) = -1 EACCES (Permission denied)',
        'openat(5</server/.diaphane/work>, "../store/blob", O_RDONLY) = -1 EACCES (Permission denied)',
        'lstat("canary.png", 0x7ffd)             = -1 ENOENT (No such file or directory)',
        'chdir("/room")                          = 0',
        'lstat("canary.png", 0x7ffd)             = -1 ENOENT (No such file or directory)',
        'renameat(4</a>, "x", 5</b>, "y")        = 0',
        'linkat(4</a>, "x", AT_FDCWD</room>, "y", 0) = 0',
    ]
    paths = [call.paths for call in read_calls(lines)]
    assert paths[:4] == [("canary.png",), ("/server/canary.png",), ("/server/.diaphane/store/blob",), paths[1]]
    assert paths[4:] == [("/room",), ("/room/canary.png",), ("/a/x", "/b/y"), ("/a/x", "/room/y")]


def test_a_call_in_two_halves_is_one() -> None:
    lines = [
        'openat(AT_FDCWD</room>, "/out/canary.png", O_RDONLY <unfinished ...>',
        "--- SIGCHLD {si_signo=SIGCHLD, si_code=CLD_EXITED} ---",
        "<... openat resumed>)                   = 3</out/canary.png>",
    ]
    call = _one(*lines)
    assert (call.paths, call.done) == (("/out/canary.png", "/out/canary.png"), True)
    killed = _one(lines[0], "+++ killed by SIGKILL +++")
    assert (killed.paths, killed.done) == (("/out/canary.png",), None)
    unknown = _one('stat("/out/canary.png", 0x7ffd) = ?', "+++ exited with 0 +++")
    assert (unknown.paths, unknown.done) == (("/out/canary.png",), None)


def test_names_are_read_as_they_are() -> None:
    found = _one(r'open("/r/a\"b, \303\244\t<c>", O_RDONLY) = 4</r/a"b, \303\244\t\74c\76>')
    assert found.paths == ('/r/a"b, ä\t<c>',) * 2
    found = _one('readlink("/proc/self/exe", "/usr/bin/pyth"..., 4096) = 43')
    assert found.paths == ("/proc/self/exe",)


def test_ways_to_other_processes_name_no_file() -> None:
    found = _one('connect(5<socket:[7]>, {sa_family=AF_UNIX, sun_path="/run/x"}, 110) = -1 EPERM (Not permitted)')
    assert (found.name, found.paths, found.done) == ("connect", (), False)


@pytest.mark.parametrize(
    "lines",
    [
        ["strace: something went wrong"],
        ["<... openat resumed>) = 3</a>"],
        ['openat(AT_FDCWD</r>, "/a", O_RDONLY <unfinished ...>', 'stat("/b", 0x7ffd) = 0'],
    ],
)
def test_nothing_is_passed_over_unread(lines: list[str]) -> None:
    with pytest.raises(ValueError, match=r"no call|never began|one thing"):
        list(read_calls(lines))
