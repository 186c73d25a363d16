"""The panel that matches a picture: what it is set to, what it begins, what it shows of the answer and on the curve."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.curves import SetOperators
from app.document.commands.layers import RemoveLayer, SetEditable, SetFrozen, SetModel, SetParameter, SetVisible
from app.document.commands.several import Several
from app.photo.match_settings import MatchAnswer, MatchSettings, PhotoPair, possible_targets, written_targets
from app.photo.photo_controller import PhotoController
from engine.core.safe_files import resolved
from engine.curve.tables import TabulatedCurve
from engine.inverse.photo_targets import Target, default_targets
from tests.app.photo.test_photo_controller import Matcher
from tests.pictures import write_exr
from tests.ui.conftest import opened
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels import file_dialog, widgets
from ui.panels.actions import AnswerQuestion, OpenMask, OpenPhoto, SetPanel
from ui.panels.curve_editor import deviation_at
from ui.panels.window_state import Place3

pytestmark = pytest.mark.gl
CHANGED = "albedo", (0.11, 0.22, 0.33)


@pytest.fixture
def matcher(window: HeadlessWindow) -> Matcher:
    made = Matcher()
    window.shell.actor.photos = PhotoController(window.shell.editor, made)
    return made


def open_panel(window: HeadlessWindow, photo: Path) -> None:
    photo.write_bytes(b"not read by the window")
    window.shell.editor.select("teapot.1.theta_h")
    window.shell.do(AnswerQuestion(photo, OpenPhoto(photo)))
    window.frames(3)


def settings(window: HeadlessWindow) -> MatchSettings:
    found = window.shell.state.match
    assert found is not None
    return found


def point(window: HeadlessWindow) -> Place3 | None:
    """The first half of a pair."""
    assert window.shell.state.picking is not None
    return window.shell.state.picking.point


def answer() -> MatchAnswer:
    table = TabulatedCurve((0.1, 0.5), ((2.0, 2.0, 2.0), (0.5, 0.5, 0.5)), kind="change")
    edit = (SetParameter("teapot.1", "alpha", 0.3), SetOperators("teapot.1", "theta_h", (table,)))
    deviations = {Target(1, "theta_h"): np.full((32, 3), 5.0)}
    light = np.ones((HEIGHT, WIDTH, 4), np.float32)
    return MatchAnswer(Several(edit, "match teapot"), 1.0, 0.01, 0.2, (), deviations, light)


def test_a_match_by_the_mouse(window: HeadlessWindow, matcher: Matcher, tmp_path: Path) -> None:
    open_panel(window, tmp_path / "pot.png")
    assert settings(window).object == "teapot" and settings(window).transfer == "srgb"
    assert settings(window).targets == ("0.scale", "1.scale", "1.theta_h", "1.alpha")
    window.click_handle("match.transfer.2")
    window.frames(2)
    assert settings(window).transfer == "2.2" and "match.gamma" in window.shell.handles.names()
    window.click_handle("match.exposure.1")
    window.click_handle("match.find.0.scale")
    window.frames(2)
    assert settings(window).exposure == 1.0 and settings(window).targets == ("1.scale", "1.theta_h", "1.alpha")
    window.click_handle("match.finds_lights")
    window.frames(2)
    assert settings(window).finds_lights and not settings(window).finds_rotation
    window.click_handle("button.match.begin")
    window.frames(2)
    assert matcher.settings == settings(window)
    assert {"button.match.stop", "button.photo.stop"} <= set(window.shell.handles.names())
    before = window.shell.editor.document
    matcher.end(answer())
    window.frames(4)
    editor = window.shell.editor
    assert editor.document.layer("teapot.1").values["alpha"] == 0.3
    assert "match.error" in window.shell.handles.names() and editor.view.stored == "pot.png"
    editor.undo()
    window.frames(2)
    assert editor.document == before


def test_labels_have_their_subscripts(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The font has none: each is drawn small, and nothing is drawn of a character that the font lacks."""
    window.shell.editor.do(SetModel("teapot.1", "ashikhmin_shirley"))
    drawn = list[str]()
    rich_text = widgets.rich_text

    def noted(draw: imgui.ImDrawList, place: imgui.ImVec2, colour: int, text: str) -> None:
        drawn.append(text)
        rich_text(draw, place, colour, text)

    monkeypatch.setattr(widgets, "rich_text", noted)
    open_panel(window, tmp_path / "pot.png")
    assert "Exponent along n_u" in drawn
    assert not set("".join(drawn)) & set(widgets.SUBSCRIPTS)
    before = settings(window).targets
    window.click_handle("match.find.1.n_u")
    window.frames(2)
    assert set(settings(window).targets) == {*before, "1.n_u"}


