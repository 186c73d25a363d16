"""The mix of lights: its rows in the document, files and paths, and the pictures that they make."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import insitu
from app.document.commands.light import SetEmission, SetRotation
from app.document.commands.mix import SetMix
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from app.document.light_mix import emission_of, exclusions_of, gains_of, lights_of, mixed_light
from app.document.light_state import ENVIRONMENT_KEY, MIX_FIELDS, LightState
from app.document.scene_change import SceneChange
from app.document.scene_state import scene_state
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.project.assignments import set_path
from app.project.project import open_project
from engine.core.blackbody import blackbody_colour
from engine.core.errors import InsituError
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE
from tests.scene_text import LAMBERT, camera, facing_down, facing_up, placed

NOON = {"name": "Noon", "direction": [0, 1, 0], "irradiance": 10.0}
KEYS = (ENVIRONMENT_KEY, "light.Noon", "lamp")


def described(**changes: Any) -> Document:
    environment = {"radiance": 1.0, "sun": [NOON]}
    tree = {**SCENE, "environment": environment, **changes}
    return document_from_description("scene.toml", parse_description(tree, "scene.toml"))


@pytest.fixture
def lit() -> Document:
    return described()


def edited(document: Document, **values: Any) -> Document:
    """With values set by path, "lamp__on" for "lamp.on"."""
    for name, value in values.items():
        document = set_path(document, name.replace("__", "."), value).apply(document)
    return document


def gains(document: Document) -> list[tuple[float, float, float]]:
    return [gains_of(document)[key] for key in KEYS]


def test_at_first_all_lights_are_as_the_scene_has_them(lit: Document) -> None:
    assert gains(lit) == [(1.0, 1.0, 1.0)] * 3 and mixed_light(lit) is lit.light
    assert emission_of(lit) == (("lamp", (5.0, 5.0, 5.0)),)


def test_a_stop_doubles_and_a_colour_multiplies(lit: Document) -> None:
    document = edited(lit, lamp__strength=3, lamp__colour=[1, 0.5, 0], light__Noon__strength=-1)
    assert gains(document) == [(1, 1, 1), (0.5, 0.5, 0.5), (8, 4, 0)]
    assert emission_of(document) == (("lamp", (40.0, 20.0, 0.0)),)
    assert mixed_light(document).suns[0].irradiance == (5.0, 5.0, 5.0)
    # What the lights are on their own stays: the row is apart from it.
    assert document.object("lamp").emission == (5.0, 5.0, 5.0) and document.light.suns == lit.light.suns


def test_a_temperature_takes_the_place_of_a_colour(lit: Document) -> None:
    warm = edited(lit, lamp__colour=[1, 0, 0], lamp__kelvin=2700)
    assert gains_of(warm)["lamp"] == blackbody_colour(2700) and warm.light.row("lamp").colour == (1, 1, 1)
    assert gains_of(edited(warm, lamp__colour=0.5))["lamp"] == (0.5, 0.5, 0.5)
    assert edited(warm, lamp__strength=3.0, lamp__on=False).light.row("lamp").tint == blackbody_colour(2700)
    assert edited(warm, lamp__kelvin=0) == lit


def test_lights_that_are_off_or_not_solo_are_black(lit: Document) -> None:
    black, plain = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    off = edited(lit, light__Noon__on=False)
    assert gains(off) == [plain, black, plain] and mixed_light(off).suns[0].irradiance == black
    solo = edited(lit, light__environment__solo=True)
    assert gains(solo) == [plain, black, black]
    assert gains(edited(solo, lamp__solo=True)) == [plain, black, plain]
    # What is off stays so when it is solo, and its strength comes back with it.
    both = edited(lit, lamp__solo=True, lamp__on=False, lamp__strength=1)
    assert gains(both) == [black] * 3
    assert gains(edited(both, lamp__on=True)) == [black, black, (2.0, 2.0, 2.0)]


def test_a_group_multiplies_its_lights(lit: Document) -> None:
    grouped = edited(lit, lamp__group="Key", light__Noon__group="Key", lamp__strength=1)
    louder = edited(grouped, light__groups__Key__strength=1, light__groups__Key__colour=[1, 1, 0.5])
    assert gains(louder) == [(1, 1, 1), (2, 2, 1), (4, 4, 2)]
    assert gains(edited(grouped, light__groups__Key__on=False)) == [(1, 1, 1), (0, 0, 0), (0, 0, 0)]
    assert gains(edited(grouped, light__groups__Key__solo=True)) == [(0, 0, 0), (1, 1, 1), (2, 2, 2)]
    # The last light that leaves the group takes its effect away.
    left = edited(louder, lamp__group="", light__Noon__group="")
    assert gains(left) == [(1, 1, 1), (1, 1, 1), (2, 2, 2)] and left.light.groups == ()


def test_the_environments_sides_are_lights_that_its_row_multiplies(lit: Document) -> None:
    split = edited(lit, light__sides=True)
    sides = [key for key in lights_of(split) if key.startswith("light.sides.")]
    assert sides == [f"light.sides.{name}" for name in ("front", "right", "back", "left", "up", "down")]
    assert ENVIRONMENT_KEY not in lights_of(split)
    document = edited(split, light__environment__strength=1, light__sides__up__colour=[1, 0.5, 0])
    assert gains_of(document)["light.sides.up"] == (2, 1, 0) and gains_of(document)["light.sides.left"] == (2, 2, 2)
    grouped = edited(document, light__sides__up__group="Top", light__groups__Top__strength=-1)
    assert gains_of(grouped)["light.sides.up"] == (1, 0.5, 0)
    # A side that is solo shines alone; the environment that is solo, with all its sides.
    alone = edited(document, light__sides__up__solo=True, light__environment__solo=True)
    assert {key for key, gain in gains_of(alone).items() if any(gain)} == {"light.sides.up"}
    together = edited(document, light__environment__solo=True)
    assert {key for key, gain in gains_of(together).items() if any(gain)} == set(sides)
    linked = edited(split, light__environment__excludes=["pot"], light__sides__up__excludes=["floor"])
    assert exclusions_of(linked)["light.sides.up"] == ("floor", "pot")
    assert exclusions_of(linked)["light.sides.down"] == ("pot",)
    # Joined again it has its own row, and those of sides are gone.
    assert edited(document, light__sides=False) == edited(lit, light__environment__strength=1)


def test_pictures_of_sides_sum_to_the_environments(tmp_path: Path) -> None:
    text = camera((0.4, 1.6, 2.6), 45, (16, 12)) + "[environment]\nradiance = [0.3, 0.4, 0.6]\n"
    (tmp_path / "s.toml").write_text(text + placed("floor", "quad", facing_up(4), LAMBERT))
    scene = insitu.open(tmp_path / "s.toml")
    whole = scene.image(bounces=1)
    scene.light.sides = True
    np.testing.assert_allclose(scene.image(bounces=1), whole, rtol=2e-3)
    scene.light["sides.up"].strength = 1.0
    louder = scene.image(bounces=1)
    scene.light["sides.up"].strength = 0.0
    scene.light["sides.up"].solo = True
    np.testing.assert_allclose(louder, whole + scene.image(bounces=1), rtol=5e-3)
    # A floor under an even sky: what comes from above is π (1 − what the sides send), more than half of it.
    share = (louder - whole)[6:, :, 0] / whole[6:, :, 0]
    assert 0.5 < share.min() and share.max() < 0.8
    scene.save(tmp_path / "split.insitu")
    np.testing.assert_array_equal(insitu.open(tmp_path / "split.insitu").document.light, scene.document.light)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("light.sides", 1, "light.sides: value = 1, expected true or false"),
        ("lamp.strength", 21, "strength = 21, expected a number from -20 to 20"),
        ("lamp.strength", "bright", "strength = 'bright', expected a number"),
        ("lamp.kelvin", 900, "kelvin = 900, expected a number from 1667 to 25000"),
        ("lamp.colour", [1, -1, 1], "colour = [1, -1, 1], expected a number or three from 0 to 1000"),
        ("lamp.on", 1, "on = 1, expected true or false"),
        ("lamp.group", 3, "group = 3, expected a name of at most 64 letters"),
        ("lamp.group", "a\nb", "group = 'a\\nb', expected a name of at most 64 letters"),
        ("lamp.excludes", "pot", "excludes = 'pot', expected a list of names of objects"),
        ("lamp.excludes", [1], "excludes = [1], expected a list of names of objects"),
        ("lamp.excludes", ["cup"], "there is no object 'cup'; available: pot, floor, lamp"),
        ("pot.strength", 1, "there is no layer of pot 'strength'"),
        ("light.groups.Key.on", False, "there is no property of the light 'groups.Key.on'"),
        ("light.Moon.on", False, "there is no property of the light 'Moon.on'"),
    ],
)
def test_what_no_row_has_is_refused_in_a_line(lit: Document, path: str, value: Any, says: str) -> None:
    with pytest.raises(InsituError) as found:
        set_path(lit, path, value).apply(lit)
    assert says in str(found.value) and "\n" not in str(found.value)


def test_a_light_excludes_what_its_row_or_its_group_excludes(lit: Document) -> None:
    document = edited(lit, lamp__excludes=["pot", "pot"], light__Noon__group="Key", lamp__group="Key")
    document = edited(document, light__groups__Key__excludes=["floor"])
    assert exclusions_of(document) == {
        ENVIRONMENT_KEY: (), "light.Noon": ("floor",), "lamp": ("floor", "pot")
    }  # fmt: skip
    # The worker gets it with the light; an object that the scene has no more counts for nothing.
    assert mixed_light(document).row("lamp").excludes == ("floor", "pot")
    without = replace(document, objects=tuple(each for each in document.objects if each.name != "pot"))
    assert exclusions_of(without)["lamp"] == ("floor",)
    left = edited(document, lamp__excludes=[], lamp__group="", light__Noon__group="")
    assert not any(exclusions_of(left).values())


def test_links_of_the_sky_have_the_lights_that_reach_each_object(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(ROOM)
    values = [("light.Noon.excludes", ["floor"]), ("lamp.excludes", ["floor", "lamp"])]
    project = open_project(str(tmp_path / "scene.toml"), values=values)
    floor, lamp = map(project.object_names.index, ("floor", "lamp"))
    whole, links = project.sky, {each.objects: each for each in project.sky.links}
    assert links.keys() == {frozenset({floor}), frozenset({lamp})}
    assert all(each.dark == {lamp} for each in links.values())
    # Without its sun the sky is even; the lamp's own distant light is the whole.
    assert np.ptp(links[frozenset({floor})].sky.environment.radiance, axis=(0, 1)).max() < 1e-6
    assert links[frozenset({lamp})].sky.environment is whole.environment


def test_the_group_of_a_group_is_its_name(lit: Document) -> None:
    grouped = edited(lit, lamp__group="Key", light__Noon__group="Key", light__groups__Key__strength=1)
    renamed = edited(grouped, light__groups__Key__group="Fill")
    assert renamed.light.groups == ("Fill",) and gains(renamed) == gains(grouped)
    assert edited(renamed, light__groups__Fill__group="Key") == grouped
    # Lights that join another group follow its row; those of none are as on their own.
    both = edited(grouped, light__environment__group="Rim", light__groups__Rim__strength=-1)
    assert gains(edited(both, light__groups__Key__group="Rim")) == [(0.5, 0.5, 0.5)] * 3
    assert edited(grouped, light__groups__Key__group="") == lit


def some_value(random: np.random.Generator, name: str) -> Any:
    values = {
        "on": bool(random.integers(2)), "solo": bool(random.integers(2)),
        "strength": float(random.integers(-3, 4)), "colour": tuple(random.uniform(0.0, 2.0, 3).tolist()),
        "kelvin": float(random.choice([0.0, 2000.0, 9000.0])), "group": str(random.choice(["", "Key", "Fill"])),
        "excludes": tuple(name for name in ("floor", "pot") if random.integers(2)),
    }  # fmt: skip
    return values[name]


def naive_gain(rows: dict[str, dict[str, Any]], key: str) -> Any:
    """A light's gain by its definition, from all values that were set."""

    def own(row: dict[str, Any]) -> Any:
        colour = np.array(blackbody_colour(row["kelvin"]) if row["kelvin"] else row["colour"])
        return row["on"] * 2.0 ** row["strength"] * colour

    def rows_of(key: str) -> list[dict[str, Any]]:
        group = rows[key]["group"]
        return [rows[key], *([rows[f"light.groups.{group}"]] if group else [])]

    some_solo = any(row["solo"] for light in KEYS for row in rows_of(light))
    if some_solo and not any(row["solo"] for row in rows_of(key)):
        return np.zeros(3)
    return np.prod([own(row) for row in rows_of(key)], axis=0)


