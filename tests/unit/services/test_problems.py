"""Problems as they leave the service: without the folders of its machines."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.problem import ExitCode, Problem
from services.problems import document_of, refusal_of, without_paths

KEY = "ab" + "0" * 62
FOLDERS = st.lists(st.text(alphabet="abcXYZ 0-._", min_size=1, max_size=12), min_size=1, max_size=4)


@given(FOLDERS)
def test_artifacts_are_named_and_not_where_they_lie(folders: list[str]) -> None:
    root = "/" + "/".join(folders)
    for where, named in (
        (f"{root}/store/render/ab/{KEY}", f"render/{KEY}"),
        (f"{root}/store/label/ab/{KEY}/allocations.zarr", f"label/{KEY}/allocations.zarr"),
        (f"{root}/store/blobs/sha256/ab/{KEY}", f"sha256/{KEY}"),
    ):
        assert without_paths(f"What is in {where} is damaged.") == f"What is in {named} is damaged."
        assert without_paths(f"'{where}' is damaged.") == f"'{named}' is damaged."


def test_a_folder_may_be_relative() -> None:
    assert without_paths(f"data/store/render/ab/{KEY} is damaged.") == f"render/{KEY} is damaged."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"'/my data/cache/sources/{KEY}/tex/a.png' cannot be read.", "'tex/a.png' cannot be read."),
        (f"The bundle /data/cache/sources/{KEY} cannot be used.", f"The bundle {KEY} cannot be used."),
        (f"/data/store/tmp/label-abababab-{'0' * 32}/shard.npz is full.", "shard.npz is full."),
        (
            "FileNotFoundError: [Errno 2] No such file or directory: '/data/x'",
            "FileNotFoundError: [Errno 2] No such file or directory",
        ),
        (
            "OSError: [Errno 18] Invalid cross-device link: '/data/x' -> \"/data/it's\"",
            "OSError: [Errno 18] Invalid cross-device link",
        ),
        ("/data/state/scratch/render-12-0/a.usd is no USD file.", "a.usd is no USD file."),
    ],
)
def test_files_are_named_as_in_their_scene(text: str, said: str) -> None:
    assert without_paths(text) == said


@pytest.mark.parametrize(
    "text",
    [
        "The prim /World/Lamp/bulb_2 has no points, see </World/Lamp>.",
        "The file tex/wood.png of the scene has 3/4 of its bytes; /v1/problems/invalid explains it.",
        f"The artifact label/{KEY} is gone, and nothing tells how to make it again.",
    ],
)
def test_other_slashes_stay(text: str) -> None:
    assert without_paths(text) == text


def test_both_ways_out_are_the_same() -> None:
    problem = Problem(
        f"/data/store/label/ab/{KEY}/x has none.", f"Remove /data/store/label/ab/{KEY}.", ExitCode.CONFLICT
    )
    for document in (document_of(problem), refusal_of(problem).document()):
        assert (document.detail, document.remedy) == (f"label/{KEY}/x has none.", f"Remove label/{KEY}.")
