"""The index of a data set: which shards belong to it, what their columns hold, and how they were made.

Rules:
- `index.json` lies beside the shards and names them by file name, so that the folder can be moved;
- its text is the one text of its content, with the content's sha256 in front: any other byte is damage;
- it holds the sum of every shard's header, which holds the sums of all rows, so that a shard which is damaged, cut
  off, or another one of the same data set is found, whole or by ranges;
- an asset is in one split, whole: checked when an index is written and when it is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)

from labeller.columns import Column, CountType, columns
from labeller.sampling import Sampling
from labeller.shard_file import open_columns, write_atomically
from labeller.shards import ShardMeta, explained
from schemas.pixel_weights import DEFAULT_WEIGHTS, PixelWeights, without_default
from schemas.problem import ExitCode, Problem
from schemas.tail import MetricName, TailName
from schemas.view import View

INDEX: Final = "index.json"
"""File of the index in the folder of a data set."""

SCHEMA_VERSION: Final = 1
"""Of the index."""

Split = Literal["train", "held-out"]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class SourceView(BaseModel):
    """What a shard's rows are pixels of.

    Attributes:
        scene: Content digest of the scene.
        view: Name of the view.
        camera: The camera, metres, relative to the scene's origin.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene: str
    view: str
    camera: View


class ShardEntry(BaseModel):
    """A shard of a data set.

    Attributes:
        file: Its name, in the folder of the index.
        sha256: Of the whole file.
        header_sha256: Of its header, which holds the sums of all blocks of rows.
        bytes: Size of the file.
        rows: Sampled pixels.
        segments: Hull segments of all rows.
        fragments: N of the view.
        asset: What the view shows; an asset is in one split.
        split: What the rows are for: `train`, or `held-out`: never trained on.
        source: Scene, view and camera.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: Annotated[str, Field(pattern=r"^[^/\\\x00]*[^/\\\x00.][^/\\\x00]*$")]
    sha256: Sha256
    header_sha256: Sha256
    bytes: int = Field(ge=0)
    rows: int = Field(ge=0)
    segments: int = Field(ge=0)
    fragments: int = Field(ge=0)
    asset: str
    split: Split
    source: SourceView


class Labels(BaseModel):
    """What the labels of all shards have in common.

    Attributes:
        tail: Tail of the error curves.
        g: Steepness of the density tail.
        metric: Space of the error.
        weights: What the errors of a pixel count.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    tail: TailName
    g: float
    metric: MetricName
    weights: PixelWeights = DEFAULT_WEIGHTS

    @model_serializer(mode="wrap")
    def _written(self, usual: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without weights an index has the text from before there were any."""
        return without_default(usual(self))

    @classmethod
    def of(cls, meta: ShardMeta) -> Labels:
        """Those of a shard."""
        return cls(tail=meta.tail, g=meta.g, metric=meta.metric, weights=meta.weights)


class DatasetIndex(BaseModel):
    """A whole data set.

    Attributes:
        schema_version: Of this index.
        code: Version of the code that made the labels.
        labels: What they mean.
        sampling: How rows were drawn.
        columns: Tensors of every shard.
        shards: In the order in which they were added.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = SCHEMA_VERSION
    code: str
    labels: Labels
    sampling: Sampling
    columns: tuple[Column, ...]
    shards: tuple[ShardEntry, ...]

    @property
    def text(self) -> str:
        """The one text of the index."""
        content = self.model_dump(mode="json")
        return json.dumps({"sha256": _digest(content), **content}, indent=1, ensure_ascii=True) + "\n"


@dataclass(frozen=True, slots=True)
class Member:
    """A shard that is to be in a data set.

    Attributes:
        file: Its name, in the folder of the data set.
        asset: What the view shows.
        split: What the rows are for.
        source: Scene, view and camera.
        sha256: Hex, of the whole file, as `write_shard` returned it; None: it is read for that.
    """

    file: str
    asset: str
    split: Split
    source: SourceView
    sha256: str | None = None


def write_index(folder: Path, members: Sequence[Member], code: str) -> DatasetIndex:
    """Writes the index of shards that lie in a folder, atomically; an equal one stays.

    Args:
        folder: Of the data set; other files in it are left alone.
        members: Its shards, in order.
        code: Version of the code that made the labels.

    Raises:
        Problem: A shard is missing, damaged or labelled otherwise than the others, or an asset is in two splits.
    """
    if not members:
        raise Problem("A data set needs a shard.", "Name at least one.")
    read = [_entry(folder, member) for member in members]
    first, *others = [(labels, sampling) for _, labels, sampling, _ in read]
    for member, made in zip(members[1:], others, strict=True):
        if made != first:
            raise Problem(
                f"{members[0].file} and {member.file} are not labelled in the same way.",
                "Make the labels of both with the same tail, g, metric and sampling.",
            )
    count_type: CountType = "uint32" if "uint32" in {found for *_, found in read} else "uint16"
    index = DatasetIndex(
        code=code,
        labels=first[0],
        sampling=first[1],
        columns=columns(count_type),
        shards=tuple(entry for entry, *_ in read),
    )
    check_splits(index)
    path = folder / INDEX
    if not path.is_file() or path.read_bytes() != index.text.encode():
        write_atomically(path, index.text.encode())
    return index


def read_index(path: Path) -> DatasetIndex:
    """Reads and verifies an index. The shards are verified as they are read (`labeller.dataset`).

    Args:
        path: The index, or the folder that it lies in.

    Raises:
        Problem: It is missing or damaged, or an asset is in two splits.
    """
    path = path / INDEX if path.is_dir() else path
    try:
        if path.exists() and not path.is_file():  # a pipe or a device may never end
            raise _damaged(path, "it is not a file")
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise Problem(f"There is no index {path}.", "Name the folder of a data set.", ExitCode.NOT_FOUND) from error
    except OSError as error:
        raise _damaged(path, error.strerror or error) from error
    index = _parsed(path, content)
    check_splits(index)
    return index


def check_splits(index: DatasetIndex) -> None:
    """Refuses an index with an asset, by its name or its scene's content, in two splits, or with a file twice.

    Raises:
        Problem: Which one.
    """
    files: set[str] = set()
    splits: dict[str, Split] = {}
    for entry in index.shards:
        if entry.file in files:
            raise Problem(f"The shard {entry.file} is in the data set twice.", "Name each shard once.")
        files.add(entry.file)
        for name in (f"asset {entry.asset}", f"scene {entry.source.scene}"):
            if splits.setdefault(name, entry.split) != entry.split:
                raise Problem(
                    f"The {name} is in two splits, {splits[name]} and {entry.split} (shard {entry.file}).",
                    "Put all views of an asset into one split: a test on what was trained on proves nothing.",
                    ExitCode.CHECK_FAILED,
                )


def _entry(folder: Path, member: Member) -> tuple[ShardEntry, Labels, Sampling, CountType]:
    """What the shard's verified header says of it."""
    path = folder / member.file
    with explained(path), open_columns(path) as file:
        layout, meta = file.layout, ShardMeta.model_validate(file.layout.view)
        header_sha256, count_type = file.header_sha256, file.count_type
        sha256 = member.sha256
        if sha256 is None:
            file.read(0, layout.rows)
            with path.open("rb") as stream:
                sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    entry = ShardEntry(
        file=member.file,
        sha256=sha256,
        header_sha256=header_sha256,
        bytes=path.stat().st_size,
        rows=layout.rows,
        segments=layout.segments,
        fragments=meta.fragments,
        asset=member.asset,
        split=member.split,
        source=member.source,
    )
    return entry, Labels.of(meta), meta.sampling, count_type


def _parsed(path: Path, content: bytes) -> DatasetIndex:
    try:
        described = json.loads(content)
        stated = described.pop("sha256")
        if described["schema_version"] != SCHEMA_VERSION:
            raise Problem(
                f"The index {path} has the schema version {described['schema_version']}, not {SCHEMA_VERSION}.",
                "Build the data set again, or read it with the version of Diaphane that wrote it.",
                ExitCode.CHECK_FAILED,
            )
        if stated != _digest(described):
            raise _damaged(path, "its content does not match its checksum")
        index = DatasetIndex.model_validate(described)
        if not index.shards:
            raise _damaged(path, "it names no shard")
    except ValidationError as error:
        raise _damaged(path, f"{_places(error)} does not fit") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise _damaged(path, "it is not the JSON that was written") from error
    if index.text.encode() != content:
        raise _damaged(path, "it is not the text that was written")
    return index


def _places(error: ValidationError) -> str:
    return ", ".join(".".join(map(str, fault["loc"])) for fault in error.errors()[:3])


def _damaged(path: Path, why: Any) -> Problem:
    return Problem(
        f"The index {path} is damaged: {why}.",
        "Copy the data set again, or delete the index and build it again.",
        ExitCode.CHECK_FAILED,
    )


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
