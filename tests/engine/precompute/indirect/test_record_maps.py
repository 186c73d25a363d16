"""Images at the cells: energy in closed forms, and rooms of textured walls against paths through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.material.layer_maps import LayerMaps
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect import record_maps
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.irradiance_cache import NO_OBJECT
from engine.precompute.indirect.record_maps import RecordMaps
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.reference.path_tracer import trace_halves
from engine.render.still import StillLayer, by_object, indirect_radiance, with_maps
from engine.scene.map_sampler import mean_factor
from tests.engine.precompute.indirect.small_scenes import (
    LAMP,
    LAMP_RADIANCE,
    LAMP_SIDE,
    QUICK,
    SPHERE,
    matt,
    placed,
    placement_of,
    solve,
)

DARK, LIGHT = 0.1, 0.9
# Cells that cross the edge of the wainscot have the mean of both sides' light.
FINER = replace(QUICK, n_cache_records=8000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an image that is dark in its lower quarter, one that is even, and a checker of 8 x 8 fields."""
    folder = tmp_path_factory.mktemp("walls")
    rows = np.arange(256)[:, None] + np.zeros(256)
    save(folder / "wainscot.png", np.where(rows >= 192, DARK, LIGHT))
    save(folder / "even.png", np.full((8, 8), 0.5))
    save(folder / "checker.png", np.where(np.indices((256, 256)).sum(axis=0) // 32 % 2 == 0, DARK, LIGHT))
    return folder


def save(path: Path, values: NDArray[np.floating]) -> None:
    Image.fromarray(np.round(255 * values).astype(np.uint8)).save(path)


def level(value: float) -> float:
    """As a file of 8 bits has it."""
    return round(255 * value) / 255


def textured(placement: Placement, i_object: int, layer: Layer, bands: tuple[int, ...] = (16,)) -> IndirectLayer:
    return indirect_layer(i_object, layer, bands, mean=mean_factor(placement.scene, i_object, layer.maps))


def lambert(albedo: float | Sequence[float], image: str = "", **maps: Any) -> Layer:
    values = [albedo] * 3 if isinstance(albedo, float) else list(albedo)
    of_image = {"texture": image, "texture_space": "linear"} if image else {}
    return make_layer(MODELS["lambert"], {"albedo": values}).replace(maps=LayerMaps(**of_image, **maps))


@pytest.fixture(scope="module")
def ball(folder: Path) -> Placement:
    """An integrating sphere whose lamp is near to its lower quarter in latitude, y < -0.707."""
    lamp = LAMP | {"transform": placed(0.0, -0.6, 0.0, LAMP_SIDE)}
    return placement_of([SPHERE, lamp], folder=folder)


@cache
def irradiance_below(y: float) -> tuple[float, float]:
    """Flux on the wall below that latitude, and on all of it, from a cube at (0, -0.6, 0) of these sides and
    radiance: of intensity L s² (|x| + |y| + |z|) towards a unit vector."""
    n = 1200
    theta, phi = (np.arange(n) + 0.5) / n * np.pi, (np.arange(2 * n) + 0.5) / n * np.pi
    sine = np.sin(theta)[:, None]
    wall = np.stack(np.broadcast_arrays(sine * np.cos(phi), np.cos(theta)[:, None], sine * np.sin(phi)), -1)
    way = wall - [0.0, -0.6, 0.0]
    far = np.linalg.norm(way, axis=2)
    intensity = LAMP_RADIANCE * LAMP_SIDE**2 * np.abs(way / far[..., None]).sum(axis=2)
    cosine = np.einsum("ijk,ijk->ij", wall, way) / far
    flux = intensity * cosine / far**2 * sine * (np.pi / n) ** 2
    return float(flux[wall[..., 1] < y].sum()), float(flux.sum())


@pytest.mark.parametrize("n_bounces", [2, 3, 5])
def test_an_integrating_sphere_of_two_albedos(ball: Placement, n_bounces: int) -> None:
    # The wall sees every part of itself alike, so that after one reflection it has ∫ρ E_0 / A everywhere, and with
    # every further one the mean of ρ by area times as much. Of that the dark cap has but a seventh: cos 45° below.
    dark, light, cap = 0.8 * level(DARK), 0.8 * level(LIGHT), (1.0 - np.sqrt(0.5)) / 2.0
    below, whole = irradiance_below(-np.sqrt(0.5))
    assert whole == pytest.approx(6 * LAMP_SIDE**2 * np.pi * LAMP_RADIANCE, rel=2e-3) and 0.4 < below / whole < 0.9
    once = (dark * below + light * (whole - below)) / (4 * np.pi)
    mean = dark * cap + light * (1.0 - cap)
    irradiance = once * (mean ** np.arange(n_bounces - 1)).sum()
    layer = textured(ball, 0, lambert(0.8, "wainscot.png"))
    assert layer.share == pytest.approx([mean / 0.8] * 3, rel=2e-3)
    found = solve(ball, [layer], n_bounces, FINER).picture([layer])
    # What gather points send to the eye has the image's mean here, which the picture puts right pixel by pixel.
    assert found.mean() == pytest.approx(mean / np.pi * irradiance, rel=0.01)
    # By the mean of the image at the cells it would be a third too bright.
    assert (mean * whole / (4 * np.pi)) / once > 1.3


def test_a_furnace_of_textured_walls(ball: Placement) -> None:
    # A closed furnace in the limit: of an even texture all the light there is, B = ρ E / (1 - ρ) in the end.
    layer, plain = textured(ball, 0, lambert(0.9, "even.png")), lambert(0.9 * level(0.5))
    found = solve(ball, [layer], 16)
    flux = 6 * LAMP_SIDE**2 * np.pi * LAMP_RADIANCE
    albedo = 0.9 * level(0.5)
    expected = albedo / np.pi * flux / (4 * np.pi) * albedo / (1.0 - albedo)
    assert found.picture([layer]).mean() == pytest.approx(expected, rel=0.01)
    # An even image is another albedo, to the last digits.
    other = indirect_layer(0, plain, (16,))
    np.testing.assert_allclose(found.picture([layer]), found.picture([other]), rtol=1e-5)


def test_albedos_of_edits_stay_powers(ball: Placement) -> None:
    layer = textured(ball, 0, lambert(0.8, "wainscot.png"))
    found = solve(ball, [layer], 4)
    bright = found.radiosity([layer], 0)
    assert bright.shape[1] == 4
    for albedo in (0.0, 0.3, 1.2):
        changed = [replace(layer, albedo=np.full(3, albedo))]
        plain = found.radiosity(changed, NO_OBJECT)[:, 0]
        powers = albedo ** np.arange(4)[:, None]
        np.testing.assert_allclose((bright * powers).sum(axis=1), plain, rtol=1e-5, atol=1e-6 * plain.max() + 1e-12)


def test_strength_weight_and_strokes_count_at_the_cells(ball: Placement) -> None:
    dab = Stroke(0.7, 1.0, 1.0, 1.0, pack_dabs([0.0, -1.0, 0.0], [0.0, -1.0, 0.0]))
    layers = {
        "half": lambert(0.8, "wainscot.png", texture_strength=0.5),
        "weight": lambert(0.8, weight="wainscot.png"),
        "inverted": lambert(0.8, weight="wainscot.png", weight_invert=True),
        "painted": lambert(0.8, weight_start=0.0, strokes=Strokes((dab,))),
    }
    found = solve(ball, [textured(ball, 0, layers["half"])], 2, FINER)
    table = found.cache.table()
    wall = np.flatnonzero(table.objects == 0)
    of_place = ball.scene.vertices[ball.scene.triangles[table.triangle[wall]], 1].mean(axis=2)
    there = np.arange(of_place.shape[1]) < table.n_places[wall, None]
    lowest, highest = np.where(there, of_place, 1.0).min(axis=1), np.where(there, of_place, -1.0).max(axis=1)
    # An image repeats, so that its upper edge is beside its lower one.
    low, high, near = wall[highest < -0.78], wall[(lowest > -0.6) & (highest < 0.9)], wall[highest < -0.9]
    assert len(low) > 30 and len(high) > 30 and len(near) > 10
    expected = {"half": (0.55, 0.95), "weight": (DARK, LIGHT), "inverted": (LIGHT, DARK), "painted": (1.0, 0.0)}
    for name, layer in layers.items():
        own = textured(ball, 0, layer)
        factor = found.cache.maps.reflectance([own], 2).relative * own.share
        of_low = factor[near if name == "painted" else low]
        # But for a few cells whose places are far apart: there images are read as coarsely.
        for values, value in zip((of_low, factor[high]), expected[name], strict=True):
            assert np.quantile(np.abs(values - value), 0.98) < 0.01, name


# A room whose lamp stands low, over a dark wainscot; its front shines upwards.
ROOM = [
    {"name": "walls", "primitive": "cube", "smooth": False, "transform": placed(0, 0, 0, 4, 3, 6)},
    {"name": "floor", "primitive": "cube", "smooth": False, "transform": placed(0, -1.5, 0, 3.99, 0.02, 5.99)},
    {"name": "block", "primitive": "cube", "smooth": False, "transform": placed(0.8, -0.9, -1.2, 0.9, 1.2, 0.8)},
    {
        "name": "lamp", "primitive": "quad", "emission": [30.0, 28.0, 24.0],
        "transform": [0.5, 0, 0, -1.2, 0, 0, 0.5, -0.6, 0, -0.5, 0, 1.0, 0, 0, 0, 1],
    },
]  # fmt: skip


FEWER = replace(STILL, n_photons=1 << 17, n_rays=512, n_cache_records=8000)


def room_layers() -> list[tuple[int, Layer]]:
    gloss = {"alpha": 0.15, "eta": [1.5] * 3, "k": [0.0] * 3, "scale": 1.0}
    copper = {"alpha": 0.2, "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.5, 2.4], "scale": 1.0}
    checker = LayerMaps("checker.png", "linear")
    return [
        (0, lambert(0.85, "wainscot.png")), (1, lambert(0.7, "checker.png")),
        (1, make_layer(MODELS["rough_conductor"], gloss)),
        (2, make_layer(MODELS["rough_conductor"], copper).replace(maps=checker)),
    ]  # fmt: skip


def test_light_between_textured_walls_has_the_mean_of_paths(folder: Path) -> None:
    placement = placement_of(ROOM, eye=(0.0, 0.2, 2.8), target=(0.1, -0.4, -1.0), n=16, folder=folder)
    hits, sky = placement.hits, SkyState(None)
    layers = with_maps(placement, [StillLayer(i, layer, bands_of(layer), False) for i, layer in room_layers()])
    ours = run_to_end(indirect_radiance(placement, layers, sky, BounceSeries(4), FEWER), lambda step: None)
    halves = run_to_end(trace_halves(placement, by_object(layers), sky, 4, 512, 1, np.arange(len(hits.pixel))))
    # By the means of the images it was 6.5 % too dark.
    off, chance = mean_and_chance(ours, halves[:, :, 1] - halves[:, :, 0])
    assert chance < 0.004 and abs(off) < 0.005 + 2.0 * chance, (off, chance)


def bands_of(layer: Layer) -> tuple[int, int]:
    return (16, 1) if layer.model.is_diffuse else (64, 16)


def mean_and_chance(ours: NDArray[np.floating], halves: NDArray[np.floating]) -> tuple[float, float]:
    """The relative difference of means (P, 3) from halves of paths (2, P, 3), and what chance these have in it."""
    truth = halves.mean(axis=0)
    chance = 0.5 * float(np.linalg.norm((halves[0] - halves[1]).mean(axis=1))) / len(truth)
    return float(ours.mean() / truth.mean()) - 1.0, chance / float(truth.mean())


def test_without_maps_records_have_the_reflectance_of_their_object() -> None:
    metal = indirect_layer(1, make_layer(MODELS["rough_conductor"], {"alpha": 0.3}), (32, 8))
    layers = [matt(0, 0.5), metal, matt(1, 0.3)]
    objects = np.array([1, 0, 2, 1, 0])
    table = SimpleNamespace(objects=objects)
    found = RecordMaps(None, table).reflectance(layers, 3)  # type: ignore[arg-type]
    expected = record_maps._reflectance(layers, [None] * 3, objects, 3)
    for name in ("relative", "diffuse", "slant", "texels"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.image == expected.image and found.slant is not None and not (found.slant == 1.0).all()
