"""Before Orbit or Deform has anything ready, camera and poses move all the same: objects in light from the eye."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.poses import AddDeformer, SetDeformer
from app.document.view_state import SetView
from app.project.distant_light import sky_of
from app.worker.cache import ArrayCache
from app.worker.deform_worker import DeformWorker
from app.worker.orbit_worker import OrbitWorker
from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.headlight import headlight_picture
from engine.scene.camera_moves import orbit_camera
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import RESOLUTION, Walk, relative_error

pytestmark = pytest.mark.gl


def never_ready(self: object, request: object) -> Iterator[None]:
    while True:
        yield None


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(OrbitWorker, "_prepare", never_ready)
    monkeypatch.setattr(DeformWorker, "_prepare", never_ready)
    return write_small_scene(tmp_path)


def expected(walk: Walk, scene: Scene) -> np.ndarray:
    """The plain picture from where the view looks, in as many pixels as it rests in."""
    editor = walk.editor
    layers = {i: state.layers for i, state in enumerate(editor.document.objects) if not state.emits}
    caster = RayCaster(scene.vertices, scene.triangles)
    sky = sky_of(scene, editor.document.light)
    return run_to_end(
        headlight_picture(scene.from_camera(editor.camera_history.camera), caster, layers, sky, RESOLUTION)
    )


@pytest.mark.parametrize("mode", ["orbit", "deform"])
def test_the_camera_moves_before_anything_is_ready(
    context: moderngl.Context, source: Path, tmp_path: Path, mode: str
) -> None:
    here = Walk(context, str(source), LateClient(np.random.default_rng(5), ArrayCache(tmp_path / "cache")), mode=mode)
    editor = here.editor
    try:
        here.until(lambda: editor.scene_is_open)
        here.frames(3)
        seen = []
        for _ in range(12):
            editor.do(SetView.of(camera=orbit_camera(editor.camera_history.camera, 10.0, 0.0)))
            here.frames(8)
            if editor.status.is_away:  # as long as the worker has not traced what is seen from there
                assert editor.status.picture == "waiting" and editor.status.follows_input  # no boxes are drawn
            seen.append(here.feed.source.canvas.linear_image())
        assert len({picture.tobytes() for picture in seen}) >= 10  # it follows
        here.frames(300)
        shown = here.feed.source.canvas.linear_image()
        assert relative_error(shown, expected(here, load_scene(source, RESOLUTION))) < 1e-3
        assert here.feed.picture is here.feed.source.picture and not here.told
    finally:
        here.close()


def test_poses_move_before_anything_is_ready(context: moderngl.Context, source: Path, tmp_path: Path) -> None:
    here = Walk(
        context, str(source), LateClient(np.random.default_rng(6), ArrayCache(tmp_path / "cache")), mode="deform"
    )
    editor = here.editor
    try:
        here.until(lambda: editor.scene_is_open)
        here.frames(3)
        editor.begin_drag()
        assert editor.do(AddDeformer("ball", "bend", 5.0)) is None
        for amount in (10.0, 20.0, 40.0):
            assert editor.do(SetDeformer("ball", 0, amount)) is None
            here.frames(40)
        assert editor.status.follows_input
        here.frames(300)
        shown = here.feed.source.canvas.linear_image()
        scene = load_scene(source, RESOLUTION)
        bent, straight = expected(here, pose_scene(scene, editor.document.poses)), expected(here, scene)
        assert relative_error(shown, bent) < 1e-3 < relative_error(straight, bent)
    finally:
        here.close()
