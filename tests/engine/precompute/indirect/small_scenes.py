"""Scenes of a few triangles, and their indirect light."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import FINE, SamplingSettings
from engine.precompute.indirect.solver import Solver
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene

QUICK = replace(
    FINE, n_rays=256, max_extra_sets=0, n_photons=1 << 14, n_cache_records=600, n_record_rays=64, n_samples=512
)
IDENTITY = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def placed(x: float, y: float, z: float, *scale: float) -> list[float]:
    """A transform that scales and then moves."""
    sx, sy, sz = scale if len(scale) == 3 else (*scale, *scale, *scale)
    return [sx, 0, 0, x, 0, sy, 0, y, 0, 0, sz, z, 0, 0, 0, 1]


def placement_of(
    objects: Sequence[dict[str, Any]], eye=(0.0, 0.0, 0.3), target=(0.0, 0.0, -1.0), n=24, folder=Path()
) -> Placement:
    """Seen in n × n pixels; folder: where meshes lie."""
    tree = {
        "version": 1,
        "name": "small",
        "camera": {"position": list(eye), "target": list(target), "fov_y": 60, "resolution": [n, n]},
        "object": list(objects),
    }
    return Placement(build_scene(parse_description(tree, "small"), folder / "small"))


def matt(i_object: int, albedo: float | Sequence[float], n_bands: int = 16) -> IndirectLayer:
    """A Lambert layer; albedos above 1 by an edit of the result, for parameters end there."""
    values = [albedo] * 3 if isinstance(albedo, float | int) else list(albedo)
    layer = indirect_layer(i_object, make_layer(MODELS["lambert"], {"albedo": [1.0, 1.0, 1.0]}), (n_bands,))
    factor = np.asarray(values, float)
    return replace(layer, gain=layer.gain * factor, albedo=layer.albedo * factor)


def solve(
    placement: Placement, layers: Sequence[IndirectLayer], n_bounces: int, fineness: SamplingSettings = QUICK,
    sky: Environment | None = None,
) -> IndirectLight:  # fmt: skip
    models: dict[int, list[str]] = {}
    for layer in layers:
        models.setdefault(layer.i_object, []).append(layer.curves.model.name)
    solver = Solver(placement, models, SkyState(sky), n_bounces, fineness)
    return run_to_end(solver.solve(layers), lambda progress: None)


# A hollow ball of diameter 2 about the origin with a small lamp in it; the camera is inside as well.
SPHERE = {"name": "ball", "primitive": "sphere", "smooth": True, "transform": placed(0, 0, 0, 2)}
LAMP_SIDE, LAMP_RADIANCE = 0.02, 1000.0
LAMP = {
    "name": "lamp", "primitive": "cube", "emission": [LAMP_RADIANCE] * 3, "transform": placed(0.2, 0.1, 0.1, LAMP_SIDE),
}  # fmt: skip
# Walls and a floor of three objects under an open sky.
CORNER = [
    {"name": "floor", "primitive": "quad", "transform": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]},
    {"name": "back", "primitive": "quad", "transform": placed(0, 1, -1, 2, 2, 1)},
    {"name": "side", "primitive": "quad", "transform": [0, 0, 1, -1, 0, 2, 0, 1, -2, 0, 0, 0, 0, 0, 0, 1]},
]
CORNER_VIEW = {"eye": (2.0, 1.6, 2.4), "target": (-0.4, 0.6, -0.4)}
