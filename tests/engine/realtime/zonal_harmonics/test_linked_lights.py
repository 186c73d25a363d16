"""Deform with linked lights: each object is drawn as if the lights that reach it were all there are."""

from __future__ import annotations

import itertools
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import constant_environment
from engine.light.suns import Sun, with_suns
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.linking import object_groups
from engine.precompute.direct.pipeline import LightLink, SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.picture_renderer import Quality
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

SIZE = (48, 36)
SCENE = (
    camera((0.8, 1.2, 3.0), 45, SIZE)
    + environment()
    + placed("ball", "sphere", scaled((0.5, 0.9, 0.5), (-0.4, 0, 0)))
    + placed("floor", "quad", facing_up(4, (0, -0.5, 0)))
    + placed("block", "cube", scaled(0.5, (0.6, -0.2, 0)))
    + placed("board", "quad", facing_down(0.8, (-0.6, 1.5, 0.4)), "emission = [6, 7, 8]\n")
)
LAYERS = make_layer(MODELS["lambert"], {"albedo": 0.5}), make_layer(MODELS["rough_conductor"], {"alpha": 0.4})
QUALITIES: tuple[Quality, ...] = ("moving", "rest")
BENT: Poses = (("ball", (Deformation("bend", 60.0),)),)


@lru_cache(maxsize=1)
def linked_sky() -> SkyState:
    """The board does not reach the ball, the sun not the floor, and the block has the sun alone."""
    sun, grey = (Sun((0.5, 0.7, 0.5), (2.0, 2.0, 1.5)),), constant_environment(0.3)
    links = (
        LightLink(frozenset({0}), SkyState(with_suns(grey, sun)), frozenset({3})),
        LightLink(frozenset({1}), SkyState(grey)),
        LightLink(frozenset({2}), SkyState(with_suns(constant_environment(0.0), sun)), frozenset({3})),
    )
    return SkyState(with_suns(grey, sun), links=links)


@pytest.mark.parametrize("poses", [(), BENT], ids=["rest", "bent"])
def test_an_object_is_drawn_as_under_the_lights_that_reach_it(tmp_path: Path, poses: Poses) -> None:
    """Of light that is reflected once: diffuse, gloss in bands, highlights of lamp and sun, and moving shadows."""
    (tmp_path / "scene.toml").write_text(SCENE)
    deform = Deform(load_scene(tmp_path / "scene.toml"), n_points=300, n_rays=24)
    deform.set_layers(dict.fromkeys(range(3), LAYERS))
    deform.set_bending(["ball"] if poses else [])
    deform.set_effort(24, 1, 0)
    deform.set_bounces(1)

    def drawn(sky: SkyState, emission: float) -> np.ndarray:
        deform.set_light(sky)
        deform.set_emission({"board": (emission, emission, emission)})
        finish_deform(deform)
        return np.stack([deform.draw(deform.scene.description.camera, SIZE, poses, each) for each in QUALITIES])

    linked, plain = drawn(linked_sky(), 7.0), drawn(SkyState(linked_sky().environment), 7.0)
    assert deform._points is not None and deform._pictures is not None
    places, eye = deform._pictures.posed.at(poses)[0], deform.scene.description.camera
    found = deform._pictures._rasterize(deform.scene, places, eye, SIZE).found
    shown = np.where(found >= 0, deform._points.surface.i_object[found], -1)
    for objects, reaching, emitters in object_groups(linked_sky(), 4):
        alone = drawn(reaching, 7.0 * emitters[3])
        for i, k in itertools.product(np.flatnonzero(objects[:3]), range(len(QUALITIES))):
            inside, mean = shown == i, alone[k][shown == i].mean()
            # At rest a pixel is the mean of four, of which edges may have several objects.
            assert np.quantile(np.abs(linked[k] - alone[k])[inside].max(axis=1), 0.8) < 1e-5 * mean, (i, k)
            assert inside.sum() > 50 and np.abs(plain[k] - alone[k])[inside].mean() > 0.1 * mean, (i, k)
