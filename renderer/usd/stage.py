"""Opening of a stage: errors that a user can act on, composition warnings, variants, time."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from schemas.problem import ExitCode, Problem

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


class OutsideHome(Problem):
    """A scene that may use the files of one folder only uses others."""


class WarningLog:
    """Collects what was not supported or was missing; the same reason on many prims makes one line."""

    def __init__(self) -> None:
        self._paths: dict[str, list[str]] = {}

    def add(self, reason: str, path: object) -> None:
        """Notes that `reason` holds for the prim, layer or texture at `path`."""
        paths = self._paths.setdefault(reason, [])
        text = str(path)
        if text not in paths[-1:]:
            paths.append(text)

    def lines(self) -> tuple[str, ...]:
        """One line for each reason, naming the first path and the number of others."""
        return tuple(
            f"{reason}: {paths[0]}" + (f" (and {len(paths) - 1} more)" if len(paths) > 1 else "")
            for reason, paths in self._paths.items()
        )


@contextmanager
def usd_diagnostics(log: WarningLog) -> Iterator[None]:
    """Keeps the library's own warnings off stderr and puts them, without addresses, into `log`."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        # A stage is composed by several threads, which say what they find in any order.
        for text in sorted(str(diagnostic.commentary).strip() for diagnostic in delegate.TakeUncoalescedDiagnostics()):
            text = re.sub(r" \((instantiating|recomposing|getting).*? stage .*$", "", text, flags=re.DOTALL)
            if ".mtlx@" in text:
                # The material reader reads these documents itself, and reports those that it cannot.
                continue
            text = re.sub(r"(Could not open asset @[^@]*@).*$", r"\1", text, flags=re.DOTALL)
            text = re.sub(r"\s+", " ", re.sub(r"<?0x[0-9a-f]+>?", "", text)).strip()
            where = re.match(r"In <([^>]+)>: (.*)$", text, flags=re.DOTALL)
            if where:
                log.add(where.group(2), where.group(1))
            else:
                log.add("USD says", text)


def check_file(path: Path) -> None:
    """Raises Problem if `path` is not a readable file with a USD suffix."""
    if not path.exists():
        raise Problem(f"There is no file {path}.", "Check the path of the scene.", ExitCode.NOT_FOUND)
    if path.is_dir():
        raise Problem(f"{path} is a folder.", "Name the USD file in it that is the root layer.", ExitCode.USAGE)
    if path.suffix.lower() not in USD_SUFFIXES:
        raise Problem(
            f"{path} is not a USD file.",
            "Give a .usd, .usda, .usdc or .usdz file.",
            ExitCode.USAGE,
        )
    try:
        str(path.resolve()).encode()
    except UnicodeEncodeError:
        readable = str(path).encode(errors="replace").decode()
        raise Problem(f"The path {readable} is no UTF-8, as USD needs it.", "Rename it.", ExitCode.USAGE) from None
    if path.stat().st_size == 0:
        raise Problem(f"{path} is empty.", "Export the scene again.", ExitCode.USAGE)


