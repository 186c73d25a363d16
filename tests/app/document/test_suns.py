"""Suns that the user aims, dims and sizes: the document, files, paths and the light that they make."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import insitu
from app.document.commands.light import SetEnvironment, SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.objects import RenameObject, free_name
from app.document.commands.suns import (
    AddSun,
    DeleteSun,
    DuplicateSun,
    RenameSun,
    SetSun,
    angles_of,
    direction_of,
    in_world,
)
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from app.document.light_state import LightState
from app.document.scene_change import SceneChange
from app.document.view_state import ViewState
from app.files.session import dump_session, load_session, parse_session, save_session
from app.files.session_fitting import fit_session
from app.project.assignments import set_path
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.light.suns import SUN_DIAMETER
from engine.scene.description import MAX_SUNS, Camera, parse_description
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


def applied(document: Document, *commands: Any) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def test_suns_are_added_duplicated_renamed_and_deleted_with_their_rows(lit: Document) -> None:
    tinted = applied(lit, AddSun(), SetMix("light.sun", "kelvin", 3000.0), DuplicateSun("sun"))
    # "sun 2" is the name of the file's second sun.
    assert names(tinted) == ["Noon", "sun 2", "sun", "sun 3"] and tinted.light.row("light.sun 3").kelvin == 3000.0
    assert tinted.light.suns[2].irradiance == (math.pi,) * 3 and tinted.light.suns[2].diameter == SUN_DIAMETER
    assert tinted.light.added_suns == ("sun", "sun 3") and tinted.light.deleted_suns == ()
    renamed = applied(tinted, RenameSun("sun", "Key"), DeleteSun("sun 3"), DeleteSun("Noon"))
    assert names(renamed) == ["sun 2", "Key"] and renamed.light.deleted_suns == ("Noon",)
    assert [key for key, _ in renamed.light.mix] == ["light.Key"] and renamed.light.row("light.Key").kelvin == 3000.0
    assert (
        applied(lit, AddSun("x"), DeleteSun("x")) == lit == applied(lit, RenameSun("Noon", "x"), RenameSun("x", "Noon"))
    )


def test_names_are_free_across_lights(lit: Document) -> None:
    object_name = lit.objects[0].name
    for refused in (object_name, "Noon", "environment", "groups", "a.b", ""):
        with pytest.raises(InsituError, match="name = "):
            RenameSun("sun 2", refused).apply(lit)
    with pytest.raises(InsituError, match="expected one that no sun has"):
        RenameObject(object_name, "Noon").apply(lit)
    assert free_name(applied(lit, AddSun("bowl")), "bowl") == "bowl 2"
    full = applied(lit, *(AddSun() for _ in range(MAX_SUNS - 2)))
    with pytest.raises(InsituError, match="at most 16"):
        AddSun().apply(full)
    with pytest.raises(InsituError, match="there is no sun 'Moon'; available: Noon, sun 2"):
        DeleteSun("Moon").apply(lit)


def test_one_that_is_added_shines_from_the_upper_left_of_the_camera(lit: Document) -> None:
    """Behind the camera on its left, 45 degrees high, whatever the light is rotated by."""
    for position in np.random.default_rng(2).normal(size=(8, 3)):
        camera = Camera(position=tuple(position.tolist()), target=(0.2, 0.1, 0.3))
        turned_light = SetRotation(70.0).apply(lit)
        sun = AddSun("key").seen_from(camera).apply(turned_light).light.suns[-1]
        towards = np.array(in_world(sun.direction, LightState(rotation=70.0)))
        forward = np.subtract(camera.target, camera.position) * (1.0, 0.0, 1.0)
        left = np.cross((0.0, 1.0, 0.0), forward)
        assert towards[1] == pytest.approx(math.sqrt(0.5))
        assert towards @ left / np.linalg.norm(left) == pytest.approx(0.5)  # cos 45° cos 45°
        assert towards @ forward / np.linalg.norm(forward) == pytest.approx(-0.5)


def test_all_of_it_is_set_by_path(lit: Document) -> None:
    for path in ("key.add", "light.key.add"):
        here = set_path(lit, path, "sun").apply(lit)
        assert names(here) == ["Noon", "sun 2", "key"]
    for path, value in (
        ("light.key.azimuth", 30.0), ("light.key.elevation", 10.0), ("light.key.duplicate", "rim"),
        ("light.key.name", "front"), ("light.Noon.deleted", True),
    ):  # fmt: skip
        here = set_path(here, path, value).apply(here)
    assert names(here) == ["sun 2", "front", "rim"]
    assert angles_of(here.light.suns[1].direction) == pytest.approx((30.0, 10.0))
    for path, value in (("light.rim.deleted", False), ("light.rim.name", 3), ("rim.add", 4)):
        with pytest.raises(InsituError, match="expected"):
            set_path(here, path, value).apply(here)


def test_undo_and_redo_are_exact(lit: Document) -> None:
    """Random edits of which suns there are, of them and of the rest of the light, undone and redone bit by bit; each
    document comes back from a session, and names stay apart."""
    random, history = np.random.default_rng(4), History(lit)
    seen = [lit]
    for _ in range(120):
        sun = str(random.choice([*names(history.document), "gone"]))
        x, y, z = random.normal(size=3).tolist()
        commands = (
            SetSun(sun, "direction", (x, y, z)),
            SetSun(sun, "irradiance", tuple(random.uniform(0.0, 9.0, 3).tolist())),
            SetSun(sun, "diameter", float(random.uniform(0.1, 90.0))),
            SetRotation(float(random.uniform(0.0, 360.0))),
            AddSun(str(random.choice(["", "key", "Noon"]))),
            DuplicateSun(sun),
            DeleteSun(sun),
            RenameSun(sun, str(random.choice(["Noon", "fill", "rim"]))),
            SetMix(f"light.{sun}", "strength", float(random.uniform(-3.0, 3.0))),
        )
        try:
            is_new = history.do(commands[int(random.integers(len(commands)))])
        except InsituError:
            continue
        if is_new:
            seen.append(history.document)
        there = names(history.document)
        assert len(set(there)) == len(there) <= MAX_SUNS
        assert {key for key, _ in history.document.light.mix} <= {f"light.{name}" for name in there}
        text = dump_session(history.document, ViewState())
        found = fit_session(parse_session(text.encode(), Path("x.insitu"), None), lit, "x.insitu")
        assert set(found.light.suns) == set(history.document.light.suns)
        assert replace(found.light, new_suns=None) == replace(history.document.light, new_suns=None)
    assert len(seen) > 50
    for before in reversed(seen[:-1]):
        assert history.undo() is not None and history.document == before
    for after in seen[1:]:
        assert history.redo() is not None and history.document == after


def test_sessions_save_edited_suns_alone(lit: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "plain.insitu", lit, ViewState())
    assert "suns =" not in path.read_text()
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


def test_added_and_deleted_suns_outlast_a_scene_that_is_saved_again(lit: Document) -> None:
    mine = applied(lit, AddSun("key"), DeleteSun("Noon"), RenameSun("sun 2", "dusk"))
    dawn = {"name": "dawn", "direction": [-1, 0.1, 0], "irradiance": 1.0}
    now = SceneChange(lit, described({**NOON, "irradiance": 30.0}, EVENING, dawn))(mine)
    assert names(now) == ["dawn", "dusk", "key"] and SceneChange(lit, described(NOON)).lost_parts(mine) == ()
    without = applied(lit, AddSun("key"), SetSun("sun 2", "diameter", 2.0))
    assert names(SceneChange(lit, described(NOON))(without)) == ["Noon", "key"]
    assert SceneChange(lit, described(NOON)).lost_parts(without) == ("sun 2",)


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


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform"])
def test_an_added_sun_lights_a_scene_without_environment(tmp_path: Path, mode: str) -> None:
    """A diffuse floor under E = irradiance * cos θ: L = albedo / pi * E."""
    (tmp_path / "scene.toml").write_text(
        camera((0, 4, 3), 20, (12, 8), head="bounces = 1\n") + placed("floor", "quad", facing_up(4), LAMBERT)
    )
    scene = insitu.open(str(tmp_path / "scene.toml"))
    sun = scene.add("sun", "key", size=2.0)
    assert list(scene.light) == ["environment", "key"] and sun.irradiance == (math.pi,) * 3 and sun.diameter == 2.0
    with pytest.raises(insitu.Error, match="expected none: a sun is far away"):
        scene.add("sun", at=(0.0, 1.0, 0.0))
    scene["floor"]["lambert"].albedo = (0.5, 0.5, 0.5)
    for elevation in (90.0, 30.0):
        sun.elevation = elevation
        found = np.asarray(scene.image(mode))
        expected = 0.5 * math.sin(math.radians(elevation))
        # Deform knows light in a few bands, whose sun is as wide as they are.
        np.testing.assert_allclose(found.mean(), expected, rtol=0.05 if mode == "deform" else 0.006)


@pytest.mark.parametrize("is_traced", [False, True])
def test_the_penumbra_is_as_wide_as_the_sun(tmp_path: Path, is_traced: bool) -> None:
    """An edge at the height d = 1 over a floor, under a sun of the diameter δ overhead. A point at x from below the
    edge sees the part of the disc beyond a line at u = x / (d tan(δ/2)): 1/2 + (u sqrt(1 - u²) + asin u) / π. So light
    goes from none to all over 2 d tan(δ/2)."""
    (tmp_path / "scene.toml").write_text(
        camera((0, 0.5, 0.001), 2.5, (96, 4), head="bounces = 1\n")
        + placed("floor", "quad", facing_up(4), LAMBERT) + placed("screen", "quad", facing_up(2, (-1, 1, 0)), LAMBERT)
    )  # fmt: skip
    scene = insitu.open(str(tmp_path / "scene.toml"))
    sun = scene.add("sun", "key", size=10.0)
    sun.direction = (0.0, 1.0, 0.0)
    scene["floor"]["lambert"].albedo = (1.0, 1.0, 1.0)
    picture = scene.image("paths", samples=256) if is_traced else scene.image()
    found = np.asarray(picture)[..., 0].mean(axis=0)
    x = 0.5 * 24.0 * math.tan(math.radians(1.25)) * (np.arange(96) - 47.5) / 48.0
    u = np.clip(x / math.tan(math.radians(5.0)), -1.0, 1.0)
    share = 0.5 + (u * np.sqrt(1.0 - u * u) + np.arcsin(u)) / math.pi
    assert ((share == 0.0).sum() > 20) and ((share == 1.0).sum() > 20)
    np.testing.assert_allclose(found, share, atol=0.03)


def test_the_command_line_sets_them(tmp_path: Path) -> None:
    light = "[environment]\nradiance = 0\nsun = [{ direction = [0, 1, 0], irradiance = 1 }]\n"
    (tmp_path / "scene.toml").write_text(camera((0, 4, 3)) + light + placed("floor", "quad", facing_up(4), LAMBERT))
    project = open_project(str(tmp_path / "scene.toml"), values=[("light.sun 1.diameter", 9.0)])
    assert project.document.light.suns[0].diameter == 9.0
    assert project.sky.environment is not None
    lit = project.sky.environment.radiance[..., 0] > 0.0
    # A disc of 9 degrees covers (1 - cos 4.5°) / 2 of the sphere; in rows of equal angle about the zenith, 4.5 of 180.
    assert lit.any(axis=1).sum() == pytest.approx(4.5 / 180.0 * len(lit), abs=2)
