"""Where things stand on a floor, or over it, its indirect light is that of paths up to the contact: no dark dashes
along a foot, no shade below a table that is too dark."""

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect.sampling_settings import STILL
from engine.reference.path_tracer import trace_halves
from tests.engine.precompute.indirect.small_scenes import matt, placed, placement_of, solve

FLOOR = {"name": "floor", "primitive": "quad", "transform": [3, 0, 0, 0, 0, 0, 3, 0, 0, -3, 0, 0, 0, 0, 0, 1]}
BACK = {"name": "back", "primitive": "quad", "transform": placed(0, 0.75, -1.5, 3, 1.5, 1)}
LAMP = {"name": "lamp", "primitive": "cube", "emission": [30.0] * 3, "transform": placed(0.9, 1.2, 0.3, 0.2)}
# Middles and sizes of what is below the lamp: a table's board, and a box on the floor.
TABLE = (-0.1, 0.42, 0.0), (1.1, 0.04, 0.8)
BOX = (-0.2, 0.2, -0.2), (0.7, 0.4, 0.5)
VIEW = {"eye": (0.3, 1.0, 2.0), "target": (-0.1, 0.25, 0.0)}
ALBEDOS = 0.7, 0.5, 0.6
N_PIXELS, N_BOUNCES, N_PATHS = 48, 3, 1024


@pytest.mark.parametrize(
    ("thing", "beside", "n_alike", "most"),
    # Without gather points close to contacts, pixels at the foot are 29 % too dark.
    [(TABLE, 0.0, 23, 0.05), (BOX, 0.1, 8, 0.05)],
    ids=["below a table", "at the foot of a box"],
)
def test_indirect_light_of_a_floor_is_that_of_paths_up_to_a_contact(thing, beside, n_alike, most):
    middle, size = thing
    objects = [FLOOR, BACK, {"name": "thing", "primitive": "cube", "transform": placed(*middle, *size)}, LAMP]
    placement = placement_of(objects, **VIEW, n=N_PIXELS)
    x, _, z = placement.hits.position[placement.rows_of(0)].T
    away = np.maximum(abs(x - middle[0]) - size[0] / 2, abs(z - middle[2]) - size[2] / 2)
    rows = placement.rows_of(0)[away < beside]
    layers = [matt(i, albedo) for i, albedo in enumerate(ALBEDOS)]
    found = solve(placement, layers, N_BOUNCES, STILL).picture(layers)[rows].mean(axis=1)
    materials = {i: [make_layer(MODELS["lambert"], {"albedo": [a] * 3})] for i, a in enumerate(ALBEDOS)}
    once, all_of_it = run_to_end(trace_halves(placement, materials, SkyState(None), N_BOUNCES, N_PATHS, 0, rows)).mean(
        axis=(0, 3)
    ).T  # fmt: skip
    truth = all_of_it - once
    # The judge's noise is 3 to 7 % a pixel: neighbours, as many as make it one to two, are judged together.
    parts = np.array(
        [
            (mine.mean(), theirs.mean())
            for mine, theirs in zip(
                *(np.array_split(light, len(rows) // n_alike) for light in (found, truth)), strict=True
            )
        ]
    )
    off = parts[:, 0] / parts[:, 1] - 1.0
    assert abs(off).max() < most and abs(found.mean() / truth.mean() - 1.0) < 0.02
