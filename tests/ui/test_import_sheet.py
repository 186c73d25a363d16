"""The sheet on what the file contains, its mark beside the file's name, and the mark that a file has changed."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest
from imgui_bundle import imgui

from app.messages.worker_messages import OpenScene
from engine.scene.import_report import ImportedObject, ImportReport
from engine.scene.loaders.model import UnshownProperty
from tests.ui.conftest import opened
from ui.headless import HeadlessWindow
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.import_sheet import MOST_LINES

pytestmark = pytest.mark.gl

UNSHOWN = (
    UnshownProperty("materials.KHR_materials_volume.thicknessFactor", 3, "glass is thin: light is not absorbed in it"),
    UnshownProperty("meshes.primitives.mode", 12, "points and lines are left out"),
    UnshownProperty("materials.alphaMode", 1, "shown opaque"),
)
REPORT = ImportReport(
    files=("bag.glb", "leather.png"),
    objects=(ImportedObject("bag 1", 1200, "leather"), ImportedObject("bag 2", 34, "brass")),
    materials=("leather", "brass"),
    textures=("bag.glb#0",),
    notes=("bag: one normal computed from the faces",),
    unshown=UNSHOWN,
)


@pytest.fixture
def reported(window: HeadlessWindow) -> HeadlessWindow:
    """A window whose file has more than is shown."""
    window.shell.editor.scenes.report = REPORT
    window.frames(2)
    return window


def handles(window: HeadlessWindow) -> set[str]:
    return set(window.shell.handles.names())


def test_nothing_is_marked_where_all_is_shown(window: HeadlessWindow) -> None:
    assert not {"button.report", "button.reload"} & handles(window)
    window.key(imgui.Key.i)
    window.frame()
    assert "button.report.close" in handles(window) and "report.order.0" not in handles(window)


def test_the_mark_opens_the_sheet_and_escape_closes_it(reported: HeadlessWindow) -> None:
    reported.click_handle("button.report")
    reported.frame()
    assert reported.shell.state.shows_report and "button.report.copy" in handles(reported)
    reported.key(imgui.Key.escape)
    reported.frame()
    assert not reported.shell.state.shows_report and "button.report.copy" not in handles(reported)
    assert reported.shell.editor.view.selected is not None  # one press, one thing
    reported.key(imgui.Key.i)
    reported.frame()
    reported.click_handle("button.report.close")
    assert not reported.shell.state.shows_report


def test_the_picture_stays_usable_under_it(reported: HeadlessWindow) -> None:
    reported.key(imgui.Key.i)
    before = reported.shell.editor.view.exposure
    reported.key(imgui.Key.right_bracket)
    assert reported.shell.editor.view.exposure > before and reported.shell.state.shows_report


def test_all_of_it_goes_to_the_clipboard(reported: HeadlessWindow) -> None:
    reported.key(imgui.Key.i)
    reported.frame()
    reported.click_handle("button.report.copy")
    text = imgui.get_clipboard_text()
    for each in UNSHOWN:
        (line,) = [line for line in text.splitlines() if each.name in line]
        assert each.effect in line and f" {each.count} " in line
    assert "one normal computed" in text and "1,234" in text


def test_the_order_can_be_chosen(reported: HeadlessWindow) -> None:
    reported.key(imgui.Key.i)
    reported.frame()
    reported.click_handle("report.order.1")
    assert reported.shell.state.report_by_count
    reported.click_handle("report.order.0")
    assert not reported.shell.state.report_by_count


def test_a_file_that_was_saved_elsewhere_is_marked_and_read_again(window: HeadlessWindow) -> None:
    shell = window.shell
    shell.editor.scenes.watch.changed = ("/there/bag.glb",)
    assert shell.idle(1.0)  # news to draw
    window.frames(2)
    requests = shell.editor._client.requests  # type: ignore[attr-defined]
    n_opened = sum(isinstance(each, OpenScene) for each in requests)
    window.click_handle("button.reload")
    assert sum(isinstance(each, OpenScene) for each in requests) == n_opened + 1
    window.frames(10)
    assert not shell.editor.status.changed_files and "button.reload" not in handles(window)
    assert shell.editor.status.message == "reloaded stand-in"


def test_it_has_its_size_in_the_first_frame_that_shows_it(window: HeadlessWindow) -> None:
    window.key(imgui.Key.i)
    heights = []
    for _ in range(4):
        sheet = imgui.internal.find_window_by_name("Import report###report")
        heights += [] if sheet is None or sheet.hidden else [sheet.size.y]
        window.frame()
    assert max(heights) <= 1.1 * min(heights)


@pytest.mark.parametrize(("size", "scale"), [((640, 480), 1.0), ((1920, 1080), 2.0)])
def test_it_fits_any_window(context: moderngl.Context, size: tuple[int, int], scale: float) -> None:
    windows: Iterator[HeadlessWindow] = opened(context, size, scale)
    window = next(windows)
    many = tuple(UnshownProperty(f"nodes.extras.key {k}", k + 1, "is left out of the picture " * 3) for k in range(60))
    report = ImportReport(files=("a" * 300 + ".glb",), notes=("note " * 90,) * 20, unshown=many)
    window.shell.editor.scenes.report = report
    window.key(imgui.Key.i)
    window.frames(3)
    x, y = window.shell.handle_position("button.report.close")
    assert 0 < x < size[0] and 0 < y < size[1]
    sheet = imgui.internal.find_window_by_name("Import report###report")
    assert sheet.pos.x >= 0 and sheet.pos.x + sheet.size.x <= size[0] and sheet.pos.y + sheet.size.y <= size[1]
    next(windows, None)


def test_a_long_list_is_drawn_in_part_and_copied_whole(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    many = tuple(UnshownProperty(f"nodes.extras.key{k:04}", k + 1, "is left out") for k in range(3000))
    window.shell.editor.scenes.report = ImportReport(files=("a.glb",), unshown=many, notes=("note",) * 3000)
    window.key(imgui.Key.i)
    window.frame()
    drawn: list[str] = []
    monkeypatch.setattr("ui.panels.widgets.fitting", lambda text, room: drawn.append(text) or text)
    window.frame()
    assert drawn == [f"extras.key{k:04}" for k in range(MOST_LINES)]
    window.click_handle("button.report.copy")
    assert imgui.get_clipboard_text().count("is left out") == 3000


def test_texts_are_cut_to_the_last_character_that_fits(window: HeadlessWindow) -> None:
    """Against one character after the other."""
    found: list[tuple[str, str, str, str]] = []

    def cut(text: str, room: float) -> None:
        end, start = text, text
        while len(end) > 4 and imgui.calc_text_size("…" + end).x > room:
            end = end[1:]
        while start and imgui.calc_text_size(start + "…").x > room:
            start = start[:-1]
        fits = imgui.calc_text_size(text).x <= room
        slow = (text, text) if fits else ("…" + end, start.rstrip() + "…")
        found.append((*slow, widgets.fitting(text, room), widgets.shortened(text, room)))

    def draw(context: PanelContext) -> list[Action]:
        for text in ("", "ab", "oak veneer.png", "W" * 40 + "i" * 40, "a b c " * 30):
            for room in (0.0, 5.0, 40.0, 90.0, 200.0, 5000.0):
                cut(text, room)
        return []

    window.key(imgui.Key.i)
    with pytest.MonkeyPatch.context() as drawing:
        drawing.setattr("ui.panels.import_sheet.draw", draw)
        window.frame()
    assert len(found) >= 30
    for slow_end, slow_start, end, start in found:
        assert (end, start) == (slow_end, slow_start)
