"""Three pictures as one, and passes of paths that add up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.stills import PathReference, compose_split
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, environment, placed

SIZE = (32, 24)
POSES = (("ball", (Deformation("twist", 170.0),)),)


def test_each_part_has_its_picture() -> None:
    traced, stays, own = (np.full((4, 10, 3), value, np.float32) for value in (1.0, 2.0, 5.0))
    parts = compose_split(traced[:2, :5], stays, own, (0.3, 0.8))
    assert parts[0, :, 0].tolist() == [1.0] * 3 + [2.0] * 5 + [5.0] * 2
    assert compose_split(None, stays, own, (0.3, 0.8))[0, 0, 0] == pytest.approx(1.0)  # dark, until there is one
    assert compose_split(traced, stays, own, (0.0, 0.0)) == pytest.approx(own)


@pytest.mark.sweep  # half a minute
def test_paths_tell_what_turns_from_what_does_not(tmp_path: Path) -> None:
    """A ball that is twisted by nearly half a turn, lit from one side: with transfer as at rest its top is in the dark
    where paths, and transfer that turns, see light."""
    path = tmp_path / "ball.toml"
    path.write_text(camera((0.5, 2.0, 3.0), 30, SIZE) + environment() + placed("ball", "sphere"))
    scene = load_scene(path)
    image = np.zeros((32, 64, 3), np.float32)
    image[8:24, 44:52] = 5.0
    sky, layers = SkyState(Environment(image, "a window")), {0: (make_layer(MODELS["lambert"], {"albedo": 0.6}),)}
    deform = Deform(scene, n_points=500, n_rays=64)
    deform.set_light(sky)
    deform.set_layers(layers)
    deform.set_bending(["ball"])
    finish_deform(deform)
    truth = PathReference(scene, POSES)
    for _ in range(2):
        run_to_end(truth.trace(layers, sky, 1))
    assert truth.picture is not None
    own, stays = (deform.draw(scene.description.camera, SIZE, POSES, "rest", turned) for turned in (True, False))
    shown = np.abs(own - own[0, 0]).max(axis=2) > 1e-3
    errors = [float(np.abs(each - truth.picture)[shown].mean()) for each in (own, stays)]
    assert truth.n_passes == 2 and errors[0] < 0.6 * errors[1]
