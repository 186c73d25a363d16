"""Tabulates layers as a measurement, for MERL files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material import kinds
from engine.material.layer import Layer, evaluate_layers
from engine.measured.measurement import SHAPE, Measurement, grid_directions
from engine.measured.sample_files import LARGEST, MISSING, SCALE

Float64Array = NDArray[np.float64]

# Cosines below which wi and wo count as below the horizon.
HORIZON = 1e-6
N_TURNS = 16


def tabulate_layers(layers: Sequence[Layer]) -> Iterator[float | NDArray[np.float32]]:
    """The sum of the visible layers, edits included, (90, 90, 180, 3) in 1/sr, -1 below the horizon; yields the share
    done, then the table.

    Such a table does not contain the azimuth of the half vector: a dependence on it is averaged.
    """
    shown = [layer for layer in layers if layer.visible]
    turns = 2.0 * np.pi * np.arange(N_TURNS) / N_TURNS if any(map(is_anisotropic, shown)) else np.zeros(1)
    wi, wo = grid_directions()
    table = np.full((*SHAPE, 3), MISSING, np.float32)
    for i in range(SHAPE[0]):
        above = (wi[i, ..., 2] > HORIZON) & (wo[i, ..., 2] > HORIZON)
        light, view = wi[i][above], wo[i][above]
        cosine = light[:, 2:]
        total = np.zeros((len(cosine), 3))
        for turn in turns:
            total += evaluate_layers(shown, _rotate(light, turn), _rotate(view, turn)) / cosine
        table[i][above] = np.minimum(total / len(turns), LARGEST * SCALE)
        yield (i + 1) / SHAPE[0]
    yield table


def untabulated_features(layers: Sequence[Layer]) -> tuple[str, ...]:
    """Features of the layers that such a table cannot represent, in words."""
    shown = [layer for layer in layers if layer.visible]
    anisotropic = [layer.name for layer in shown if is_anisotropic(layer)]
    images = [layer.name for layer in shown if not layer.maps.is_plain]
    notes = [f"{', '.join(anisotropic)}: averaged around the normal, as the format is isotropic"] if anisotropic else []
    notes += [f"{', '.join(images)}: without its images"] if images else []
    varying = [f"{layer.name} {each.parameter}" for layer in shown for each in layer.parameter_maps]
    return (*notes, *([f"{', '.join(varying)}: its own value in place of its map"] if varying else []))


def is_anisotropic(layer: Layer) -> bool:
    """Whether the layer changes when the surface rotates about its normal."""
    measurement = layer.values.get("file")
    if isinstance(measurement, Measurement) and measurement.is_anisotropic:
        return True
    return any(factor.gamma in kinds.HALF_AZIMUTHS for factor in layer.model.factors)


def _rotate(directions: Float64Array, angle: float) -> Float64Array:
    if angle == 0.0:
        return directions
    x, y = np.cos(angle), np.sin(angle)
    about = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    return np.ascontiguousarray(directions @ about.T)
