"""What the processes that meet uploads ask for, seen from the outside: their room, and what libraries need."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from attacks import make
from attacks.calls import ENDED, Call, read_calls

from services.sandbox import DEVICES, OWN_PACKAGES, SYSTEM

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CANARY = "canary"
PROJECT = (*(str(ROOT / name) for name in OWN_PACKAGES), str(ROOT / "deploy"))
PYTHON = (sys.prefix, sys.base_prefix, str(Path(sys.executable).resolve().parent))
MACHINE = (*SYSTEM, *DEVICES, "/proc", "/sys", "/etc/locale.alias", "/etc/ssl/openssl.cnf", "/sbin/ldconfig")
"""What the interpreter and libraries read of the machine, before a process is shut in as well."""
LISTED = {"/dev", str(ROOT), str(ROOT / "tests")}
"""Folders whose names are read: for devices, and for modules in the entries of PYTHONPATH."""
PROBED = re.compile(
    rf"/selinux|/etc/ld\.so\.preload|/etc/zarr|.*/lib/python{sys.version_info.major}{sys.version_info.minor}\.zip"
    r"|/dev/shm/sem\.\w+"
)
"""What libraries try on every machine: the loader, a format of arrays, the interpreter above its own folder, and a
semaphore, which Python does without."""
LOOKS = {"stat", "lstat", "newfstatat", "statx", "readlink", "readlinkat"}
"""Calls that tell that something is there, and not what is in it."""
PATIENCE_SECONDS = 30.0

TEXTURE = """
def Material "NAME" {
    token outputs:surface.connect = </NAME/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </NAME/Reader.outputs:rgb>
        float inputs:opacity = 0.5
        token outputs:surface
    }
    def Shader "Reader" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @PATH@
        float3 outputs:rgb
    }
}
"""
SHEET = """
def Mesh "NAME_sheet" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, Z), (1, 0, Z), (1, 1, Z), (0, 1, Z)]
    color3f[] primvars:displayColor = [(0.ZZ, 0.5, 0.1)]
    rel material:binding = <LOOK>
}
"""
MATERIALX = """<?xml version="1.0"?>
<materialx version="1.38">
  <image name="picture" type="color3"><input name="file" type="filename" value="canary.png"/></image>
  <standard_surface name="surface" type="surfaceshader">
    <input name="base_color" type="color3" nodename="picture"/>
  </standard_surface>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="surface"/>
  </surfacematerial>