def test_it_begins_with_a_material_of_the_library(window: HeadlessWindow, matcher: Matcher, tmp_path: Path) -> None:
    """What is found is of its layers, and one edit gives them to the object and changes them."""
    editor, before = window.shell.editor, window.shell.editor.document
    open_panel(window, tmp_path / "pot.png")
    own = settings(window)
    assert window.run_until(lambda: bool(window.shell.actor.library.entries), 20.0)
    material = window.shell.actor.library.entries[0].material
    window.click_handle("match.start")
    window.frames(3)
    window.click_handle(f"match.start.{material.name}")
    window.frames(3)
    begun = settings(window)
    assert begun.start == material.name and begun.start_layers == material.layers
    assert begun.targets == written_targets(default_targets(material.layers))
    shown = {name for name in window.shell.handles.names() if name.startswith("match.find.")}
    assert shown == {f"match.find.{name}" for name in written_targets(list(possible_targets(material.layers)))}
    window.click_handle("button.match.begin")
    window.frames(2)
    assert matcher.settings == begun
    matcher.end(replace(answer(), edit=Several((SetParameter("teapot.0", *CHANGED),), "match teapot"), deviations={}))
    window.frames(4)
    layers = editor.document.object("teapot").layers
    assert [each.model for each in layers] == [each.model for each in material.layers]
    assert layers[0].values[CHANGED[0]] == CHANGED[1] != material.layers[0].values[CHANGED[0]]
    editor.undo()
    assert editor.document == before
    window.click_handle("match.start")
    window.frames(3)
    window.click_handle("match.start.Its own")
    window.frames(3)
    assert settings(window) == own


def test_a_double_click_begins_a_match_and_does_not_stop_it(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path
) -> None:
    open_panel(window, tmp_path / "pot.png")
    place = window.shell.handle_position("button.match.begin")
    for _ in range(2):
        window.click(*place)
        window.frames(1)
    window.frames(2)
    assert matcher.settings is not None and window.shell.actor.photos.progress


def test_a_mask_is_chosen_and_taken_away(window: HeadlessWindow, matcher: Matcher, tmp_path: Path) -> None:
    open_panel(window, tmp_path / "pot.png")
    window.click_handle("button.match.mask")
    window.frames(3)
    assert window.shell.state.question is not None and window.shell.state.question.purpose == "open_mask"
    assert {".jpg", ".jpeg", ".webp"} <= set(file_dialog.ENDINGS["open_mask"])
    mask = resolved(tmp_path / "mask.jpg")
    window.shell.do(AnswerQuestion(mask, OpenMask(mask)))
    assert settings(window).mask is None and "no such file" in window.shell.editor.status.message
    mask.write_bytes(b"not read by the window")
    window.shell.do(AnswerQuestion(mask, OpenMask(mask)))
    window.frames(3)
    assert settings(window).mask == mask
    window.click_handle("button.match.unmask")
    window.frames(2)
    assert settings(window).mask is None


