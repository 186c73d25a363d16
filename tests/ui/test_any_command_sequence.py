"""Any sequence of all commands in a window, under a painted sky among others: no fault, in the end the picture of a
fresh start, and undo to the bit.

As in `test_any_sequence`, the worker is the real one, on a small scene, and commands come between any two of its steps.
They come as panels return them, and all panels are drawn beside each document that they lead to.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import get_args

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.document.commands import EditCommand
from app.document.commands.layers import SetVisible
from app.document.commands.light import SetIntensity, SetMapChange, SetRotation, SplitEnvironment
from app.document.commands.mix import SetMix
from app.document.commands.painted import AddPainted, RemovePainted, SetPainted
from app.document.document import Document
from app.document.material_match import MaterialAnswer, MaterialMatch, MaterialMatchErrors
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.editor.material_matching import MaterialMatching
from app.files.session import dump_session
from app.operators.arrange import painting
from app.operators.material_matches import MatchMaterial
from app.worker.cache import ArrayCache
from engine.curve.tables import TabulatedCurve
from engine.material import MODELS as ALL_MODELS
from engine.material import make_layer
from tests.app.fake_matcher import FakeMatcher
from tests.ui.any_command import MAKERS, MODELS, AnyCommand
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import COMMANDS, MAY_BE_TOLD, MOVES, OBJECTS, RESOLUTION, Walk, assert_as_fresh
from ui.headless import HeadlessWindow
from ui.panels.actions import Action, BeginDrag, CancelDrag, EndDrag, RunOperator, StopMaterialMatch
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

SIZE = (480, 360)
KINDS = ("box", "disc", "gradient", "sky")


class WindowWalk(Walk):
    """An editor in a window without a display. random: of what its commands draw."""

    def __init__(self, context: moderngl.Context, source: str, client: LateClient, random: np.random.Generator) -> None:
        self.client, self.random = client, random
        self.editor = Editor(client, source, resolution=RESOLUTION)
        self.window = HeadlessWindow(self.editor, size=SIZE, context=context)
        self.feed = self.window.shell.source = PictureFeed(context, self.editor.mode)
        self.matcher = FakeMatcher[MaterialMatch, MaterialAnswer]()
        self.editor.material_matching = MaterialMatching(self.editor, self.matcher)
        self.folder = Path(source).parent
        self.editor.do(SetView.of(n_lights=1000, n_bounces=1))
        self.told = set[str]()

    def frames(self, n: int = 1) -> None:
        for _ in range(n):
            before = self.editor.status.message_number
            self.window.frame()
            status = self.editor.status
            if status.message_number != before and status.is_error:
                self.told.add(status.message)

    def do(self, *actions: Action) -> None:
        self.window.shell.do(*actions)

    def close(self) -> None:
        self.feed.close()
        self.window.close()
        self.editor.close()


def painted(walk: WindowWalk) -> str | None:
    """One of the painted lights, None where there is none."""
    names = [each.name for each in walk.editor.document.light.painted]
    return str(walk.random.choice(names)) if names else None


def drag_light(walk: WindowWalk, last: Action) -> None:
    """Drag a painted light over the sky, some steps in frames of their own."""
    name = painted(walk)
    if name is None:
        return
    walk.do(BeginDrag())
    for _ in range(int(walk.random.integers(1, 5))):
        azimuth, elevation = (float(walk.random.uniform(*span)) for span in ((-180.0, 180.0), (-80.0, 80.0)))
        walk.do(SetPainted(name, (("azimuth", azimuth), ("elevation", elevation))))
        walk.frames(int(walk.random.integers(0, 4)))
    walk.do(last)


def drag_map(walk: WindowWalk, name: str, low: float, high: float) -> None:
    """Drag a slider of the environment's map."""
    walk.do(BeginDrag())
    for value in walk.random.uniform(low, high, 3):
        walk.do(SetMapChange(name, float(value)))
        walk.frames(int(walk.random.integers(0, 3)))
    walk.do(EndDrag())


