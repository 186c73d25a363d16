"""Panels side by side: nothing overlaps, nothing is cut off, at several sizes and scales; the layout is remembered."""

from __future__ import annotations

import itertools
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from app.document.document import ObjectState
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import Progress
from app.modes.placement.indirect_controller import IndirectController
from engine.material.layer import Layer
from tests.ui.conftest import opened
from tests.ui.stand_in import StandInClient
from ui import layout
from ui.headless import HeadlessWindow
from ui.layout import SETTLING
from ui.panels import number_fields, widgets
from ui.panels.actions import SetPanel, ShowPanel

pytestmark = pytest.mark.gl

SIZES = [((1280, 800), 1.0), ((1920, 1080), 1.0), ((2560, 1600), 2.0), ((1600, 1000), 1.25)]
# Of a square picture: what there was before it was given more room, and what is asked of it.
PICTURE_SIDES = [((1380, 860), 428.0, 540.0), ((800, 600), 168.0, 310.0), ((1920, 1080), 600.0, 750.0)]


def rectangles(window: HeadlessWindow) -> dict[str, tuple[float, float, float, float]]:
    """(left, top, right, bottom) of each panel on screen."""
    window.shell.io  # noqa: B018  makes this window's imgui context current
    found = {}
    for panel in layout.PANELS:
        each = imgui.internal.find_window_by_name(panel.window)
        if each is not None and each.active and not each.hidden:
            found[panel.key] = (each.pos.x, each.pos.y, each.pos.x + each.size.x, each.pos.y + each.size.y)
    return found


@pytest.mark.parametrize(("size", "scale"), SIZES)
def test_no_panel_overlaps_or_is_cut_off(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], scale: float
) -> None:
    monkeypatch.setattr(IndirectController, "noise", 0.123)
    for window in opened(context, size, scale):
        client = window.shell.editor._client
        assert isinstance(client, StandInClient)
        # The longest contents: work under way and every figure known.
        window.shell.editor.do(SetView.of(n_bounces=4))
        client.say(Progress("final", 0.3, 79.0, "teapot.1"))
        window.frames(4)
        places = rectangles(window)
        assert set(places) == {panel.key for panel in layout.PANELS} - {"brdf", "plan"}  # behind library and accuracy
        window.shell.do(ShowPanel("brdf"))
        window.frames(4)
        assert rectangles(window) == {"brdf" if key == "library" else key: place for key, place in places.items()}
        for one, two in itertools.combinations(places.values(), 2):
            across = min(one[2], two[2]) - max(one[0], two[0])
            down = min(one[3], two[3]) - max(one[1], two[1])
            assert across <= 0 or down <= 0, (one, two)
        for left, top, right, bottom in places.values():
            assert left >= 0 and top >= 0 and right <= size[0] and bottom <= size[1]
        for panel in layout.PANELS:
            each = imgui.internal.find_window_by_name(panel.window)
            # As many lines as the scene has curves or lights.
            scrolls = panel in (layout.PLAN, layout.LIGHT)
            assert not each.scrollbar_x and (scrolls or not each.scrollbar_y), f"{panel.title} does not fit"


def overlapping(places: dict[str, tuple[float, float, float, float]]) -> list[tuple[str, str]]:
    """Pairs of panels that share some of the window."""
    pairs = itertools.combinations(places.items(), 2)
    return [
        (one, two)
        for (one, a), (two, b) in pairs
        if min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])
    ]


@pytest.mark.parametrize(("size", "before", "least"), PICTURE_SIDES)
def test_the_picture_has_most_of_the_window(
    context: moderngl.Context, size: tuple[int, int], before: float, least: float
) -> None:
    for window in opened(context, size, 1.0):
        left, top, right, bottom = rectangles(window)["viewport"]
        assert min(right - left, bottom - top) >= least > 1.2 * before


@pytest.mark.parametrize("size", [(1380, 860), (1024, 640), (800, 600), (640, 480), (400, 300)])
def test_every_panel_has_its_place_in_a_window_of_any_size(context: moderngl.Context, size: tuple[int, int]) -> None:
    for window in opened(context, size, 1.0):
        for panel in layout.PANELS:
            window.shell.do(ShowPanel(panel.key))
            window.frames(3)
            places = rectangles(window)
            assert panel.key in places and not overlapping(places)
            for left, top, right, bottom in places.values():
                assert 0 <= left < right <= size[0] and 0 <= top < bottom <= size[1]
            # Up or down it may scroll, not sideways; and no control stands outside the window.
            assert not imgui.internal.find_window_by_name(panel.window).scrollbar_x, panel.title
            for name in window.shell.handles.names():
                x, _ = window.shell.handle_position(name)
                assert 0 <= x <= size[0], name