def test_random_edits_are_mixed_by_the_definition_and_undone_to_the_bit(lit: Document) -> None:
    random, history, seen = np.random.default_rng(32), History(lit), [lit]
    groups = [f"light.groups.{name}" for name in ("Key", "Fill")]
    plain = {
        "on": True, "solo": False, "strength": 0.0, "colour": (1.0, 1.0, 1.0), "kelvin": 0.0, "group": "",
        "excludes": (),
    }  # fmt: skip
    rows = {key: dict(plain) for key in (*KEYS, *groups)}
    for _ in range(200):
        there = [key for key in groups if key.rpartition(".")[2] in history.document.light.groups]
        key, name = str(random.choice([*KEYS, *there])), str(random.choice(MIX_FIELDS))
        if key in groups and name == "group":
            continue
        value = some_value(random, name)
        history.do(SetMix(key, name, value))
        rows[key][name] = value
        if name in ("colour", "kelvin"):
            other = "kelvin" if name == "colour" else "colour"
            rows[key][other] = plain[other]
        if history.document is not seen[-1]:  # what changes nothing is no step
            seen.append(history.document)
        for light in KEYS:
            np.testing.assert_allclose(gains_of(history.document)[light], naive_gain(rows, light), rtol=1e-12)
            group = rows[light]["group"]
            excluded = {*rows[light]["excludes"], *(rows[f"light.groups.{group}"]["excludes"] if group else ())}
            assert set(exclusions_of(history.document)[light]) == excluded
    for before in reversed(seen[:-1]):
        assert history.undo() is not None and history.document == before
    for after in seen[1:]:
        assert history.redo() is not None and history.document == after


