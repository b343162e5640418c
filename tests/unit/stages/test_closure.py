"""A module's version follows from its imports and from the files that they load, and from nothing else."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.imports import imported, module_files

from evaluation.versions import ROOT
from stages.catalogue import STAGES
from stages.closure import PACKAGES, Tree
from stages.stage import module_of
from stages.tasks import StageName

EVERY = frozenset(STAGES)


def packages_of(name: str) -> set[str]:
    parts = name.split(".")
    return {".".join(parts[:end]) for end in range(1, len(parts) + 1)}


def test_imports_are_those_that_the_parser_finds() -> None:
    tree, modules = Tree(), module_files()
    for name, path in modules.items():
        parsed = {package for each in imported(path, modules) for package in packages_of(each)}
        found = tree.imports(name) & modules.keys()
        late = found - parsed  # what a package imports when it is first asked for has no import of its own
        assert parsed <= found, name
        assert not late or any("__getattr__" in modules[each].read_text() for each in parsed), (name, late)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("tree")
    unneeded = shutil.ignore_patterns("__pycache__", "static")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, root / package, ignore=unneeded)
    return root


@pytest.fixture(scope="module")
def as_copied(copy: Path) -> dict[str, str]:
    return versions(copy)


def versions(root: Path) -> dict[str, str]:
    tree = Tree(root)
    return {stage: tree.version(module_of(stage)) for stage in STAGES}


@pytest.mark.parametrize(
    ("file", "stages"),
    [
        ("stages/desk.py", EVERY),
        ("stages/__init__.py", EVERY),
        ("schemas/scene.py", EVERY),
        ("renderer/gate/gltf.py", EVERY),  # of a .glb, by an import in a function
        ("schemas/options.py", {"export"}),  # a new option makes anew only what it decides
        ("renderer/rooms.py", {"scene"}),
        ("renderer/capture.py", {"render"}),
        ("renderer/shaders/capture/append.frag", {"render", "evaluate"}),
        ("renderer/shaders/common/texture.glsl", EVERY),  # of an include of an include
        ("renderer/shaders/sbuffer/resolve.frag", {"evaluate"}),
        ("renderer/shaders/dual-depth-peeling/step.frag", {"evaluate"}),  # its folder's name stands by itself
        ("renderer/techniques/moment.py", {"evaluate"}),
        ("labeller/curves.py", {"label", "train", "export", "evaluate"}),
        ("labeller/hull.py", {"label", "train", "export"}),
        ("trainer/sgd.py", {"train"}),
        ("evaluation/templates/report.css", {"train", "report"}),
        ("stages/making/report.py", {"report"}),
        ("services/templates/dashboard/base.html.j2", set()),
        ("renderer/shaders/hidden/hidden.frag", set()),
        ("labeller/api.py", set()),
        ("services/api/routes.py", set()),
        ("stages/bodies.py", set()),
    ],
)
def test_a_change_makes_the_stages_anew_that_import_it_and_no_other(
    file: str, stages: frozenset[str], copy: Path, as_copied: dict[str, str]
) -> None:
    path = copy / file
    content = path.read_bytes()
    path.write_bytes(content + b"\n")
    now = versions(copy)
    path.write_bytes(content)
    assert {stage for stage in STAGES if now[stage] != as_copied[stage]} == set(stages)


@pytest.mark.parametrize("stage", STAGES)
def test_whatever_a_stage_imports_is_among_its_files(stage: StageName) -> None:
    modules, seen = module_files(), set[str]()
    ahead = packages_of(module_of(stage))
    while ahead:
        name = ahead.pop()
        seen.add(name)
        if name in modules:
            ahead |= {package for each in imported(modules[name], modules) for package in packages_of(each)} - seen
    paths = {modules[name] for name in seen if name in modules}
    assert paths <= set(Tree().files(module_of(stage)))
    named = {path for path in paths if "import_module(" in path.read_text()}
    assert all("def __getattr__" in path.read_text() for path in named), "an import by name is none that can be found"


def small(root: Path, **sources: str) -> Tree:
    for name, text in sources.items():
        path = root / "services" / f"{name}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return Tree(root)


def test_what_only_type_checkers_read_does_not_count(tmp_path: Path) -> None:
    one = "if TYPE_CHECKING:\n    from services.two import x\n\n    from services.three import (\n        y,\n    )\n"
    then = "\ndef f():\n    from services import four\n"
    tree = small(tmp_path, one=one + then, two="", three="", four="")
    assert tree.modules("services.one") == {"services", "services.one", "services.four"}


def test_modules_that_import_each_other_end(tmp_path: Path) -> None:
    tree = small(tmp_path, one="import services.two\n", two="from services.one import x  # a comment\n")
    assert tree.modules("services.one") == tree.modules("services.two") == {"services", "services.one", "services.two"}


def test_a_name_that_a_package_imports_late_counts_where_it_is_taken(tmp_path: Path) -> None:
    package = 'from services.two import y\ndef __getattr__(name):\n    return import_module("services.three").x\n'
    tree = small(tmp_path, __init__=package, late="from services import x", early="from services import y", three="")
    assert "services.three" in tree.modules("services.late")
    assert "services.three" not in tree.modules("services.early")


def test_a_renamed_file_is_another_version(tmp_path: Path) -> None:
    before = small(tmp_path, one="from services.two import x", two="").version("services.one")
    (tmp_path / "services" / "two.py").rename(tmp_path / "services" / "three.py")
    assert small(tmp_path, one="from services.two import x").version("services.one") != before


def test_an_unknown_module_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"services\.one"):
        small(tmp_path).version("services.one")
