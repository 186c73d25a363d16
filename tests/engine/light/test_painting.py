"""Painted lights against closed forms: solid angles, irradiance, symmetry, tilt, seams and poles, and linearity."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.light.environment import LUMINANCE, Environment, constant_environment, texel_solid_angles
from engine.light.map_changes import MapChange, changed_map, hue_matrix
from engine.light.painted_lights import PaintedLight, tilt_matrix
from engine.light.painting import painted_environment

DARK = constant_environment(0.0)
HARD_BOX = PaintedLight("key", "box", width=30.0, height=50.0, softness=0.0, radiance=(1.0, 1.0, 1.0))
DISC = PaintedLight("disc", "disc", elevation=90.0, width=20.0, softness=0.0, radiance=(2.0, 2.0, 2.0))


def total(environment: Environment) -> np.ndarray:
    """The integral of radiance over the sphere, (3,)."""
    image = environment.radiance
    return np.einsum("hwc,h->c", image, texel_solid_angles(*image.shape[:2]), dtype=np.float64)


def irradiance(environment: Environment) -> float:
    """Of a horizontal plane, by the exact integral of cos theta over each texel."""
    image = environment.radiance[..., 1].astype(np.float64)
    edges = np.sin(np.minimum(math.pi * np.arange(len(image) + 1) / len(image), 0.5 * math.pi)) ** 2
    return float(image.mean(axis=1) @ (math.pi * np.diff(edges)))


@pytest.mark.parametrize("azimuth", [0.0, 180.0, 77.3])
@pytest.mark.parametrize(
    ("elevation", "rotation"), [(0.0, 0.0), (88.0, 13.0), (90.0, 45.0), (-90.0, 0.0), (45.0, 60.0)]
)
def test_a_box_has_the_solid_angle_of_its_pyramid_wherever_it_is(azimuth: float, elevation: float, rotation: float):
    # 4 asin(sin(w/2) sin(h/2)), across the seam and over the poles as well
    light = replace(HARD_BOX, azimuth=azimuth, elevation=elevation, rotation=rotation)
    expected = 4.0 * math.asin(math.sin(math.radians(15.0)) * math.sin(math.radians(25.0)))
    assert total(painted_environment(DARK, (light,))) == pytest.approx(expected, rel=1e-3)


def test_the_irradiance_of_a_disc_at_the_zenith_is_pi_l_sine_squared():
    expected = math.pi * 2.0 * math.sin(math.radians(10.0)) ** 2
    assert irradiance(painted_environment(DARK, (DISC,))) == pytest.approx(expected, rel=1e-3)


def test_the_irradiance_of_a_soft_disc_is_that_of_its_discs():
    # f(t) = ∫ -f'(r) [t < r] dr: a soft disc is a sum of hard ones, of pi L sin² r each
    softness, radius = 0.6, math.radians(25.0)
    q = (np.arange(20000) + 0.5) / 20000
    rims = radius * (1.0 - softness * q)
    expected = 2.0 * math.pi * float((6.0 * q * (1.0 - q) * np.sin(rims) ** 2).mean())
    soft = replace(DISC, width=50.0, softness=softness)
    assert irradiance(painted_environment(DARK, (soft,))) == pytest.approx(expected, rel=1e-3)


def test_a_soft_box_is_symmetric():
    box = painted_environment(
        DARK, (PaintedLight("key", elevation=0.0, width=60.0, height=40.0, softness=0.7),)
    ).radiance
    assert np.allclose(box, box[:, ::-1], atol=0.01)
    assert np.allclose(box, box[::-1], atol=0.01)
    # it fades from its radiance in the middle to nothing at its rim, and falls all the way
    row = box[len(box) // 2, box.shape[1] // 2 :, 0]
    assert row[0] == pytest.approx(4.0)
    assert (np.diff(row) <= 1e-6).all()
    assert row[math.ceil(30.5 / 360.0 * box.shape[1])] == 0.0


def test_there_is_no_seam():
    # the same light turned by a whole number of columns is the same image, rolled
    ahead = painted_environment(DARK, (replace(HARD_BOX, softness=0.3),)).radiance
    behind = painted_environment(DARK, (replace(HARD_BOX, softness=0.3, azimuth=180.0),)).radiance
    assert np.allclose(np.roll(ahead, ahead.shape[1] // 2, axis=1), behind, atol=1e-5)


def test_tilted_light_is_as_much_and_where_it_should_be():
    light = replace(HARD_BOX, azimuth=30.0, elevation=20.0)
    straight, tilted = (painted_environment(DARK, (light,), tilt) for tilt in (0.0, 35.0))
    assert total(tilted) == pytest.approx(total(straight), rel=1e-3)
    towards = tilt_matrix(35.0) @ light.frame[2]
    assert tilted.evaluate(towards[None]) == pytest.approx(1.0)
    assert tilt_matrix(90.0) @ [0.0, 0.0, -1.0] == pytest.approx([0.0, 1.0, 0.0])  # ahead rises to the zenith


def test_a_tilted_map_keeps_its_light_and_a_tilt_back_restores_it():
    rng = np.random.default_rng(1)
    smooth = Environment(
        np.repeat(np.repeat(rng.uniform(0.5, 1.5, (8, 16, 3)), 16, 0), 16, 1).astype(np.float32), "map"
    )
    tilted = painted_environment(smooth, (), 50.0)
    assert total(tilted) == pytest.approx(total(smooth), rel=1e-5)
    directions = rng.normal(size=(500, 3))
    there = tilted.evaluate(directions @ tilt_matrix(50.0).T) - painted_environment(smooth, (), 1e-9).evaluate(
        directions
    )
    assert np.sqrt((there**2).mean()) < 0.03


def test_order_and_covering():
    grey, below, card = (
        constant_environment(0.5), replace(HARD_BOX, name="below"),
        replace(HARD_BOX, name="card", blend="cover", width=10.0, height=10.0, opacity=0.25, radiance=(8.0, 0.0, 0.0)),
    )  # fmt: skip
    ahead = HARD_BOX.frame[2][None]
    # 0.5 + 1 is below; a quarter of it is covered by 8
    assert painted_environment(grey, (below, card)).evaluate(ahead)[0] == pytest.approx([3.125, 1.125, 1.125])
    # what is added over the card is not covered: 0.5 * 0.75 + 2 + 1
    assert painted_environment(grey, (card, below)).evaluate(ahead)[0] == pytest.approx([3.375, 1.375, 1.375])


def test_lights_alone_sum_to_all_of_them():
    lights = (
        replace(HARD_BOX, name="a"),
        PaintedLight("b", "disc", "cover", elevation=45.0, width=30.0, radiance=(1.0, 2.0, 3.0), opacity=0.7),
        PaintedLight("c", "gradient", radiance=(0.3, 0.2, 0.1), far=(0.0, 0.1, 0.2), width=120.0, gain=(1.0, 0.5, 2.0)),
        PaintedLight("d", "sky", "cover", elevation=20.0, radiance=(0.1, 0.1, 0.1), opacity=0.5, sun=0.0),
    )
    grey = constant_environment(0.5)
    covers = [each.alone()[0].dark() if each.covers else None for each in lights]
    summed = painted_environment(grey, tuple(c for c in covers if c)).radiance.astype(np.float64)
    for place, each in enumerate(lights):
        white, weight = each.alone()
        over = tuple(c for c in covers[place + 1 :] if c)
        summed = summed + np.array(weight) * painted_environment(DARK, (white, *over)).radiance
    assert np.allclose(summed, painted_environment(grey, lights).radiance, rtol=1e-4, atol=1e-5)


def test_a_gradient_goes_from_one_end_to_the_other():
    light = PaintedLight(
        "ramp", "gradient", elevation=90.0, width=180.0, softness=0.0, radiance=(1.0, 1.0, 1.0), far=(0.0, 0.5, 0.0)
    )
    found = painted_environment(DARK, (light,)).evaluate([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    assert found[:, 0] == pytest.approx([1.0, 0.5, 0.0], abs=3e-3)
    assert found[:, 1] == pytest.approx([1.0, 0.75, 0.5], abs=3e-3)


def test_images_are_the_right_way_round(tmp_path: Path):
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0], pixels[0, 1] = (255, 0, 0, 255), (0, 255, 0, 255)  # red, green
    pixels[1, 0], pixels[1, 1] = (0, 0, 255, 255), (255, 255, 255, 0)  # blue, nothing
    Image.fromarray(pixels, "RGBA").resize((64, 64), Image.Resampling.NEAREST).save(tmp_path / "card.png")
    card = PaintedLight(
        "card", "image", "cover", elevation=0.0, softness=0.0, radiance=(1.0, 1.0, 1.0), file=str(tmp_path / "card.png")
    )
    # looking along -Z, right is +X
    quarters = np.array([[-0.2, 0.2, -1.0], [0.2, 0.2, -1.0], [-0.2, -0.2, -1.0], [0.2, -0.2, -1.0]])
    found = painted_environment(constant_environment(0.25), (card,)).evaluate(quarters)
    expected = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.25, 0.25, 0.25]]
    assert found == pytest.approx(np.array(expected), abs=1e-5)
    whole = replace(card, placement="panorama", azimuth=90.0)
    seen = painted_environment(constant_environment(0.25), (whole,)).evaluate([[0.1, 0.1, -0.1], [0.1, 0.1, 0.1]])
    assert seen == pytest.approx(np.array(expected[:2]), abs=1e-5)  # its middle is at +X, red is left of it
    with pytest.raises(LoadError, match="no_such"):
        painted_environment(DARK, (replace(card, file=str(tmp_path / "no_such.png")),))


def test_hue_turns_colours_and_keeps_luminance():
    for degrees in (30.0, -100.0, 180.0):
        matrix = hue_matrix(degrees)
        assert matrix @ np.ones(3) == pytest.approx(np.ones(3))  # grey stays grey
        assert LUMINANCE @ matrix == pytest.approx(LUMINANCE)
    assert hue_matrix(120.0) @ hue_matrix(240.0) == pytest.approx(np.eye(3), abs=1e-9)


def test_contrast_and_clamp():
    image = np.full((4, 8, 3), 1.0, np.float32)
    image[1, 2] = (40.0, 20.0, 10.0)
    flat = changed_map(Environment(image, "map"), MapChange(contrast=0.0)).radiance @ LUMINANCE
    assert flat == pytest.approx(np.full((4, 8), flat[0, 0]), rel=1e-4)  # no contrast: even luminance
    clamped = changed_map(Environment(image, "map"), MapChange(clamp=4.0)).radiance
    assert clamped[1, 2] == pytest.approx([4.0, 2.0, 1.0])  # of the same colour
    assert clamped[0, 0] == pytest.approx(1.0)
