"""The data set of a local build: its label shards beside an index, in a folder that can be copied elsewhere.

The shards are links to the store's artifacts where the disk has links, so that they take no room twice. The shards of
earlier builds stay until the new index is there.
"""

from __future__ import annotations

import os
import re
import shutil
import uuid
from collections.abc import Sequence
from pathlib import Path

from diaphane.local.replay import Replay
from labeller.dataset_index import Member, SourceView, write_index
from labeller.shards import damaged
from schemas.canonical import file_sha256
from stages.desk import SHARD
from stages.records import LabelledView
from stages.store import Store, sync

_SUFFIX = ".safetensors"


def write_dataset(folder: Path, views: Sequence[LabelledView], store: Store, replay: Replay | None = None) -> None:
    """Writes the data set of labelled views; what is there already stays.

    Args:
        folder: Of the data set; made if missing.
        views: All views of a build, those of held-out scenes too.
        store: Where their shards lie.
        replay: Shards of an earlier data set that were trained on as well: they become part of this one.

    Raises:
        Problem: A shard in the store is damaged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    members = [_member(view) for view in views]
    for view, member in zip(views, members, strict=True):
        _provide(store.fetch(view.task.artifact) / SHARD, folder / member.file, view.facts.shard.sha256)
    for entry in () if replay is None else replay.entries:
        assert replay is not None
        _provide(replay.dataset.folder / entry.file, folder / entry.file, entry.sha256)
        members.append(Member(entry.file, entry.asset, entry.split, entry.source, entry.sha256))
    write_index(folder, members, views[0].task.version)
    for stale in {path.name for path in folder.glob(f"*{_SUFFIX}")} - {member.file for member in members}:
        (folder / stale).unlink(missing_ok=True)


def _member(view: LabelledView) -> Member:
    camera, sha256 = view.rendered.view, view.facts.shard.sha256
    readable = re.sub(r"[^A-Za-z0-9._-]+", "_", f"{view.scene.label}-{camera.name}").strip("._")
    return Member(
        file=f"{readable}-{sha256[:12]}{_SUFFIX}",
        asset=view.scene.label,
        split="held-out" if view.scene.held_out else "train",
        source=SourceView(scene=view.scene.digest, view=camera.name, camera=camera),
        sha256=sha256,
    )


def _provide(source: Path, target: Path, sha256: str) -> None:
    """Makes `target` the file `source`, in one step."""
    if target.exists() and (target.samefile(source) or file_sha256(target) == sha256):
        return
    if file_sha256(source) != sha256:
        raise damaged(source, "it does not match its checksum")
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex}")
    try:
        try:
            os.link(source, temporary)
        except OSError:  # another disk, or one without links
            shutil.copyfile(source, temporary)
            sync(temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