def named(command: Callable[[str], Action]) -> Callable[[WindowWalk], None]:
    """What a command does to one of the painted lights, where there is any."""
    return lambda w: None if (name := painted(w)) is None else w.do(command(name))


PAINTED: dict[str, Callable[[WindowWalk], object]] = {
    **{f"paint a {kind}": lambda w, kind=kind: w.do(RunOperator(painting(kind))) for kind in KINDS},
    "paint a card": lambda w: w.do(AddPainted("image", "", (("file", str(w.folder / "card.png")),))),
    "paint what is not there": lambda w: w.do(AddPainted("image", "", (("file", "/nowhere/card.png"),))),
    "set any": lambda w: give(w, MAKERS[SetPainted]),
    "set any again": lambda w: give(w, MAKERS[SetPainted]),
    "drag it": lambda w: drag_light(w, EndDrag()),
    "drag it and give up": lambda w: drag_light(w, CancelDrag()),
    "paint it first": named(lambda name: SetPainted.of(name, "position", 0)),
    "rename it": named(lambda name: SetPainted.of(name, "name", f"{name[:20]} too")),
    "brighten it": named(lambda name: SetMix(f"light.painted.{name}", "strength", 1.5)),
    "switch it off": named(lambda name: SetMix(f"light.painted.{name}", "on", False)),
    "solo": named(lambda name: SetMix(f"light.painted.{name}", "solo", True)),
    "solo no more": named(lambda name: SetMix(f"light.painted.{name}", "solo", False)),
    "keep it from the ball": named(lambda name: SetMix(f"light.painted.{name}", "excludes", ("ball",))),
    "remove it": named(RemovePainted),
    "tilt": lambda w: drag_map(w, "tilt", -90.0, 90.0),
    "hue": lambda w: drag_map(w, "hue", -180.0, 180.0),
    "contrast": lambda w: drag_map(w, "contrast", 0.2, 2.0),
    "clamp": lambda w: w.do(SetMapChange("clamp", float(w.random.uniform(0.0, 2.0)))),
    "turn": lambda w: w.do(SetRotation(float(w.random.uniform(0.0, 360.0)))),
    "all brighter": lambda w: w.do(SetIntensity(2.0)),
    "six sides": lambda w: w.do(SplitEnvironment(True)),
    "one sky": lambda w: w.do(SplitEnvironment(False)),
    "hide the lamp": lambda w: w.do(SetVisible("lamp", False)),
    **{
        name: COMMANDS[name]
        for name in (
            "lift", "draw in red", "roughness", "Phong", "hall", "select θh", "select nothing", "fix", "free",
            "brighten the sky", "warm the sky", "before a colour", "one light", "light in place", "compare",
            "compare no more", "kill", "stop and go on", "Copper",
        )
    },
    **{
        name: OBJECTS[name]
        for name in (
            "add a box", "delete", "delete the lamp", "add a sun", "widen the sun", "delete the sun", "show all",
            "move", "select the last",
        )
    },
    **{name: MOVES[name] for name in ("move the lamp", "move the ball", "brighten the lamp", "wait")},
    "undo": lambda w: w.do(RunOperator("undo")),
    "undo again": lambda w: w.do(RunOperator("undo")),
    "redo": lambda w: w.do(RunOperator("redo")),
}  # fmt: skip
TOLD = (
    *MAY_BE_TOLD, "/nowhere/card.png", "a material is still being matched", "it was not matched",
    "what was found is dropped", "has no visible layer to match",
)  # fmt: skip


@pytest.fixture
def source(tmp_path: Path) -> str:
    Image.fromarray(np.random.default_rng(5).integers(0, 256, (12, 24, 3)).astype(np.uint8)).save(tmp_path / "card.png")
    return str(write_small_scene(tmp_path))


def written(document: Document) -> str:
    """All of a document that is saved, to the bit."""
    return dump_session(document, ViewState())


def stroll(walk: WindowWalk, commands: dict[str, Callable[[WindowWalk], object]], n: int) -> list[str]:
    """Give so many commands, some frames apart; their names."""
    done = []
    for name in map(str, walk.random.choice(sorted(commands), n)):
        done.append(name)
        print(name, end=", ")
        commands[name](walk)
        walk.frames(int(walk.random.choice([0, 1, 3, 10])))
    return done


