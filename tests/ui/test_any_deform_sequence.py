"""Whatever a hand does in Deform, at whatever stage: no fault, and in the end the picture of what there is.

As in `test_any_orbit_sequence` the worker is the real one with a stand-in for Deform's engine, whose pictures name all
that they are drawn of.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import (
    AddDeformer,
    AddObject,
    DeleteObject,
    MoveDeformer,
    MoveObject,
    RemoveDeformer,
    SetDeformer,
    SetPose,
    SetShadowCatcher,
    SetSurface,
    SetTime,
    SetTransform,
)
from app.document.commands.lamps import SetCone
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetRotation
from app.document.commands.mix import SetMix
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.light_mix import emission_of, exclusions_of
from app.document.scene_state import SceneState, moved_objects
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.modes.deform.deform_controller import DeformController
from app.modes.orbit.desired_state import DesiredOrbit
from app.project.distant_light import sky_of
from app.worker.cache import ArrayCache
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.realtime.zonal_harmonics.gloss_transfer import LayerGloss
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import Camera, CameraDescription
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_kinds import SurfacesByObject
from tests.engine.realtime.zonal_harmonics.test_posed_scene import write_bar
from tests.scene_text import facing_down, placed
from tests.ui.late_client import LateClient
from tests.ui.test_any_orbit_sequence import (
    CAMERAS,
    N_STEPS,
    NamedOrbit,
    OrbitWalk,
    assert_called_alike,
    colour_of,
    expected_shadow,
    plan_lines,
    said_of_layers,
    with_parts,
)
from tests.ui.test_any_sequence import MAY_BE_TOLD, RESOLUTION


class NamedDeform(NamedOrbit):
    """As `engine.realtime.zonal_harmonics.deform_engine.Deform`, drawn as `NamedOrbit` is."""

    lost_shares: Mapping[int, float] = {}  # noqa: RUF012 - it has none
    gloss: Mapping[tuple[int, Layer], LayerGloss] = {}  # noqa: RUF012

    def __init__(
        self, scene: Scene, n_points: int = 1, n_rays: int = 1, store: object = None, caster: object = None
    ) -> None:
        super().__init__(scene)
        self._posed: tuple[str, ...] = ()
        self._surfaces: SurfacesByObject = ()
        self._moved: tuple[tuple[str, ...], Poses] = (), ()
        self._emission: list[float] = []

    def set_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        before = self._emission
        super().set_emission(emission)
        self._emission = self.scene.emission.tolist()
        self._left = N_STEPS if self._emission != before else self._left

    def set_moved(self, moved: Sequence[str], lamps: Poses) -> None:
        if (tuple(moved), lamps) != self._moved:
            self._moved = tuple(moved), lamps
            self._begin()

    def set_surfaces(self, surfaces: SurfacesByObject) -> None:
        if surfaces != self._surfaces:
            self._surfaces = surfaces
            self._begin()

    def set_effort(self, n_rays: int, n_lobes: int, n_gloss_rows: int | None = None) -> None:
        if (n_rays, n_lobes, n_gloss_rows) != self._effort:
            self._effort = n_rays, n_lobes, n_gloss_rows
            self._begin()

    def set_bending(self, names: Sequence[str]) -> None:
        if tuple(names) != self._posed:
            self._posed = tuple(names)
            self._begin()

    def carried(self, poses: Poses) -> dict[str, tuple[float, float, float]]:
        return {}

    def draw_errors(self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = ()) -> np.ndarray:
        return self.draw(camera, resolution, poses)

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (), quality: str = "moving",
        turned: bool = True, transparent: bool = False, apart: Collection[int] = (),
    ) -> np.ndarray:  # fmt: skip
        assert self.is_ready and self._light is not None
        seen = Camera(**{name: getattr(camera, name) for name in Camera.model_fields})
        names, emitters = self.scene.object_names, np.flatnonzero(self.scene.emitters)
        emission = sorted((names[i], self.scene.emission[i].tolist()) for i in emitters)
        dark = sorted({(names[i], names[k]) for link in self._light.links for i in link.dark for k in link.objects})
        of = self._layers, self._posed, self._surfaces, self._moved, emission, dark
        wanted = self._light.rotation, *of, poses, self._effort, self._bounces
        colour = colour_of(seen, *wanted) * self.is_done
        colour = with_parts(colour, transparent, apart)
        return np.broadcast_to(colour, (*resolution[::-1], len(colour))).astype(np.float32)


def test_the_stand_in_is_called_as_the_engine_is() -> None:
    assert_called_alike(NamedDeform, Deform)


def expected_colour(editor: Editor) -> np.ndarray:
    document = editor.document
    desired = DesiredOrbit.of(document, effective_view(editor.view, document))
    moves = moved_objects(document)
    posed = tuple(s.name for s in document.shown if s.deformations or s.moment is not None or s.name in moves[0])
    colour = named_colour(editor, document, desired.scene, posed, moves, document.poses)
    if desired.catchers is None:
        return colour
    alone = desired.catchers.with_posed_lamps()
    lamps = alone.lamps_of(moves[1])
    rest = named_colour(editor, alone.document, alone.scene, (), ((), lamps), lamps)
    return expected_shadow(editor, colour, rest, sky_of(load_scene(document.source), alone.scene.light))


def named_colour(
    editor: Editor, document: Document, scene: SceneState, posed: tuple[str, ...], moves: object, poses: Poses
) -> np.ndarray:
    """That of `NamedDeform` of a document, at rest or in poses."""
    settings = effective_view(editor.view, editor.document).settings
    effort = settings.n_rays, settings.n_lobes, settings.n_gloss_rows
    names = [state.name for state in document.objects]
    own = [said_of_layers([each.layer for each in scene.layers if each.object == name]) for name in names]
    shining = [(name, np.float32(radiance).tolist()) for name, radiance in emission_of(document)]
    lamps = {state.name for state in document.objects if state.emits}
    dark = [(name, each) for name, excluded in exclusions_of(document).items() if name in lamps for each in excluded]
    set_up = own, posed, document.new_surfaces, moves, sorted(shining), sorted(dark)
    wanted = document.light.rotation, *set_up, poses, effort, settings.n_bounces
    return colour_of(editor.camera_history.camera, *wanted)


def first(editor: Editor, name: str, command: Callable[[int], object]) -> None:
    """Do something to the first deformer of an object, where it has one."""
    if editor.document.object(name).deformations:
        editor.do(command(0))  # type: ignore[arg-type]


def drag_the_lamp(walk: OrbitWalk) -> None:
    """As a hand does, a frame after each step."""
    walk.editor.begin_drag()
    for _ in range(3):
        if any(state.name == "lamp" for state in walk.editor.document.objects):
            walk.editor.do(MoveObject("lamp", (0.1, 0.0, 0.05), (0.0, 0.0, 10.0)))
        walk.frames(1)
    walk.editor.end_drag()


COMMANDS: dict[str, Callable[[OrbitWalk], object]] = {
    "drag the lamp": drag_the_lamp,
    "move the lamp": lambda w: w.editor.do(MoveObject("lamp", (w.now % 0.5, 0.0, 0.1), (0.0, 20.0, 0.0))),
    "put the lamp back": lambda w: w.editor.do(SetTransform("lamp")),
    "widen the lamp": lambda w: w.editor.do(SetTransform("lamp", scale=(2.0, 2.0, 2.0))),
    "dim the lamp": lambda w: w.editor.do(SetMix("lamp", "strength", -1.0)),
    "colour the lamp": lambda w: w.editor.do(SetMix("lamp", "colour", (1.0, 0.5, w.now % 1.0))),
    "the lamp off": lambda w: w.editor.do(SetMix("lamp", "on", False)),
    "the lamp on": lambda w: w.editor.do(SetMix("lamp", "on", True)),
    "the lamp alone": lambda w: w.editor.do(SetMix("lamp", "solo", True)),
    "the sky alone": lambda w: w.editor.do(SetMix("light.environment", "solo", True)),
    "the lamp in a group": lambda w: w.editor.do(SetMix("lamp", "group", "Key")),
    "dim the group": lambda w: w.editor.do(SetMix("light.groups.Key", "strength", -2.0)),
    "the lamp not on the dice": lambda w: w.editor.do(SetMix("lamp", "excludes", ("dice",))),
    "the lamp on all": lambda w: w.editor.do(SetMix("lamp", "excludes", ())),
    "hide the lamp": lambda w: w.editor.do(SetVisible("lamp", False)),
    "show the lamp": lambda w: w.editor.do(SetVisible("lamp", True)),
    "delete the lamp": lambda w: w.editor.do(DeleteObject("lamp")),
    "add a spot": lambda w: w.editor.do(AddObject("spot light", "key")),
    "open the spot": lambda w: w.editor.do(SetCone("key", outer=80.0)),
    "move the spot": lambda w: w.editor.do(MoveObject("key", (0.1, 0.2, 0.0))),
    "bend the bar": lambda w: w.editor.do(AddDeformer("bar", "bend", 30.0)),
    "twist the dice": lambda w: w.editor.do(AddDeformer("dice", "twist", -90.0, "x")),
    "a bend of nothing": lambda w: w.editor.do(AddDeformer("dice", "bend")),
    "more": lambda w: first(w.editor, "bar", lambda i: SetDeformer("bar", i, amount=w.now * 10.0 % 1.0)),
    "too much": lambda w: first(w.editor, "bar", lambda i: SetDeformer("bar", i, amount=1e9)),
    "another axis": lambda w: first(w.editor, "dice", lambda i: SetDeformer("dice", i, axis="z")),
    "later": lambda w: first(w.editor, "bar", lambda i: MoveDeformer("bar", i, i + 1)),
    "take one away": lambda w: first(w.editor, "bar", lambda i: RemoveDeformer("bar", i)),
    "back to rest": lambda w: w.editor.do(SetPose("dice")),
    "move the bar": lambda w: w.editor.do(MoveObject("bar", (w.now % 0.5, 0.0, 0.1), (0.0, 20.0, 0.0))),
    "scale the dice": lambda w: w.editor.do(SetTransform("dice", scale=(2.0, 1.0, 1.0))),
    "put the bar back": lambda w: w.editor.do(SetTransform("bar")),
    "a time": lambda w: w.editor.do(SetTime(0.4)),
    "a time beyond the end": lambda w: w.editor.do(SetTime(7.3)),
    "the file's pose": lambda w: w.editor.do(SetTime(None)),
    "play": lambda w: w.editor.player.play(),
    "pause": lambda w: w.editor.player.pause(),
    "no loop": lambda w: w.editor.do(SetView.of(loops=False)),
    "loop": lambda w: w.editor.do(SetView.of(loops=True)),
    "a surface": lambda w: w.editor.do(SetSurface("dice", "membrane", (("translucency", w.now % 1.0),))),
    "a thick membrane": lambda w: w.editor.do(SetSurface("dice", "membrane", (("thickness", w.now % 1e-3),))),
    "another surface": lambda w: w.editor.do(SetSurface("dice", "subsurface")),
    "a slab": lambda w: w.editor.do(SetSurface("dice", "patch", (("thickness", w.now % 1.0),))),
    "a plain surface": lambda w: w.editor.do(SetSurface("dice", "")),
    "the error": lambda w: w.editor.do(SetView.of(fit_error=True)),
    "no error": lambda w: w.editor.do(SetView.of(fit_error=False)),
    "catch": lambda w: w.editor.do(SetShadowCatcher("dice", True)),
    "catch no more": lambda w: w.editor.do(SetShadowCatcher("dice", False)),
    "undo": lambda w: w.editor.undo(),
    "undo again": lambda w: w.editor.undo(),
    "redo": lambda w: w.editor.redo(),
    "take hold": lambda w: w.editor.begin_drag(),
    "let go": lambda w: w.editor.end_drag(),
    "give up": lambda w: w.editor.cancel_drag(),
    "select the bar": lambda w: w.editor.select("bar"),
    "select the dice": lambda w: w.editor.select("dice"),
    "select nothing": lambda w: w.editor.select(None),
    "Placement": lambda w: w.editor.do(SetView.of(mode="placement")),
    "Deform": lambda w: w.editor.do(SetView.of(mode="deform")),
    "back to Deform": lambda w: w.editor.do(SetView.of(mode="deform")),
    "paint it": lambda w: w.editor.do(SetParameter("dice.0", "albedo", (0.1, 0.2, w.now % 1.0))),
    "turn the light": lambda w: w.editor.do(SetRotation(w.editor.document.light.rotation + 20.0)),
    "a camera": lambda w: w.editor.do(SetView.of(camera=CAMERAS[0])),
    "the scene's camera": lambda w: w.editor.do(SetView.of(camera=None)),
    "stop and go on": lambda w: (w.editor.cancel_work(), w.editor.resume_work()),
    "kill": lambda w: w.client.kill(),
    "bounces as planned": lambda w: w.editor.do(SetView.of(n_bounces=0)),
    "light once": lambda w: w.editor.do(SetView.of(n_bounces=1)),
    **plan_lines(transfer_rays=(64, 2000), lobes=(0, 1, 3), gloss_rows=(0, 9)),
}


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(s, marks=pytest.mark.sweep) for s in range(3, 100))])
def test_the_last_picture_is_of_the_last_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    monkeypatch.setattr("engine.realtime.zonal_harmonics.deform_engine.Deform", NamedDeform)
    random = np.random.default_rng(seed)
    with (scene := write_bar(tmp_path)).open("a") as file:
        file.write(placed("lamp", "quad", facing_down(0.2, (0.1, 1.5, 0.1)), "emission = [9, 8, 7]\n"))
    walk = OrbitWalk(str(scene), LateClient(random, ArrayCache(tmp_path / "cache")), None, mode="deform")
    done = []
    try:
        walk.open()
        for name in map(str, random.choice(sorted(COMMANDS), 25)):
            done.append(name)
            COMMANDS[name](walk)
            walk.frames(int(random.choice([0, 1, 3, 10, 30])))
        walk.editor.player.pause()
        walk.begin_again()
        walk.editor.do(SetSurface("dice", ""))
        walk.editor.do(SetView.of(fit_error=False))
        walk.editor.do(SetView.of(mode="deform"))
        walk.until(
            lambda: isinstance(walk.editor.controller, DeformController) and walk.editor.status.picture == "refining"
        )
        told = [
            line for line in walk.told if not any(known in line for known in (*MAY_BE_TOLD, "expected -720 to 720"))
        ]
        assert not told, done
        assert walk.picture.shape == (*RESOLUTION[::-1], 3)
        np.testing.assert_array_equal(walk.picture[0, 0], expected_colour(walk.editor), err_msg=str(done))
        document, n_steps = walk.editor.document, len(walk.editor.history.undo_steps)
        assert all(walk.editor.undo() for _ in range(n_steps)) and all(walk.editor.redo() for _ in range(n_steps))
        assert walk.editor.document == document
    finally:
        walk.close()
