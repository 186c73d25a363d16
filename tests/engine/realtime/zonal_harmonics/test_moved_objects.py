"""Objects and lamps that were moved by hand: the scene is that of a file which has them there, in every mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.bending_points import PosedPoints, bending_points
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.realtime.zonal_harmonics.posed_scene import pose_scene, resting_box
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_uvs import corner_uvs
from engine.scene.tangents import object_tangents
from engine.scene.transform import Transform
from tests.scene_text import LAMBERT, camera, environment, facing_down, facing_up, placed, scaled

SIZE = (24, 18)
MOVED = Transform((0.4, -0.2, 1.5), (30.0, 50.0, -110.0), (0.5, 1.5, 2.0))
SPOT = "emission = [5, 4, 3]\ncone = { inner = 10, outer = 30 }\n"
TEXT = camera((0, 1, 6), 40, SIZE) + environment()


def text_of(matrix: np.ndarray) -> str:
    return ", ".join(f"{value!r}" for value in matrix.ravel().tolist())


def loaded(folder: Path, text: str) -> Scene:
    path = folder / "scene.toml"
    path.write_text(TEXT + text)
    return load_scene(path)


def two_scenes(folder: Path, transform: Transform) -> tuple[Scene, Scene]:
    """A ball, a box and a spot, moved by hand and in the file."""
    at = {"ball": scaled(1, (0.2, 0, 0)), "box": scaled((1, 2, 1), (3, 0, 0)), "spot": facing_down(0.2, (0, 2, 0))}
    shapes = {"ball": ("sphere", LAMBERT), "box": ("cube", f"smooth = false\n{LAMBERT}"), "spot": ("quad", SPOT)}
    resting = loaded(folder, "".join(placed(name, shapes[name][0], at[name], shapes[name][1]) for name in at))
    there = ""
    for i, name in enumerate(at):
        pivot = resting_box(resting, i).mean(axis=0) + resting.origin
        file = np.reshape(resting.description.objects[i].transform, (4, 4))
        there += placed(name, shapes[name][0], text_of(transform.matrix(pivot) @ file), shapes[name][1])
    poses = tuple((name, (transform,)) for name in at)
    return pose_scene(resting, poses), loaded(folder, there)


@pytest.mark.parametrize("transform", [MOVED, Transform((1.0, 2.0, -3.0)), Transform(scale=(3.0, 3.0, 3.0))])
def test_a_moved_scene_is_that_of_a_file_with_the_same_transform(tmp_path: Path, transform: Transform) -> None:
    moved, expected = two_scenes(tmp_path, transform)
    assert np.array_equal(moved.triangles, expected.triangles)
    for name in ("vertices", "normals", "boxes", "cones"):
        assert getattr(moved, name) == pytest.approx(getattr(expected, name), abs=2e-6), name
    # Of faces 1 cm wide whose corners are rounded to single precision.
    assert moved.geometric_normals == pytest.approx(expected.geometric_normals, abs=3e-4)
    assert moved.bounds == pytest.approx(expected.bounds, abs=2e-6)
    every = np.arange(len(moved.triangles))
    assert corner_uvs(moved, every) == pytest.approx(corner_uvs(expected, every), abs=2e-6)
    ids, normals = np.array([0, 0, 1]), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    assert object_tangents(moved, ids, normals) == pytest.approx(object_tangents(expected, ids, normals), abs=1e-6)
    for one, two in zip(moved.description.objects, expected.description.objects, strict=True):
        assert one.transform == pytest.approx(two.transform, abs=2e-6)


def test_a_transform_comes_after_deformers_and_about_the_pivot_at_rest(tmp_path: Path) -> None:
    scene = loaded(tmp_path, placed("ball", "sphere", scaled(1, (0.2, 1, 0)), LAMBERT))
    bend = Deformation("bend", 60.0)
    bent, both = (pose_scene(scene, (("ball", row),)) for row in ((bend,), (bend, MOVED)))
    matrix = MOVED.matrix((0.2, 1.0, 0.0))
    assert both.vertices == pytest.approx(bent.vertices @ matrix[:3, :3].T + matrix[:3, 3], abs=2e-6)
    agree = np.einsum("tk,tk->t", both.geometric_normals, both.normals[both.triangles[:, 0]])
    assert agree.min() > 0.3  # cofactors keep normals outwards under uneven scales


def test_tangents_of_files_turn_along(tmp_path: Path) -> None:
    scene = loaded(tmp_path, placed("ball", "sphere", more=LAMBERT))
    along = np.zeros((len(scene.triangles), 3, 4), np.float32)
    along[:-1] = (1.0, 0.0, 0.0, -1.0)  # the last has none
    own = Scene(**(vars(scene) | {"tangents": along}))
    turned = pose_scene(own, (("ball", (Transform(rotation=(0.0, 90.0, 0.0), scale=(2.0, 2.0, 2.0)),)),))
    assert turned.tangents is not None
    assert turned.tangents[:-1] == pytest.approx(np.broadcast_to([0.0, 0.0, -1.0, -1.0], along[:-1].shape), abs=1e-6)
    assert not turned.tangents[-1].any() and own.tangents is along and along[0, 0, 0] == 1.0


def test_deform_draws_an_object_where_the_scene_has_it(tmp_path: Path) -> None:
    scene = loaded(tmp_path, placed("ball", "sphere", scaled(1, (0.2, 0, 0)), LAMBERT) + placed("box", "cube"))
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 200)
    row = (Deformation("twist", 40.0), MOVED)
    places, frames = PosedPoints(scene, points).at((("ball", row),))
    moved = pose_scene(scene, (("ball", row),))
    drawn = places[points.points_of(0)]
    low, high = moved.bounds[0]
    assert drawn.min(axis=0) == pytest.approx(low, abs=0.02) and drawn.max(axis=0) == pytest.approx(high, abs=0.02)
    outwards = drawn - drawn.mean(axis=0)
    assert np.einsum("pk,pk->p", outwards, frames[points.points_of(0), 2]).min() > 0.0
    assert places[points.points_of(1)] == pytest.approx(points.rest_places[points.points_of(1)])


def lit(scene: Scene, poses: tuple[tuple[str, tuple[Transform]], ...], moved: tuple[str, ...]) -> np.ndarray:
    """Deform's picture of objects lit by lamps alone, at rest."""
    deform = Deform(scene, n_points=400, n_rays=64)
    deform.set_light(SkyState(None))
    deform.set_layers(dict.fromkeys(np.flatnonzero(scene.reflecting).tolist(), (make_layer(MODELS["lambert"], {}),)))
    deform.set_bending([name for name, _ in poses])
    deform.set_moved(moved, tuple((name, row) for name, row in poses if name == "lamp"))
    deform.set_bounces(1)
    return finish_deform(deform).draw(scene.description.camera, SIZE, poses, "rest")


