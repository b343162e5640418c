"""The browser client's sources: what is committed is what they make, and their own tests pass."""

from __future__ import annotations

import base64
import hashlib
import json
import shutil
import tarfile
from pathlib import Path

import pytest
from support.web import ROOT, WEB, run

from renderer.samples.glb import HOME, SAMPLES

STATIC = ROOT / "services/dashboard/static"
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


def _content(folder: Path) -> dict[str, object]:
    """What the files of a folder say; of a package that, and not how this version of node packs it."""
    return {path.relative_to(folder).as_posix(): _said(path) for path in folder.rglob("*") if path.is_file()}


def _said(path: Path) -> object:
    if path.suffix == ".tgz":
        with tarfile.open(path) as packed:
            return {each.name: packed.extractfile(each).read() for each in packed.getmembers()}  # type: ignore[union-attr]
    if path.name == "index.json":
        listed = json.loads(path.read_text(encoding="utf-8"))["packages"]
        return [{name: one[name] for name in one.keys() - {"bytes", "integrity"}} for one in listed]
    return path.read_bytes()


@pytest.fixture(scope="module")
def made(installed: Path) -> Path:
    """What the sources make, in the place of the service's folder of it."""
    done = run(installed, "npm", "run", "build")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return installed.parents[2] / STATIC.relative_to(ROOT)


@pytest.mark.parametrize("name", ["demo", "examples", "clients"])
def test_what_is_committed_is_what_the_sources_make(made: Path, name: str) -> None:
    ours, theirs = _content(made / name), _content(STATIC / name)
    assert sorted(ours) == sorted(theirs), "run `make clients`"
    assert ours == theirs, "run `make clients`"


def test_the_list_of_packages_is_right() -> None:
    for one in json.loads((STATIC / "clients/index.json").read_text(encoding="utf-8"))["packages"]:
        content = (STATIC / "clients" / one["file"]).read_bytes()
        assert one["bytes"] == len(content)
        assert one["integrity"] == f"sha512-{base64.b64encode(hashlib.sha512(content).digest()).decode()}"


def test_packages_install_in_an_empty_folder_and_their_types_hold(installed: Path, tmp_path: Path) -> None:
    """With the lines of the package's own README, and three.js as it is installed here: nothing is fetched."""
    (tmp_path / "package.json").write_text('{"private": true, "type": "module"}')
    packages = [str(path) for path in sorted((STATIC / "clients").glob("*.tgz"))]
    three = [str(installed / "node_modules" / name) for name in ("three", "@types/three")]
    done = run(tmp_path, "npm", "install", "--offline", "--no-audit", "--no-fund", *packages, *three)
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "node_modules/@diaphane/three/LICENSE").is_file()
    readme = (tmp_path / "node_modules/@diaphane/three/README.md").read_text(encoding="utf-8")
    (tmp_path / "first.ts").write_text(readme.split("```js\n")[1].split("```")[0], encoding="utf-8")
    strict = ("--strict", "--noEmit", "--module", "esnext", "--moduleResolution", "bundler", "--target", "es2022")
    done = run(tmp_path, str(installed / "node_modules/.bin/tsc"), *strict, "first.ts")
    assert done.returncode == 0, done.stdout


def test_its_own_tests_pass(installed: Path) -> None:
    done = run(installed, "npm", "test")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@needs_node
def test_types_are_those_of_the_api(tmp_path: Path) -> None:
    done = run(WEB, "node", "scripts/api-types.mjs", str(tmp_path / "api.ts"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api.ts").read_text() == (WEB / "packages/core/src/api.ts").read_text(), "run `npm run types`"


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_what_their_author_makes(name: str) -> None:
    assert SAMPLES[name]() == (HOME / name).read_bytes(), "run `python -m renderer.samples.glb`"