def test_another_photograph_keeps_what_does_not_belong_to_it(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path
) -> None:
    open_panel(window, tmp_path / "pot.png")
    chosen = replace(
        settings(window), transfer="2.2", targets=("1.alpha",), exposure=0.5, finds_rotation=True, finds_lights=True,
        mask=tmp_path / "mask.png", start="lacquer", start_layers=window.shell.editor.document.object("teapot").layers,
    )  # fmt: skip
    assert len(fields(MatchSettings)) == 12  # another one belongs above
    pairs = (PhotoPair((0.1, 0.9), (1.0, 2.0, 3.0)),)
    other = resolved(tmp_path / "other.png")
    other.write_bytes(b"not read by the window")

    def choose(file: Path) -> MatchSettings:
        """By the panel's button; what is selected is another object."""
        window.shell.do(SetPanel({"match": replace(chosen, pairs=pairs)}))
        window.shell.editor.select("tray")
        window.frames(3)
        window.click_handle("button.match.file")
        window.frames(3)
        question = window.shell.state.question
        assert question is not None and question.purpose == "open_photo"
        window.shell.do(file_dialog.answer(question, file))
        window.frames(2)
        return settings(window)

    assert choose(other) == replace(chosen, file=other, pairs=())
    assert choose(chosen.file) == replace(chosen, pairs=pairs)  # the same photograph, perhaps a new version of it
    # By the menu it is of the selected object.
    window.shell.do(AnswerQuestion(other, OpenPhoto(other)))
    found = settings(window)
    assert (
        found == replace(chosen, file=other, object="tray", targets=found.targets) and found.targets != chosen.targets
    )
    before = found
    window.shell.editor.select(None)
    window.shell.do(AnswerQuestion(other, OpenPhoto(other)))
    assert settings(window) == before and window.shell.editor.status.message.endswith("select the object that it shows")


def test_what_cannot_be_matched_is_said_and_match_does_nothing(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path
) -> None:
    open_panel(window, tmp_path / "pot.png")
    for command in (SetEditable("teapot", False), SetFrozen("teapot", True), SetVisible("teapot", False)):
        assert "match.refusal" not in window.shell.handles.names()
        window.shell.editor.do(command)
        window.frames(3)
        assert "match.refusal" in window.shell.handles.names()
        window.click_handle("button.match.begin")
        window.frames(2)
        assert matcher.settings is None
        window.shell.editor.undo()
        window.frames(3)
    # Of a layer that has gone nothing is found.
    window.shell.editor.do(RemoveLayer("teapot.1"))
    window.frames(3)
    window.click_handle("button.match.begin")
    window.frames(2)
    assert matcher.settings is not None and matcher.settings.targets == ("0.scale",)


def test_it_is_stopped_and_closed(window: HeadlessWindow, matcher: Matcher, tmp_path: Path) -> None:
    open_panel(window, tmp_path / "pot.exr")
    assert "match.transfer.0" not in window.shell.handles.names()  # a linear file
    window.click_handle("button.match.begin")
    window.frames(2)
    window.click_handle("button.match.stop")
    window.frames(2)
    assert matcher.settings is None and "button.match.begin" in window.shell.handles.names()
    window.shell.do(SetPanel({"match": replace(settings(window), scene="another")}))
    window.frames(2)
    assert window.shell.state.match is None  # what it was set to belongs to the scene
    open_panel(window, tmp_path / "pot.exr")
    window.key(imgui.Key.escape)
    window.frames(2)
    assert window.shell.state.match is None


