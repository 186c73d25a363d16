"""From one picture to the next, frame by frame: never a mixture of two documents, never coarser than it was.

The worker is that of the random walks, on a small scene; its answers come in bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetMaterial, SetParameter
from app.document.commands.light import SetEmission, SetEnvironment, SetRotation
from app.document.document import Selection
from app.document.view_state import SetView
from app.worker.cache import ArrayCache
from engine.scene.description import Camera
from tests.ui.late_client import LateClient
from tests.ui.small_scene import SCENE, write_small_scene
from tests.ui.test_any_sequence import LIBRARY, LIFT, Walk, relative_error
from ui.modes.placement.gl.transport import TransportUpload
from ui.panels.status_bar import picture_state

pytestmark = pytest.mark.gl

# By bounces. Of a picture in its last stage but one, whose sky is cut into 400 lights, and whose light that has been
# reflected before is rough: under other light it may come first.
PREVIEW = {1: 0.02, 2: 0.04}
# Half floats; and light that has been reflected before is found anew under other materials: the same but for chance.
SAME = {1: 2e-3, 2: 5e-3}
Act = Callable[[Walk], object]


def material(name: str) -> SetMaterial:
    return SetMaterial("ball", LIBRARY.entry(name).material.layers)


def several_undone(walk: Walk) -> None:
    for _ in range(3):
        walk.editor.undo()
        walk.frames(1)


CAMERA = Camera(position=(0.4, 1.2, 2.6), target=(0.0, 0.45, 0.0), fov_y=42.0)
# What is done in one go, and how far off the old and the new picture a frame in between may be at most.
CHANGES: dict[str, tuple[Act, dict[int, float]]] = {
    "a material of the library": (lambda w: w.editor.do(material("Copper")), SAME),
    "another of them, which has more layers": (lambda w: w.editor.do(material("Car paint, blue")), SAME),
    "undo": (lambda w: w.editor.undo(), SAME),
    "a curve that is not selected": (lambda w: w.editor.do(AddOperator("ground.0", "theta_i", LIFT)), SAME),
    "another sky": (lambda w: w.editor.do(SetEnvironment("hall")), PREVIEW),
    "a turned sky": (lambda w: w.editor.do(SetRotation(60.0)), PREVIEW),
    "a lamp of another colour": (lambda w: w.editor.do(SetEmission("lamp", (1.0, 4.0, 9.0))), PREVIEW),
}  # fmt: skip


@pytest.fixture
def walk(context: moderngl.Context, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Walk]:
    """The small scene, its last picture there; the parameter is how often light bounces."""
    bounces = getattr(request, "param", 1)
    text = SCENE.replace("bounces = 1", f"bounces = {bounces}")
    client = LateClient(np.random.default_rng(3), ArrayCache(tmp_path / "cache"))
    made = Walk(context, str(write_small_scene(tmp_path, text)), client, n_bounces=bounces)
    made.client.hurries = True
    made.until(lambda: made.editor.scene_is_open)
    made.editor.do(SetView.of(n_bounces=bounces))
    made.settle()
    yield made
    made.close()
    assert context.error == "GL_NO_ERROR"


def pictures(walk: Walk) -> list[np.ndarray]:
    """Those of all frames until the picture rests."""
    shown, renderer = [], walk.feed.source.renderer
    for _ in range(4000):
        walk.frames(1)
        if not shown or renderer.linear_image_with_alpha().tobytes() != shown[-1].tobytes():
            shown.append(renderer.linear_image_with_alpha())
        if walk.editor.status.is_finished and not walk.feed.is_behind:
            return shown
    raise AssertionError(walk.editor.status)


def farthest(before: np.ndarray, shown: list[np.ndarray]) -> float:
    """How far a frame was from both the picture before and the last one."""
    return max(min(relative_error(each, before), relative_error(each, shown[-1])) for each in shown)


@pytest.mark.parametrize("walk", [1, 2], indirect=True)
def test_a_frame_shows_one_document_as_well_as_it_was_shown(walk: Walk) -> None:
    found = {}
    for name, (act, allowed) in CHANGES.items():
        before = walk.feed.source.renderer.linear_image_with_alpha()
        act(walk)
        shown = pictures(walk)
        most = allowed[walk.editor.view.settings.n_bounces]
        assert relative_error(before, shown[-1]) > 5 * most, name  # there is something to be seen
        found[name] = farthest(before, shown)
        assert found[name] < most, found


def test_quick_undo_of_all_goes_from_picture_to_picture(walk: Walk) -> None:
    finals = [walk.feed.source.renderer.linear_image_with_alpha()]
    for act in (material("Copper"), AddOperator("ground.0", "theta_i", LIFT), SetParameter("ball.0", "alpha", 0.35)):
        assert walk.editor.do(act) is None
        finals.append(walk.settle())
    several_undone(walk)
    shown = pictures(walk)
    assert relative_error(shown[-1], finals[0]) < SAME[1]
    for each in shown:
        assert min(relative_error(each, final) for final in finals) < 0.01


def test_a_finer_stage_never_goes_back_to_the_curve_of_its_request(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage's radiance has the curves of its request; an edit since is added when its transport is uploaded."""
    editor, renderer = walk.editor, walk.feed.source.renderer
    editor.do(SetView.of(selected=Selection("ball", 1, "theta_h"), camera=CAMERA))
    before = walk.settle()
    editor.do(AddOperator("ball.1", "theta_h", replace(LIFT, magnitude=4.0)))
    change = walk.settle() - before
    editor.undo()
    walk.settle()
    n_slices = [0]
    advance = TransportUpload.advance

    def slowly(upload: TransportUpload, seconds: float) -> bool:
        n_slices[0] += 1
        return n_slices[0] % 6 == 0 and advance(upload, 1.0)

    monkeypatch.setattr(TransportUpload, "advance", slowly)
    editor.do(SetView.of(camera=CAMERA.model_copy(update={"fov_y": 42.01})))
    walk.until(lambda: editor.status.stage == "preview" and renderer.transport_curve("ball.1") == "theta_h")
    editor.do(AddOperator("ball.1", "theta_h", replace(LIFT, magnitude=4.0)))
    walk.frames(5)
    shown = [float(np.vdot(image - before, change) / np.vdot(change, change)) for image in pictures(walk)]
    assert shown[-1] == pytest.approx(1.0, abs=0.01)
    assert len(shown) > 3 and min(shown) > 0.4, shown  # few samples lack half of the highlight


