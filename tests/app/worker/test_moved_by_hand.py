"""Objects and lamps that are moved by hand, in Placement: the picture is that of a file which has them there, and
nothing cached is stale."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import SetCamera
from app.project.project import open_project
from app.stills.stills import render_project
from app.worker.tasks import WorkerContext
from engine.core.generators import run_to_end
from engine.scene.transform import Transform
from tests.scene_text import LAMBERT, camera, environment, facing_down, facing_up, placed, scaled

SIZE = (24, 18)
BY_HAND = (("lamp", (Transform((1.0, 0.0, 0.0)),)),)


def text(x: float) -> str:
    lamp = placed("lamp", "quad", facing_down(0.4, (x, 1.2, 0)), "emission = [9, 8, 7]\n")
    floor = placed("floor", "quad", facing_up(4), LAMBERT)
    return camera((0, 2.0, 4.0), 40, SIZE) + environment((0.1, 0.1, 0.1)) + floor + lamp


def box_text(size: tuple[float, float, float], at: tuple[float, float, float]) -> str:
    box = placed("box", "cube", scaled(size, at), f"smooth = false\n{LAMBERT}")
    floor = placed("floor", "quad", facing_up(4), LAMBERT)
    lamp = placed("lamp", "quad", facing_down(0.5, (0.5, 2.0, 0)), "emission = [9, 8, 7]\n")
    return camera((0, 2.0, 4.0), 40, SIZE) + environment((0.1, 0.2, 0.3)) + floor + box + lamp


def test_a_moved_box_has_the_picture_of_a_file_with_it_there_to_the_bit(tmp_path: Path) -> None:
    """All numbers are sums of powers of two, which single precision has exactly."""
    here, there = tmp_path / "here.toml", tmp_path / "there.toml"
    here.write_text(box_text((0.5, 0.5, 0.5), (-0.5, 0.25, 0.0)))
    there.write_text(box_text((1.0, 0.5, 0.25), (0.25, 0.75, -0.5)))
    values = ("box.position", [0.75, 0.5, -0.5]), ("box.scale", [2.0, 1.0, 0.5])
    projects = open_project(str(here), values=values), open_project(str(there)), open_project(str(here))
    found, expected, before = (render_project(each, lambda step: None).picture for each in projects)
    assert np.array_equal(found, expected) and not np.array_equal(before, expected)


def test_the_picture_is_that_of_a_file_with_the_lamp_there(tmp_path: Path) -> None:
    here, there = tmp_path / "here.toml", tmp_path / "there.toml"
    here.write_text(text(-0.5))
    there.write_text(text(0.5))
    moved = open_project(str(here), values=(("lamp.position", [1.0, 0.0, 0.0]),))
    projects = moved, open_project(str(there)), open_project(str(here))
    found, expected, before = (render_project(each, lambda step: None).picture for each in projects)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-5)
    assert np.abs(before - expected).max() > 0.1 * expected.max()


def test_keys_of_the_cache_follow_a_moved_lamp(tmp_path: Path) -> None:
    path = tmp_path / "lamp.toml"
    path.write_text(text(-0.5))
    context, keys = WorkerContext(), []
    context.load(open_project(str(path)).scene, 1)
    for poses in ((), BY_HAND, (), BY_HAND):
        run_to_end(context.set_camera(SetCamera(1, poses=poses)))
        keys.append((context.geometry_key, context.view_key))
    assert keys[0] == keys[2] != keys[1] == keys[3]