def test_the_light_of_a_moved_lamp_comes_from_where_it_is(tmp_path: Path) -> None:
    """Deform's picture of a lamp moved by hand is that of a file which has it there; the old place is dark."""
    floor = placed("floor", "quad", facing_up(6), LAMBERT)

    def lamp(x: float) -> str:
        return placed("lamp", "quad", facing_down(0.5, (x, 2.0, 0)), "emission = [5, 4, 3]\n")

    by_hand = (("lamp", (Transform((2.4, 0.0, 0.0)),)),)
    found = lit(loaded(tmp_path, floor + lamp(-1.2)), by_hand, ("lamp",))
    expected = lit(loaded(tmp_path, floor + lamp(1.2)), (), ())
    before = lit(loaded(tmp_path, floor + lamp(-1.2)), (), ())
    scale = expected.mean()
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.02 * scale
    assert np.sqrt(((before - expected) ** 2).mean()) > 0.5 * scale


def test_a_moved_object_leaves_no_shadow_of_a_lamp_behind(tmp_path: Path) -> None:
    floor = placed("floor", "quad", facing_up(6), LAMBERT)
    lamp = placed("lamp", "quad", facing_down(0.5, (0, 3.0, 0)), "emission = [50, 40, 30]\n")
    board = placed("board", "quad", facing_up(1, (0, 0.6, 0)), LAMBERT)
    away = lit(loaded(tmp_path, floor + lamp + board), (("board", (Transform((0.0, 0.0, 40.0)),)),), ("board",))
    assert away == pytest.approx(lit(loaded(tmp_path, floor + lamp), (), ()), rel=0.05, abs=0.02)