def test_the_curve_shows_how_far_it_is_determined_while_it_is_what_was_found(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[np.ndarray] = []
    monkeypatch.setattr("ui.panels.curve_plot.draw_band", lambda *given: drawn.append(given[3]))
    open_panel(window, tmp_path / "pot.png")
    window.shell.actor.photos.begin(settings(window))
    assert not drawn
    matcher.end(answer())
    window.frames(3)
    assert drawn and np.all(drawn[-1] == 5.0)
    window.shell.editor.undo()
    window.frames(2)
    drawn.clear()
    window.frames(2)
    assert not drawn
    window.shell.editor.redo()
    window.frames(3)
    assert drawn


def test_pairs_are_clicked_in_the_picture_and_in_the_photograph(
    window: HeadlessWindow, matcher: Matcher, tmp_path: Path
) -> None:
    photo = tmp_path / "pot.exr"
    write_exr(photo, np.ones((2 * HEIGHT, 2 * WIDTH, 3), np.float32))
    window.shell.editor.select("teapot.1.theta_h")
    window.shell.do(AnswerQuestion(photo, OpenPhoto(photo)))
    window.frames(3)
    window.click_handle("match.camera.1")
    editor = window.shell.editor
    assert window.run_until(lambda: editor.view.stored == "pot.exr", 30.0) and editor.view.difference == "present"
    window.frames(2)
    x, y = window.shell.handle_position("viewport.corner")
    centre, middle = window.shell.handle_position("viewport.centre")
    width, height = 2 * (centre - x), 2 * (middle - y)
    for _ in range(2):  # a double click is one point, and no pair
        window.click(x + 0.7 * width, y + 0.8 * height)
        window.frames(1)
    assert point(window) is not None and not settings(window).pairs
    window.key(imgui.Key.escape)
    assert point(window) is None and editor.view.difference == "present" and window.shell.state.picking is not None
    window.frames(40)  # the next click is none of that double click
    places = [(0.7, 0.8), (0.6, 0.9), (0.55, 0.7), (0.65, 0.95), (0.72, 0.6)]
    for number, (u, v) in enumerate(places):
        assert ("match.refusal" in window.shell.handles.names()) == (number < 4)
        window.click(x + u * width, y + v * height)
        window.frames(3)
        assert point(window) is not None and editor.view.difference == "stored"
        window.click(x + (u - 0.05) * width, y + v * height)
        window.frames(3)
        assert point(window) is None and editor.view.difference == "present"
        pair = settings(window).pairs[number]
        np.testing.assert_allclose(pair.place, (u - 0.05, v), atol=0.02)
    # What the camera looks at is in the middle.
    target = settings(window).pairs[0]._replace(point=editor.camera_history.camera.target)
    window.shell.do(SetPanel({"match": replace(settings(window), pairs=(target, *settings(window).pairs[1:]))}))
    window.frames(2)
    np.testing.assert_allclose(window.shell.handle_position("viewport.pair.1"), (centre, middle), atol=2.0)
    window.click_handle("button.match.pair.0")
    window.frames(2)
    assert len(settings(window).pairs) == len(places) - 1
    window.click_handle("button.match.begin")
    window.frames(2)
    assert matcher.settings == settings(window) and window.shell.state.picking is None
    camera = editor.camera_history.camera.model_copy(update={"fov_y": 33.0})
    matcher.end(replace(answer(), camera=camera, missed=(0.5,) * 4))
    window.frames(4)
    assert editor.camera_history.camera == camera and editor.camera_undo_label == "align the camera to a picture"
    assert editor.undo_label == "match teapot"
    editor.camera_history.undo()
    assert editor.camera_history.camera == editor.camera_history.own_camera
    window.click_handle("match.camera.0")
    window.frames(2)
    assert settings(window).pairs == ()


def test_deviations_are_linear_between_the_middles_of_bands() -> None:
    gamma = np.array([0.0, np.pi / 8, np.pi / 4, 3 * np.pi / 8, 1.5])
    found = deviation_at(gamma, np.array([[1.0, 0.0, 2.0], [3.0, 0.0, 2.0]]))
    np.testing.assert_allclose(found, [[1, 0, 2], [1, 0, 2], [2, 0, 2], [3, 0, 2], [3, 0, 2]])


def test_in_a_small_window_the_panel_scrolls(context: moderngl.Context, tmp_path: Path) -> None:
    """With many pairs it ends above the window's end, and what lies below is reached by the wheel."""
    for small in opened(context, (900, 620), 1.0):
        small.shell.actor.photos = PhotoController(small.shell.editor, Matcher())
        open_panel(small, tmp_path / "pot.png")
        pairs = tuple(PhotoPair((0.1 * i, 0.05 * i * i), (0.1 * i, 0.2, 0.3)) for i in range(9))
        small.shell.do(SetPanel({"match": replace(settings(small), pairs=pairs)}))
        small.frames(3)
        panel = imgui.internal.find_window_by_name("Match a picture###match")
        assert panel.pos.y + panel.size.y <= 620.0
        assert panel.scroll_max.y > 0.0
        small.move(panel.pos.x + 0.5 * panel.size.x, panel.pos.y + 0.5 * panel.size.y)
        small.wheel(-50.0)
        small.frames(20)
        small.click_handle("button.match.begin")
        small.frames(2)
        assert small.shell.actor.photos.progress
