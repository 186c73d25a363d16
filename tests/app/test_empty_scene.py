"""A scene without objects: every mode shows its environment, and objects are added and deleted in it."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import insitu
from engine.core.camera import centre_directions
from engine.light.environment import load_environment
from engine.scene.builtin import EMPTY_SCENE, builtin_scenes
from tests.scene_text import camera, environment, material, placed, scaled

SIZE = (24, 16)
VIEW = camera((0.0, 0.5, 3.0), 40, SIZE) + environment(radiance=[0.2, 0.4, 0.6])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(VIEW)
    return path


@pytest.mark.parametrize("n_bounces", [1, 3])
@pytest.mark.parametrize("mode", ["placement", "orbit", "deform", "paths"])
def test_every_mode_shows_the_environment_alone(mode: insitu.Mode, n_bounces: int) -> None:
    scene = insitu.open(EMPTY_SCENE, resolution=SIZE)
    found = scene.image(mode, bounces=n_bounces, samples=1)
    light = load_environment(builtin_scenes()[EMPTY_SCENE].with_name("studio.exr"))
    directions = centre_directions(scene.viewpoint.camera, SIZE).reshape(-1, 3)
    expected = light.evaluate(directions).reshape(SIZE[1], SIZE[0], 3)
    # Deform stores its background more coarsely.
    np.testing.assert_allclose(found, expected, rtol=0.06 if mode == "deform" else 1e-5, atol=1e-6)


def test_an_added_object_looks_as_one_of_a_file(file: Path, tmp_path: Path) -> None:
    scene = insitu.open(file)
    bare = scene.image()
    scene.add("sphere", "ball", at=(0.0, 0.0, 0.0), size=1.0)
    scene["ball"]["0"].albedo = (0.5, 0.5, 0.5)
    found = scene.image()
    (tmp_path / "ball").mkdir()
    other = tmp_path / "ball" / "scene.toml"
    layer = material('model = "lambert", albedo = [0.5, 0.5, 0.5]')
    other.write_text(VIEW + placed("ball", "sphere", scaled(1.0, (0.0, 0.5, 0.0)), layer))
    np.testing.assert_allclose(found, insitu.open(other).image(), rtol=1e-3, atol=1e-4)
    scene["ball"].deleted = True
    np.testing.assert_array_equal(scene.image(), bare)


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform", "paths"])
def test_the_light_remains_of_a_scene_whose_objects_are_deleted(mode: insitu.Mode, tmp_path: Path) -> None:
    shapes = insitu.open("teatray", resolution=SIZE)
    for state in shapes.document.objects:
        shapes[state.name].deleted = True
    bare = shapes.image(mode, bounces=2, samples=1)
    light = load_environment(builtin_scenes()["teatray"].with_name("studio.exr"))
    directions = centre_directions(shapes.viewpoint.camera, SIZE).reshape(-1, 3)
    expected = light.evaluate(directions).reshape(SIZE[1], SIZE[0], 3)
    np.testing.assert_allclose(bare, expected, rtol=0.06 if mode == "deform" else 1e-5, atol=1e-6)
    shapes.save(tmp_path / "bare.insitu")
    again = insitu.open(tmp_path / "bare.insitu", resolution=SIZE)
    np.testing.assert_array_equal(again.image(mode, bounces=2, samples=1), bare)


def test_any_sequence_of_additions_and_deletions_is_taken_back_to_the_bit(file: Path) -> None:
    chance, scene = random.Random(7), insitu.open(file)
    documents, place = [scene.document], 0
    for _ in range(120):
        names = [state.name for state in scene.document.objects]
        step = chance.choice(["add", "duplicate", "delete", "delete", "delete", "undo", "redo"])
        if step == "undo" and place > 0:
            scene.undo()
            place -= 1
        elif step == "redo" and place + 1 < len(documents):
            scene.redo()
            place += 1
        elif step == "add" or step in ("duplicate", "delete") and names:
            if step == "add":
                scene.add(chance.choice(["box", "torus", "disc light"]))
            elif step == "delete":
                scene[chance.choice(names)].deleted = True
            else:
                scene[chance.choice(names)].duplicate = f"copy {len(documents)} {chance.random()}".replace(".", "")
            documents, place = [*documents[: place + 1], scene.document], place + 1
        assert scene.document == documents[place]
        assert bool(scene.document.composition) == bool(scene.document.objects)
    assert any(not each.objects for each in documents[1:])


def test_a_session_and_a_scene_of_nothing_open_again(file: Path, tmp_path: Path) -> None:
    scene = insitu.open(file)
    before = scene.image()
    session = tmp_path / "nothing.insitu"
    scene.save(session)
    package = scene.save_scene(tmp_path / "nothing.insitu.zip")
    for path in (session, package):
        np.testing.assert_array_equal(insitu.open(path).image(), before)