def test_a_picture_of_before_the_edit_is_called_that(walk: Walk) -> None:
    status = walk.editor.status
    assert status.is_finished and not status.is_held
    walk.editor.do(material("Copper"))
    before, words = walk.feed.source.renderer.linear_image_with_alpha(), set()
    for _ in range(4000):
        walk.frames(1)
        same = walk.feed.source.renderer.linear_image_with_alpha().tobytes() == before.tobytes()
        if same and not walk.editor.status.is_finished:
            words.add(picture_state(walk.editor.status)[1])
        if walk.editor.status.is_finished:
            break
    assert words == {"before the edit"} and not walk.editor.status.is_held


def test_the_sky_behind_turns_with_the_light_on_the_objects(walk: Walk) -> None:
    # Half-way through a preview: what is there of the light in the hand is quick, but of one piece.
    editor, renderer = walk.editor, walk.feed.source.renderer
    frame = renderer.frame
    lit = frame.emission_image.sum(axis=-1) > 0.0
    sky, ground = (frame.open_image == 1.0) & ~lit, (frame.open_image == 0.0) & ~lit
    assert sky.any() and ground.any()
    editor.do(SetParameter("ball.1", "alpha", 0.15))
    walk.frames(12)
    editor.begin_drag()
    pairs = []
    for degrees in np.linspace(0.0, 200.0, 200):
        editor.do(SetRotation(float(degrees)))
        walk.frames(1)
        shown = renderer.linear_image_with_alpha()
        pairs.append((shown[sky].tobytes(), shown[ground].tobytes()))
    turned = [i for i in range(1, len(pairs)) if pairs[i][0] != pairs[i - 1][0]]
    assert len(turned) >= 5  # it follows the hand
    assert all(pairs[i][1] != pairs[i - 1][1] for i in turned)  # and not without the light on the ground


def test_the_first_picture_has_all_its_layers(context: moderngl.Context, tmp_path: Path) -> None:
    client = LateClient(np.random.default_rng(4), ArrayCache(tmp_path / "cache"))
    here = Walk(context, str(write_small_scene(tmp_path)), client, n_bounces=1)
    try:
        here.until(lambda: here.editor.scene_is_open)
        keys = {"ground", "ball"}
        while here.editor.status.picture == "waiting":
            here.frames(1)
            there = set(here.feed.source.renderer.layer_keys)
            assert there in ({"ground", "ball"}, {"ground.0", "ball.0", "ball.1"}) or there < keys
    finally:
        here.close()


def test_a_hand_sees_a_new_material_before_its_last_stage(walk: Walk) -> None:
    # At rest nothing coarse takes the place of a picture; in the hand what can be moved counts for more.
    walk.client.hurries = False
    before = walk.feed.source.renderer.linear_image_with_alpha()
    walk.editor.do(material("Copper"))
    while not walk.editor.controller._changeover.waits:  # its coarse picture has come
        walk.frames(1)
    np.testing.assert_array_equal(walk.feed.source.renderer.linear_image_with_alpha(), before)
    walk.editor.begin_drag()
    walk.editor.do(SetParameter("ball.0", "alpha", 0.3))
    walk.frames(2)
    assert not walk.editor.controller.picture.is_held
    assert relative_error(walk.feed.source.renderer.linear_image_with_alpha(), before) > 0.02
    walk.editor.end_drag()
