"""Whatever is done to the view, in any order: what is on screen is the linear picture through the view's description.

All that a user can do to a view at random (channels, exposure, gamma, views and configurations, stored pictures, the
comparison, crop, pins, zoom, modes, the window's size, the camera), with edits and undo between. Each few commands the
window comes to rest, and is compared with a slow twin (`tests.naive.shown_view`): the picture's colours, what lies over
it, values of pixels, scopes, relRMSE. In each frame no legend stands over colours of another kind.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetBackground, SetBackgroundColour, SetIntensity, SetRotation
from app.document.view_state import DIFFERENCES, PICTURE_CHANNELS, SetView, ViewState
from app.operators.inspect import channel_operator
from app.operators.registry import run_operator
from engine.core.colour import VIEWS, ConfigView
from engine.render.crop import Crop
from engine.render.display import exr_bytes
from engine.scene.camera_moves import orbit_camera
from tests.ui.conftest import opened
from tests.ui.stand_in import HEIGHT, WIDTH
from tests.ui.view_walk import ViewWalk
from ui.panels.actions import StorePicture

pytestmark = pytest.mark.gl
Key = imgui.Key

SIZES = ((1280, 800), (900, 620), (1000, 720))
# Of what a view is, what an edit and undo leave alone.
INSPECTED = (
    "exposure", "gamma", "tone_mapping", "picture_channel", "zebra", "stored", "difference", "compare_divider", "crop",
    "probes", "fit", "zoom", "centre",
)  # fmt: skip
# Said to a person, and meant for one.
MAY_BE_TOLD = ("remove one first", "no such file", "No such file", "gone.ocio", "there is no picture yet")


def view_of(walk: ViewWalk, **changes: Any) -> None:
    walk.editor.do(SetView.of(**changes))


def do_and_keep_view(walk: ViewWalk, edit: Callable[[], object]) -> None:
    """An edit, undo or redo leaves the view's inspection alone."""
    before = [getattr(walk.editor.view, name) for name in INSPECTED]
    edit()
    walk.frames()
    assert [getattr(walk.editor.view, name) for name in INSPECTED] == before


def store(walk: ViewWalk, name: str = "") -> None:
    if not walk.is_placement or not walk.editor.status.is_finished:
        return
    walk.rest()
    light, names = walk.light(), set(walk.stored)
    walk.shell.request(StorePicture(name))
    walk.frames()
    if walk.random.random() < 0.5:  # what is stored is what was shown
        walk.editor.do(SetIntensity(walk.number(0.5, 2.0)))
    walk.frames()
    assert walk.window.run_until(lambda: not walk.shell.saving.is_storing, 20)
    if walk.editor.view.stored and (set(walk.editor.stored.names) != names or walk.editor.view.stored == name):
        walk.stored[walk.editor.view.stored] = light


def load(walk: ViewWalk, size: tuple[int, int]) -> None:
    file = walk.folder / f"{size[0]} {len(walk.done)}.exr"
    light = walk.random.uniform(0.0, 1.0, (size[1], size[0], 3)).astype(np.float32)
    file.write_bytes(exr_bytes(light))
    names = set(walk.stored)
    run_operator(walk.editor, "compare_file", str(file))
    assert walk.window.run_until(lambda: not walk.editor.stored.is_reading, 20)
    for name in set(walk.editor.stored.names) - names:
        walk.stored[name] = np.dstack([light, np.ones(light.shape[:2])])


def remove(walk: ViewWalk) -> None:
    if walk.stored:
        name = walk.one(walk.stored)
        assert run_operator(walk.editor, "remove_stored", name) is None
        del walk.stored[name]


def compare(walk: ViewWalk) -> None:
    if walk.is_placement:
        walk.rest()
        walk.before = walk.light()
        run_operator(walk.editor, "compare")


def choose_mode(walk: ViewWalk, name: str) -> None:
    run_operator(walk.editor, "mode", name)
    walk.frames(4)


def wheel(walk: ViewWalk) -> None:
    """Zoom about a place, or pan, by the mouse."""
    window, (x, y) = walk.window, walk.shell.handle_position("viewport.centre")
    window.move(x + walk.number(-80, 80), y + walk.number(-60, 60))
    for key in (Key.mod_ctrl, Key.mod_alt):
        window.hold(key, True)
    if walk.random.random() < 0.6:
        for _ in range(int(walk.random.integers(1, 6))):
            window.wheel(walk.one((1.0, 1.0, -1.0)))
    else:
        window.drag((x, y), (x + walk.number(-60, 60), y + walk.number(-60, 60)))
    for key in (Key.mod_alt, Key.mod_ctrl):
        window.hold(key, False)


def draw_crop(walk: ViewWalk) -> None:
    window, (x, y) = walk.window, walk.shell.handle_position("viewport.centre")
    window.key(Key.b, Key.mod_ctrl)
    window.drag(
        (x - walk.number(20, 150), y - walk.number(20, 90)), (x + walk.number(20, 150), y + walk.number(20, 90))
    )


def press(*keys: imgui.Key) -> Callable[[ViewWalk], None]:
    return lambda walk: walk.window.key(*keys)


def pin(walk: ViewWalk) -> None:
    x, y = walk.shell.handle_position("viewport.centre")
    walk.window.move(x + walk.number(-100, 100), y + walk.number(-80, 80))
    walk.window.frames(1)
    walk.window.key(Key.q, Key.mod_shift, Key.mod_alt)


def move_camera(walk: ViewWalk) -> None:
    history = walk.editor.camera_history
    moved = orbit_camera(history.camera, walk.number(-0.3, 0.3), walk.number(-0.1, 0.1))
    history.set_viewpoint(replace_camera(walk.editor.view, moved), "orbit")


