"""Highlights of lamps on sharp gloss: sums over places of the lamp, and coefficients of light without its patches."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.core.frames import local_frames
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layers, make_layer
from engine.precompute.direct.pipeline import Placement
from engine.realtime.triple_product._incident_kernels import compress
from engine.realtime.triple_product._patch_kernels import remove_patches
from engine.realtime.triple_product.incident import hemisphere
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.triple_product.visibility import upper_triangles
from engine.scene.description import parse_description
from engine.scene.scene_loader import Scene, build_scene
from tests.scene_text import camera, facing_down, facing_up, placed

SIZE, SIDE, HEIGHT, RADIANCE = (24, 18), 0.5, 0.8, np.array([5.0, 4.0, 3.0])


def scene() -> Scene:
    """A floor that mirrors a lamp above it, in full view."""
    text = (
        camera((0, 0.8, 1.4), 40, SIZE, (0, 0, 0.1))
        + placed("floor", "quad", facing_up(1.6))
        + placed("lamp", "quad", facing_down(SIDE, (0, HEIGHT, -1.0)), f"emission = {RADIANCE.tolist()}\n")
    )
    return build_scene(parse_description(tomllib.loads(text), "lamp"), Path("lamp.toml"))


def reflected(scene: Scene, layer: Layer, n: int = 96) -> np.ndarray:
    """Radiance (H W, 3) by the layer's formula towards n x n places of the lamp."""
    hits = Placement(scene, None, 0).hits
    x = SIDE * ((np.arange(n) + 0.5) / n - 0.5)
    places = np.stack([*np.meshgrid(x, x - 1.0), np.full((n, n), HEIGHT)], axis=2).reshape(-1, 3)[:, [0, 2, 1]]
    found = np.zeros((SIZE[0] * SIZE[1], 3))
    begin, end = hits.object_ranges[0]
    frames = local_frames(hits.tangent, hits.normal)
    for k in range(begin, end):
        towards = places - hits.position[k]
        squared = (towards**2).sum(axis=1)
        wi, wo = towards @ frames[k].T / np.sqrt(squared)[:, None], frames[k] @ hits.wo[k]
        solid = (SIDE / n) ** 2 * towards[:, 1] / squared**1.5
        value = evaluate_layers([layer], wi, np.tile(wo.astype(np.float64), (len(wi), 1)))
        found[hits.pixel[k]] = RADIANCE * (solid @ value)
    return found


def test_the_highlight_of_a_lamp_is_as_sharp_as_the_gloss() -> None:
    layer, made = make_layer(MODELS["rough_conductor"], {"alpha": 0.05}), scene()
    orbit = Orbit(made, n_points=200)
    orbit.set_bounces(1)
    orbit.set_layers({0: (layer,)})
    for _ in orbit.work():
        pass
    exact = reflected(made, layer)
    on_floor = exact.any(axis=1)
    errors = {}
    for quality in ("moving", "rest", "still"):
        found = orbit.draw(made.description.camera, SIZE, quality).reshape(-1, 3)
        errors[quality] = np.sqrt(((found - exact)[on_floor] ** 2).mean()) / exact[on_floor].mean()
    # While something moves, by triangles of 2.8 degrees.
    assert errors["rest"] < 0.03 and errors["still"] < 0.03 and errors["moving"] > 0.08, errors


@pytest.mark.parametrize("n", [5120, 60])
def test_coefficients_without_patches_are_those_of_what_remains(n: int) -> None:
    # The transform is linear, so that each coefficient that is kept loses what patches add to it; bfloat16 has 8 bits.
    generator, half = np.random.default_rng(0), hemisphere()
    powers = np.zeros((5120, 3), np.float32)
    powers[upper_triangles()] = generator.random((2560, 3)) ** 4
    place = generator.integers(0, 2560, 30)
    patches = (5.0 * generator.random((30, 3))).astype(np.float32)
    together = powers.copy()
    np.add.at(together, half.number[place], patches)

    def compressed(light: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
        number, value = np.empty(n, np.int16), np.empty((n, 3), np.uint16)
        compress(light.copy(), half.place, np.empty((5120, 3), np.float32), np.empty(5120, np.float32), number, value)
        return number, (value.astype(np.uint32) << 16).view(np.float32)

    number, value = compressed(together, n)
    rest, scratch = np.append(value.ravel(), np.float32(0.0)), np.zeros((5120, 3), np.float32)
    remove_patches(place, patches, half.number, number, n, scratch, rest)
    wanted, of_rest = np.zeros((5120, 3), np.float32), compressed(powers, 5120)
    np.add.at(wanted, *of_rest)  # what is not filled adds 0 to number 0
    is_filled = value.any(axis=1)
    expected = wanted[number[is_filled]]
    np.testing.assert_allclose(rest[:-1].reshape(-1, 3)[is_filled], expected, atol=2**-8 * value.max())
    assert not scratch.any() and np.abs(value[is_filled] - expected).max() > 0.1 * value.max()
