"""The resolve shader of an installed Storm, changed in place, with a backup beside it."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

from evaluation.storm.resolve import KNOWN, SHADER, digest_of, is_patched, replaced
from schemas.problem import ExitCode, Problem

BACKUP = ".diaphane-backup"
"""Suffix of the file as it was."""


@dataclass(frozen=True, slots=True)
class Target:
    """An installed resolve shader.

    Attributes:
        file: The shader.
        text: What it is now.
    """

    file: Path
    text: str

    @classmethod
    def of(cls, folder: Path) -> Target:
        """The one in a folder of OpenUSD's plug-ins.

        Raises:
            Problem: There is none.
        """
        file = folder / SHADER
        if not file.is_file():
            raise Problem(
                f"There is no {SHADER} in {folder}.",
                "Name OpenUSD's folder of plug-ins, such as lib/usd.",
                ExitCode.NOT_FOUND,
            )
        return cls(file, file.read_text(encoding="utf-8"))

    @property
    def backup(self) -> Path:
        """Where the file as it was is kept."""
        return self.file.with_name(self.file.name + BACKUP)

    def changed(self) -> str:
        """The text with the nearest eight and a tail.

        Raises:
            Problem: It is changed already, or is not what a known version ships.
        """
        if is_patched(self.text):
            raise Problem(f"{self.file} is patched already.", "Undo it with --revert.", ExitCode.CONFLICT)
        if digest_of(self.text) not in KNOWN:
            raise Problem(
                f"{self.file} is not what a known version of OpenUSD ships ({', '.join(KNOWN.values())}).",
                "Install a known version; a changed file is not touched.",
                ExitCode.CONFLICT,
            )
        return replaced(self.text, "nearest")

    def difference(self) -> str:
        """What `apply` would change, as a unified diff."""
        lines = (self.text.splitlines(keepends=True), self.changed().splitlines(keepends=True))
        return "".join(difflib.unified_diff(*lines, fromfile=str(self.file), tofile=str(self.file)))

    def apply(self) -> None:
        """Keep the file beside itself and change it: at no moment is there half a file."""
        changed = self.changed()
        self._put(self.backup, self.text)
        self._put(self.file, changed)

    def revert(self) -> None:
        """Put the kept file back.

        Raises:
            Problem: Nothing is kept, or it is not what a known version ships.
        """
        if not self.backup.is_file():
            raise Problem(f"{self.file} was not patched here: there is no backup.", "Nothing is to be done.")
        kept = self.backup.read_text(encoding="utf-8")
        if digest_of(kept) not in KNOWN:
            raise Problem(f"{self.backup} was changed.", "Install this OpenUSD again.", ExitCode.CONFLICT)
        self._put(self.file, kept)
        self.backup.unlink()

    def _put(self, file: Path, text: str) -> None:
        new = file.with_name(file.name + ".new")
        try:
            new.write_text(text, encoding="utf-8")
            new.replace(file)
        except OSError as error:
            raise Problem(f"{file} cannot be written: {error.strerror}.", "Run as its owner.") from error