def replace_camera(view: ViewState, camera: Any) -> Any:
    return view.viewpoint._replace(camera=camera)


def random_crop(walk: ViewWalk) -> Crop:
    (left, right), (upper, lower) = (np.sort(walk.random.uniform(0.0, 1.0, 2)) for _ in range(2))
    return Crop(float(left), float(upper), float(max(right, left + 0.01)), float(max(lower, upper + 0.01)))


def edit(command: Callable[[ViewWalk], Any]) -> Callable[[ViewWalk], None]:
    return lambda walk: do_and_keep_view(walk, lambda: walk.editor.do(command(walk)))


COMMANDS: dict[str, Callable[[ViewWalk], object]] = {
    **{
        f"channel {each}": lambda w, each=each: run_operator(w.editor, channel_operator(each))
        for each in PICTURE_CHANNELS
    },
    "darker": press(Key.left_bracket),
    "brighter": press(Key.right_bracket),
    "expose": lambda w: view_of(w, exposure=w.number(-3.0, 3.0)),
    "gamma": lambda w: view_of(w, gamma=w.number(0.6, 2.0)),
    "reset exposure": press(Key.backslash),
    "a view": lambda w: view_of(w, tone_mapping=w.one(VIEWS)),
    "filmic": lambda w: view_of(w, tone_mapping="filmic"),
    "standard": lambda w: view_of(w, tone_mapping="linear"),
    "stops": press(Key._9, Key.mod_ctrl),
    "a configuration": lambda w: w.editor.colours.open(
        ConfigView(str(w.config), *w.one((("Monitor", "Plain"), ("Monitor", "Film"), ("Projector", "Cube"))))
    ),
    "its look": lambda w: view_of(w, tone_mapping=ConfigView(str(w.config), "Projector", "Plain", "Warm")),
    "zebra": press(Key._8, Key.mod_ctrl),
    "store": store,
    "store again": store,
    "store by name": lambda w: store(w, "kept"),
    "load": lambda w: load(w, (WIDTH, HEIGHT)),
    "load another size": lambda w: load(w, (WIDTH + 2, HEIGHT)),
    "load nothing": lambda w: run_operator(w.editor, "compare_file", str(w.folder / "none.exr")),
    "compare with": lambda w: w.editor.stored.compare_with(w.one(["", *w.stored, *w.stored])),
    "difference": lambda w: run_operator(w.editor, "difference", w.one(DIFFERENCES)),
    "signed": lambda w: run_operator(w.editor, "difference", "signed"),
    "absolute": lambda w: run_operator(w.editor, "difference", "absolute"),
    "next": press(Key.c, Key.mod_alt),
    "remove": remove,
    "compare": compare,
    "compare no more": lambda w: view_of(w, compare=None),
    "divider": lambda w: view_of(w, compare_divider=w.number(-0.1, 1.1)),
    "crop": lambda w: view_of(w, crop=random_crop(w)),
    "draw a crop": draw_crop,
    "all of it": press(Key.b, Key.mod_ctrl, Key.mod_alt),
    "pin": pin,
    "unpin": lambda w: view_of(w, probes=()),
    "zoom": lambda w: view_of(w, fit=False, zoom=w.number(6.0, 18.0), centre=(w.number(0.2, 0.8), w.number(0.2, 0.8))),
    "wheel": wheel,
    "wheel again": wheel,
    "magnify": press(Key.equal, Key.mod_ctrl),
    "less": press(Key.minus, Key.mod_ctrl),
    "fit": press(Key._0),
    "pixels": press(Key._1),
    "scopes": press(Key._0, Key.mod_ctrl),
    "values": press(Key.q),
    "error": press(Key.e),
    "Orbit": lambda w: choose_mode(w, "orbit"),
    "Placement": lambda w: choose_mode(w, "placement"),
    "Placement again": lambda w: choose_mode(w, "placement"),
    "resize": lambda w: w.window.resize(w.one(SIZES)),
    "move the camera": move_camera,
    "turn the light": edit(lambda w: SetRotation(w.number(0.0, 360.0))),
    "intensity": edit(lambda w: SetIntensity(w.number(0.3, 3.0))),
    "roughness": edit(lambda w: SetParameter("teapot.1", "alpha", w.number(0.1, 0.6))),
    "hide": edit(lambda w: SetVisible("teapot.0", False)),
    "show": edit(lambda w: SetVisible("teapot.0", True)),
    "transparent": edit(lambda w: SetBackground("transparent")),
    "before a colour": edit(lambda w: SetBackgroundColour((0.2, 0.4, 0.8))),
    "before the sky": edit(lambda w: SetBackground("environment")),
    "undo": lambda w: do_and_keep_view(w, w.editor.undo),
    "undo again": lambda w: do_and_keep_view(w, w.editor.undo),
    "redo": lambda w: do_and_keep_view(w, w.editor.redo),
    "select": lambda w: w.editor.select(w.one(("teapot.1.theta_h", "tray", None))),
}  # fmt: skip


@pytest.mark.parametrize("seed", [700, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(701, 760))])
def test_the_screen_is_the_picture_through_the_view(context: moderngl.Context, tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    windows = opened(context, SIZES[0], 1.0)
    walk = ViewWalk(next(windows), random, tmp_path)
    try:
        for i, name in enumerate(map(str, random.choice(sorted(COMMANDS), 120))):
            walk.done.append(name)
            COMMANDS[name](walk)
            walk.frames(int(random.choice([0, 1, 3])))
            if i % 3 == 2:
                walk.rest()
                walk.hold_to_twin()
            status = walk.editor.status
            assert not status.is_error or any(known in status.message for known in MAY_BE_TOLD), status.message
        assert walk.n_looked_at > 5
    except BaseException:
        print(seed, walk.done[-12:])
        raise
    finally:
        for _ in windows:
            pass
