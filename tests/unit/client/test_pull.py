"""The client: whatever the server or the network does, a bundle is whole and genuine, or the old one stays."""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.bundles import make_bundle
from support.release_server import KEY, ReleaseServer
from support.releases import SIGNER, STRANGER, Record, pointer_to, publish, record_of, serve, state

from diaphane_client import Denied, NotFound, Refused, Unavailable, cached, pull
from diaphane_client import server as client_server
from schemas.bundle import FILES, MANIFEST
from schemas.bundle_files import bundle_files
from schemas.service import FileRef

CLIENT = Path(__file__).parents[3] / "deploy" / "client" / "python"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ReleaseServer]:
    monkeypatch.setattr(client_server, "FIRST_WAIT", 0.001)
    found = ReleaseServer()
    yield found
    found.stop()


def fetch(server: ReleaseServer, tmp_path: Path, alias: str = "champion", **options: Any) -> Path:
    return pull("glass", alias, url=server.url, key=KEY, folder=tmp_path / "bundles", **options)


def visible(tmp_path: Path) -> list[str]:
    """Versions that a reader of the folder sees, after a check that each is whole."""
    versions = sorted((tmp_path / "bundles" / "glass" / "versions").glob("*"))
    for folder in versions:
        assert {path.name for path in folder.iterdir()} == {MANIFEST, *FILES}
        for name, file in json.loads((folder / MANIFEST).read_bytes())["files"].items():
            assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == file["sha256"]
    return [folder.name for folder in versions]


