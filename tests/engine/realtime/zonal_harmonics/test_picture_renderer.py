"""What pixels see of images that lie on bending objects."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from PIL import Image

from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.material.layer_maps import LayerMaps
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, environment, facing_up, placed

SIZE = (24, 18)


@pytest.mark.parametrize("quality", ["moving", "rest"])
def test_an_image_far_finer_than_pixels_is_its_mean(tmp_path: Path, quality: Literal["moving", "rest"]) -> None:
    """A chess board of two texels a pixel and more: single texels would be black and white, their mean is 0.5."""
    board = np.indices((64, 64)).sum(axis=0) % 2
    Image.fromarray(np.uint8(255 * board)).save(tmp_path / "board.png")
    path = tmp_path / "floor.toml"
    floor = placed("floor", "quad", facing_up(9))
    path.write_text(camera((0, 2.0, 0.01), 60, SIZE) + environment() + floor)
    deform = Deform(load_scene(path), n_points=0, n_rays=16)
    deform.set_light(SkyState(constant_environment((1.0, 1.0, 1.0))))
    maps = LayerMaps(texture="board.png", texture_space="linear", texture_scale=(20.0, 20.0))
    deform.set_layers({0: (make_layer(MODELS["lambert"], {"albedo": (1.0, 1.0, 1.0)}).replace(maps=maps),)})
    picture = finish_deform(deform).draw(deform.scene.description.camera, SIZE, (), quality)
    assert picture == pytest.approx(0.5, abs=0.02)
