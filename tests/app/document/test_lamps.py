"""Lamps by numbers in the document: sizes, cones and targets by commands and paths, sessions, reloads, sequences."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.document.commands import MoveObject, SetCone, SetLampSize, SetTarget, SetTransform
from app.document.described import document_from_description
from app.document.document import Document
from app.document.scene_change import SceneChange
from app.document.scene_state import moved_objects
from app.document.view_state import ViewState
from app.files.session import dump_session, load_session
from app.files.session_fitting import fit_session
from app.interface.values import value_at
from app.project.assignments import set_path
from engine.core.errors import InsituError
from engine.light.cones import Cone
from engine.scene.description import parse_description
from engine.scene.transform import Transform
from tests.app.fake_worker import SCENE

# Of 0.4 by 0.2 m, as its file has it askew: its sides go along (0.6, 0.8, 0) and (-0.8, 0.6, 0).
ASKEW = [0.24, -0.16, 0, 1, 0.32, 0.12, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]
BALL = [0.1, 0, 0, 0, 0, 0.1, 0, 2, 0, 0, 0.1, 0, 0, 0, 0, 1]
LAMPS = [
    {"name": "key", "primitive": "quad", "emission": 5.0, "transform": ASKEW},
    {"name": "spot", "primitive": "sphere", "emission": 5.0, "transform": BALL, "cone": {"inner": 10, "outer": 30}},
    {"name": "bulb", "primitive": "sphere", "emission": 5.0, "transform": BALL},
]


def described(lamps: list[dict[str, Any]]) -> Document:
    scene = {**SCENE, "object": [*SCENE["object"], *lamps]}
    return document_from_description("shelf", parse_description(scene, "scene.toml"))


@pytest.fixture
def lit() -> Document:
    return described(LAMPS)


def put(document: Document, path: str, value: Any) -> Document:
    return set_path(document, path, value).apply(document)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("key.width", 0.7), ("key.height", 0.05), ("spot.radius", 0.2), ("spot.inner_angle", 25.0),
        ("spot.outer_angle", 60.0), ("spot.target", (0.5, 0.0, -1.0)), ("key.target", (0.0, 0.3, 0.0)),
    ],
)  # fmt: skip
def test_what_a_path_sets_is_read_again_and_outlives_a_session(
    lit: Document, path: str, value: Any, tmp_path: Path
) -> None:
    found = put(lit, path, value)
    assert value_at(found, path) == pytest.approx(value, rel=1e-6, abs=1e-9)
    assert found.object(path.partition(".")[0]).name in dict(found.poses)
    file = tmp_path / "a.session.toml"
    file.write_text(dump_session(found, ViewState()))
    again = fit_session(load_session(file), lit, str(file))
    assert again == found and again.poses == found.poses


def test_what_scales_a_lamp_is_its_size(lit: Document) -> None:
    found = MoveObject("spot", scale=(3.0, 3.0, 3.0)).apply(lit)
    assert value_at(lit, "spot.radius") == pytest.approx(0.05) and value_at(found, "spot.radius") == pytest.approx(0.15)
    # The radiance stays.
    assert put(lit, "key.width", 3.0).object("key").emission == lit.object("key").emission


def test_a_rectangle_askew_is_scaled_along_its_sides_and_back(lit: Document) -> None:
    found = put(put(lit, "key.width", 0.8), "key.height", 0.2)
    transform = found.object("key").transform
    assert transform.scale == pytest.approx((2.0, 1.0, 1.0)) and transform.axes == pytest.approx((0.0, 0.0, 53.1301024))
    assert SetTransform("key").apply(found) == lit


def test_the_angle_that_is_set_counts(lit: Document) -> None:
    for inner, outer in ((50.0, 60.0), (5.0, 20.0), (0.0, 90.0)):
        one = put(put(lit, "spot.inner_angle", inner), "spot.outer_angle", outer)
        other = put(put(lit, "spot.outer_angle", outer), "spot.inner_angle", inner)
        assert one.object("spot").cone == other.object("spot").cone == Cone(inner, outer)
    assert put(lit, "spot.outer_angle", 4.0).object("spot").cone == Cone(4.0, 4.0)
    assert SetCone("spot", 10.0, 30.0).apply(lit) == lit  # that of the file is none of its own


def test_a_target_goes_along_and_is_seen_from_where_the_light_is(lit: Document) -> None:
    found = SetTarget("spot", (1.0, 0.0, 0.0)).apply(lit)
    moved = MoveObject("spot", by=(0.0, 0.0, 2.0)).apply(found)
    assert value_at(moved, "spot.target") == pytest.approx((1.0, 0.0, 2.0))
    commands = SetTarget("spot", (0.0, 0.0, 0.0)), SetCone("spot"), SetLampSize("key", "width", 1.0)
    assert [each.label for each in commands] == ["aim spot", "cone of spot", "width of key"]


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("key.width", -1, "width = -1"),
        ("key.width", 1e5, "expected 0.0004 m to 400 m"),
        ("key.width", "wide", "expected a number"),
        ("key.radius", 1.0, "key has no radius; expected width, height, target"),
        ("key.outer_angle", 1.0, "key has no outer_angle; expected width, height, target"),
        ("bulb.target", [0, 0, 0], "bulb shines to all sides"),
        ("spot.target", [0, 0], "three numbers"),
        ("spot.target", [0, 2, 0], "own centre"),
        ("spot.inner_angle", 91, "expected a number from 0 to 90"),
        ("spot.outer_angle", 0, "expected a number from 0.05 to 90"),
        ("spot.outer_angle", True, "expected a number"),
        ("pot.width", 1.0, "pot"),
    ],
)
def test_bad_values_are_refused_in_a_line(lit: Document, path: str, value: Any, reason: str) -> None:
    with pytest.raises(InsituError, match=reason.replace("[", r"\[")) as refused:
        put(lit, path, value)
    assert "\n" not in str(refused.value)


def test_deform_is_told_of_cones(lit: Document) -> None:
    found = put(put(lit, "spot.outer_angle", 40.0), "spot.position", (1.0, 0.0, 0.0))
    expected = (Cone(10.0, 40.0), Transform((1.0, 0.0, 0.0)))
    assert moved_objects(found) == ((), (("spot", expected),))


def test_edits_outlive_files_that_are_saved_again(lit: Document) -> None:
    edited = put(put(lit, "spot.outer_angle", 40.0), "spot.radius", 0.1)
    larger = [{**each, "cone": {"inner": 5, "outer": 40}} if each["name"] == "spot" else each for each in LAMPS]
    now = SceneChange(lit, described(larger))(edited)
    assert now.object("spot").cone == Cone(10.0, 40.0) and value_at(now, "spot.radius") == pytest.approx(0.1)
    without = [{key: value for key, value in each.items() if key != "cone"} for each in LAMPS]
    assert SceneChange(lit, described(without))(edited).object("spot").cone is None


def test_any_sequence_reads_back_what_was_set_last(lit: Document) -> None:
    """Each value is the last one that was set, but for what another one takes along."""
    rng, document = random.Random(5), lit
    for _ in range(200):
        name, field = rng.choice((
            ("key", "width"), ("key", "height"), ("spot", "radius"), ("spot", "inner_angle"), ("spot", "outer_angle"),
            ("key", "target"), ("spot", "target"),
        ))  # fmt: skip
        value: Any = rng.uniform(0.1, 2.0)
        if field == "target":
            value = (rng.uniform(-2, 2), rng.uniform(-1, 1), rng.uniform(-2, 2))
        elif field.endswith("angle"):
            value = rng.uniform(0.1, 90.0)
        before, document = document, put(document, f"{name}.{field}", value)
        assert value_at(document, f"{name}.{field}") == pytest.approx(value, rel=1e-6, abs=1e-6)
        kept = {"width": "height", "height": "width"}.get(field)
        if kept is not None:
            assert value_at(document, f"{name}.{kept}") == pytest.approx(value_at(before, f"{name}.{kept}"))
        cone = document.object("spot").cone
        assert cone is not None and 0.0 <= cone.inner <= cone.outer <= 90.0
    for name in ("key", "spot"):
        document = SetTransform(name).apply(document)
        document = document.with_object(replace(document.object(name), new_cone=None, target_distance=None))
    assert document == lit