def test_a_bundle_is_fetched_whole_and_found_again_by_one_question(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    assert folder == tmp_path / "bundles" / "glass" / "versions" / "1.0.0"
    assert visible(tmp_path) == ["1.0.0"]
    assert (folder / FILES[0]).read_text().startswith(f"{FILES[0]} 1.0.0")
    before = len(server.requests)
    assert fetch(server, tmp_path) == folder
    ((path, headers),) = server.requests[before:]
    assert path == "/v1/models/glass/pointers/champion"
    assert headers["Cache-Control"] == "no-cache"
    assert not (tmp_path / "bundles" / "glass" / "parts").exists()


def test_a_new_version_replaces_the_old_one_which_stays_readable(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.9.0")
    old = fetch(server, tmp_path)
    publish(server, tmp_path, "1.10.0")
    assert fetch(server, tmp_path).name == "1.10.0"
    assert visible(tmp_path) == ["1.10.0", "1.9.0"]
    assert old.is_dir()
    assert fetch(server, tmp_path, "1.9.0") == old


def test_files_that_were_damaged_here_are_fetched_again(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    for damage in (lambda: (folder / FILES[0]).write_text("x"), lambda: (folder / FILES[1]).unlink()):
        damage()
        assert cached("glass", url=server.url, folder=tmp_path / "bundles") is None
        assert fetch(server, tmp_path) == folder
        assert visible(tmp_path) == ["1.0.0"]


def _other_signature(record: Record) -> Record:
    return {**record, "signature": STRANGER.sign(record["statement"])}


def _no_signature(record: Record) -> Record:
    return {**record, "signature": ""}


def _other_key(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of(record["version"], files, STRANGER)


def _higher_version(record: Record) -> Record:
    return {**record, "version": "9.0.0"}


def _higher_version_in_the_statement(record: Record) -> Record:
    return {**record, "version": "9.0.0", "statement": record["statement"].replace("1.1.0", "9.0.0")}


def _file_swapped(record: Record) -> Record:
    files = {**record["files"], FILES[0]: {"sha256": "0" * 64, "bytes": 3}}
    return {**record, "files": files}


def _file_added(record: Record) -> Record:
    return {**record, "files": {**record["files"], "evil.glsl": {"sha256": "0" * 64, "bytes": 3}}}


def _file_left_out(record: Record) -> Record:
    return {**record, "files": {name: file for name, file in record["files"].items() if name != FILES[0]}}


def _other_digest(record: Record) -> Record:
    return {**record, "digest": "0" * 64}


def _other_digest_signed(record: Record) -> Record:
    text = record["statement"].replace(record["digest"], "0" * 64)
    return {**record, "digest": "0" * 64, "statement": text, "signature": SIGNER.sign(text)}


def _other_name(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of(record["version"], files, name="crystal")


def _path_for_a_name(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of(record["version"], {**files, "../../evil": FileRef(sha256="0" * 64, bytes=3)})


def _path_for_a_version(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of("../../../published-1.0.0-0", files)


def _no_version(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of("", files)


def _without_manifest(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items() if name != MANIFEST}
    return record_of(record["version"], files)


def _too_large(record: Record) -> Record:
    files = {name: FileRef(**file) for name, file in record["files"].items()}
    return record_of(record["version"], {**files, FILES[0]: FileRef(sha256="0" * 64, bytes=1 << 40)})


def _no_record(record: Record) -> Record:
    return {"detail": "hello"}


TAMPERED: list[Callable[[Record], Record]] = [
    _other_signature,
    _no_signature,
    _other_key,
    _higher_version,
    _higher_version_in_the_statement,
    _file_swapped,
    _file_added,
    _file_left_out,
    _other_digest,
    _other_digest_signed,
    _other_name,
    _path_for_a_name,
    _path_for_a_version,
    _no_version,
    _without_manifest,
    _too_large,
    _no_record,
]


@pytest.mark.parametrize("tamper", TAMPERED)
def test_a_tampered_record_is_refused_and_the_old_bundle_stays(
    tamper: Callable[[Record], Record], server: ReleaseServer, tmp_path: Path
) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    before = len(server.blob_requests())
    server.records["glass/versions/1.1.0"] = json.dumps(tamper(publish(server, tmp_path, "1.1.0"))).encode()
    with pytest.raises(Refused):
        fetch(server, tmp_path)
    assert len(server.blob_requests()) == before
    assert visible(tmp_path) == ["1.0.0"]
    assert cached("glass", url=server.url, folder=tmp_path / "bundles") == folder


@pytest.mark.parametrize("name", [MANIFEST, *FILES])
def test_a_tampered_file_is_refused_and_the_old_bundle_stays(name: str, server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    record = publish(server, tmp_path, "1.1.0")
    sha256 = record["files"][name]["sha256"]
    genuine = server.blobs[sha256]
    for tampered in (b"?" + genuine[1:], genuine + b"?"):
        server.blobs[sha256] = tampered
        with pytest.raises(Refused):
            fetch(server, tmp_path)
        assert visible(tmp_path) == ["1.0.0"]
        assert cached("glass", url=server.url, folder=tmp_path / "bundles") == folder
    server.blobs[sha256] = genuine
    assert fetch(server, tmp_path).name == "1.1.0"


INVALID: list[tuple[dict[str, Any], str]] = [
    ({"format": "other/1"}, "format 'other/1'"),
    ({"files": {}}, "there are no files"),
    ({"files": {FILES[0]: {}}}, "missing"),
    ({"hidden": [5]}, "the layers do not follow"),
    ({"features": []}, "no features"),
    ({"features": [{"name": "count", "mean": 0.0, "std": 0.0}]}, "no spread"),
    ({"features": [{"name": "count", "mean": float("nan"), "std": 1.0}]}, "not finite"),
    ({"features": [{"name": "count", "mean": 10**400, "std": 1.0}]}, "too large"),
    ({"outputs": ["a"]}, "does not answer a"),
    ({"head": "other"}, "head 'other'"),
    ({"self_test": None, "tail": None}, "another type"),
    ({"surprise": 1}, "surprise is unknown"),
]


@pytest.mark.parametrize(("change", "why"), INVALID)
def test_a_manifest_that_is_not_valid_is_refused_though_it_is_signed(
    change: dict[str, Any], why: str, server: ReleaseServer, tmp_path: Path
) -> None:
    with pytest.raises(Refused, match=f"not one that this client understands: .*{why}"):
        _fetch_with_manifest(server, tmp_path, change)
    assert visible(tmp_path) == []


def test_a_manifest_that_lists_other_files_is_refused_though_it_is_signed(
    server: ReleaseServer, tmp_path: Path
) -> None:
    files = json.loads((make_bundle(tmp_path / "other", "other") / MANIFEST).read_bytes())["files"]
    with pytest.raises(Refused, match="does not list the files"):
        _fetch_with_manifest(server, tmp_path, {"files": files})
    assert visible(tmp_path) == []


def _fetch_with_manifest(server: ReleaseServer, tmp_path: Path, change: dict[str, Any]) -> None:
    bundle = make_bundle(tmp_path / "bundle")
    manifest = json.loads((bundle / MANIFEST).read_text())
    (bundle / MANIFEST).write_text(json.dumps({**manifest, **change}))
    files = bundle_files(bundle)
    server.blobs |= {files[name].sha256: (bundle / name).read_bytes() for name in files}
    serve(server, record_of("1.0.0", files))
    fetch(server, tmp_path)


def test_the_same_version_with_other_files_is_refused(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    fetch(server, tmp_path)
    bundle = make_bundle(tmp_path / "other", "other")
    files = bundle_files(bundle)
    server.blobs |= {files[name].sha256: (bundle / name).read_bytes() for name in files}
    for alias in ("champion", "candidate", "1.0.0"):
        serve(server, record_of("1.0.0", files), alias)
        with pytest.raises(Refused, match="a folder of its own"):
            fetch(server, tmp_path, alias)
    other = pull("glass", "candidate", url=server.url, key=KEY, folder=tmp_path / "others")
    assert visible(tmp_path) == ["1.0.0"]
    assert (other / MANIFEST).read_bytes() == (bundle / MANIFEST).read_bytes()


def test_a_version_that_was_asked_for_is_that_version(server: ReleaseServer, tmp_path: Path) -> None:
    record = publish(server, tmp_path, "1.0.0")
    state(server, pointer_to(record, "1.1.0"), "1.1.0")
    with pytest.raises(Refused, match=r"1\.0\.0 for 'glass' 1\.1\.0"):
        fetch(server, tmp_path, "1.1.0")


def test_the_first_key_is_pinned_and_a_given_key_counts_from_the_first(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    with pytest.raises(Refused, match="not the one that was given"):
        fetch(server, tmp_path, public_key=STRANGER.public_key)
    fetch(server, tmp_path)
    trust = json.loads((tmp_path / "bundles" / "trust.json").read_text())
    assert trust["servers"] == {server.url: SIGNER.public_key}
    publish(server, tmp_path, "1.1.0", signer=STRANGER)
    with pytest.raises(Refused, match="give the new one as public_key"):
        fetch(server, tmp_path)
    assert fetch(server, tmp_path, public_key=STRANGER.public_key).name == "1.1.0"
    assert fetch(server, tmp_path).name == "1.1.0"


def test_a_cache_that_was_tampered_with_is_not_used(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    fetch(server, tmp_path)
    pulled = tmp_path / "bundles" / "glass" / "aliases" / "champion.json"
    genuine = pulled.read_text()
    digest = json.loads(genuine)["digest"]
    server.stop()
    for tampered in ("{", "[]", genuine.replace("1.0.0", "1.0.1"), genuine.replace(digest, "0" * 64)):
        pulled.write_text(tampered)
        assert cached("glass", url=server.url, folder=tmp_path / "bundles") is None
        with pytest.raises(Unavailable):
            fetch(server, tmp_path)
    pulled.write_text(genuine)
    assert cached("glass", url=server.url, folder=tmp_path / "bundles")
    assert cached("glass", url=server.url, folder=tmp_path / "bundles", public_key=STRANGER.public_key) is None
    assert cached("glass", url="http://other.test", folder=tmp_path / "bundles") is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ranges", [True, False])
def test_a_connection_cut_anywhere_never_shows_a_partial_bundle(
    ranges: bool, seed: int, server: ReleaseServer, tmp_path: Path
) -> None:
    publish(server, tmp_path, "1.0.0")
    old = fetch(server, tmp_path)
    record = publish(server, tmp_path, "1.1.0")
    drawn = random.Random(seed)
    server.ranges = ranges
    server.cuts = [drawn.randrange(5000) if drawn.random() < 0.7 else 0 for _ in range(40)]
    for _ in range(60):
        assert fetch(server, tmp_path) in (old, old.with_name("1.1.0"))
        assert visible(tmp_path)[0] == "1.0.0"
        if not server.cuts:
            break
    assert fetch(server, tmp_path).name == "1.1.0"
    assert visible(tmp_path) == ["1.0.0", "1.1.0"]
    assert record["version"] == "1.1.0"


def test_a_cut_download_goes_on_where_it_stopped(server: ReleaseServer, tmp_path: Path) -> None:
    record = publish(server, tmp_path, "1.0.0")
    manifest_bytes = record["files"][MANIFEST]["bytes"]
    server.cuts = [manifest_bytes, 1000, 2000]
    fetch(server, tmp_path)
    ranges = [headers["Range"] for headers in server.blob_requests() if "Range" in headers]
    assert ranges == ["bytes=1000-", "bytes=3000-"]


def test_a_download_goes_on_in_the_next_process(server: ReleaseServer, tmp_path: Path) -> None:
    record = publish(server, tmp_path, "1.0.0")
    server.cuts = [record["files"][MANIFEST]["bytes"], 1000, *([0] * client_server.ATTEMPTS)]
    with pytest.raises(Unavailable):
        fetch(server, tmp_path)
    assert visible(tmp_path) == []
    assert fetch(server, tmp_path).name == "1.0.0"
    assert server.blob_requests()[-len(FILES)]["Range"] == "bytes=1000-"


def test_a_damaged_part_of_an_earlier_attempt_is_fetched_anew(server: ReleaseServer, tmp_path: Path) -> None:
    record = publish(server, tmp_path, "1.0.0")
    parts = tmp_path / "bundles" / "glass" / "parts"
    parts.mkdir(parents=True)
    (parts / record["files"][FILES[0]]["sha256"]).write_bytes(b"?" * 100)
    (parts / record["files"][FILES[1]]["sha256"]).write_bytes(b"?" * 100_000)
    assert fetch(server, tmp_path).name == "1.0.0"


def test_a_server_that_is_down_does_not_take_the_bundle_away(
    server: ReleaseServer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    for status in (500, 503, 429):
        server.status = status
        assert fetch(server, tmp_path) == folder
    server.stop()
    assert fetch(server, tmp_path) == folder
    assert "Using 'glass' 1.0.0 of an earlier pull" in caplog.text
    with pytest.raises(Unavailable):
        fetch(server, tmp_path, "candidate")
    server.status = None
    server.start()
    assert fetch(server, tmp_path) == folder


def test_refusals_of_the_server_say_what_to_do(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    with pytest.raises(NotFound, match="diaphane models list"):
        fetch(server, tmp_path, "candidate")
    for key, said in ((None, "scope `read`"), ("dia_\u00e4", "one word"), ("dia_x\nHost: x", "one word")):
        with pytest.raises(Denied, match=said):
            pull("glass", url=server.url, key=key, folder=tmp_path / "bundles")
    assert pull("glass", url=server.url, key=f"{KEY}\n", folder=tmp_path / "bundles").name == "1.0.0"
    for status in (301, 418):
        server.status = status
        with pytest.raises(Refused, match=f"status {status}"):
            fetch(server, tmp_path)
    for name, alias in (("../x", "champion"), ("glass", "../../keys"), ("glass", "a/b"), ("", "champion")):
        with pytest.raises(NotFound, match="There can be no"):
            pull(name, alias, url=server.url, key=KEY, folder=tmp_path / "bundles")


def test_a_record_without_end_is_not_read_to_its_end(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    for path in ("versions/1.0.0", "pointers/champion"):
        server.records[f"glass/{path}"] = b" " * (4 << 20)
        with pytest.raises(Refused, match="too long"):
            fetch(server, tmp_path)


def test_a_full_disk_leaves_the_old_bundle(
    server: ReleaseServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish(server, tmp_path, "1.0.0")
    folder = fetch(server, tmp_path)
    publish(server, tmp_path, "1.1.0")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            fetch(server, tmp_path)
    assert visible(tmp_path) == ["1.0.0"]
    assert cached("glass", url=server.url, folder=tmp_path / "bundles") == folder
    assert fetch(server, tmp_path).name == "1.1.0"


def test_two_processes_that_pull_at_once_both_get_the_bundle(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    code = (
        "import sys; from diaphane_client import pull; "
        "print(pull('glass', url=sys.argv[1], key=sys.argv[2], folder=sys.argv[3]))"
    )
    command = [sys.executable, "-c", code, server.url, KEY, str(tmp_path / "bundles")]
    processes = [
        subprocess.Popen(command, cwd=CLIENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for process in processes:
        out, err = process.communicate(timeout=60)
        assert process.returncode == 0, err
        assert Path(out.strip()).name == "1.0.0"
    assert visible(tmp_path) == ["1.0.0"]


def test_the_client_needs_numpy_signatures_and_an_http_client_and_nothing_else(tmp_path: Path) -> None:
    shutil.copytree(CLIENT / "diaphane_client", tmp_path / "diaphane_client")
    code = (
        "import sys; before = set(sys.modules); import diaphane_client; "
        "found = {name.split('.')[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names); "
        "print(*sorted(name for name in found if not name.startswith('_')))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
    of_httpx = {"anyio", "certifi", "h11", "httpcore", "idna", "sniffio", "typing_extensions"}
    # What httpx takes along where it happens to be installed: its command line, and other transports.
    optional = {"click", "rich", "pygments", "markdown_it", "mdurl", "h2", "hpack", "hyperframe", "socksio", "brotli"}
    found = set(done.stdout.split())
    assert {"diaphane_client", "cryptography", "httpx", "numpy"} <= found
    assert found <= {"diaphane_client", "cryptography", "httpx", "numpy", *of_httpx, *optional}
    declared = tomllib.loads((CLIENT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert [re.split("[<>=]", each)[0] for each in declared] == ["cryptography", "httpx", "numpy"]
