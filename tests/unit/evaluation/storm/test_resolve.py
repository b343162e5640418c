"""Storm's resolve shader with another text in it, and the same on disk; nothing of Storm is needed."""

from __future__ import annotations

from pathlib import Path

import pytest

from diaphane.cli.app import run
from evaluation.storm import patch, resolve
from evaluation.storm.engine import Engine
from evaluation.storm.patch import Target
from evaluation.storm.resolve import SHADER, Resolve, digest_of, is_patched, replaced
from schemas.problem import Problem

SHIPPED = """vec4 imageShader(vec2 uv)
{
    const int maxSamples = 8;
    int nodeIndex = ATOMIC_LOAD(hdxOitCounterBuffer[screenIndex]);
    vec4 sortedColor[maxSamples];
    float a = hdxOitDepthBuffer[0]; vec4 b = hdxOitDataBuffer[0]; int c = hdxOitIndexBuffer[0];
    colorAccum = clamp(colorAccum, vec4(0), vec4(1));
    return colorAccum;
}
"""
"""Laid out as Storm's, and as short as that can be."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    file = tmp_path / SHADER
    file.parent.mkdir(parents=True)
    file.write_text(SHIPPED)
    for module in (resolve, patch):
        monkeypatch.setattr(module, "KNOWN", {digest_of(SHIPPED): "1.0"})
    return tmp_path


@pytest.mark.parametrize("how", ["exact", "nearest"])
def test_only_what_composites_is_replaced__how(how: Resolve) -> None:
    made = replaced(SHIPPED, how)
    begin, end = SHIPPED.index("    vec4 sortedColor"), SHIPPED.index("    colorAccum = clamp")
    assert made.startswith(SHIPPED[:begin])
    assert made.endswith(SHIPPED[end:])
    assert SHIPPED[begin:end] not in made
    assert is_patched(made)
    assert not is_patched(SHIPPED)


def test_the_counter_is_read_as_the_version_reads_it() -> None:
    assert "ATOMIC_LOAD(hdxOitCounterBuffer[0])" in replaced(SHIPPED, "exact")
    older = replaced(
        SHIPPED.replace("ATOMIC_LOAD(hdxOitCounterBuffer[screenIndex])", "hdxOitCounterBuffer[screenIndex]"), "exact"
    )
    assert "ATOMIC_LOAD" not in older
    assert "hdxOitCounterBuffer[0] + 1 >=" in older


@pytest.mark.parametrize("gone", ["    vec4 sortedColor[maxSamples];\n", "hdxOitIndexBuffer", "    colorAccum = clamp"])
def test_another_layout_is_refused(gone: str) -> None:
    with pytest.raises(Problem, match="another layout"):
        replaced(SHIPPED.replace(gone, ""), "nearest")


def test_what_is_applied_is_what_was_shown_and_reverting_restores_every_byte(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / SHADER
    before = file.read_bytes()
    assert run(["storm", "patch", str(folder), "--dry-run"]) == 0
    shown = capsys.readouterr().out
    assert file.read_bytes() == before
    assert run(["storm", "patch", str(folder), "--apply"]) == 0
    after = file.read_text()
    added = [line[1:] for line in shown.splitlines() if line.startswith("+") and not line.startswith("+++")]
    assert added
    assert all(line in after.splitlines() for line in added)
    assert run(["storm", "patch", str(folder), "--revert"]) == 0
    assert file.read_bytes() == before
    assert [each.name for each in file.parent.iterdir()] == [file.name]


def test_nothing_is_patched_twice_and_nothing_unknown_is_touched(folder: Path) -> None:
    Target.of(folder).apply()
    with pytest.raises(Problem, match="patched already"):
        Target.of(folder).apply()
    Target.of(folder).revert()
    with pytest.raises(Problem, match="no backup"):
        Target.of(folder).revert()
    (folder / SHADER).write_text(SHIPPED + "// somebody's own\n")
    with pytest.raises(Problem, match="not what a known version"):
        Target.of(folder).apply()
    assert (folder / SHADER).read_text().endswith("own\n")


def test_a_backup_that_was_changed_is_not_put_back(folder: Path) -> None:
    target = Target.of(folder)
    target.apply()
    target.backup.write_text("something else")
    with pytest.raises(Problem, match="was changed"):
        Target.of(folder).revert()
    assert is_patched((folder / SHADER).read_text())


@pytest.mark.parametrize("wanted", [[], ["--apply", "--revert"]])
def test_one_thing_has_to_be_asked_for(folder: Path, wanted: list[str]) -> None:
    assert run(["storm", "patch", str(folder), *wanted]) == 2


def test_a_missing_storm_is_a_problem(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="no interpreter"):
        Engine.of(tmp_path / "python")
    python = tmp_path / "bin" / "python"
    python.parent.mkdir()
    python.touch()
    with pytest.raises(Problem, match="no OpenUSD with Storm"):
        Engine.of(python)
    with pytest.raises(Problem, match="There is no"):
        Target.of(tmp_path)
