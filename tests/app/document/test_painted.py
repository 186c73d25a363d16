"""Painted lights in the document: commands, paths, undo, the mix, sessions, and the environment that they make."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import insitu
from app.document.commands.light import SetMapChange
from app.document.commands.mix import SetMix
from app.document.commands.painted import AddPainted, RemovePainted, SetPainted
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from app.document.light_mix import gains_of, mixed_light
from app.document.light_state import ENVIRONMENT_KEY
from app.document.named_files import files_of_document
from app.document.painted_parameters import parameters_of
from app.document.scene_change import SceneChange
from app.document.single_lights import light_weights
from app.document.view_state import ViewState
from app.files.session import dump_session, load_session, parse_session, save_session
from app.project.assignments import parse_assignment, set_path
from app.project.distant_light import sky_of
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.light.painted_lights import PAINTED_KINDS
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed

KEY, CARD = "light.painted.Key", "light.painted.Card"


def described() -> Document:
    tree = {**SCENE, "environment": {"radiance": 0.5, "scale": 2.0}}
    return document_from_description("scene.toml", parse_description(tree, "scene.toml"))


@pytest.fixture
def painted() -> Document:
    document = AddPainted("box", "Key", (("width", 20.0),)).apply(described())
    return AddPainted("disc", "Card", (("blend", "cover"), ("radiance", 0.0), ("elevation", 60))).apply(document)


def names(document: Document) -> list[str]:
    return [each.name for each in document.light.painted]


def test_lights_are_painted_with_the_values_of_their_kind(painted: Document) -> None:
    key, card = painted.light.painted
    assert (key.kind, key.width, key.height, key.radiance) == ("box", 20.0, 40.0, (4.0, 4.0, 4.0))
    assert (card.blend, card.width, card.elevation) == ("cover", 20.0, 60.0)
    twice = AddPainted("sky").apply(AddPainted("sky").apply(painted))
    assert names(twice) == ["Key", "Card", "Sun and sky", "Sun and sky 2"]
    assert twice.light.painted[2].radiance == (0.1, 0.1, 0.1)


def test_they_are_set_by_path(painted: Document) -> None:
    document = painted
    for path, value in (
        (f"{KEY}.azimuth", 450.0), (f"{KEY}.softness", 0.5), (f"{CARD}.position", 0), (f"{KEY}.strength", -1),
        ("light.tilt", 12.5), ("light.hue", -30), ("light.contrast", 1.5), ("light.clamp", 8), (f"{KEY}.name", "Fill"),
        ("light.painted.Rim.add", "disc"), ("light.painted.Rim.width", 5),
        ("light.painted.Top.add", {"kind": "gradient", "far": [0.1, 0.2, 0.3]}),
    ):  # fmt: skip
        document = set_path(document, path, value).apply(document)
    light = document.light
    assert names(document) == ["Card", "Fill", "Rim", "Top"]
    assert (light.painted[1].azimuth, light.painted[1].softness) == (90.0, 0.5)
    assert light.row("light.painted.Fill").strength == -1.0  # its row came along with its name
    assert (light.tilt, light.hue, light.contrast, light.clamp) == (12.5, -30.0, 1.5, 8.0)
    assert light.painted[3].far == (0.1, 0.2, 0.3)
    document = set_path(document, "light.painted.Fill.deleted", True).apply(document)
    assert names(document) == ["Card", "Rim", "Top"] and not document.light.mix
    assert parse_assignment('light.painted.Rim.add={kind="box", width=30}')[1] == {"kind": "box", "width": 30}


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (f"{KEY}.width", 300, "width = 300, expected a number from 0.5 to 170"),
        (f"{CARD}.height", 3, "no property of the light 'painted.Card.height'"),
        ("light.painted.Key.add", "box", "there is a painted light 'Key' already"),
        ("light.painted.New.add", "lamp", "expected an image"),
        ("light.painted.New.add", 3, "expected one of box, disc, gradient, sky, image"),
        ("light.painted.New.add", {"kind": "cone"}, "expected one of box, disc, gradient, sky, image"),
        (f"{KEY}.name", "a.b", "expected a name of 1 to 64 letters"),
        (f"{KEY}.position", 2, "expected a whole number from 0 to 1"),
        (f"{KEY}.deleted", False, "expected true"),
        ("light.tilt", 500, "expected a number from -180 to 180"),
    ],
)
def test_what_is_wrong_changes_nothing_and_is_one_line(painted: Document, path: str, value: Any, line: str) -> None:
    with pytest.raises(InsituError) as refused:
        set_path(painted, path, value).apply(painted)
    assert line in str(refused.value) and "\n" not in str(refused.value)


def test_each_is_a_row_of_the_mix(painted: Document) -> None:
    rows = SetMix(KEY, "strength", 1.0).apply(SetMix(CARD, "solo", True).apply(painted))
    assert gains_of(rows)[KEY] == gains_of(rows)[ENVIRONMENT_KEY] == (0.0, 0.0, 0.0)
    key, card = mixed_light(rows).painted
    assert key.gain == (0.0, 0.0, 0.0) and card.gain == (1.0, 1.0, 1.0)
    grouped = SetMix(KEY, "group", "A").apply(painted)
    grouped = SetMix("light.groups.A", "kelvin", 3000.0).apply(grouped)
    assert mixed_light(grouped).painted[0].gain == pytest.approx(grouped.light.row("light.groups.A").gain)
    # what is switched off covers nothing; what adds keeps its place, so that pictures of it stay
    off = SetMix(CARD, "on", False).apply(SetMix(KEY, "on", False).apply(painted))
    assert [each.name for each in mixed_light(off).painted] == ["Key"]


def room(folder: Path) -> Path:
    text = camera((0, 1, 3), 40, (8, 6)) + environment((0.5, 0.4, 0.3)) + placed("floor", "quad", facing_up(2), LAMBERT)
    (folder / "scene.toml").write_text(text + placed("ball", "sphere", "", LAMBERT))
    return folder / "scene.toml"


def test_lights_alone_make_the_environment_of_all(tmp_path: Path, painted: Document) -> None:
    scene = open_project(str(room(tmp_path))).scene
    light = replace(mixed_light(SetMix(KEY, "colour", (1.0, 0.5, 0.0)).apply(painted)), tilt=20.0)

    def radiance(of: Any) -> Any:
        sky = sky_of(scene, of)
        assert sky.environment is not None
        return sky.scale * sky.environment.radiance.astype(np.float64)

    summed = sum(np.array(weight) * radiance(single.light) for single, weight in light_weights(light, ()).items())
    assert np.allclose(summed, radiance(light), rtol=1e-4, atol=1e-5)
    # the card over the sky is dark, the key adds to the sky
    top = sky_of(scene, replace(light, tilt=0.0)).environment
    assert top is not None
    key, card = light.painted
    assert top.evaluate(card.frame[2][None])[0] == pytest.approx([0.0, 0.0, 0.0])
    assert top.evaluate(key.frame[2][None])[0] == pytest.approx([4.5, 2.4, 0.3])


def test_a_linked_light_leaves_what_it_excludes_dark(tmp_path: Path, painted: Document) -> None:
    scene = open_project(str(room(tmp_path))).scene
    document = replace(painted, light=painted.light.with_row(KEY, replace(painted.light.row(KEY), excludes=("ball",))))
    (link,) = sky_of(scene, document.light).links
    key, card = document.light.painted
    assert link.objects == {1} and link.sky.environment is not None
    assert link.sky.environment.evaluate(key.frame[2][None])[0] == pytest.approx([0.5, 0.4, 0.3])
    assert link.sky.environment.evaluate(card.frame[2][None])[0] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("seed", range(3))
def test_any_sequence_of_edits_is_undone_to_the_bit_and_equal_to_a_fresh_start(tmp_path: Path, seed: int) -> None:
    chance, history = random.Random(seed), History(described())
    states = [history.document]
    for _ in range(25):
        document = history.document
        there = document.light.painted
        command: Any = AddPainted(chance.choice(PAINTED_KINDS[:4]))
        if there and chance.random() < 0.75:
            one = chance.choice(there)
            name, parameter = chance.choice(list(parameters_of(one.kind).items()))
            low, high = parameter.limits
            value: Any = chance.uniform(low, high)
            if parameter.kind == "choice":
                value = chance.choice(parameter.choices)
            command = chance.choice([
                SetPainted.of(one.name, name, value), SetPainted.of(one.name, "position", chance.randrange(len(there))),
                SetPainted.of(one.name, "name", f"light {chance.random():.3f}".replace(".", " ")),
                RemovePainted(one.name), SetMix(f"light.painted.{one.name}", "strength", chance.uniform(-3, 3)),
                SetMapChange("tilt", chance.uniform(-90, 90)), SetMapChange("contrast", chance.uniform(0, 2)),
            ])  # fmt: skip
        before = history.document
        history.do(command)
        if history.document != before:  # else it is no step
            states.append(history.document)
    # A document read from its session is the same, and makes the same environment.
    text = dump_session(history.document, ViewState())
    read = parse_session(text.encode(), tmp_path / "a.insitu", None).document
    assert read.light == replace(history.document.light, own_suns=())
    scene = open_project(str(room(tmp_path))).scene
    made = [
        sky_of(scene, mixed_light(replace(history.document, light=each.light))) for each in (read, history.document)
    ]
    assert made[0].environment is not None and made[1].environment is not None
    assert (made[0].environment.radiance == made[1].environment.radiance).all()
    for expected in reversed(states[:-1]):
        history.undo()
        assert history.document == expected


def test_images_are_saved_beside_the_session_and_followed(tmp_path: Path) -> None:
    Image.new("RGB", (200, 100), (255, 0, 0)).save(tmp_path / "window.png")
    scene = insitu.open(room(tmp_path))
    window = scene.light.paint("image", file=tmp_path / "window.png", azimuth=30)
    assert (window.placement, window.width) == ("card", 40.0) and 20.0 < window.height < 21.0  # its proportions
    scene.save(tmp_path / "lit.insitu")
    assert 'file = "window.png"' in (tmp_path / "lit.insitu").read_text()
    again = insitu.open(tmp_path / "lit.insitu")
    assert again.light["painted.window"].file == str(tmp_path / "window.png")
    assert tmp_path / "window.png" in files_of_document(again.document)
    again.save_scene(tmp_path / "elsewhere")
    packed = insitu.open(tmp_path / "elsewhere")
    copy = Path(packed.light["painted.window"].file)
    assert copy.is_relative_to(tmp_path / "elsewhere") and copy.read_bytes() == (tmp_path / "window.png").read_bytes()


def test_a_session_names_what_is_wrong_in_it(tmp_path: Path) -> None:
    scene = room(tmp_path)
    save_session(tmp_path / "a.insitu", open_project(str(scene)).document, ViewState())
    text = (tmp_path / "a.insitu").read_text()
    for wrong, line in (
        ('[{ name = "Key", kind = "cone" }]', "'box', 'disc', 'gradient', 'sky' or 'image'"),
        ('[{ name = "Key", kind = "disc", height = 3.0 }]', "a painted disc has no 'height'"),
        ('[{ name = "Key", kind = "box", width = 200.0 }]', "width = 200.0, expected a number from 0.5 to 170"),
        ('[{ name = "Key", kind = "box" }, { name = "Key", kind = "sky" }]', "names that differ"),
        ('[{ name = "Key", kind = "image" }]', "file = '', expected an image"),
    ):
        (tmp_path / "b.insitu").write_text(text.replace("[light]\n", f"[light]\npainted = {wrong}\n"))
        with pytest.raises(InsituError) as refused:
            load_session(tmp_path / "b.insitu")
        assert line in str(refused.value) and "painted" in str(refused.value)


def test_painted_lights_stay_when_the_scene_is_saved_again(painted: Document) -> None:
    base = described()
    now = replace(base, light=replace(base.light, rotation=33.0))
    merged = SceneChange(base, now)(painted)
    assert merged.light.painted == painted.light.painted and merged.light.rotation == 33.0
