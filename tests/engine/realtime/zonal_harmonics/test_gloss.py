"""Gloss in low bands: no rings under a small light, whatever the layer; and what it is off is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import LUMINANCE, Environment
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layer, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.deform_engine import ORDER, Deform, finish_deform
from engine.realtime.zonal_harmonics.shading import N_ANGLES, STEEPEST, low_gloss
from engine.scene.scene_loader import load_scene
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import basis
from tests.scene_text import camera, placed

SIZE = (64, 48)
AMBIENT, SUN = 0.05, 600.0


def gold(alpha: float) -> Layer:
    return make_layer(MODELS["rough_conductor"], {"alpha": alpha})


@pytest.mark.parametrize("alpha", [0.05, 0.3, 0.8])
def test_its_lobe_falls_from_its_axis_for_every_view_angle(alpha: float) -> None:
    to_axis = np.linspace(-1.0, 1.0, 501)
    directions = np.stack([np.sqrt(1.0 - to_axis**2), np.zeros(501), to_axis], axis=1)
    middle = np.arange(ORDER) * np.arange(1, ORDER + 1)  # of each band, the one about the axis
    root = np.sqrt(4.0 * np.pi / (2.0 * np.arange(ORDER) + 1.0))
    zonal = basis(directions, ORDER)[:, middle] * root  # Legendre polynomials
    weights = (2.0 * np.arange(ORDER) + 1.0) / (4.0 * np.pi)
    lobes = np.einsum("dl,alc->adc", zonal * weights, low_gloss(gold(alpha), ORDER).bands)
    peaks = lobes.max(axis=1, keepdims=True)
    assert (lobes / peaks).min() > -1e-5 and (np.diff(lobes, axis=1) / peaks).min() > -1e-5


def test_its_error_is_reported() -> None:
    """The square integral of what is left, of a lobe that is drawn out over the sphere once more."""
    layer, sphere = gold(0.3), geodesic(5)
    found, at_45 = low_gloss(layer, ORDER), np.radians(45.0)
    wi, weights = sphere.centres, sphere.solid_angles
    sent = evaluate_layer(layer, wi, np.tile([np.sin(at_45), 0.0, np.cos(at_45)], (len(wi), 1))) @ LUMINANCE
    sent[wi[:, 2] <= 0.0] = 0.0
    angles = np.linspace(0.0, STEEPEST, N_ANGLES)
    lean = np.interp(at_45, angles, found.lean)
    bands = np.array([np.interp(at_45, angles, band) for band in (found.bands @ LUMINANCE).T])
    along = np.clip(wi @ [-np.sin(lean), 0.0, np.cos(lean)], -1.0, 1.0)
    lobe = np.polynomial.legendre.legval(along, (2.0 * np.arange(ORDER) + 1.0) / (4.0 * np.pi) * bands)
    off = (weights * (sent - lobe) ** 2).sum() / (weights * sent**2).sum()
    assert found.lost_share == pytest.approx(off, abs=0.02) and 0.1 < off < 0.9


def test_a_gold_ball_under_a_small_sun_has_no_rings(tmp_path: Path) -> None:
    """It was black in rings, 0 for no less than what the sky alone gives, and bright again behind them."""
    path = tmp_path / "ball.toml"
    path.write_text(
        camera((0.0, 0.0, 4.0), 30, SIZE) + "[environment]\nradiance = [1, 1, 1]\n" + placed("ball", "sphere")
    )
    sky = np.full((32, 64, 3), AMBIENT, np.float32)
    sky[8, 20] = SUN
    deform = Deform(load_scene(path), n_points=0, n_rays=1000)
    deform.set_light(SkyState(Environment(sky, "sun")))
    deform.set_layers({0: (gold(0.3),)})
    picture = finish_deform(deform).draw(deform.scene.description.camera, SIZE)
    ball = picture[(np.abs(picture - AMBIENT) > 1e-6).any(axis=2)]
    grey = ball @ LUMINANCE
    least = AMBIENT * float(low_gloss(gold(0.3), ORDER).bands[:, 0].min())
    assert len(ball) > 300 and ball.min() > 0.95 * least
    assert grey.max() > 20.0 * grey.min()
