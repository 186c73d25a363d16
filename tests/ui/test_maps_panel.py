"""Images in the window: loaded by the browser or dropped, seen in the panel, edited by hand, undone; bumps alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import SetFrame, SetModel, SetVisible
from app.document.commands.maps import SetBumps, SetMap, SetOpacity
from app.document.view_state import OpenPanel
from app.modes.placement.placement_messages import MapsSampled, SampleMaps
from engine.material.bumps import NO_BUMPS, Bumps
from engine.material.layer_maps import LayerMaps, MapMeans
from engine.material.opacity import OPAQUE, Opacity
from tests.ui.stand_in import StandInClient, scene_frame
from ui.headless import HeadlessWindow
from ui.panels.actions import AskFile, OpenImage
from ui.panels.file_dialog import answer
from ui.panels.maps import image_at, image_label, short_label
from ui.panels.window_state import FileQuestion, PanelState
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

MEANS = MapMeans((0.5, 0.5, 0.5), 0.25, (0.125, 0.125, 0.125))


def sample(window: HeadlessWindow) -> None:
    """The stand-in's worker samples what was asked last: a texture of a half, a weight of a quarter."""
    client = window.shell.editor._client
    assert isinstance(client, StandInClient)
    window.frames(2)
    request = next(r for r in reversed(client.requests) if isinstance(r, SampleMaps))
    for key, images in request.layers:
        start, stop = scene_frame().object_ranges[0]
        samples = np.full((int(stop - start), 4), (0.5, 0.5, 0.5, 0.25 if images.weight else 1.0), np.float16)
        names = {name: np.full((8, 16, 3), 128, np.uint8) for name in ("texture", "weight") if getattr(images, name)}
        client.say(MapsSampled(key, images, samples, MEANS, names, id=request.id))
    window.frames(4)
    assert window.run_until(lambda: window.shell.editor.status.picture == "exact", 30.0)


def linear(window: HeadlessWindow) -> np.ndarray:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source.source.renderer.linear_image()


def maps_of(window: HeadlessWindow) -> LayerMaps:
    return window.shell.editor.document.layer("teapot.0").maps