def test_what_the_worker_gets_depends_on_the_gains_alone(lit: Document) -> None:
    """Names of groups, and strengths of what is off, change no light: nothing is computed for them."""
    one = edited(lit, lamp__strength=2, light__Noon__on=False)
    two = edited(lit, lamp__group="Key", lamp__strength=1, light__groups__Key__strength=1, light__Noon__strength=-20)
    two = edited(two, light__Noon__on=False)
    assert scene_state(one) == scene_state(two) != scene_state(lit)


def test_sessions_save_edited_rows_alone(lit: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "plain.insitu", lit, ViewState())
    assert "mix = " not in path.read_text()
    document = edited(lit, lamp__strength=0.1, lamp__group="Key", light__Noon__on=False, light__environment__kelvin=4e3)
    document = edited(document, light__groups__Key__colour=[0.1, 0.2, 0.3], light__Noon__solo=True)
    document = edited(document, light__Noon__excludes=["pot", "floor"])
    path = save_session(tmp_path / "mixed.insitu", document, ViewState())
    assert fit_session(load_session(path), lit, "mixed.insitu").light == document.light
    for good, bad, says in (
        ("kelvin = 4000.0", "kelvin = 10.0", "kelvin"),
        ("strength = 0.1", "strength = 99.0", "strength"),
        ('light = "lamp"', 'light = ""', "light"),
        ("on = false", "off = true", "off"),
        ('excludes = ["floor", "pot"]', 'excludes = "pot"', "excludes"),
    ):
        assert good in path.read_text()
        (tmp_path / "bad.insitu").write_text(path.read_text().replace(good, bad))
        with pytest.raises(InsituError, match=says):
            load_session(tmp_path / "bad.insitu")