def test_what_is_chosen_from_a_list_is_not_cut_off(context: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    begin, seen = imgui.begin_combo, {}

    def begun(name: str, text: str, flags: int = 0) -> bool:
        arrow = 0.0 if flags & imgui.ComboFlags_.no_arrow_button else imgui.get_frame_height()
        room = imgui.calc_item_width() - 2.0 * imgui.get_style().frame_padding.x - arrow
        seen[name] = text, imgui.calc_text_size(text).x <= room
        return begin(name, text, flags)

    monkeypatch.setattr(imgui, "begin_combo", begun)
    for window in opened(context, (800, 600), 1.0):
        window.shell.editor.do(SetView.of(n_bounces=4))
        window.shell.do(ShowPanel("accuracy"))
        window.frames(4)
    shown = {name: text for name, (text, _) in seen.items() if name.startswith("##accuracy")}
    assert shown == {"##accuracy.lights": "4k", "##accuracy.patches": "768", "##accuracy.first": "Auto",
                     "##accuracy.second": "All", "##accuracy.edges": "Auto edges"}  # fmt: skip
    assert all(fits for name, (_, fits) in seen.items() if name in shown)


def test_panels_fold_away_together_and_come_back_from_the_strip(window: HeadlessWindow) -> None:
    before = rectangles(window)
    window.click_handle("button.fold.curve")
    window.frames(3)
    folded = rectangles(window)
    assert "curve" not in folded
    # The picture takes their room, but for the strip that brings them back.
    assert folded["viewport"][3] > before["curve"][3] - 30
    window.click_handle("button.fold.brdf")  # which has the library before it
    window.frames(3)
    assert {"brdf", "library"}.isdisjoint(rectangles(window))
    for key in ("curve", "brdf", "library"):
        window.click_handle(f"button.unfold.{key}")
        window.frames(3)
    assert rectangles(window) == before


def test_a_window_made_small_for_a_moment_is_as_it_was_when_it_is_large_again(window: HeadlessWindow) -> None:
    places = rectangles(window)
    bar = (0.5 * (places["curve"][0] + places["curve"][2]), places["viewport"][3] + 1.0)
    window.drag(bar, (bar[0], bar[1] - 60))
    window.click_handle("button.fold.light")
    window.frames(3)
    large = rectangles(window)
    seen = []
    for size in ((800, 600), (400, 300), (1280, 800)):
        window.resize(size)
        window.frames(4)
        seen.append(rectangles(window))
        assert not overlapping(seen[-1])
    compact, small, again = seen
    assert "light" not in large and "curve" in compact  # each form folds its own panels
    assert set(small) == {"viewport"}
    assert again == large


def test_labels_and_buttons_stay_inside_the_window(window: HeadlessWindow) -> None:
    for name in window.shell.handles.names():
        x, y = window.shell.handle_position(name)
        assert 0 <= x <= 1280 and 0 <= y <= 800, name


def test_surfaces_are_exact_greys(window: HeadlessWindow) -> None:
    pixels = window.pixels()
    x, y = (round(v) for v in window.shell.handle_position("objects.lamp"))
    # An empty part of the object list, below the last row: colour beside the picture would tint it.
    empty = pixels[y + 60, x]
    assert empty[0] == empty[1] == empty[2] > 0


def test_panels_close_and_come_back(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    from app.document.view_state import OpenPanel

    before = window.pixels()
    editor.do(OpenPanel("light", False))
    window.frames(4)
    assert "light" not in rectangles(window)
    editor.do(OpenPanel("light", True))
    window.frames(4)
    assert "light" in rectangles(window)
    # Back in its old place: the right column looks as before, but for figures that differ from frame to frame.
    column = np.s_[40:500, 980:]
    assert np.abs(window.pixels()[column].astype(int) - before[column]).mean() < 2.0


def test_the_layout_is_remembered(context: moderngl.Context, tmp_path: Path) -> None:
    file = tmp_path / "layout.ini"

    def window_with_layout() -> HeadlessWindow:
        return HeadlessWindow(Editor(StandInClient(), "stand-in"), context=context, layout_file=file)

    first = window_with_layout()
    first.frames(4)
    # The bar between picture and curve.
    places = rectangles(first)
    bar = (0.5 * (places["curve"][0] + places["curve"][2]), places["viewport"][3] + 1.0)
    first.drag(bar, (bar[0], bar[1] - 80))
    moved = rectangles(first)
    assert moved["curve"][1] == pytest.approx(places["curve"][1] - 80, abs=2)
    first.close()
    second = window_with_layout()
    second.frames(4)
    assert rectangles(second)["curve"] == pytest.approx(moved["curve"], abs=1)
    # So is what is folded away.
    second.click_handle("button.fold.curve")
    second.close()
    again = window_with_layout()
    again.frames(4)
    assert "curve" not in rectangles(again)
    again.close()
    # What was made for another scale, or is damaged, gives the default.
    file.write_text("; insitu layout 5 scale 2.00\n; form wide folded curve\n[Window][x]\nPos=1,1\n")
    third = window_with_layout()
    third.frames(4)
    assert rectangles(third)["curve"] == pytest.approx(places["curve"], abs=1)
    third.close()


def test_an_unwritable_layout_costs_nothing(context: moderngl.Context, tmp_path: Path) -> None:
    file = tmp_path / "there-is-no-such-folder" / "layout.ini"
    window = HeadlessWindow(Editor(StandInClient(), "stand-in"), context=context, layout_file=file)
    window.frames(3)
    window.close()
    assert not file.exists()


def test_shortcuts_overlay_opens_and_closes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.key(imgui.Key.slash, imgui.Key.mod_shift)
    assert editor.view.show_shortcuts
    window.key(imgui.Key.escape)
    assert not editor.view.show_shortcuts
    editor.do(SetView.of(show_shortcuts=True))
    window.frames(2)
    window.click(4, 400)
    assert not editor.view.show_shortcuts


def test_a_window_that_has_changed_its_form_draws_until_its_tabs_are_in_place(window: HeadlessWindow) -> None:
    window.frames(80)  # until nothing else asks for frames
    while window.draw().busy:
        pass
    window.resize((800, 600))
    while window.draw().busy:
        pass
    # On tabs that do not fit there are arrows in its place.
    for key in ("material", "objects", "curve"):
        window.shell.handle_position(f"button.fold.{key}")


def in_front(window: HeadlessWindow) -> set[str]:
    """Of the panels that share a place with others, those that are seen."""
    shared = {panel.key for panel in layout.PANELS if layout.shares_place(panel)}
    return shared & set(rectangles(window))


def test_accuracy_is_before_the_plan_whatever_form_the_window_had(window: HeadlessWindow) -> None:
    assert in_front(window) == {"library", "accuracy"}
    for size in ((400, 300), (1280, 800)):  # small, all panels are folded away: they come back together
        window.resize(size)
        window.frames(layout_frames())
    assert in_front(window) == {"library", "accuracy"}
    tabs = imgui.internal.find_window_by_name(layout.ACCURACY.window).dock_node.tab_bar.tabs
    assert [tabs[i].window.name.partition("#")[0] for i in range(len(tabs))] == ["Accuracy", "Plan"]


@pytest.mark.parametrize("chosen", [("library", "accuracy"), ("brdf", "plan")], ids="+".join)
def test_the_picture_alone_leaves_the_panels_in_front_that_were(
    window: HeadlessWindow, chosen: tuple[str, ...]
) -> None:
    for key in chosen:
        window.shell.do(ShowPanel(key))
        window.frames(3)
    assert in_front(window) == set(chosen)
    for alone in (True, False):
        window.shell.do(SetPanel({"single_panel": alone}))
        window.frames(layout_frames())
    assert in_front(window) == set(chosen)


def test_the_panel_a_hand_has_put_in_front_stays_there(context: moderngl.Context, tmp_path: Path) -> None:
    """While the window has another form, and when it is opened again."""

    def opened_again() -> HeadlessWindow:
        editor = Editor(StandInClient(), "stand-in")
        found = HeadlessWindow(editor, context=context, layout_file=tmp_path / "layout.ini")
        found.frames(layout_frames())
        return found

    window = opened_again()
    window.shell.do(ShowPanel("plan"))
    window.frames(3)
    for size in ((400, 300), (1280, 800)):  # small, all panels are folded away: they come back together
        window.resize(size)
        window.frames(layout_frames())
    assert in_front(window) == {"library", "plan"}
    window.close()
    again = opened_again()
    assert in_front(again) == {"library", "plan"}
    again.close()


def layout_frames() -> int:
    """Until panels stand where their form has them, the right ones in front."""
    return SETTLING + 2


@pytest.mark.parametrize("lamps", [True, False])
@pytest.mark.parametrize("mode", ["placement", "orbit", "deform"])
def test_no_words_are_cut_off_in_a_column_of_225_pixels(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch, mode: str, lamps: bool
) -> None:
    cut = set[str]()
    segment, centred, shortened = widgets._segment, number_fields._centred, widgets.shortened

    def note_segment(draw: object, corner: ImVec2, size: ImVec2, text: str, *rest: object) -> None:
        window = imgui.internal.get_current_window_read()
        if corner.x + size.x > window.work_rect.max.x + 0.5:
            cut.add(text)
        segment(draw, corner, size, text, *rest)

    def note_field(field: number_fields._Field) -> None:
        text = field.shown or field.text % field.value
        if imgui.calc_text_size(text).x > field.size.x:
            cut.add(text)
        centred(field)

    def note_choice(text: str, room: float) -> str:
        if imgui.calc_text_size(text).x > room:
            cut.add(text)
        return shortened(text, room)

    monkeypatch.setattr(layout, "RIGHT_WIDTH", 225.0)
    monkeypatch.setattr(widgets, "_segment", note_segment)
    monkeypatch.setattr(number_fields, "_centred", note_field)
    monkeypatch.setattr(widgets, "shortened", note_choice)
    if not lamps:
        monkeypatch.setattr(ObjectState, "emits", False)
    for window in opened(context, (1280, 900), 1.0):
        window.shell.editor.do(SetView.of(n_bounces=4, mode=mode))
        for panel in ("accuracy", "plan"):
            window.shell.do(ShowPanel(panel))
            window.frames(4)
            cut.clear()  # until then panels find out whether they have a scroll bar
            window.frames(1)
            assert not cut, panel


def row_of(window: HeadlessWindow, key: str) -> tuple[np.ndarray, int]:
    """A row of the list of objects, (H, W) grey, and the column in which its icons begin."""
    x, y = window.shell.handle_position(f"button.visible.{key}")
    window.shell.io  # noqa: B018  makes this window's imgui context current
    half = round(0.5 * imgui.get_frame_height())
    return window.pixels()[round(y) - half : round(y) + half, :, :3].mean(axis=-1), round(x) - half


def test_icons_of_the_selected_row_are_to_be_seen(window: HeadlessWindow) -> None:
    window.move(700.0, 300.0)
    window.frames(2)
    row, icons = row_of(window, "teapot.1")
    seen = row[4:-4, icons : icons + 18]
    assert np.ptp(seen) > 35.0  # of 255; it was 22, and the eye was lost on the row's grey


def test_a_name_that_is_too_long_ends_before_the_icons(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Layer, "title", "H" * 60)  # bars all the way: where it is cut off there is ink
    window.move(700.0, 300.0)
    window.frames(2)
    row, icons = row_of(window, "teapot.1")
    middle = row[len(row) // 2 - 5 : len(row) // 2 + 2]  # above the dots, which stand on the line
    assert np.ptp(middle[:, icons - 60 : icons - 20]) > 100.0 and np.ptp(middle[:, icons - 5 : icons]) < 10.0


def test_the_heading_of_a_material_ends_within_its_panel(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Layer, "title", "H" * 60)
    window.move(700.0, 300.0)
    window.frames(3)
    _, top, right, _ = rectangles(window)["material"]
    window.shell.io  # noqa: B018  makes this window's imgui context current
    panel = imgui.internal.find_window_by_name(
        layout.PANELS[[each.key for each in layout.PANELS].index("material")].window
    )
    line = panel.inner_rect.min.y + panel.window_padding.y
    heading = window.pixels()[round(line + 3) : round(line + 9), :, :3].mean(axis=-1)
    assert np.ptp(heading[:, round(right) - 90 : round(right) - 40]) > 40.0
    assert np.ptp(heading[:, round(panel.work_rect.max.x) - 4 : round(panel.work_rect.max.x) + 6]) < 10.0


@pytest.mark.parametrize("n_frames", [1, 2, 4])
def test_a_size_given_in_the_first_frames_leaves_the_right_panels_in_front(
    context: moderngl.Context, n_frames: int
) -> None:
    editor = Editor(StandInClient(), "stand-in")
    window = HeadlessWindow(editor, size=(1440, 900), context=context)
    window.frames(n_frames)
    window.resize((1000, 700))
    window.frames(SETTLING + 3)
    window.shell.io  # noqa: B018  makes this window's imgui context current
    behind = {panel.key for panel in layout.PANELS if layout.is_behind(panel)}
    assert behind == {"library", "brdf", "light", "accuracy", "plan"}
    window.close()
    editor.close()


def test_the_list_of_objects_scrolls_to_what_is_selected_elsewhere(context: moderngl.Context) -> None:
    for window in opened(context, (1280, 440), 1.0):  # the lamp, the last, is below the panel's edge
        editor, seen = window.shell.editor, []
        for name in ("teapot", "lamp", "teapot"):
            editor.select(name)
            window.frames(4)
            window.shell.io  # noqa: B018  makes this window's imgui context current
            panel = imgui.internal.find_window_by_name(layout.OBJECTS.window)
            seen.append(panel.scroll.y)
            _, y = window.shell.handle_position(f"objects.{name}")
            assert panel.inner_rect.min.y <= y <= panel.inner_rect.max.y
        assert seen[2] < seen[1] and seen[0] == 0.0