def hold_to_fresh_start(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int,
    commands: dict[str, Callable[[WindowWalk], object]], n: int,
) -> None:  # fmt: skip
    """After any of these commands: no fault, undo to the bit, and the picture of a fresh start."""
    random = np.random.default_rng(seed)
    here = WindowWalk(context, source, LateClient(random, ArrayCache(tmp_path / "cache")), random)
    editor = here.editor
    try:
        here.client.hurries = True
        here.until(lambda: editor.scene_is_open)
        editor.do(SetView.of(n_bounces=1))
        here.client.hurries = False
        first = editor.document
        stroll(here, commands, n)
        here.do(SetView.of(lighting="scene"))
        here.frames()
        here.settle()
        assert all(any(known in line for known in TOLD) for line in here.told), here.told
        last = editor.document
        while editor.undo_label is not None:
            here.do(RunOperator("undo"))
            here.frames(int(random.choice([0, 0, 1])))
        assert editor.document == first and written(editor.document) == written(first)
        while editor.redo_label is not None:
            here.do(RunOperator("redo"))
        assert editor.document == last and written(editor.document) == written(last)
        assert_as_fresh(context, here, tmp_path, bounces=1)
    finally:
        here.close()
    assert context.error == "GL_NO_ERROR"


@pytest.mark.parametrize("seed", [500, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(501, 540))])
def test_any_sequence_under_a_painted_sky(context: moderngl.Context, source: str, tmp_path: Path, seed: int) -> None:
    hold_to_fresh_start(context, source, tmp_path, seed, PAINTED, 20)


def test_every_command_takes_part() -> None:
    assert MAKERS.keys() == set(get_args(EditCommand))


def give(walk: WindowWalk, make: Callable[[AnyCommand], EditCommand]) -> None:
    """Give a command of one kind, where there is something that it edits."""
    try:
        command = make(AnyCommand(walk.editor.document, walk.random, walk.folder))
    except IndexError:
        return
    walk.do(command)


def match_material(walk: WindowWalk) -> None:
    """Begin to match the material of one object with that of another."""
    names = [each.name for each in walk.editor.document.objects if not each.is_lamp and each.editable]
    if names:
        object, source = map(str, walk.random.choice(names, 2))
        model = str(walk.random.choice(MODELS))
        walk.do(RunOperator("match_material", MatchMaterial(object=object, source=source, model=model)))


def find_material(walk: WindowWalk) -> None:
    """The match that is under way finds something."""
    match = walk.matcher.settings
    if match is not None:
        layer = make_layer(ALL_MODELS[match.model])
        change = TabulatedCurve((0.1, 0.9), ((0.5, 0.4, 0.3), (0.0, 0.0, 0.0)), kind="change")
        layer = layer.with_operators(layer.model.factors[0].name, (change,))
        walk.matcher.end(MaterialAnswer(layer, MaterialMatchErrors(0.5, 0.1, 0.1)))


EVERY: dict[str, Callable[[WindowWalk], object]] = {
    **{kind.__name__: lambda w, make=make: give(w, make) for kind, make in MAKERS.items()},
    "match a material": match_material,
    "find a material": find_material,
    "match and find a material": lambda w: (match_material(w), w.frames(), find_material(w)),
    "fail to match": lambda w: w.matcher.end(None, "it was not matched"),
    "stop matching": lambda w: w.do(StopMaterialMatch()),
    **{
        name: PAINTED[name]
        for name in (
            "undo", "undo again", "redo", "drag it", "tilt", "select θh", "select nothing", "select the last", "kill",
            "stop and go on", "compare", "compare no more", "one light", "light in place", "wait",
        )
    },
}  # fmt: skip


@pytest.mark.parametrize("seed", [600, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(601, 700))])
def test_any_sequence_of_all_commands(context: moderngl.Context, source: str, tmp_path: Path, seed: int) -> None:
    hold_to_fresh_start(context, source, tmp_path, seed, EVERY, 25)
