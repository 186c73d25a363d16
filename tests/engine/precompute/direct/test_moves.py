"""What a moved object changes of direct light, against closed forms: a small lamp over a plane, and a ball between."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.moves import changed_light, changed_rows, kept_detail, same_points, scene_move
from engine.precompute.direct.pipeline import Placement
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.scene_loader import load_scene
from engine.scene.transform import Transform
from tests.scene_text import LAMBERT, camera, facing_down, facing_up, placed, scaled

RADIUS, BALL, LAMP = 0.2, np.array([0.0, 0.6, 0.0]), np.array([0.0, 1.6, 0.0])
MOVED = (0.5, 0.1, 0.2)


def placements(folder: Path) -> tuple[Placement, Placement]:
    """The scene before, and with the ball elsewhere."""
    file = folder / "scene.toml"
    ball = placed("ball", "sphere", scaled(2 * RADIUS, BALL.tolist()), LAMBERT)
    lamp = placed("lamp", "quad", facing_down(0.01, LAMP.tolist()), "emission = [500, 500, 500]\n")
    floor = placed("floor", "quad", facing_up(3), LAMBERT)
    file.write_text(camera((0.3, 2.5, 2.5), 45, (64, 48)) + floor + ball + lamp)
    scene = load_scene(file)
    return Placement(scene), Placement(pose_scene(scene, (("ball", (Transform(MOVED),)),)))


def distance_of_ray(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """How far the segments from points (P, 3) to the lamp pass from a centre."""
    along = LAMP - points
    at = np.clip(np.einsum("pi,pi->p", centre - points, along) / np.einsum("pi,pi->p", along, along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points + at[:, None] * along - centre, axis=1))


def test_shadows_leave_and_arrive_where_a_sphere_throws_them(tmp_path: Path) -> None:
    before, after = placements(tmp_path)
    move = scene_move(before.scene, after.scene)
    assert move is not None and move.moved.tolist() == [False, True, False]
    same = same_points(before.hits, after.hits)
    floor = np.flatnonzero((after.hits.objects == 0) & (same >= 0)).astype(np.int32)
    points = after.at_rows(floor)
    lighting = prepare_lighting(None, points.emitters(1), 1.0, True)
    *_, found = changed_light(points, before.caster, lighting, move.boxes)
    assert found is not None
    here = points.hits.position.astype(np.float64) + after.scene.origin
    was, now = (distance_of_ray(here, BALL + shift) for shift in (np.zeros(3), np.array(MOVED)))
    # The lamp is a square of 1 cm, so that penumbras are narrower than 2 cm.
    clear = (np.abs(was - RADIUS) > 0.02) & (np.abs(now - RADIUS) > 0.02)
    for light, expected in zip(found, ((was < RADIUS) & (now > RADIUS), (was > RADIUS) & (now < RADIUS)), strict=True):
        rows = np.zeros(len(floor), bool)
        rows[changed_rows(light)] = True
        assert np.array_equal(rows[clear], expected[clear]) and expected[clear].sum() > 20


def test_points_that_show_the_same_place_are_found(tmp_path: Path) -> None:
    before, after = placements(tmp_path)
    same = same_points(before.hits, after.hits)
    known = same >= 0
    assert np.array_equal(before.hits.position[same[known]], after.hits.position[known])
    assert np.array_equal(before.hits.pixel[same[known]], after.hits.pixel[known])
    # A pixel whose centre shows the floor in both pictures shows the same place of it.
    floor = (before.hits.object_image == 0) & (after.hits.object_image == 0)
    rows = after.hits.row_image[floor]
    assert known[rows].all() and not known[after.hits.objects == 1].any()
    assert np.array_equal(same_points(before.hits, before.hits), np.arange(len(before.hits.pixel)))


@pytest.mark.parametrize("changed", ["another object", "nothing"])
def test_scenes_that_differ_in_more_are_no_move(tmp_path: Path, changed: str) -> None:
    before, after = placements(tmp_path)
    (tmp_path / "other.toml").write_text((tmp_path / "scene.toml").read_text().replace('"ball"', '"bowl"'))
    if changed == "another object":
        assert scene_move(before.scene, load_scene(tmp_path / "other.toml")) is None
    else:
        found = scene_move(after.scene, after.scene)
        assert found is not None and not found.moved.any() and found.boxes.shape == (0, 2, 3)


def test_detail_stays_by_the_share_of_other_light() -> None:
    """All of it where nothing changes; three quarters and none where a quarter, all or more than all of the light does;
    in the dark all where nothing changes, none where light comes."""
    light, changed = [2.0, 2.0, 2.0, 2.0, 0.0, 0.0], [0.0, 0.5, 2.0, 3.0, 0.0, 1e-44]
    kept = kept_detail(np.array([light], np.float32), np.array([changed], np.float32))
    assert kept.tolist() == [[1.0, 0.75, 0.0, 0.0, 1.0, 0.0]]
