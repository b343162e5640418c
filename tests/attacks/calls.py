"""What a process asked the kernel for by name, read from strace's log of one thread (`-ff -y`).

An attempt counts as much as a success: what a sandbox refuses was still asked for.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

ENDED = re.compile(r"\+\+\+ (?:exited with|killed by) .* \+\+\+")
_SIGNAL = re.compile(r"--- .* ---")
_UNFINISHED = " <unfinished ...>"
_RESUMED = re.compile(r"<\.\.\. (?P<name>\w+) resumed>")
_HEAD = re.compile(r"(?P<name>\w+)\(")
_RESULT = re.compile(r"\) += (?P<value>-?\d+|\?)(?P<rest>.*)$")
_STRING, _PLACE = r'"(?P<string>(?:[^"\\]|\\.)*)"(?:\.\.\.)?', r"<(?P<place>(?:[^<>\\]|\\.)*)>(?:\(deleted\))?"
_ARGUMENT = re.compile(rf"{_STRING}|{_PLACE}|[\[{{(]|[\]}})]|,")
_ESCAPE = re.compile(r'\\([0-7]{1,3}|x[0-9a-f]{2}|[\\"abfnrtv])')
_LETTERS = {"a": 7, "b": 8, "f": 12, "n": 10, "r": 13, "t": 9, "v": 11, "\\": 92, '"': 34}
_NAMED_FIRST = {"execve", "readlink", "readlinkat"}
"""Calls whose later strings are no paths."""
_NO_FILES = {"socket", "connect", "bind"}


@dataclass(frozen=True)
class Call:
    """One call of the kernel.

    Attributes:
        name: Of the call.
        paths: Files that it names, and the one that was opened: absolute, without `..`; as they were named where it is
            not known what they are relative to.
        done: Whether the kernel did it; not known of a call that a thread did not survive.
        text: As strace wrote it.
    """

    name: str
    paths: tuple[str, ...]
    done: bool | None
    text: str


def read_calls(lines: Iterable[str]) -> Iterator[Call]:
    """The calls in the log of one thread.

    Raises:
        ValueError: A line is none of those that strace writes: nothing is passed over unread.
    """
    folder = ""
    for line in _whole(lines):
        call = _read(line, folder)
        where = re.search(r"AT_FDCWD<((?:[^<>\\]|\\.)*)>", line)
        if where:
            folder = _text(where[1])
        elif call.name in ("chdir", "getcwd") and call.done:
            folder = call.paths[0]
        yield call


def _whole(lines: Iterable[str]) -> Iterator[str]:
    """Calls in one piece each; those that a thread did not survive as far as they came."""
    begun = ""
    for line in lines:
        if ENDED.fullmatch(line) or _SIGNAL.fullmatch(line):
            continue
        if resumed := _RESUMED.match(line):
            if not begun.startswith(f"{resumed['name']}("):
                raise ValueError(f"this call never began: {line}")
            line, begun = begun + line[resumed.end() :], ""
        if begun:
            raise ValueError(f"a thread does one thing at a time: {begun}")
        if line.endswith(_UNFINISHED):
            begun = line.removesuffix(_UNFINISHED)
        else:
            yield line
    if begun:
        yield begun


def _read(line: str, folder: str) -> Call:
    head, result = _HEAD.match(line), _RESULT.search(line)
    if head is None:
        raise ValueError(f"this is no call: {line}")
    name = head["name"]
    done = None if result is None or result["value"] == "?" else not result["value"].startswith("-")
    if name in _NO_FILES:
        return Call(name, (), done, line)
    named = list(_named(line[head.end() : result.start() if result else None], folder))
    paths = named[:1] if name in _NAMED_FIRST else named
    opened = re.match(_PLACE, result["rest"]) if result else None
    if opened:
        paths.append(_without_mark(_text(opened["place"])))
    return Call(name, tuple(paths), done, line)


def _named(arguments: str, folder: str) -> Iterator[str]:
    """The paths that a call's own arguments name, from the folder whose descriptor stands before each."""
    depth, base = 0, folder
    for found in _ARGUMENT.finditer(arguments):
        if found["string"] is not None and depth == 0:
            text = _text(found["string"])
            if not text and not base.startswith("/"):
                continue  # a pipe or a socket, looked at by its descriptor
            named = os.path.join(base, text)  # noqa: PTH118 (an absolute one replaces the folder)
            yield os.path.normpath(named)
            base = folder
        elif found["place"] is not None and depth == 0:
            base = _without_mark(_text(found["place"]))
        elif found[0] in "[{(":
            depth += 1
        elif found[0] in ")}]":
            depth -= 1


def _without_mark(path: str) -> str:
    """Other versions of strace have the kernel's mark of a removed file within the path."""
    return path.removesuffix(" (deleted)")


def _text(quoted: str) -> str:
    """What strace's escapes stand for."""
    if "\\" not in quoted:
        return quoted
    raw = _ESCAPE.sub(lambda found: chr(_character(found[1])), quoted)
    return raw.encode("latin-1").decode(errors="replace")


def _character(escape: str) -> int:
    if escape[0] == "x" and len(escape) > 1:
        return int(escape[1:], 16)
    return int(escape, 8) if escape[0].isdigit() else _LETTERS[escape]
