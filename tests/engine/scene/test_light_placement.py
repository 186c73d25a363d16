"""Lights placed by their highlight and by a shadow, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.light_placement import PlacedLight, rotation_between
from engine.scene.transform import Transform, rotation_matrix

RANDOM = np.random.default_rng(4)


def unit(n: int = 3) -> np.ndarray:
    vector = RANDOM.normal(size=n)
    return vector / np.linalg.norm(vector)


def some_light() -> PlacedLight:
    rotation = tuple(RANDOM.uniform(-180.0, 180.0, 3).tolist())
    return PlacedLight(RANDOM.normal(size=3), unit(), Transform((0.3, -0.2, 2.0), rotation, (2.0, 1.0, 0.5)))


def assert_shines_on(light: PlacedLight, moved: Transform, point: np.ndarray) -> np.ndarray:
    """It is as far from the point as before, turned towards it and as large; returns the direction to it."""
    centre = light.pivot + moved.translation
    assert np.linalg.norm(centre - point) == pytest.approx(np.linalg.norm(light.centre - point))
    towards = (centre - point) / np.linalg.norm(centre - point)
    assert light.facing is not None and moved.scale == light.transform.scale
    np.testing.assert_allclose(rotation_matrix(moved.rotation) @ light.facing, -towards, atol=1e-9)
    return towards


@pytest.mark.parametrize("_", range(20))
def test_the_highlight_is_where_it_was_asked_for(_: int) -> None:
    """The half vector of the directions to the light and to the eye is the normal."""
    light, point, normal = some_light(), RANDOM.normal(size=3), unit()
    eye = point + RANDOM.uniform(0.1, 5.0) * unit()
    eye += 2.0 * max(0.0, -(eye - point) @ normal) * normal  # in front of the surface
    towards = assert_shines_on(light, light.by_highlight(point, normal, eye), point)
    half = towards + (eye - point) / np.linalg.norm(eye - point)
    np.testing.assert_allclose(half / np.linalg.norm(half), normal, atol=1e-9)


@pytest.mark.parametrize("_", range(20))
def test_the_shadow_of_a_point_falls_where_it_was_asked_for(_: int) -> None:
    light, caster, receiver = some_light(), RANDOM.normal(size=3), RANDOM.normal(size=3)
    towards = assert_shines_on(light, light.by_shadow(caster, receiver), caster)
    np.testing.assert_allclose(towards, (caster - receiver) / np.linalg.norm(caster - receiver), atol=1e-9)


def test_nothing_moves_where_there_is_no_such_place() -> None:
    light = some_light()
    assert light.by_highlight((0, 0, 0), (0, 0, 1), (0, 0, -2)) == light.transform  # seen from behind
    assert light.by_highlight((0, 0, 0), (0, 0, 1), (0, 0, 0)) == light.transform
    assert light.by_shadow((1, 2, 3), (1, 2, 3)) == light.transform
    bulb = PlacedLight(np.zeros(3), None, Transform((0.0, 0.0, 2.0), (10.0, 20.0, 30.0)))
    assert bulb.by_shadow((0, 0, 0), (-1, 0, 0)) == Transform((2.0, 0.0, 0.0), (10.0, 20.0, 30.0))


def test_opposite_directions_are_half_a_turn_apart() -> None:
    for start in (*np.eye(3), unit()):
        turned = rotation_between(start, -start)
        np.testing.assert_allclose(turned @ start, -start, atol=1e-12)
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turned) == pytest.approx(1.0)


def test_a_light_is_aimed_from_where_it_is_and_turned_no_further_than_that_takes() -> None:
    start = Transform((1.0, 2.0, 0.0), (10.0, 20.0, 30.0), (2.0, 1.0, 1.0))
    light = PlacedLight(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), start)
    point = np.array([-2.0, 0.5, 4.0])
    aimed = light.aimed_at(point)
    assert (aimed.translation, aimed.scale) == (start.translation, start.scale)
    before, after = rotation_matrix(start.rotation), rotation_matrix(aimed.rotation)
    towards = (point - light.centre) / np.linalg.norm(point - light.centre)
    assert light.facing is not None and after @ light.facing == pytest.approx(towards)
    # The angle of the rotation between is that between the two directions.
    turned = np.arccos(np.clip((np.trace(after @ before.T) - 1.0) / 2.0, -1.0, 1.0))
    assert turned == pytest.approx(np.arccos(before @ light.facing @ towards))
    assert light.aimed_at(light.centre) is start
    assert PlacedLight(light.pivot, None, start).aimed_at(point) is start
