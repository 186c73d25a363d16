"""A fault in one part of a frame: the window goes on, says so once, and the journal has the edits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter
from app.editor.editor import Editor
from app.files.journal import Journal
from app.system.barrier import Barrier
from app.system.paths import state_directory
from tests.ui.stand_in import StandInClient
from ui import shell as shell_module
from ui.headless import HeadlessWindow
from ui.panels import (
    accuracy,
    brdf,
    curve_editor,
    file_dialog,
    library,
    light,
    material,
    menus,
    objects,
    status_bar,
)
from ui.panels import shortcuts as shortcuts
from ui.panels.actions import RunOperator, ShowPanel
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


@dataclass
class Clock:
    """The barrier's clock: it goes on a second whenever a test says so."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Holding:
    """A window whose barrier holds faults back, its picture exact."""

    window: HeadlessWindow
    editor: Editor
    feed: PictureFeed
    clock: Clock
    journal: Journal

    def told(self) -> str:
        notice = self.window.shell.state.message
        return "" if notice is None else notice.text


@pytest.fixture(scope="module")
def holding(context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Holding]:
    """One window for all faults: each finds it as the one before left it."""
    yield from opened(context, Journal(tmp_path_factory.mktemp("journals")))


def opened(context: moderngl.Context, journal: Journal) -> Iterator[Holding]:
    clock = Clock()
    editor = Editor(StandInClient(), "stand-in", journal=journal, barrier=Barrier(holds=True, clock=clock))
    window = HeadlessWindow(editor, context=context)
    feed = PictureFeed(context, editor.mode)
    window.shell.source = feed
    assert window.run_until(lambda: editor.status.picture == "exact", 90.0), editor.status
    window.frames(4)
    yield Holding(window, editor, feed, clock, journal)
    feed.close()
    window.close()
    editor.close()


def broken(*arguments: object, **named: object) -> Any:
    """What a part of the program does that has a defect."""
    raise KeyError("theta_i")


def broken_panel(context: object) -> Any:
    """A panel that fails with everything open."""
    imgui.push_style_color(imgui.Col_.text, 0xFF)
    imgui.push_id("x")
    imgui.begin_child("c")
    imgui.begin_group()
    imgui.begin_table("t", 2)
    imgui.begin_disabled()
    raise KeyError("theta_i")


DOCKED = {
    "material": material, "light": light, "objects": objects, "library": library, "curve": curve_editor,
    "accuracy": accuracy, "brdf": brdf,
}  # fmt: skip
ELSEWHERE = {"menus": menus, "status bar": status_bar, "dialogs": file_dialog, "help": shortcuts}
FAULTS: dict[str, Callable[[Holding, pytest.MonkeyPatch], None]] = {
    "what is asked": lambda h, patch: patch.setattr(h.editor.controller._transport, "update", broken),
    "the comparison": lambda h, patch: patch.setattr(h.editor.controller._comparison, "update", broken),
    "an answer": lambda h, patch: patch.setattr(h.editor.controller._transport.contractions, "receive_picture", broken),
    "the poll": lambda h, patch: patch.setattr(h.editor._client, "poll", broken),
    "the renderer's layer": lambda h, patch: patch.setattr(h.feed.source.renderer, "set_layer_gain", broken),
    "the renderer's update": lambda h, patch: patch.setattr(h.feed.source.renderer, "update", broken),
    "the renderer's picture": lambda h, patch: patch.setattr(h.feed.source.renderer, "composite", broken),
    "the panels' context": lambda h, patch: patch.setattr(shell_module, "panel_context", broken),
    "the BRDF's picture": lambda h, patch: patch.setattr(h.window.shell._brdf, "draw", broken),
    "a thumbnail": lambda h, patch: patch.setattr(h.window.shell._pictures.materials, "step", broken),
    "an action": lambda h, patch: patch.setattr(h.editor, "select", broken),
    **{
        f"the panel {name}": lambda h, patch, panel=panel: patch.setattr(panel, "draw", broken_panel)  # type: ignore[misc]
        for name, panel in (DOCKED | ELSEWHERE).items()
    },
    "the keyboard": lambda h, patch: patch.setattr(shortcuts, "keyboard", broken_panel),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_reported_once_and_the_window_goes_on(
    holding: Holding, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, editor = holding.window, holding.editor
    log = state_directory() / "log" / "window.log"
    log.unlink(missing_ok=True)
    n_edits = len(editor.history.undo_steps)
    editor.select("teapot.1.theta_h")
    name = fault.removeprefix("the panel ")
    window.shell.do(ShowPanel(name if name in DOCKED else "brdf"))  # some share their place
    window.frames(2)
    before = holding.feed.source.renderer.display_image()
    with monkeypatch.context() as patch:
        FAULTS[fault](holding, patch)
        editor.do(SetParameter("teapot.1", "alpha", 0.2 + 0.001 * n_edits))
        for _ in range(8):
            if fault == "an action":
                window.shell.do(RunOperator("select", "tray"))
            window.frames(3)  # half a second in all: the light is asked for when the hand has rested
            holding.clock.now += 0.3
    holding.clock.now += 2.0
    window.frames(2)  # a fault of the status bar is told when the bar is back
    found = log.read_text()
    assert found.count("Traceback") == 1 and "KeyError: 'theta_i'" in found
    line = editor.status.message
    assert editor.status.is_error and "\n" not in line and "window.log" in line and "theta_i" not in line
    assert holding.told() == line
    assert before.shape == holding.feed.source.renderer.display_image().shape
    # The fault is gone: all of it goes on, and the picture is that of the document.
    now = 0.6 - 0.001 * n_edits
    editor.do(SetParameter("teapot.1", "alpha", now))
    window.frames(2)
    assert window.run_until(lambda: editor.status.picture == "exact", 90.0), editor.status
    assert np.abs(before.astype(int) - holding.feed.source.renderer.display_image()).max() > 0
    assert window.context.error == "GL_NO_ERROR"
    assert window.run_until(lambda: f"alpha = {now}" in holding.journal.path.read_text(), 20.0)


def test_a_drag_can_be_ended_after_an_action_that_failed(holding: Holding, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(holding.editor, "do", broken)
        holding.window.drag_handle("curve.magnitude", (0, -60))
    assert not holding.editor.history.dragging
    holding.window.drag_handle("curve.magnitude", (0, -60))
    assert holding.editor.undo() is not None


def test_commands_hold_nothing_back(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "draw", broken_panel)
    for _ in range(2):  # the console makes one line and exit status 1 of it
        with pytest.raises(KeyError):
            window.frame()
