"""The window's part of the viewer, on a window of the test's own: what is drawn, and when nothing is."""

from __future__ import annotations

import queue
from collections.abc import Hashable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import numpy as np
import pytest
from support.scenes import VIEW, shells

from evaluation.bench.exact import Exact
from evaluation.bench.rounds import shoot
from evaluation.bench.subject import Subject
from evaluation.viewer import window as module
from evaluation.viewer.comparing import Compared, Comparer, Picture, compare
from evaluation.viewer.controls import KEYS, Look, Place
from evaluation.viewer.model import Source
from evaluation.viewer.session import Session
from evaluation.viewer.studio import Studio
from evaluation.viewer.window import Files, Viewer
from renderer import context
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBuffer, KBufferTemporal, Needs, Rendered, SBuffer, Technique
from renderer.techniques.kbuffer_temporal import SETTLED
from renderer.timing import Recording
from schemas.bundle import TailSpec
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import TailName

SIZE = (120, 60)


class Window:
    """What the viewer needs of a moderngl-window window."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx, self.title, self.is_closing = ctx, "", False
        self.buffer_size = self.size = SIZE
        names = {name.removeprefix("shift+") for name in (*KEYS, "P", "C", "ESCAPE")}
        self.keys = SimpleNamespace(ACTION_PRESS=1, ACTION_RELEASE=0, **{name: name for name in names})
        self.modifiers = SimpleNamespace(shift=False)
        self.mouse_states = SimpleNamespace(left=True, middle=False, right=False)
        self.fbo = ctx.framebuffer([ctx.texture(SIZE, 4)])
        self.swaps = 0

    @property
    def width(self) -> int:
        return self.size[0]

    @property
    def height(self) -> int:
        return self.size[1]

    def use(self) -> None:
        self.fbo.use()

    def swap_buffers(self) -> None:
        self.swaps += 1

    def pixels(self) -> np.ndarray:
        """uint8 [H, W, 3], row 0 at the top."""
        rows = np.frombuffer(self.fbo.read(components=3, alignment=1), np.uint8)
        return rows.reshape(self.height, self.width, 3)[::-1]


class Beside(Comparer):
    """Compares at once, and answers when it may."""

    def __init__(self) -> None:
        super().__init__()
        self.views: list[Hashable] = []
        self.may_answer, self.found = True, None

    def ask(self, view: Hashable, dump: FragmentDump, picture: Picture) -> None:
        assert not self.is_busy
        self.views.append(view)
        self.is_busy, self.found = True, compare(Exact(dump), picture)

    def answer(self) -> Compared | Problem | None:
        if not (self.is_busy and self.may_answer):
            return None
        self.is_busy = False
        return self.found


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


@pytest.fixture
def viewer(gpu: GpuScene, ctx: moderngl.Context, tmp_path: Path) -> Viewer:
    return make(gpu, ctx, tmp_path)


def make(gpu: GpuScene, ctx: moderngl.Context, tmp_path: Path, bundle: Path | None = None) -> Viewer:
    studio = Studio(gpu, Needs(bundle=bundle), (1.0, 1.0, 1.0), 0.75)
    left = "kbuffer" if bundle is None else "kbuffer-deep"
    look = Look(VIEW, SIZE, left, "sbuffer", 1.0, "density-16", readout=False)
    place = Place(("kbuffer", "sbuffer", "kbuffer-optimal"), (VIEW,), (0.0, 1.0, 0.0), gpu.scene.bounds)
    source = Source(bundle, "glass@champion" if bundle else "", queue.SimpleQueue())
    files = Files(tmp_path / "out", None, lambda _: None)
    return Viewer(Window(ctx), Session(studio, look, "shells", source.name), place, source, files, Beside())


def press(viewer: Viewer, name: str, shift: bool = False) -> None:
    viewer.on_key(name, 1, SimpleNamespace(shift=shift))
    viewer.on_key(name, 0, SimpleNamespace(shift=shift))


def test_the_picture_is_on_the_screen_pixel_by_pixel_and_fills_it(viewer: Viewer) -> None:
    window: Window = viewer.window
    for key in ("NUMBER_2", "NUMBER_1", "NUMBER_3", "NUMBER_4", "NUMBER_5", "I"):
        press(viewer, key)
        viewer.step()
        assert np.array_equal(window.pixels(), viewer.session.screen())
    assert "kbuffer | sbuffer" in window.title


def test_the_read_out_says_what_it_costs_and_how_far_off_it_is(viewer: Viewer) -> None:
    session = viewer.session
    shot = session.sides()["left"]
    before = session._lines("left", shot)
    session.rows(0)
    lines = session._lines("left", shot)
    assert before[:2] == lines[:2] == ["kbuffer", "F 1 per pixel, 7,200; tail density-16"]
    assert before[-1] == "against exact: when the camera rests"
    compared = session.studio.known(shot, False)  # type: ignore[arg-type]
    assert isinstance(compared, Compared)
    assert f"MSE {1e5 * compared.mse:.4g} x1e-5, PSNR {compared.psnr:.2f} dB" in lines[-1]
    assert f"of {compared.fragments:,}, k {compared.k[0]}..{compared.k[1]}" in " ".join(lines)
    # A pass and its time are on one line, in letters that the font has.
    passes = [part for line in lines for part in line.removesuffix(",").split(", ") if "chain" in part]
    assert passes
    assert all(len(part.split(" ")) == 2 for part in passes)
    assert all(line.isascii() for line in lines)


def test_a_window_of_odd_width_has_a_black_column_beside_two_pictures(viewer: Viewer) -> None:
    window: Window = viewer.window
    window.buffer_size = window.size = (SIZE[0] - 1, SIZE[1] - 1)
    window.fbo = window.ctx.framebuffer([window.ctx.texture(window.size, 4)])
    viewer.step()
    assert viewer.session.look.size == (59, 59)
    assert np.array_equal(window.pixels()[:, :118], viewer.session.screen())
    assert not window.pixels()[:, 118].any()


def test_nothing_is_rendered_while_nothing_changes(viewer: Viewer, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    assert viewer.step()
    shots = viewer.session.sides()
    assert not viewer.step()
    assert known(viewer, "left") is None
    now[0] += module.REST + 0.1
    assert [viewer.step() for _ in range(4)] == [True, True, True, False]  # asked for; the left one; the right one
    assert [isinstance(known(viewer, side), Compared) for side in shots] == [True, True]
    now[0] += 10.0
    assert not viewer.step()
    assert viewer.session.sides()["left"] is shots["left"]
    press(viewer, "Q")
    assert viewer.step()
    press(viewer, "A")
    viewer.step()
    assert viewer.session.sides()["left"] is shots["left"]  # going back renders nothing


def test_what_learns_from_frame_to_frame_settles_before_it_is_compared(
    gpu: GpuScene, ctx: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    budgets = []

    class Learning(KBuffer):
        def render(self, frame: Frame, budget: Budget) -> Rendered:
            budgets.append(budget)
            return super().render(frame, budget)

    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr("evaluation.viewer.studio.technique", lambda *_: Learning())
    viewer = make(gpu, ctx, tmp_path, tmp_path)
    viewer.session.look = replace(viewer.session.look, left=KBufferTemporal.name, layout="single")
    viewer.step()
    budgets.clear()
    now[0] += module.REST + 0.1
    for number in range(2, 5):
        assert viewer.step()
        assert len(budgets) == number - 1
    press(viewer, "B")
    viewer.step()
    press(viewer, "V")
    viewer.step()
    assert len(budgets) == 4, "it is the picture of before, which begins anew when the camera rests"
    now[0] += module.REST + 0.1
    budgets.clear()
    while known(viewer, "left") is None:
        assert viewer.step()
    assert len(budgets) == SETTLED
    assert len(set(budgets)) == 1


def test_while_it_is_compared_the_window_goes_on_and_shows_no_answer_to_what_it_left(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    beside: Beside = viewer._comparer  # type: ignore[assignment]
    beside.may_answer = False
    viewer.step()
    now[0] += module.REST + 0.1
    viewer.step()
    assert said(viewer) == "against exact: computing"
    assert not viewer.step(), "nothing is drawn while it is waited for"
    for _ in range(5):  # quick switching: whoever looks does not wait, and nothing is queued
        press(viewer, "RIGHT")
        assert viewer.step()
        assert said(viewer) == "against exact: when the camera rests"
        now[0] += module.REST + 0.1
        viewer.step()
        assert said(viewer) == "against exact: computing"
    assert len(beside.views) == 1
    beside.may_answer = True
    viewer.step()
    assert known(viewer, "left") is None, "the answer is about another camera"
    for _ in range(3):
        viewer.step()
    look = viewer.session.look
    assert beside.views[1:] == [(look.view, look.size)] * 2
    assert said(viewer).startswith("against exact: MSE")
    beside.may_answer = False
    press(viewer, "F")
    viewer.step()
    assert said(viewer) == "against exact: when the camera rests", "FLIP was not computed"


def test_a_comparison_that_fails_is_said_once(viewer: Viewer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "REST", -1.0)
    beside: Beside = viewer._comparer  # type: ignore[assignment]
    press(viewer, "NUMBER_1")
    for _ in range(2):
        viewer.step()
    beside.found = Problem("It ended.", "Make the window smaller.")
    for _ in range(3):
        viewer.step()
    assert viewer.session.message == "It ended. Make the window smaller."
    assert said(viewer) == "against exact: could not be computed"
    assert not viewer.step()
    assert len(beside.views) == 1
    assert viewer.session.rows(0)[0]["mse"], "statistics are computed when they are asked for"


def known(viewer: Viewer, side: str) -> Compared | Problem | None:
    """What is known of a picture that is shown."""
    shot = viewer.session.sides()[side]
    return viewer.session.studio.known(shot, viewer.session.look.perceptual)  # type: ignore[arg-type]


def said(viewer: Viewer) -> str:
    """The read-out's word about the left picture's error."""
    session = viewer.session
    lines = session._lines("left", session.sides()["left"])
    return next(line for line in lines if line.startswith("against exact"))


def test_the_mouse_turns_moves_and_zooms(viewer: Viewer) -> None:
    window: Window = viewer.window
    start = viewer.session.look.view
    viewer.on_press(10, 10, 1)
    viewer.on_drag(30, 10, 20, 0)
    viewer.on_release(30, 10, 1)
    turned = viewer.session.look.view
    assert turned.eye[1] == pytest.approx(start.eye[1])
    assert turned.eye != start.eye
    window.mouse_states.right = True
    viewer.on_drag(30, 20, 0, 10)
    moved = viewer.session.look.view
    assert np.array(moved.eye) - np.array(turned.eye) == pytest.approx(np.array(moved.target) - np.array(turned.target))
    assert moved.eye[1] > turned.eye[1]  # the scene follows the mouse down
    viewer.on_scroll(0.0, 1.0)
    nearer = viewer.session.look.view
    assert np.linalg.norm(np.array(nearer.eye) - np.array(nearer.target)) < np.linalg.norm(
        np.array(moved.eye) - np.array(moved.target)
    )


def test_the_divider_is_dragged_where_it_is_and_the_camera_elsewhere(viewer: Viewer) -> None:
    press(viewer, "NUMBER_3")
    start = viewer.session.look.view
    viewer.on_press(62, 10, 1)
    viewer.on_drag(90, 10, 28, 0)
    viewer.on_release(90, 10, 1)
    assert viewer.session.look.split == 0.75
    assert viewer.session.look.view == start
    viewer.on_press(20, 10, 1)
    viewer.on_drag(30, 10, 10, 0)
    assert viewer.session.look.split == 0.75
    assert viewer.session.look.view != start


def test_slow_pictures_are_coarse_while_the_mouse_leads_the_camera(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    window: Window = viewer.window
    monkeypatch.setattr(module, "_SLOW", 0.0)
    viewer.step()
    viewer.on_press(10, 10, 1)
    viewer.on_drag(30, 10, 20, 0)
    viewer.step()
    assert viewer.session.look.size == (SIZE[0] // 8, SIZE[1] // 4)
    coarse = np.kron(viewer.session.image(), np.ones((4, 4, 1), np.uint8))
    assert np.array_equal(window.pixels(), coarse)
    viewer.on_release(30, 10, 1)
    viewer.step()
    assert viewer.session.look.size == (SIZE[0] // 2, SIZE[1])


def test_files_are_written_and_what_went_wrong_is_said(viewer: Viewer, tmp_path: Path) -> None:
    viewer.step()
    for key in ("P", "P", "C", "C"):
        press(viewer, key)
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    one = [f"shells-001{part}.png" for part in ("-left-kbuffer", "-right-sbuffer", "")]
    assert names == [*one, *(name.replace("001", "002") for name in one), "statistics.csv"]
    assert [(row["frame"], row["side"]) for row in viewer.rows] == [(n, s) for n in (0, 1) for s in ("left", "right")]
    assert viewer.session.message == "Wrote statistics.csv."
    (tmp_path / "out" / "statistics.csv").write_text("something else")
    press(viewer, "C")
    assert "no file of statistics" in viewer.session.message
    press(viewer, "H")
    assert viewer.session.message == ""


def test_a_technique_that_cannot_render_leaves_the_window_alone(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise Problem("It needs 9 GiB.", "Ask for less.")

    monkeypatch.setattr("evaluation.viewer.studio.shoot", refuse)
    press(viewer, "I")
    viewer.step()
    assert len({tuple(pixel) for pixel in viewer.session.image().reshape(-1, 3).tolist()}) == 1
    press(viewer, "P")
    assert viewer.session.message == "It needs 9 GiB. Ask for less."


def test_there_is_no_difference_to_a_picture_that_there_is_none_of(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(subject: Subject, technique: Technique, budget: Budget) -> tuple[Rendered, Recording]:
        if technique.name == "kbuffer":
            raise Problem("It needs 9 GiB.", "Ask for less.")
        return shoot(subject, technique, budget)

    monkeypatch.setattr("evaluation.viewer.studio.shoot", refuse)
    press(viewer, "NUMBER_4")
    viewer.step()
    assert len({tuple(pixel) for pixel in viewer.session.image().reshape(-1, 3).tolist()}) == 1
    press(viewer, "NUMBER_2")
    viewer.step()
    assert len({tuple(pixel) for pixel in viewer.session.image().reshape(-1, 3).tolist()}) > 1


def test_half_of_one_picture_is_for_each_read_out(viewer: Viewer) -> None:
    for key in ("I", "NUMBER_3"):
        press(viewer, key)
    viewer.step()
    before = viewer.session.screen()
    for key in ("W", "NUMBER_3"):
        press(viewer, key)
    half = before.shape[1] // 2
    assert not np.array_equal(viewer.session.screen()[:, half:], before[:, half:])
    assert np.array_equal(viewer.session.screen()[:, :half], before[:, :half])


def test_a_view_without_an_exact_picture_is_shown_and_the_reason_said(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise Problem("There are too many fragments.", "Ask for less.")

    monkeypatch.setattr(module, "REST", -1.0)
    monkeypatch.setattr("evaluation.bench.subject.capture", refuse)
    for _ in range(4):
        viewer.step()
    assert viewer.session.message == "There are too many fragments. Ask for less."
    assert not viewer.step()


def test_escape_ends_it(viewer: Viewer) -> None:
    press(viewer, "ESCAPE")
    viewer.run()
    assert viewer.window.swaps == 0


def test_a_new_bundle_is_taken_while_the_window_is_open(
    gpu: GpuScene, ctx: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def technique(_name: str, needs: Needs) -> Technique:
        version = str(needs.bundle)
        if version == "1.2.0":
            raise Problem("The bundle is damaged.", "Fetch it again.")
        return KBuffer() if version == "1.0.0" else SBuffer()

    monkeypatch.setattr("evaluation.viewer.studio.technique", technique)
    viewer = make(gpu, ctx, tmp_path, Path("1.0.0"))
    viewer.step()
    before = viewer.session.sides()
    viewer._source.later.put(Path("1.1.0"))
    assert viewer.step()
    after = viewer.session.sides()
    assert after["right"] is before["right"]
    assert after["left"].rendered.captured > before["left"].rendered.captured  # type: ignore[union-attr]
    assert viewer.session.rows(0)[0]["bundle"] == "glass@1.1.0"
    viewer._source.later.put(Path("1.2.0"))
    viewer.step()
    assert viewer.session.sides()["left"] is after["left"]
    assert viewer.session.message == "The bundle is damaged. Fetch it again."
    assert viewer.session.bundle == "glass@1.1.0"


def test_a_new_bundle_brings_its_tail_unless_another_one_was_chosen(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, tails = viewer.session, [TailSpec(name="binned-16", g=0.5), TailSpec(name="binned-8", g=0.25)]
    monkeypatch.setattr(session.studio, "load", lambda _: tails.pop(0))
    session.load(Path("1.1.0"), "glass@1.1.0")
    assert session.look.tail == "density-16", "it was asked for"
    session.trained, tails[:] = (
        TailSpec(name="density-16", g=0.75),
        [tails[0], *tails, TailSpec(name="binned-12", g=0.0)],
    )
    cases: list[tuple[TailName, str]] = [
        ("density-16", "binned-8"),
        ("exact-coverage", "exact-coverage"),
        ("binned-8", "binned-12"),
    ]
    for chosen, shown in cases:
        session.look = replace(session.look, tail=chosen)
        session.load(Path("1.2.0"), "glass@1.2.0")
        assert session.look.tail == shown
    assert session.studio.g == 0.0


def test_a_process_has_one_context(gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RuntimeError, match="already"):
        context.adopt(gl)
    old: Any = SimpleNamespace(version_code=330)
    monkeypatch.setattr(context, "_context", None)
    with pytest.raises(Problem, match=r"OpenGL 3\.3"):
        context.adopt(old)