def open_stage(path: Path, variants: tuple[str, ...] = ()) -> Usd.Stage:
    """Opens a stage with all payloads.

    Args:
        path: A .usd, .usda, .usdc or .usdz file.
        variants: Selections `set=choice` (every prim that has the set) or `/prim/path:set=choice`.

    Raises:
        Problem: The file is missing or cannot be parsed, or a variant does not exist.
    """
    check_file(path)
    try:
        stage = Usd.Stage.Open(str(path.resolve()), Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        raise Problem(
            f"{path} cannot be read as USD: {usd_reason(error)}.",
            "Open it with usdview or usdcat, or export it again.",
            ExitCode.USAGE,
        ) from error
    if variants:
        _select_variants(stage, [Selection.of(text) for text in variants])
    return stage


def is_inside(home: Path | None, name: str) -> bool:
    """Whether a file that was found, or the package that it is in, lies in a folder.

    Args:
        home: The folder, resolved; None: anywhere will do.
        name: As the asset resolver gave it; one that it did not find is relative, and lies nowhere.
    """
    if home is None:
        return True
    file = Path(Ar.SplitPackageRelativePathOuter(name)[0])
    return file.is_absolute() and file.resolve().is_relative_to(home)


def used_layers(stage: Usd.Stage, home: Path | None) -> int:
    """How many layers a stage uses, those of value clips included.

    Args:
        stage: The stage.
        home: Folder that all of them have to lie in, resolved; None: anywhere will do.

    Raises:
        Problem: One lies elsewhere.
    """
    layers = [layer for layer in stage.GetUsedLayers() if not layer.anonymous]
    if not all(is_inside(home, layer.realPath or layer.identifier) for layer in layers):
        raise OutsideHome("The scene uses a layer outside its folder.", "Put the layer into the folder.")
    return len(layers)


def stage_time(stage: Usd.Stage, time: float | None) -> Usd.TimeCode:
    """The one time at which every attribute is read.

    An attribute without time samples has its default value at any time; one that is authored at time samples
    only has no value at the default time, so the stage's start time is used unless the user names a time.
    """
    if time is not None:
        return Usd.TimeCode(time)
    if stage.HasAuthoredMetadata("startTimeCode") and math.isfinite(stage.GetStartTimeCode()):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def canonical_path(prim: Usd.Prim) -> Sdf.Path:
    """The prim's path, in its prototype if it is an instance proxy."""
    return (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()


def usd_reason(error: Exception) -> str:
    """The innermost quoted message of a Tf error, on one line, without addresses."""
    try:
        text = str(error)
    except UnicodeDecodeError:
        # The message quotes the file, whatever bytes that has.
        return "it is damaged"
    messages = re.findall(r" : '(.*?)'\s*$", text, flags=re.MULTILINE | re.DOTALL)
    text = messages[0] if messages else text
    return re.sub(r"\s+", " ", text).strip().rstrip(".")[:300]


@dataclass(frozen=True, slots=True)
class Selection:
    """A choice of variant: for the prim at `where`, or for every prim that has the set if that is empty."""

    where: str
    name: str
    choice: str

    @staticmethod
    def of(text: str) -> Selection:
        """Reads `set=choice` or `/prim/path:set=choice`.

        Raises:
            Problem: It is neither.
        """
        where, _, rest = text.rpartition(":")
        name, equals, choice = rest.partition("=")
        if not equals or not name:
            raise Problem(
                f"'{text}' is not a variant selection.",
                "Write it as set=choice or /prim/path:set=choice.",
                ExitCode.USAGE,
            )
        return Selection(where, name, choice)

    def __str__(self) -> str:
        return f"{self.where}{':' if self.where else ''}{self.name}={self.choice}"


def _select_variants(stage: Usd.Stage, selections: list[Selection]) -> None:
    """Selects in the session layer; where several fit a prim, the last one."""
    found: dict[str, set[str]] = {}
    applied: set[Selection] = set()
    made: set[tuple[str, str]] = set()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        # A selection can bring prims and sets that were not there before, and those may be selected too.
        while _select_once(stage, selections, found, applied, made):
            pass
    for selection in selections:
        if selection not in applied:
            known = "; ".join(f"{key}={'|'.join(sorted(values))}" for key, values in sorted(found.items())) or "none"
            raise Problem(
                f"The scene has no variant '{selection}'.", f"Choose from what is there: {known}.", ExitCode.NOT_FOUND
            )


def _select_once(
    stage: Usd.Stage,
    selections: list[Selection],
    found: dict[str, set[str]],
    applied: set[Selection],
    made: set[tuple[str, str]],
) -> bool:
    """Goes over the stage once; whether anything changed. `made` are prims and sets that are done."""
    changed = False
    # The list is made first: a selection changes the prims that a running traversal would visit.
    for prim in list(stage.TraverseAll()):
        mine = [s for s in selections if not s.where or str(prim.GetPath()) == s.where] if prim else []
        for name in prim.GetVariantSets().GetNames() if mine else ():
            variants = prim.GetVariantSet(name)
            choices = variants.GetVariantNames()
            found.setdefault(name, set()).update(choices)
            fitting = [s for s in mine if s.name == name and s.choice in choices]
            applied.update(fitting)
            if fitting and (str(prim.GetPath()), name) not in made:
                made.add((str(prim.GetPath()), name))
                changed = changed or variants.GetVariantSelection() != fitting[-1].choice
                variants.SetVariantSelection(fitting[-1].choice)
    return changed