def test_load_edit_and_clear(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.0")
    editor.do(SetVisible("teapot.1", False))  # what is left is the base alone
    window.frames(3)
    plain = linear(window)
    window.click_handle("material.images.0")
    window.click_handle("material.texture")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_texture", "teapot.0")
    (tmp_path / "oak.png").touch()
    actor.perform([answer(question, tmp_path / "oak.png")], window.shell.state, 0.0)
    assert maps_of(window).texture == str(tmp_path / "oak.png")
    window.shell.state = PanelState()
    sample(window)
    np.testing.assert_allclose(linear(window)[:, :12], 0.5 * plain[:, :12], rtol=1e-3)
    client = editor._client
    assert isinstance(client, StandInClient)
    n_asked = sum(isinstance(request, SampleMaps) for request in client.requests)
    window.click_handle("material.texture.thumbnail")  # painted on elsewhere
    sample(window)
    assert sum(isinstance(request, SampleMaps) for request in client.requests) == n_asked + 1
    window.drag_handle("material.texture_strength", (-1000, 0))
    assert maps_of(window).texture_strength == 0.0
    window.frames(2)
    np.testing.assert_allclose(linear(window)[:, :12], plain[:, :12], rtol=1e-3)
    editor.undo()
    window.click_handle("material.texture_space.0")
    assert maps_of(window).texture_space == "srgb"
    window.click_handle("button.clear_texture")
    assert maps_of(window).is_plain
    window.frames(2)
    np.testing.assert_allclose(linear(window)[:, :12], plain[:, :12], rtol=1e-3)


def test_a_weight_map_is_inverted_by_a_button(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.0")
    editor.do(SetVisible("teapot.1", False))  # what is left is the base alone
    window.frames(3)
    plain = linear(window)
    editor.do(SetMap("teapot.0", "weight", "mask.png"))
    window.frames(2)
    sample(window)
    np.testing.assert_allclose(linear(window)[:, :12], 0.125 * plain[:, :12], rtol=1e-3)
    window.click_handle("material.weight_invert.0")
    window.frames(2)
    assert maps_of(window).weight_invert
    np.testing.assert_allclose(linear(window)[:, :12], 0.375 * plain[:, :12], rtol=1e-3)


def test_dropped_pictures_are_textures_of_what_is_selected(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell = window.shell.editor, window.shell
    editor.select("teapot.0")
    shell.drop([str(tmp_path / "gone.png")])
    assert maps_of(window).is_plain and "no such file" in editor.status.message
    (tmp_path / "oak.jpg").touch()
    shell.drop([str(tmp_path / "oak.jpg")])
    assert maps_of(window).texture == str(tmp_path / "oak.jpg")
    editor.undo()
    editor.select(None)
    shell.drop([str(tmp_path / "oak.jpg")])
    assert maps_of(window).is_plain and "select the layer" in editor.status.message


def test_what_is_dropped_on_a_row_is_that_image(window: HeadlessWindow, tmp_path: Path) -> None:
    shell = window.shell
    shell.editor.select("teapot.0")
    window.frames(3)
    window.click_handle("material.images.0")
    window.frames(2)
    x, y = shell.handle_position("material.weight")
    places = {"weight": (x - 60.0, y + 8.0), "texture": shell.handle_position("material.texture"), None: (20.0, 20.0)}
    for name, place in places.items():
        assert image_at(shell.handles, shell.theme, *place) == name
    (tmp_path / "mask.exr").touch()
    shell.drop([str(tmp_path / "mask.exr")], "weight")  # anywhere else it would be a sky
    assert maps_of(window).weight == str(tmp_path / "mask.exr")


def test_the_browser_answers_for_the_layer_it_was_asked_for(tmp_path: Path) -> None:
    question = FileQuestion("open_weight", tmp_path, key="tray.0")
    assert answer(question, tmp_path / "a.png").action == OpenImage(tmp_path / "a.png", "tray.0", "weight")
    assert AskFile("open_texture", "tray.0").key == "tray.0"
    assert (short_label("oak.png"), short_label("cup.glb#2")) == ("oak", "cup.glb#2")
    assert image_label("maps/oak.png") == "oak.png" and image_label("cup.glb#2") == "cup.glb#2"


def test_bumps_are_loaded_edited_and_cleared(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.0")
    window.frames(3)

    def bumps() -> Bumps:
        return editor.document.object("teapot").bumps

    for other in ("light", "accuracy"):  # room for all rows
        editor.do(OpenPanel(other, False))
    window.frames(6)
    window.click_handle("material.images.0")
    window.click_handle("material.bump_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_bump_map", "teapot")
    (tmp_path / "dents.png").touch()
    actor.perform([answer(question, tmp_path / "dents.png")], window.shell.state, 0.0)
    assert bumps() == Bumps(bump_map=str(tmp_path / "dents.png"))
    window.shell.state = PanelState()
    window.frames(2)
    window.drag_handle("material.bump_strength", (1000, 0))
    assert bumps().bump_strength == 10.0
    window.drag_handle("material.bump_repeats.u", (50, 0))
    assert bumps().bump_repeats[0] > 1.0
    window.drag_handle("material.bump_height", (50, 0))
    assert bumps().bump_height > 0.01
    for _ in range(3):  # a drag is one step
        editor.undo()
    assert bumps() == Bumps(bump_map=str(tmp_path / "dents.png"))
    window.frames(2)
    window.click_handle("button.clear_bumps")
    assert not bumps().file
    editor.undo()
    editor.undo()
    assert bumps() == NO_BUMPS


def test_the_words_of_buttons_without_an_image_are_whole(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    shortened: list[str] = []
    monkeypatch.setattr("ui.panels.widgets.fitting", lambda text, room: shortened.append(text) or text)
    window.click_handle("material.images.0")
    window.frames(2)
    assert {"material.texture", "material.normal_map", "material.bump_map"} <= set(window.shell.handles.names())
    assert shortened == []


def test_the_rotation_of_a_streak_is_dragged_mapped_and_undone(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor

    def bumps() -> Bumps:
        return editor.document.object("teapot").bumps

    for other in ("light", "accuracy"):  # room for all rows
        editor.do(OpenPanel(other, False))
    editor.select("teapot.0")
    editor.do(SetModel("teapot.0", "lambert"))
    window.frames(6)
    assert "material.tangent_angle" not in window.shell.handles.names()  # nothing has a direction
    editor.do(SetModel("teapot.0", "ashikhmin_shirley"))
    window.frames(3)
    window.drag_handle("material.tangent_angle", (1000, 0))
    assert bumps() == Bumps(tangent_angle=360.0)
    editor.undo()  # a drag is one step
    assert bumps() == NO_BUMPS
    window.frames(2)
    window.click_handle("material.tangent_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_tangent_map", "teapot")
    (tmp_path / "brush.png").touch()
    actor.perform([answer(question, tmp_path / "brush.png")], window.shell.state, 0.0)
    assert bumps() == Bumps(tangent_map=str(tmp_path / "brush.png"))
    window.shell.state = PanelState()
    window.frames(2)
    window.drag_handle("material.tangent_range", (1000, 0))
    assert bumps().tangent_range == 360.0
    window.click_handle("button.clear_tangent")
    assert not bumps().tangent_map


def test_a_layer_takes_the_coats_normals(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.0")
    for other in ("light", "accuracy"):  # room for all rows
        editor.do(OpenPanel(other, False))
    window.frames(6)
    window.click_handle("material.images.0")
    assert "material.frame.0" not in window.shell.handles.names()  # only coats, and layers that have it
    editor.do(SetFrame("teapot.0", "coat"))
    window.frames(3)
    window.click_handle("material.coat_normal_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_coat_normal_map", "teapot")
    (tmp_path / "peel.png").touch()
    actor.perform([answer(question, tmp_path / "peel.png")], window.shell.state, 0.0)
    window.shell.state = PanelState()
    window.frames(2)
    window.drag_handle("material.coat_strength", (1000, 0))
    file = str(tmp_path / "peel.png")
    assert editor.document.object("teapot").bumps == Bumps(coat_normal_map=file, coat_strength=10.0)
    window.click_handle("button.clear_coat_bumps")
    assert not editor.document.object("teapot").bumps.coat_normal_map
    window.frames(2)
    window.click_handle("material.frame.0")
    assert editor.document.layer("teapot.0").frame == "base"
    for _ in range(5):
        editor.undo()
    assert editor.document.object("teapot").bumps == NO_BUMPS and editor.document.layer("teapot.0").frame == "base"


def test_opacity_is_chosen_dragged_mapped_and_undone(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.0")
    for other in ("light", "accuracy"):  # room for all rows
        editor.do(OpenPanel(other, False))
    window.frames(6)
    window.click_handle("material.images.0")
    assert "material.opacity_cutoff" not in window.shell.handles.names()  # of what is all there
    editor.do(SetOpacity("teapot", "opacity_mode", "mask"))
    window.frames(3)
    window.drag_handle("material.opacity_cutoff", (1000, 0))
    assert editor.document.object("teapot").opacity == Opacity("mask", 1.0)
    window.click_handle("material.opacity_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_opacity_map", "teapot")
    (tmp_path / "leaf.png").touch()
    actor.perform([answer(question, tmp_path / "leaf.png")], window.shell.state, 0.0)
    assert editor.document.object("teapot").opacity.opacity_map == str(tmp_path / "leaf.png")
    window.shell.state = PanelState()
    window.frames(2)
    window.click_handle("button.clear_opacity")
    assert editor.document.object("teapot").opacity == Opacity("mask", 1.0)
    for _ in range(4):
        editor.undo()
    assert editor.document.object("teapot").opacity == OPAQUE and not editor.document.new_opacities


def test_switches_of_vertex_colours_and_of_green(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.0")
    for other in ("light", "accuracy"):  # room for all rows
        editor.do(OpenPanel(other, False))
    window.frames(6)
    window.click_handle("material.images.0")
    assert "material.vertex_colours.0" not in window.shell.handles.names()  # its mesh has none
    editor.do(SetMap("teapot.0", "vertex_colours", True))
    editor.do(SetBumps("teapot", "normal_map", "lean.png"))
    window.frames(3)
    window.click_handle("material.flip_green.0")
    assert editor.document.object("teapot").bumps == Bumps(normal_map="lean.png", flip_green=True)
    window.click_handle("material.vertex_colours.0")
    assert not maps_of(window).vertex_colours
