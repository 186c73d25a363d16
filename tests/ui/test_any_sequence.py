"""Whatever a hand does, at whatever stage: no fault, no word of ours, and in the end the picture of a fresh editor.

The worker is the real one on a small scene, in this process: a command comes after any of its steps, see `LateClient`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands import MoveObject, SetTransform
from app.document.commands.curves import AddOperator, ResetCurve
from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetEditable,
    SetFresnelTerm,
    SetMaterial,
    SetModel,
    SetParameter,
    SetVisible,
    new_layer,
)
from app.document.commands.light import SetBackground, SetBackgroundColour, SetEnvironment, SetRotation
from app.document.commands.maps import SetBumps
from app.document.commands.mix import SetMix
from app.document.commands.objects import AddObject, DeleteObject, RenameObject
from app.document.commands.suns import AddSun, DeleteSun, RenameSun, SetSun
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.files.materials import Library
from app.operators.arrange import Move
from app.operators.curve_drawing import CurvePoints, CurveStroke
from app.operators.registry import run_operator
from app.worker.cache import ArrayCache
from engine.curve.operators import Operator
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

LIFT = Operator("translate", "y", 0.1, 0.2, 0.5, 0.8, magnitude=0.4)
RESOLUTION = (48, 32)
FRAME_SECONDS = 0.03
MOST_FRAMES = 20_000
# Of the root of the mean square of all pixels to their mean.
TOLERANCE = 1e-5
# While a curve is selected its layer is a sum of transport in half floats, each of which is off by up to 2^-11 of
# itself, unless the user wants full floats. Once it is left, the worker sums it.
HALVES = 1e-3
# Rays between surfaces go where the materials need them by which they were sent: those of a fresh start are others.
SAMPLED = 0.1


class Walk:
    """An editor, its picture on the graphics card, and the lines that were told while nobody gave a command."""

    def __init__(self, context: moderngl.Context, source: str, client: LateClient, **view: object) -> None:
        self.client = client
        self.editor = Editor(client, source, resolution=RESOLUTION)
        self.feed = PictureFeed(context, self.editor.mode)
        self.editor.do(SetView.of(n_lights=1000, **view))
        self.view = view
        self.now, self.told = 0.0, set[str]()

    def frames(self, n: int = 1) -> None:
        for _ in range(n):
            self.now += FRAME_SECONDS
            before = self.editor.status.message_number
            self.feed.take(self.editor, self.now)
            self.feed.draw(self.editor, 10.0)
            status = self.editor.status
            if status.message_number != before and status.is_error:
                self.told.add(status.message)

    def until(self, done: Callable[[], bool]) -> None:
        for _ in range(MOST_FRAMES):
            if done():
                return
            self.frames()
        raise AssertionError(self.editor.status)

    def settle(self) -> np.ndarray:
        """The final picture, linear."""
        self.editor.end_drag()
        self.client.hurries = True
        self.until(lambda: not self.editor.exchange.is_reading)
        self.until(lambda: self.editor.status.is_finished and not self.feed.is_behind)
        self.frames(3)
        self.client.hurries = False
        return self.feed.source.renderer.linear_image_with_alpha()

    def close(self) -> None:
        self.feed.close()
        self.editor.close()


def draw(walk: Walk, drawn: CurveStroke | CurvePoints) -> str | None:
    """Draw the selected curve, where one is selected."""
    return run_operator(walk.editor, "draw_curve" if isinstance(drawn, CurveStroke) else "set_points", drawn)


LIBRARY = Library()
LIBRARY.read_all()
NAMES = ("Copper", "Velvet, red", "Porcelain", "Car paint, blue", "Plaster")
COMMANDS: dict[str, Callable[[Walk], object]] = {
    "lift": lambda w: w.editor.do(AddOperator("ball.1", "theta_h", LIFT)),
    "lift another curve": lambda w: w.editor.do(AddOperator("ball.1", "theta_d", LIFT)),
    "lift the ground": lambda w: w.editor.do(AddOperator("ground.0", "theta_i", LIFT)),
    "draw": lambda w: draw(w, CurveStroke(points=((20.0, 0.9), (60.0, 0.1), (50.0, 0.6)))),
    "draw in red": lambda w: draw(w, CurveStroke(points=((0.0, 0.2), (30.0, 1.1)), channel="r")),
    "set points": lambda w: draw(w, CurvePoints(points=((5.0, 1.0), (40.0, 0.2), (70.0, 0.6)))),
    "paste a table": lambda w: w.editor.exchange.read_table("clipboard", "0,2\n30,0.5\n60,0.7"),
    "paste a bad table": lambda w: w.editor.exchange.read_table("clipboard", "0,2\n30,x"),
    "reset": lambda w: w.editor.do(ResetCurve("ball.1", "theta_h")),
    "roughness": lambda w: w.editor.do(SetParameter("ball.1", "alpha", 0.4)),
    "eta": lambda w: w.editor.do(SetParameter("ball.1", "eta", 1.7)),
    "Cook-Torrance": lambda w: w.editor.do(SetModel("ball.1", "cook_torrance")),
    "Phong": lambda w: w.editor.do(SetModel("ball.0", "phong")),
    "one ratio": lambda w: w.editor.do(SetModel("ball.1", "ashikhmin_shirley_ratio")),
    "one width": lambda w: w.editor.do(SetModel("ball.1", "ashikhmin_shirley_width")),
    "turn the streak": lambda w: w.editor.do(SetParameter("ball.1", "ratio", 0.1)),
    "turn it back": lambda w: w.editor.do(SetParameter("ball.1", "ratio", 8.0)),
    "rotate the streak": lambda w: w.editor.do(SetBumps("ball", "tangent_angle", 70.0)),
    "rotate it back": lambda w: w.editor.do(SetBumps("ball", "tangent_angle", 0.0)),
    "rotate by a map": lambda w: w.editor.do(SetBumps("ball", "tangent_map", "nowhere.png")),
    "rotate by none": lambda w: w.editor.do(SetBumps("ball", "tangent_map", "")),
    "Fresnel term": lambda w: w.editor.do(SetFresnelTerm("ball.1", True)),
    "a layer more": lambda w: w.editor.do(AddLayers("ball", (new_layer("schlick"),))),
    "a layer less": lambda w: w.editor.do(RemoveLayer("ball.0")),
    "hide": lambda w: w.editor.do(SetVisible("ball.0", False)),
    "show": lambda w: w.editor.do(SetVisible("ball.0", True)),
    "turn": lambda w: w.editor.do(SetRotation(w.editor.document.light.rotation + 20.0)),
    "brighten the sky": lambda w: w.editor.do(SetMix("light.environment", "strength", 1.0)),
    "warm the sky": lambda w: w.editor.do(SetMix("light.environment", "kelvin", 3000.0)),
    "transparent": lambda w: w.editor.do(SetBackground("transparent")),
    "before a colour": lambda w: w.editor.do(SetBackgroundColour((0.2, 0.4, 0.8))),
    "before the sky": lambda w: w.editor.do(SetBackground("environment")),
    "hall": lambda w: w.editor.do(SetEnvironment("hall")),
    "studio": lambda w: w.editor.do(SetEnvironment("studio")),
    "no such sky": lambda w: w.editor.do(SetEnvironment("/nowhere/sky.exr")),
    "fix": lambda w: w.editor.do(SetEditable("ground", False)),
    "free": lambda w: w.editor.do(SetEditable("ground", True)),
    "undo": lambda w: w.editor.undo(),
    "redo": lambda w: w.editor.redo(),
    "take hold": lambda w: w.editor.begin_drag(),
    "let go": lambda w: w.editor.end_drag(),
    "give up": lambda w: w.editor.cancel_drag(),
    "select θh": lambda w: w.editor.select("ball.1.theta_h"),
    "select θd": lambda w: w.editor.select("ball.1.theta_d"),
    "select the base": lambda w: w.editor.select("ball.0"),
    "select the ground": lambda w: w.editor.select("ground"),
    "select nothing": lambda w: w.editor.select(None),
    "half": lambda w: w.editor.do(SetView.of(precision="half")),
    "float": lambda w: w.editor.do(SetView.of(precision="float")),
    "compare": lambda w: w.editor.do(SetView.of(compare=w.editor.document)),
    "no shadows": lambda w: w.editor.do(SetView.of(lighting="no_shadows")),
    "one light": lambda w: w.editor.do(SetView.of(lighting="point_light")),
    "light in place": lambda w: w.editor.do(SetView.of(lighting="scene")),
    "compare no more": lambda w: w.editor.do(SetView.of(compare=None)),
    "a scene that is not there": lambda w: w.editor.open("nowhere.toml"),
    "kill": lambda w: w.client.kill(),
    "stop and go on": lambda w: (w.editor.cancel_work(), w.editor.resume_work()),
    **{
        name: lambda w, name=name: w.editor.do(SetMaterial("ball", LIBRARY.entry(name).material.layers))
        for name in NAMES
    },
}
OBJECTS: dict[str, Callable[[Walk], object]] = {
    **{
        name: COMMANDS[name]
        for name in (
            "undo",
            "redo",
            "lift",
            "roughness",
            "compare",
            "kill",
            "turn",
            "select the ground",
            "stop and go on",
        )
    },
    "undo twice": lambda w: (w.editor.undo(), w.editor.undo()),
    "add a box": lambda w: w.editor.do(AddObject("box")),
    "add a spot": lambda w: w.editor.do(AddObject("spot light", "key")),
    "add what is not there": lambda w: w.editor.do(AddObject("/nowhere/cup.ply")),
    "duplicate": lambda w: run_operator(w.editor, "duplicate"),
    "linked duplicate": lambda w: run_operator(w.editor, "linked_duplicate"),
    "make single user": lambda w: run_operator(w.editor, "make_single_user"),
    "delete": lambda w: run_operator(w.editor, "delete_object"),
    "delete the lamp": lambda w: w.editor.do(DeleteObject("lamp")),
    "rename": lambda w: w.editor.do(RenameObject("ball", "bowl")),
    "call it ball": lambda w: w.editor.do(RenameObject("bowl", "ball")),
    "move": lambda w: run_operator(w.editor, "move", Move(object=w.editor.document.objects[-1].name, by=(0.2, 0, 0.1))),
    "hide or show": lambda w: run_operator(w.editor, "hide"),
    "hide the lamp": lambda w: w.editor.do(SetVisible("lamp", False)),
    "hide the ground": lambda w: w.editor.do(SetVisible("ground", False)),
    "show all": lambda w: run_operator(w.editor, "show_all"),
    "select the last": lambda w: w.editor.select(w.editor.document.objects[-1].name),
    "add a sun": lambda w: w.editor.do(AddSun()),
    "add it again": lambda w: w.editor.do(AddSun("noon")),
    "aim the sun": lambda w: w.editor.do(SetSun("noon", "direction", (0.4, 0.8, 0.2))),
    "widen the sun": lambda w: w.editor.do(SetSun("sun", "diameter", 12.0)),
    "rename the sun": lambda w: w.editor.do(RenameSun("sun", "noon")),
    "select the sun": lambda w: w.editor.select("light.noon"),
    "dim the sun": lambda w: w.editor.do(SetMix("light.noon", "strength", -1.0)),
    "delete the sun": lambda w: w.editor.do(DeleteSun("noon")),
}


def move(walk: Walk, *names: str) -> None:
    """Move objects a little further, as a hand does, where they are still there."""
    for name in names:
        walk.editor.do(MoveObject(name, (0.15, 0.0, 0.1)))
        walk.frames(2)


def let_worker_go_on(walk: Walk) -> None:
    """Let the worker come to the end of what it does, and the picture with it."""
    walk.client.hurries = True
    walk.frames(60)
    walk.client.hurries = False


MOVES: dict[str, Callable[[Walk], object]] = {
    **{
        name: COMMANDS[name]
        for name in (
            "undo", "redo", "lift", "roughness", "turn", "brighten the sky", "take hold", "let go", "give up", "kill",
            "compare", "compare no more", "fix", "free", "select θh", "stop and go on", "no shadows", "light in place",
        )
    },
    "brighten the lamp": lambda w: w.editor.do(SetMix("lamp", "strength", 1.0)),
    "move the lamp": lambda w: move(w, "lamp"),
    "move the lamp on": lambda w: move(w, "lamp", "lamp", "lamp"),
    "move the ball": lambda w: move(w, "ball"),
    "move both": lambda w: move(w, "lamp", "ball"),
    "put the lamp back": lambda w: w.editor.do(SetTransform("lamp")),
    "wait": let_worker_go_on,
    "wait longer": lambda w: (let_worker_go_on(w), let_worker_go_on(w)),
}  # fmt: skip
# Said to a person, and meant for one.
MAY_BE_TOLD = (
    "computing stopped (killed) and was started again; your edits are untouched",
    "/nowhere/sky.exr",
    "nowhere.toml",
    "nowhere.png",
    "clipboard: line 2: value = x",
    "there is no such curve any more",
    "/nowhere/cup.ply",
    "there is no object",
    "there is no layer",
    "expected one that no other object has",
    "the comparison ended: its picture has other objects",
    "is not deleted",
    "there is no sun",
    "expected one that no sun has",
    "there is no light",
    "there is no property of the light",
)


@pytest.fixture
def source(tmp_path: Path) -> str:
    return str(write_small_scene(tmp_path))


@pytest.mark.parametrize("restless", ["eta", pytest.param("selection", marks=pytest.mark.sweep)])
def test_a_hand_that_never_rests_while_the_stages_come(
    context: moderngl.Context, source: str, tmp_path: Path, restless: str
) -> None:
    # Pictures of one stage are asked for while another is computed, in each of its steps.
    here = Walk(context, source, LateClient(np.random.default_rng(1), ArrayCache(tmp_path / "cache")), n_bounces=1)
    try:
        here.until(lambda: here.editor.scene_is_open)
        here.editor.do(SetModel("ball.1", "cook_torrance"))
        n = 0
        while here.editor.status.picture == "waiting" or here.editor.status.light_note:
            n += 1
            if restless == "eta":
                here.editor.do(SetParameter("ball.1", "eta", 1.2 + 0.01 * (n % 50)))
            else:
                here.editor.select(("ball.1.theta_h", "ball.1.theta_d", "ground.0", "ball.0")[n % 4])
            here.frames()
            assert n < MOST_FRAMES
        assert not here.told
        assert_as_fresh(context, here, tmp_path, bounces=1)
    finally:
        here.close()


def walk(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int, n_commands: int, bounces: int,
    commands: dict[str, Callable[[Walk], object]] = COMMANDS,
) -> None:  # fmt: skip
    random = np.random.default_rng(seed)
    store = ArrayCache(tmp_path / "cache")
    here = Walk(context, source, LateClient(random, store), n_bounces=bounces)
    done: list[str] = []
    try:
        here.client.hurries = True
        here.until(lambda: here.editor.scene_is_open)
        here.editor.do(SetView.of(n_bounces=bounces))
        here.client.hurries = False
        for name in map(str, random.choice(sorted(commands), n_commands)):
            done.append(name)
            commands[name](here)
            here.frames(int(random.choice([0, 1, 3, 10, 40])))
        here.editor.do(SetView.of(lighting="scene"))
        here.frames()  # until then the status is of the picture under the light before
        here.settle()
        assert all(any(known in line for known in MAY_BE_TOLD) for line in here.told), here.told
        assert_as_fresh(context, here, tmp_path, bounces)
    finally:
        print(seed, done)
        here.close()
    assert context.error == "GL_NO_ERROR"


def assert_as_fresh(context: moderngl.Context, here: Walk, tmp_path: Path, bounces: int) -> None:
    """The picture at rest is that of a new editor on the document as it was saved."""
    here.editor.do(SetView.of(compare=None, solo=None))
    as_edited = here.settle()
    selected = here.editor.view.selected
    is_edited = selected is not None and selected.factor is not None
    here.editor.do(SetView.of(precision="float"))
    if bounces > 1:
        find_anew(here, tmp_path)
    here.frames()
    shown, expected = here.settle(), fresh(context, here, tmp_path)
    assert relative_error(shown, expected) < TOLERANCE
    assert relative_error(as_edited, expected) < (SAMPLED if bounces > 1 else HALVES if is_edited else TOLERANCE)


def find_anew(here: Walk, tmp_path: Path) -> None:
    """Have another worker, which knows nothing, find light between surfaces for the materials as they are: those that
    the transport is requested with."""
    n_lights = here.editor.view.settings.n_lights
    for each in (n_lights + 1, n_lights):
        here.editor.do(SetView.of(n_lights=each))
        here.frames(2)
        here.client.hurries = True
        here.until(lambda: here.editor.status.is_finished)
    here.client.kill(ArrayCache(tmp_path / "forgotten"))


def fresh(context: moderngl.Context, before: Walk, tmp_path: Path) -> np.ndarray:
    """The picture of a new editor and a new worker, with nothing in the cache, on the document as it was saved."""
    session = tmp_path / "walk.insitu"
    assert before.editor.save(session) is None
    other = Walk(context, str(session), LateClient(np.random.default_rng(0), ArrayCache(tmp_path / "empty")))
    try:
        other.client.hurries = True
        other.until(lambda: other.editor.scene_is_open)
        other.client.hurries = True
        return other.settle()
    finally:
        other.close()


def relative_error(shown: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean((shown - expected) ** 2)) / np.mean(expected))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.sweep)])
def test_any_sequence_of_commands_ends_with_the_right_picture(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    walk(context, source, tmp_path, seed, 20, bounces=1)


@pytest.mark.parametrize("seed", [300, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(301, 340))])
def test_so_it_does_while_objects_come_and_go(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    walk(context, source, tmp_path, seed, 20, bounces=1, commands=OBJECTS)


@pytest.mark.parametrize("seed", [400, 401, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(402, 440))])
def test_so_it_does_while_objects_and_lamps_are_moved(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    walk(context, source, tmp_path, seed, 25, bounces=1 + seed % 2, commands=MOVES)


def test_so_it_does_with_indirect_light(context: moderngl.Context, source: str, tmp_path: Path) -> None:
    walk(context, source, tmp_path, 100, 10, bounces=2)


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(200, 260))
def test_many_more_sequences(context: moderngl.Context, source: str, tmp_path: Path, seed: int) -> None:
    walk(context, source, tmp_path, seed, 40, bounces=1 + seed % 2)
