"""What a gloss sends on of light from one direction, against sums over all directions that it goes to, and paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layer, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect.albedo import slant_roots
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.reference.path_tracer import trace_halves
from engine.render.still import StillLayer, by_object, indirect_radiance
from engine.sphere.geodesic import geodesic
from tests.engine.precompute.indirect.small_scenes import QUICK, matt, placed, placement_of, solve

POLISH = make_layer(MODELS["rough_conductor"], {"alpha": 0.3, "eta": [1.5] * 3, "k": [0.0] * 3, "scale": 1.0})


def directional_albedo(layer: Layer, cosine: float) -> float:
    """∫ ρ(ωi, ωo) cos θ_o dω_o by 81,920 directions."""
    sphere = geodesic(6)
    above = sphere.centres[:, 2] > 1e-4
    wo, solid_angle = sphere.centres[above], sphere.solid_angles[above]
    wi = np.broadcast_to([np.sqrt(1.0 - cosine**2), 0.0, cosine], wo.shape)
    return float((evaluate_layer(layer, wi, wo)[:, 1] / cosine * wo[:, 2] * solid_angle).sum())


@pytest.mark.parametrize("model", ["rough_conductor", "blinn_phong", "lambert"])
def test_a_layer_sends_on_what_all_directions_take(model: str) -> None:
    layer = POLISH if model == "rough_conductor" else make_layer(MODELS[model])
    bands = (128, 32)[: len(layer.model.factors)]
    found = indirect_layer(0, layer, bands)
    for cosine in (0.16, 0.36, 0.64, 1.0):
        ours = np.interp(np.sqrt(cosine), slant_roots(), found.slant[:, 1]) * found.albedo[1]
        assert ours == pytest.approx(directional_albedo(layer, cosine), rel=0.03), cosine
    # The mean over all directions by their cosine is the equivalent albedo.
    cosines = np.sqrt((np.arange(400) + 0.5) / 400)
    mean = np.interp(np.sqrt(cosines), slant_roots(), found.slant[:, 1]).mean()
    assert mean == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize("aside", [0.05, 1.3])
def test_a_floor_sends_on_what_a_lamp_brings_by_its_angle(aside: float) -> None:
    # A lamp of 2 cm over the floor: all its light comes at nearly one angle to each cell.
    floor = {"name": "floor", "primitive": "quad", "transform": [3, 0, 0, 0, 0, 0, 3, -1, 0, -3, 0, 0, 0, 0, 0, 1]}
    wall = {"name": "wall", "primitive": "quad", "transform": placed(0, 0, -1.5, 3, 2, 1)}
    height = 0.5
    lamp = {"name": "lamp", "primitive": "cube", "emission": [100.0] * 3, "transform": placed(0, height - 1, 0, 0.02)}
    placement = placement_of([floor, wall, lamp], eye=(0, 0.5, 1.0), target=(0, -0.6, -1.2))
    layers = [indirect_layer(0, POLISH, (128, 32)), matt(1, 0.5)]
    found = solve(placement, layers, 2, replace(QUICK, n_cache_records=3000)).without_glossy_hits()
    light = found.light
    sent, brought = found.radiosity(layers)[:, 0, 1], light.irradiance[:, 1]
    # Its angle by the hats that light is shared out by: exact where all of it comes at one.
    roots = light.direct[:, :, 1] @ slant_roots() / np.maximum(brought, 1e-20)
    wanted = height / np.hypot(height, aside)
    near = np.flatnonzero((light.objects == 0) & (abs(roots - np.sqrt(wanted)) < 0.03) & (brought > 0.0))
    assert len(near) >= 3
    ratio = np.median(sent[near] / brought[near])
    assert ratio == pytest.approx(directional_albedo(POLISH, wanted), rel=0.12)
    # The equivalent albedo is twice that from above, and less than at a slant.
    assert (ratio < 0.7 * layers[0].albedo[1]) == (aside < 0.5)


def test_light_below_a_low_lamp_has_the_mean_of_paths() -> None:
    # A polished floor: by its equivalent albedo the third bounce was 1.8 ± 0.4 % too bright, all three 0.6 ± 0.2.
    room = {"name": "room", "primitive": "cube", "smooth": False, "transform": placed(0, 0, 0, 4, 3, 6)}
    floor = {"name": "floor", "primitive": "cube", "smooth": False, "transform": placed(0, -1.5, 0, 3.99, 0.02, 5.99)}
    lamp = {
        "name": "lamp", "primitive": "quad", "emission": [30.0, 28.0, 24.0],
        "transform": [0.5, 0, 0, -1.2, 0, 0, -0.5, -0.6, 0, 0.5, 0, 1.0, 0, 0, 0, 1],
    }  # fmt: skip
    placement = placement_of([room, floor, lamp], eye=(0.0, 0.2, 2.8), target=(0.1, -0.4, -1.0), n=20)
    dark = make_layer(MODELS["lambert"], {"albedo": [0.05] * 3})
    white = make_layer(MODELS["lambert"], {"albedo": [0.7] * 3})
    layers = [StillLayer(0, white, (16, 1), False), StillLayer(1, dark, (16, 1), False)]
    layers += [StillLayer(1, POLISH, (128, 32), False)]
    ours = run_to_end(
        indirect_radiance(placement, layers, SkyState(None), BounceSeries(3), replace(STILL, n_photons=1 << 17)),
        lambda step: None,
    )
    rows = np.arange(len(placement.hits.pixel))
    halves = run_to_end(trace_halves(placement, by_object(layers), SkyState(None), 3, 1024, 1, rows))
    indirect = halves[:, :, 1] - halves[:, :, 0]
    truth = indirect.mean(axis=0)
    chance = 0.5 * float(np.linalg.norm((indirect[0] - indirect[1]).mean(axis=1))) / len(truth) / float(truth.mean())
    off = float(ours.mean() / truth.mean()) - 1.0
    assert chance < 0.008 and abs(off) < 0.005 + 2.0 * chance, (off, chance)
