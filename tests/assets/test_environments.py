"""The committed environments: right frames, right energy, no surprises for a loader."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from assets.generate import hall, sky, studio
from assets.generate.environments import ENVIRONMENTS
from assets.generate.panorama import HEIGHT, WIDTH, directions, hashed, noise, panorama, save_exr
from assets.generate.scenes import LIT_BY

ASSETS = Path(__file__).resolve().parents[2] / "assets"


def load(name: str) -> np.ndarray:
    with OpenEXR.File(str(ASSETS / "environments" / f"{name}.exr")) as file:
        return file.channels()["RGB"].pixels.astype(np.float64)


def solid_angles() -> np.ndarray:
    """(HEIGHT, 1) exact solid angle of a texel in each row."""
    edges = np.cos(np.pi * np.arange(HEIGHT + 1) / HEIGHT)
    return ((edges[:-1] - edges[1:]) * 2 * np.pi / WIDTH)[:, None]


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_committed_environment_is_sound(name: str) -> None:
    image = load(name)
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert np.isfinite(image).all() and image.min() >= 0
    luminance = image @ (0.2126, 0.7152, 0.0722)
    mean = (luminance * solid_angles()).sum() / (4 * np.pi)
    assert 0.2 < mean < 2  # a white thing is bright at exposure 1, and does not burn out
    assert luminance.max() / np.median(luminance) > 100  # real contrast: that is what the editor is for


@pytest.mark.parametrize(("scene", "name"), LIT_BY.items())
def test_scene_holds_a_copy_of_its_environment(scene: str, name: str) -> None:
    original = ASSETS / "environments" / f"{name}.exr"
    assert (ASSETS / "scenes" / scene / f"{name}.exr").read_bytes() == original.read_bytes()


def test_directions_follow_the_conventions() -> None:
    d = directions(256, 512)
    assert np.allclose(d[127:129, 255:257].mean(axis=(0, 1)), (0, 0, -1), atol=1e-4)  # the centre looks along -Z
    assert d[0, :, 1].min() > 0.99  # +Y is up
    assert np.allclose(d[128, 384], (1, 0, 0), atol=0.02)  # a quarter to the right lies +X
    assert np.allclose(np.linalg.norm(d, axis=2), 1)


def test_panorama_averages_by_solid_angle() -> None:
    image = panorama(lambda d: np.abs(d[:, :1]) * np.ones(3))
    # The mean of |x| over the sphere is 1/2.
    assert (image[..., 0] * solid_angles()).sum() / (4 * np.pi) == pytest.approx(0.5, rel=1e-4)


def test_suns_energy_reaches_the_picture() -> None:
    image = load("sky")
    d = directions(HEIGHT, WIDTH)
    near = d @ sky.sun_direction() > np.cos(np.radians(2.0))
    background = sky.sky_radiance(d[near])
    irradiance = ((image[near] - background) * np.broadcast_to(solid_angles(), near.shape)[near][:, None]).sum(axis=0)
    # 92 klx at 25 kcd/m² to one, tinted; half floats and the sky's curvature behind it cost a little.
    assert np.allclose(irradiance, sky.sun_irradiance(), rtol=0.01)


def test_sky_is_blue_above_and_brightest_about_the_sun() -> None:
    zenith, opposite, beside = (
        sky.sky_radiance(np.array([d]) / np.linalg.norm(d))[0]
        for d in ((0, 1, 0), -sky.sun_direction() * (1, -1, 1), sky.sun_direction() + (0, 0.08, 0))
    )
    assert zenith[2] > 1.3 * zenith[0]
    assert beside.sum() > 4 * opposite.sum()


def test_studio_keeps_dark_between_its_lights() -> None:
    d = directions(HEIGHT, WIDTH).reshape(-1, 3)
    lit = sum(box.seen(d) for box in studio.BOXES).max(axis=1) > 0.01
    assert 0.02 < lit.mean() < 0.2
    assert studio.surroundings(d).max() < 0.6 < studio.radiance(d).max() / 50


def test_soft_box_is_seen_where_it_stands() -> None:
    box = studio.SoftBox((0.0, 0.0, -2.0), (2.0, 1.0), (3.0, 3.0, 3.0), fade=0.0, edge=0.01)
    seen = box.seen(np.array([[0, 0, -1.0], [0.4, 0, -0.917], [0, 0.4, -0.917], [0, 0, 1.0]]))[:, 0]
    # It reaches 1 m to the side and 0.5 m up at 2 m: the second meets it, the third passes above, the last looks away.
    assert np.allclose(seen, (3, 3, 0, 0), atol=1e-9)


def test_hall_mirrors_its_windows_in_the_floor() -> None:
    rng = np.random.default_rng(2)
    d = rng.normal(size=(4000, 3))
    d[:, 1] = -np.abs(d[:, 1])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    at = d * hall.LOW[1] / d[:, 1:2]
    floor = ((at > hall.LOW + 1e-3) & (at < hall.HIGH - 1e-3))[:, [0, 2]].all(axis=1)
    marble = floor & (np.abs(at[:, 0] - hall.MIDDLE) > hall.RUNNER)
    gained = hall.radiance(d) - hall._traced(np.zeros_like(d), d, mirror=False)
    # What an eye as deep below the floor as ours stands above it would see, looking up: the mirrored room.
    below = np.broadcast_to([0, 2 * hall.LOW[1], 0], d.shape)
    seen = hall._traced(below, d * (1, -1, 1), mirror=False)
    share = 0.06 + 0.94 * (1 + d[:, 1:2]) ** 5
    lamps = gained.min(axis=1) == 0  # a lamp hides the floor, or stands in the mirrored eye's way
    assert np.median(np.abs(gained - share * seen)[marble]) < 1e-3
    assert (gained[floor & ~marble] == 0).all()
    assert gained[marble & ~lamps].max() > 1  # the windows show


def test_save_refuses_what_half_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not fit half"):
        save_exr(np.full((2, 4, 3), 70000.0), tmp_path / "a.exr")


def test_hash_and_noise_are_even_and_repeatable() -> None:
    cells = (
        np.stack(np.meshgrid(np.arange(-50, 50), np.arange(100), indexing="ij"), axis=-1).reshape(-1, 2).astype(float)
    )
    values = hashed(cells)
    counts = np.histogram(values, 10, (0, 1))[0]
    assert ((counts - 1000) ** 2 / 1000).sum() < 27.9  # chi-square, 9 degrees of freedom, p = 0.001
    assert np.array_equal(values, hashed(cells))
    points = np.random.default_rng(1).uniform(-9, 9, (2000, 2))
    assert np.abs(noise(points) - noise(points + 1e-6)).max() < 1e-4  # continuous across cells
    assert 0 <= noise(points).min() < 0.3 and 0.7 < noise(points).max() <= 1