def test_rows_stay_when_the_scene_is_read_again(lit: Document) -> None:
    mixed = edited(lit, lamp__strength=1, light__Noon__on=False)
    brighter = described(environment={"radiance": 2.0, "sun": [{**NOON, "irradiance": 30.0}]})
    again = SceneChange(lit, brighter)(mixed)
    assert again.light.mix == mixed.light.mix and again.light.suns == brighter.light.suns
    # A lamp of another name keeps its row, where it is known to be the same.
    objects = [{**each, "name": "bulb"} if each["name"] == "lamp" else each for each in SCENE["object"]]
    linked = edited(mixed, light__Noon__excludes=["lamp", "pot"])
    renamed = SceneChange(lit, described(object=objects), {"bulb": "lamp"})(linked)
    assert gains_of(renamed)["bulb"] == (2.0, 2.0, 2.0)
    assert renamed.light.row("light.Noon").excludes == ("bulb", "pot")


def test_a_row_of_a_light_that_is_gone_darkens_nothing(lit: Document) -> None:
    alone = edited(lit, lamp__solo=True)
    without = replace(alone, objects=alone.objects[:2])
    assert gains_of(without)[ENVIRONMENT_KEY] == (1.0, 1.0, 1.0)


ROOM = (
    camera((0, 4, 3), 20, (12, 8), head="bounces = 2\n")
    + "[environment]\nradiance = [0.2, 0.3, 0.4]\nsun = [{ name = 'Noon', direction = [0.3, 1, 0], irradiance = 1 }]\n"
    + placed("floor", "quad", facing_up(4), LAMBERT)
    + placed("lamp", "quad", facing_down(0.5, (0.5, 1.0, 0.2)), "emission = [3.0, 2.0, 1.0]\n")
)


