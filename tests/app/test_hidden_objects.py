"""Hidden objects: every picture is that of a scene whose file does not have them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import insitu
from app.export.mitsuba import export_steps
from app.interface.scene import Mode
from engine.core.generators import run_to_end
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, facing_up, material, placed, scaled

CLAY = 'model = "lambert", name = "clay", albedo = [0.6, 0.5, 0.4]'
OBJECTS = {
    "ground": placed("ground", "quad", facing_up(5), material(CLAY)),
    "ball": placed("ball", "sphere", scaled(0.9, (0, 0.5, 0)), material(CLAY)),
    "lamp": placed("lamp", "cube", scaled(0.3, (-1, 1.5, 1)), "emission = [9.0, 7.0, 5.0]\n"),
    "cube": placed("cube", "cube", scaled(0.4, (0.6, 0.2, 0.6)), material(CLAY)),
}


@pytest.fixture
def few_points(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    use_few_points(monkeypatch, 60, 60)
    yield


def write(folder: Path, names: list[str]) -> Path:
    file = folder / f"{'-'.join(names) or 'none'}.toml"
    view = camera((0.4, 1.2, 2.6), 42, (24, 16), (0, 0.45, 0), 'bounces = 1\nname = "hidden"\n')
    file.write_text(view + environment(radiance=(0.5, 0.6, 0.8)) + "".join(OBJECTS[name] for name in names))
    return file


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform", "paths"])
@pytest.mark.parametrize("hidden", ["lamp", "cube"])
def test_a_picture_is_that_of_a_scene_without_them(tmp_path: Path, few_points: None, mode: Mode, hidden: str) -> None:
    # The cube is the last one: others keep their numbers, on which random numbers depend, and so does the lamp's light.
    scene = insitu.open(str(write(tmp_path, list(OBJECTS))))
    scene[hidden].visible = False
    # What is edited of a hidden object is nothing to the picture.
    scene[hidden].position = (0.3, 0.1, 0.0)
    found = np.asarray(scene.image(mode, samples=2))
    without = insitu.open(str(write(tmp_path, [name for name in OBJECTS if name != hidden])))
    expected = np.asarray(without.image(mode, samples=2))
    assert np.allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_where_all_are_hidden_the_background_is_seen(tmp_path: Path, few_points: None) -> None:
    scene = insitu.open(str(write(tmp_path, list(OBJECTS))))
    for name in scene:
        scene[name].visible = False
    for mode in ("placement", "orbit", "deform", "paths"):
        assert np.allclose(np.asarray(scene.image(mode, samples=1)), (0.5, 0.6, 0.8), rtol=2e-3), mode
    for _ in OBJECTS:
        scene.undo()
    assert all(scene[name].visible for name in scene)


def test_exports_leave_them_out(tmp_path: Path) -> None:
    scene = insitu.open(str(write(tmp_path, list(OBJECTS))))
    scene["ball"].visible = False
    run_to_end(export_steps(scene._seen_in(None), tmp_path / "written", 1))
    text = (tmp_path / "written" / "scene.xml").read_text()
    assert "ground" in text and "ball" not in text
    meshes = [path.name for path in (tmp_path / "written" / "meshes").iterdir()]
    assert len(meshes) == 3 and not any("ball" in name for name in meshes)