</materialx>
"""


def _sheet(name: str, number: int, look: str) -> str:
    """A square with a material; several of them lie behind each other."""
    return SHEET.replace("NAME", name).replace("ZZ", str(number)).replace("Z", f"0.{number}").replace("LOOK", look)


def _textures(stolen: str) -> dict[str, str]:
    """Textures that lie where the service was started: named directly, as tiles, in documents, in layers."""
    named = {"Blob": stolen, "Plain": "canary.png", "Dotted": "./canary.png", "Tiles": "canary.<UDIM>.png"}
    body = "".join(TEXTURE.replace("NAME", name).replace("PATH", path) for name, path in named.items())
    looks = [*(f"/{name}" for name in named), "/Below", "/Given/Look"]
    body += "".join(_sheet(look.split("/")[1], number + 1, look) for number, look in enumerate(looks))
    body += 'def "Below" (references = @below/look.usda@</Look>) {}\ndef "Given" (references = @own.mtlx@) {}\n'
    below = TEXTURE.replace("NAME", "Look").replace("PATH", "canary.png")
    return {"scene.usda": make.usda(body), "below/look.usda": make.usda(below), "own.mtlx": MATERIALX}


def _layers() -> dict[str, str]:
    """An upload whose layers lie where the service was started, by every way to compose one."""
    active = "double2[] active = [(0, 0)]\ndouble2[] times = [(0, 0), (4, 4)]"
    sets = {
        "given": f"asset[] assetPaths = [@canary.usda@]\nasset manifestAssetPath = @canary.usda@\n{active}",
        "counted": f'string templateAssetPath = "./canary.#.usda"\n{make.TEMPLATE}',
    }
    clips = "".join(
        f'dictionary {name} = {{\n{lines}\nstring primPath = "/Sheet"\n}}\n' for name, lines in sets.items()
    )
    body = f'def "Clipped" (\nclips = {{\n{clips}}}\n) {{\ndouble x\n}}\n'
    for arc in ("references = @canary.usda@", "payload = @canary.usda@", "prepend references = @canary.mtlx@"):
        body += f'def "Arc{len(body)}" (\n{arc}\n) {{\n}}\n'
    body += 'def "Named" {\nasset file = @canary.png@\n}\n'
    return {"scene.usda": make.usda(body + _sheet("Plain", 1, "/None"), "subLayers = [@canary.usda@]")}


def _outside(server: Path) -> dict[str, dict[str, str]]:
    """Uploads that name what lies where the service was started, and are refused without a look at it."""
    up = "../" * 6  # from a child's sources/DIGEST to the folder that has .diaphane
    climbing = TEXTURE.replace("NAME", "Look").replace("PATH", f"{up}canary.png")
    absolute = make.usda(f'def "Taken" (references = @{server}/canary.usda@) {{}}')
    return {"climbing": {"scene.usda": make.usda(climbing)}, "absolute": {"scene.usda": absolute}}


@dataclass(frozen=True)
class Watched:
    """What one child asked for.

    Attributes:
        room: Its room.
        calls: Of all its threads.
    """

    room: str
    calls: list[Call]


@dataclass(frozen=True)
class Audited:
    """What a service did, and its children.

    Attributes:
        folder: Where it ran.
        done: What became of scenes and job.
        children: Its children.
        stolen: Hash of the file that an upload asks for by its place in the store.
    """

    folder: Path
    done: dict[str, Any]
    children: list[Watched]
    stolen: str


@pytest.fixture(scope="module")
def audited(tmp_path_factory: pytest.TempPathFactory) -> Audited:
    """A service started in a folder of files that nobody may open."""
    assert shutil.which("strace"), "scripts/setup-tests.sh installs it"
    folder = tmp_path_factory.mktemp("audited")
    server = folder / "server"
    server.mkdir()
    victim = make.png(3, 5)
    (folder / "victim.png").write_bytes(victim)
    digest = hashlib.sha256(victim).hexdigest()
    for name in ("canary.png", "canary.1001.png"):
        (server / name).write_bytes(victim)
    (server / "canary.mtlx").write_text(MATERIALX)
    for name in ("canary.usda", "canary.0.usda", "canary.1.usda"):
        (server / name).write_text(make.usda())
    stolen = f".diaphane/store/blobs/sha256/{digest[:2]}/{digest}"
    for name, files in {"textures": _textures(stolen), "layers": _layers(), **_outside(server)}.items():
        for file, text in files.items():
            path = folder / "scenes" / name / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests"), str(ROOT / "deploy/client/python")])
    environment = {k: v for k, v in os.environ.items() if not k.startswith("DIAPHANE_")} | {"PYTHONPATH": path}
    # Where USD would look if a child believed its worker's environment.
    environment["PXR_AR_DEFAULT_SEARCH_PATH"] = str(server)
    command = [sys.executable, str(HERE / "audit.py"), str(folder)]
    finished = subprocess.run(command, cwd=server, env=environment, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return Audited(folder, json.loads((folder / "done.json").read_text()), list(_children(folder)), digest)


def _children(folder: Path) -> Iterator[Watched]:
    """What the logs have of each child, once all of them are whole: a tracer ends after what it traces."""
    end = time.monotonic() + PATIENCE_SECONDS
    logs: dict[Path, list[str]] = {}
    while not logs or not all(lines and ENDED.fullmatch(lines[-1]) for lines in logs.values()):
        assert time.monotonic() < end, [log.name for log, lines in logs.items() if not ENDED.fullmatch(lines[-1])]
        time.sleep(0.1)
        logs = {log: log.read_text(errors="replace").splitlines() for log in folder.glob("asked.*.*")}
    for child in sorted({log.name.split(".")[1] for log in logs}):
        calls = [call for log, lines in logs.items() if log.name.split(".")[1] == child for call in read_calls(lines)]
        (room,) = {found[1] for call in calls if (found := re.search(r"AT_FDCWD<([^>]*)/empty>", call.text))}
        yield Watched(room, calls)


def _is_within(path: str, *folders: str) -> bool:
    return any(path == folder or path.startswith(f"{folder}/") for folder in folders)


def test_every_kind_of_process_was_watched(audited: Audited) -> None:
    states = {name: scene["state"] for name, scene in audited.done["scenes"].items()}
    refused = dict.fromkeys(("climbing", "absolute"), "rejected")
    assert states == {"textures": "accepted", "layers": "accepted", **refused}, audited.done["scenes"]
    assert audited.done["job"]["state"] == "succeeded", audited.done["job"]
    assert set(audited.done["tasks"].values()) == {"done"}
    stages = {name.split()[0] for name in audited.done["tasks"]}
    assert stages == {"scene", "render"}
    rooms = [Path(child.room).name.split("-")[0] for child in audited.children]
    assert rooms.count("check") == len(audited.done["scenes"]), "a process for each check"
    assert rooms.count("render") >= list(states.values()).count("accepted"), "and one for each scene that is rendered"
    for child in audited.children:
        own = [call for call in child.calls if any(_is_within(path, f"{child.room}/sources") for path in call.paths)]
        assert any(call.name.startswith("open") and call.done for call in own), "the log has what it should have"


def test_no_process_asks_for_anything_outside_of_its_room(audited: Audited) -> None:
    """What is refused was still asked for. What leads to its room may be looked at, and not be listed or opened."""
    key = f"{audited.folder}/server/.diaphane/work/kernels/{audited.done['job']['submitted_by']}"
    outside = []
    for child in audited.children:
        own = (child.room, key) if Path(child.room).name.startswith("render") else (child.room,)
        inside = (*PYTHON, *PROJECT, *MACHINE, *own)
        above = {str(parent) for folder in inside for parent in Path(folder).parents}
        for call in child.calls:
            here = [path for path in call.paths if path not in LISTED and not PROBED.fullmatch(path)]
            here = [path for path in here if not _is_within(path, *inside)]
            if call.name not in LOOKS or not all(path in above for path in here):
                outside += [call.text] * bool(here)
            if call.name in ("socket", "connect", "bind"):
                outside.append(call.text)
    assert outside == []


def test_what_lies_where_the_service_was_started_is_asked_for_in_the_upload_only(audited: Audited) -> None:
    """By its words, wherever they stand in a line. USD looks for a name in the upload, then in the empty folder."""
    asked = []
    for child in audited.children:
        own = (f"{child.room}/sources", f"{child.room}/empty")
        for call in child.calls:
            if any(word in call.text for word in (CANARY, audited.stolen, "victim")):
                asked.append(call)
                assert call.paths, call.text
                assert all(_is_within(path, *own) for path in call.paths), call.text
    assert asked, "the uploads ask for them"


def test_no_process_asks_for_the_input_of_another_task(audited: Audited) -> None:
    for child in audited.children:
        sources = {found for call in child.calls for found in re.findall(r"/sources/([0-9a-f]{64})", call.text)}
        assert len(sources) == 1, child.room


def test_check_and_job_agree_on_what_is_missing(audited: Audited) -> None:
    for name in audited.done["warnings"]:
        found = [line for line in audited.done["scenes"][name]["facts"]["warnings"] if "not in the upload" not in line]
        told = [line for line in audited.done["warnings"][name] if not line.startswith("USD says")]
        assert not any(str(audited.folder) in line for line in audited.done["warnings"][name]), name
        assert [line for line in found if not line.startswith("USD found")] == told, name
    texts = "\n".join(audited.done["warnings"]["textures"])
    for look in ("Blob", "Plain", "Dotted", "Tiles"):
        assert f"/{look}/Reader" in texts, look
