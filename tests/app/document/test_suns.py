"""Suns that the user aims, dims and sizes: the document, files, paths and the light that they make."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import insitu
from app.document.commands.light import SetEnvironment, SetRotation
from app.document.commands.suns import SetSun, angles_of, direction_of
from app.document.document import Document, document_from_description
from app.document.history import History
from app.document.scene_change import SceneChange
from app.document.view_state import ViewState
from app.files.session import fit_session, load_session, save_session
from app.project.project import open_project, set_path
from engine.core.errors import InsituError
from engine.light.suns import SUN_DIAMETER
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE
from tests.scene_text import LAMBERT, camera, facing_up, placed

NOON = {"name": "Noon", "direction": [0, 1, 0], "irradiance": 10.0}
EVENING = {"direction": [1, 0.1, 0], "irradiance": [3.0, 1.0, 0.5], "diameter": 4.0}


def described(*suns: dict[str, Any], scale: float = 2.0) -> Document:
    environment = {"radiance": 1.0, "scale": scale, "sun": list(suns)}
    return document_from_description(
        "scene.toml", parse_description({**SCENE, "environment": environment}, "scene.toml")
    )


@pytest.fixture
def lit() -> Document:
    return described(NOON, EVENING)


def names(document: Document) -> list[str]:
    return [sun.name for sun in document.light.suns]


def test_a_document_has_the_suns_of_its_scene(lit: Document) -> None:
    noon, evening = lit.light.suns
    # The environment's scale multiplies its suns: rows say what they send.
    assert (noon.name, noon.irradiance, noon.diameter) == ("Noon", (20.0, 20.0, 20.0), SUN_DIAMETER)
    assert (evening.name, evening.irradiance, evening.diameter) == ("sun 2", (6.0, 2.0, 1.0), 4.0)
    assert names(described(NOON, NOON, NOON)) == ["Noon", "Noon+", "Noon++"]
    assert not described().light.suns


def test_suns_are_set_by_path(lit: Document) -> None:
    changed = set_path(lit, "light.Noon.direction", [0.0, 3.0, -4.0]).apply(lit)
    changed = set_path(changed, "light.sun 2.irradiance", 5).apply(changed)
    changed = set_path(changed, "light.sun 2.diameter", 10).apply(changed)
    noon, evening = changed.light.suns
    assert noon.direction == (0.0, 0.6, -0.8) and evening.irradiance == (5.0, 5.0, 5.0) and evening.diameter == 10.0
    # Another environment keeps them, and what is as in the scene is no edit.
    assert SetEnvironment("studio").apply(changed).light.suns == changed.light.suns
    back = SetSun("Noon", "direction", (0.0, 1.0, 0.0)).apply(SetSun("Noon", "direction", (1.0, 0.0, 0.0)).apply(lit))
    assert back == lit


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("light.Noon.irradiance", -1, "irradiance = -1, expected a number or three from 0 to 1e+09"),
        ("light.Noon.diameter", 0, "diameter = 0, expected a number from 0.1 to 90"),
        ("light.Noon.direction", [0, 0, 0], "expected a direction other than 0 0 0"),
        ("light.Noon.direction", "up", "direction = 'up', expected"),
        ("light.Moon.diameter", 1, "there is no property of the light 'Moon.diameter'; did you mean 'Noon.diameter'?"),
        ("light.Noon.hue", 1, "there is no property of the light 'Noon.hue'"),
    ],
)
def test_what_is_no_sun_is_refused_in_a_line(lit: Document, path: str, value: Any, says: str) -> None:
    with pytest.raises(InsituError) as found:
        set_path(lit, path, value).apply(lit)
    assert says in str(found.value) and "\n" not in str(found.value)


def test_undo_and_redo_are_exact(lit: Document) -> None:
    """Random edits of suns and of the rest of the light, undone and redone, bit by bit."""
    random, history = np.random.default_rng(4), History(lit)
    seen = [lit]
    for _ in range(60):
        sun = str(random.choice(names(lit)))
        x, y, z = random.normal(size=3).tolist()
        command = random.choice(4)
        history.do(
            [
                SetSun(sun, "direction", (x, y, z)),
                SetSun(sun, "irradiance", tuple(random.uniform(0.0, 9.0, 3).tolist())),
                SetSun(sun, "diameter", float(random.uniform(0.1, 90.0))),
                SetRotation(float(random.uniform(0.0, 360.0))),
            ][command]
        )
        seen.append(history.document)
    for before in reversed(seen[:-1]):
        assert history.undo() is not None and history.document == before
    for after in seen[1:]:
        assert history.redo() is not None and history.document == after


def test_sessions_save_edited_suns_alone(lit: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "plain.insitu", lit, ViewState())
    assert "suns" not in path.read_text()
    assert fit_session(load_session(path), lit, "plain.insitu").light == lit.light
    edited = SetSun("sun 2", "direction", (1.0, 2.0, 3.0)).apply(SetSun("Noon", "irradiance", 0.1).apply(lit))
    path = save_session(tmp_path / "edited.insitu", edited, ViewState())
    assert fit_session(load_session(path), lit, "edited.insitu").light == edited.light
    path.write_text(path.read_text().replace("diameter = 4.0", "diameter = 400.0"))
    with pytest.raises(InsituError, match="diameter = 400"):
        load_session(path)


def test_a_reloaded_scene_brings_suns_that_were_not_edited(lit: Document) -> None:
    brighter = described({**NOON, "irradiance": 30.0}, EVENING)
    turned = SetRotation(40.0).apply(lit)
    assert SceneChange(lit, brighter)(turned).light.suns == brighter.light.suns
    edited = SetSun("Noon", "diameter", 2.0).apply(lit)
    assert SceneChange(lit, brighter)(edited).light == SetSun("Noon", "diameter", 2.0).apply(brighter).light


def test_angles_are_those_of_the_lat_long_map() -> None:
    # -Z is azimuth 0, +X is 90 degrees to its right, +Y is up.
    for direction, angles in (
        ((0, 0, -1), (0, 0)),
        ((1, 0, 0), (90, 0)),
        ((0, 1, 0), (0, 90)),
        ((0, -0.6, 0.8), (180, -36.87)),
    ):
        assert angles_of(direction) == pytest.approx(angles, abs=0.01)
    for azimuth, elevation in np.random.default_rng(5).uniform((-180, -89), (180, 89), (50, 2)):
        assert angles_of(direction_of(azimuth, elevation)) == pytest.approx((azimuth, elevation))
        assert math.hypot(*direction_of(azimuth, elevation)) == pytest.approx(1.0)


@pytest.mark.parametrize("environment", ["scene", "constant"])
def test_a_floor_is_lit_as_its_sun_says(tmp_path: Path, environment: str) -> None:
    """Albedo over pi times E cos, of a sun that was lowered to 30 degrees and dimmed by a script."""
    light = "[environment]\nradiance = 0\nscale = 3\nrotation = 25\n"
    light += "sun = [{ name = 'Noon', direction = [0, 1, 0], irradiance = 1 }]\n"
    floor = placed("floor", "quad", facing_up(4), LAMBERT)
    (tmp_path / "scene.toml").write_text(camera((0, 4, 3), 20, (12, 8), head="bounces = 1\n") + light + floor)
    scene = insitu.open(str(tmp_path / "scene.toml"))
    assert list(scene.light) == ["environment", "Noon"] and scene.light["Noon"].irradiance == (3.0, 3.0, 3.0)
    scene.light["Noon"].direction = direction_of(70.0, 30.0)
    scene.light["Noon"].irradiance = (4.0, 2.0, 1.0)
    if environment == "constant":
        scene._editing.do(SetEnvironment("constant", radiance=(1.0, 1.0, 1.0)))
    expected = scene["floor"]["lambert"].albedo[0] / math.pi * 0.5 * np.array([4.0, 2.0, 1.0])
    expected += scene["floor"]["lambert"].albedo[0] if environment == "constant" else 0.0
    found = np.asarray(scene.image("placement")).mean(axis=(0, 1))
    np.testing.assert_allclose(found, expected, rtol=0.005)
    assert scene.undo() is not None


def test_the_command_line_sets_them(tmp_path: Path) -> None:
    light = "[environment]\nradiance = 0\nsun = [{ direction = [0, 1, 0], irradiance = 1 }]\n"
    (tmp_path / "scene.toml").write_text(camera((0, 4, 3)) + light + placed("floor", "quad", facing_up(4), LAMBERT))
    project = open_project(str(tmp_path / "scene.toml"), values=[("light.sun 1.diameter", 9.0)])
    assert project.document.light.suns[0].diameter == 9.0
    assert project.sky.environment is not None
    lit = project.sky.environment.radiance[..., 0] > 0.0
    # A disc of 9 degrees covers (1 - cos 4.5°) / 2 of the sphere; in rows of equal angle about the zenith, 4.5 of 180.
    assert lit.any(axis=1).sum() == pytest.approx(4.5 / 180.0 * len(lit), abs=2)