def test_a_picture_is_the_sum_of_its_lights_by_their_gains(tmp_path: Path) -> None:
    """Light adds up: pictures of each light alone, times its gain, sum to the picture of the mix."""
    (tmp_path / "scene.toml").write_text(ROOM)
    scene = insitu.open(str(tmp_path / "scene.toml"))
    rows = [scene.light["environment"], scene.light["Noon"], scene["lamp"]]
    alone = []
    for row in rows:
        row.solo = True
        alone.append(np.asarray(scene.image("placement"), np.float64))
        row.solo = False
    rows[0].strength, rows[1].colour, rows[2].kelvin = -2.0, (0.5, 2.0, 1.0), 2700
    weights = [(0.25, 0.25, 0.25), (0.5, 2.0, 1.0), blackbody_colour(2700)]
    expected = sum(np.array(weight) * picture for weight, picture in zip(weights, alone, strict=True))
    found = np.asarray(scene.image("placement"), np.float64)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.02 * found.mean()
    # An environment that is off is black behind the scene as well.
    rows[0].on = rows[1].on = rows[2].on = False
    assert not np.asarray(scene.image("placement")).any()


def test_the_command_line_sets_rows(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(ROOM)
    values = [("light.environment.strength", 1), ("light.Noon.on", False), ("lamp.colour", [0, 1, 0])]
    project = open_project(str(tmp_path / "scene.toml"), values=values)
    assert project.sky.environment is not None and project.sky.scale == 2.0
    assert project.sky.environment.radiance.reshape(-1, 3).tolist() == [pytest.approx([0.2, 0.3, 0.4])]
    lamp = project.object_names.index("lamp")
    assert project.scene.emission[lamp].tolist() == [0.0, 2.0, 0.0]


def test_a_mix_is_part_of_the_light_and_no_edit_of_emission(lit: Document) -> None:
    document = SetEmission("lamp", 3.0).apply(edited(lit, lamp__strength=1))
    assert emission_of(document) == (("lamp", (6.0, 6.0, 6.0)),)
    turned = SetRotation(90.0).apply(document)
    assert turned.light == replace(document.light, rotation=90.0) and isinstance(turned.light, LightState)
