"""Lights placed in the picture: by H and the mouse where a highlight is to be seen, by J where a shadow is to fall."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetRotation
from app.document.commands.suns import AddSun, in_world
from app.document.light_state import LightState
from app.editor.editor import Editor
from app.messages.light_path_messages import TraceLightPath
from engine.scene.light_placement import PlacedLight, mirror_direction
from engine.scene.surface_spot import SurfaceSpot
from engine.scene.transform import Transform
from tests.ui.stand_in import StandInClient
from tests.ui.test_gizmo import BOX, prepared
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

HIDDEN = "lamp is placed, but teapot hides it from that point"
pytestmark = pytest.mark.gl
H, J = imgui.Key.h, imgui.Key.j


def slope(feed: PictureFeed, column: int, row: int) -> SurfaceSpot:
    """A surface that rises behind the picture's lower edge, at the point that a pixel sees."""
    return SurfaceSpot(np.array([0.1 * column, -0.05 * row, -0.1 * row]), np.array([0.0, 0.8, 0.6]), 0.01)


@pytest.fixture
def editor(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> Editor:
    """The editor in Placement, its lamp selected, before a slope."""
    monkeypatch.setattr(PictureFeed, "spot_at", slope)
    found = prepared(window, "placement")
    found.select("lamp")
    window.frames(2)
    return found


def place(window: HeadlessWindow, x: float, y: float) -> tuple[float, float]:
    """A place over the picture, as shares of the way from its upper left corner to the middle."""
    (left, top), (middle, centre) = map(window.shell.handle_position, ("viewport.corner", "viewport.centre"))
    return left + x * (middle - left), top + y * (centre - top)


def spot(window: HeadlessWindow, at: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The point and the normal of the surface there."""
    feed = window.shell.source
    assert isinstance(feed, PictureFeed)
    found = feed.spot_at(*pixel(window, at))
    assert found is not None
    return found.place, found.normal


def pixel(window: HeadlessWindow, at: tuple[float, float]) -> tuple[int, int]:
    """The picture's pixel there."""
    feed, (left, top) = window.shell.source, window.shell.handle_position("viewport.corner")
    assert isinstance(feed, PictureFeed) and feed.picture is not None
    size = 2.0 * (window.shell.handle_position("viewport.centre")[0] - left)
    column, row = (
        int((value - start) * feed.picture.width / size) for value, start in zip(at, (left, top), strict=True)
    )
    return column, row


def lamp(editor: Editor) -> Transform:
    return editor.document.object("lamp").transform


def test_a_click_places_the_highlight_and_a_drag_slides_it_in_one_step(window: HeadlessWindow, editor: Editor) -> None:
    at, to, resting = place(window, 0.22, 0.53), place(window, 0.31, 0.72), Transform()
    light = PlacedLight(BOX.mean(axis=0), np.array([0.0, 0.0, 1.0]), resting)
    window.hold(H, True)
    window.click(*at)
    window.frames(2)
    eye = editor.camera_history.camera.position
    assert lamp(editor) == light.by_highlight(*spot(window, at), eye) != resting
    clicked = lamp(editor)
    window.drag(at, to)
    window.hold(H, False)
    assert [step.label for step in editor.history.undo_steps] == ["place lamp by its highlight"] * 2
    assert lamp(editor) != clicked and editor.view.selected is not None and editor.view.selected.object == "lamp"
    editor.undo()
    assert lamp(editor) == clicked
    editor.undo()
    assert lamp(editor) == resting


def test_what_hides_the_light_is_said_and_that_nothing_does_any_more(window: HeadlessWindow, editor: Editor) -> None:
    client = editor._client
    assert isinstance(client, StandInClient)
    client.light_path = HIDDEN
    window.hold(H, True)
    window.click(*place(window, 0.22, 0.53))
    window.frames(2)
    assert editor.status.message == HIDDEN and not editor.status.is_error
    (path, *others) = [each.path for each in client.requests if isinstance(each, TraceLightPath)]
    assert path.light == "lamp" and not others  # one way is traced once
    # As far from the surface as it was, and seen from the camera.
    assert path.reach == pytest.approx(np.linalg.norm(BOX.mean(axis=0) - path.point))
    assert path.eye == editor.camera_history.camera.position
    client.light_path = ""
    window.click(*place(window, 0.31, 0.72))
    window.hold(H, False)
    window.frames(2)
    assert not editor.status.message


def test_a_drag_from_a_caster_names_it(window: HeadlessWindow, editor: Editor) -> None:
    client, start = editor._client, place(window, 0.22, 0.33)
    assert isinstance(client, StandInClient)
    window.hold(J, True)
    window.drag(start, place(window, 0.27, 0.91))
    window.hold(J, False)
    path = [each.path for each in client.requests if isinstance(each, TraceLightPath)][-1]
    assert path.caster == pytest.approx(spot(window, start)[0])
    feed, (column, row) = window.shell.source, pixel(window, start)
    assert isinstance(feed, PictureFeed) and path.caster_object == (feed.object_at(column, row) or "")


def test_a_drag_goes_from_what_casts_the_shadow_to_where_it_falls(window: HeadlessWindow, editor: Editor) -> None:
    start, end = place(window, 0.22, 0.33), place(window, 0.27, 0.91)
    light = PlacedLight(BOX.mean(axis=0), np.array([0.0, 0.0, 1.0]), Transform())
    window.hold(J, True)
    window.drag(start, end)
    window.hold(J, False)
    assert lamp(editor) == light.by_shadow(spot(window, start)[0], spot(window, end)[0]) != Transform()
    assert len(editor.history.undo_steps) == 1


def test_other_objects_are_selected_as_before_and_esc_takes_a_drag_back(window: HeadlessWindow, editor: Editor) -> None:
    at = place(window, 0.22, 0.53)
    window.hold(H, True)
    window.move(*at)
    window.press()
    window.move(at[0] + 8.0, at[1] + 8.0)
    assert lamp(editor) != Transform()
    window.key(imgui.Key.escape)
    window.release()
    assert lamp(editor) == Transform() and not editor.history.undo_steps
    editor.select("teapot")
    window.frames(2)
    window.click(*at)
    window.hold(H, False)
    assert not editor.history.undo_steps  # it shines not: a click selects
    assert editor.view.selected is not None and editor.view.selected.object == "teapot"


def test_a_sun_is_placed_by_its_highlight_and_by_a_shadow(window: HeadlessWindow, editor: Editor) -> None:
    """The camera's mirror image at the click, and the way from the shadow to what throws it; the light is rotated."""
    editor.do(SetRotation(-35.0))
    editor.do(AddSun("key"))
    n_steps, resting = len(editor.history.undo_steps), editor.document.light.suns[-1]
    assert editor.view.sun == "key"
    window.frames(2)

    def towards() -> np.ndarray:
        return np.array(in_world(editor.document.light.suns[-1].direction, LightState(rotation=-35.0)))

    at = place(window, 0.22, 0.53)
    window.hold(H, True)
    window.click(*at)
    window.hold(H, False)
    expected = mirror_direction(*spot(window, at), editor.camera_history.camera.position)
    np.testing.assert_allclose(towards(), expected, atol=1e-9)
    start, end = place(window, 0.22, 0.33), place(window, 0.27, 0.91)
    window.hold(J, True)
    window.drag(start, end)
    window.hold(J, False)
    between = spot(window, start)[0] - spot(window, end)[0]
    np.testing.assert_allclose(towards(), between / np.linalg.norm(between), atol=1e-9)
    labels = [step.label for step in editor.history.undo_steps[n_steps:]]
    assert labels == ["place key by its highlight", "place key by a shadow"]
    editor.undo()
    editor.undo()
    assert editor.document.light.suns[-1] == resting
