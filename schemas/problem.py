"""The one error type a user meets, and the exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of every `diaphane` command."""

    OK = 0
    CHECK_FAILED = 1
    USAGE = 2
    NOT_FOUND = 3
    AUTH = 4
    CONFLICT = 5
    TRY_AGAIN = 6
    LIMIT = 7
    INTERRUPTED = 130


class Problem(Exception):
    """Something the user can act on: what is wrong, and what to do about it.

    Args:
        title: What is wrong, one sentence, naming the input.
        remedy: What the user can do about it, one sentence in the imperative.
        code: The exit status that the command line ends with.
    """

    def __init__(self, title: str, remedy: str, code: ExitCode = ExitCode.USAGE) -> None:
        super().__init__(f"{title} {remedy}")
        self.title = title
        self.remedy = remedy
        self.code = code
