"""The reflection of an object's layers as Orbit reads it: BRDF times cosine for a grid of outgoing directions.

Slices stand over the angle of ωo to the normal and its azimuth [Ma06, 3.2 and 3.4]. An isotropic BRDF is the same
function turned about the normal, and the sphere has ten symmetries about it, so that slices over 36 degrees of azimuth,
4.5 apart, serve all of them; an anisotropic one has slices all around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.orbit import _slice_kernels as kernels
from engine.orbit.incident import Incident
from engine.orbit.visibility import LEVEL
from engine.render.integrator import evaluate_layers
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import forward, levels_of_coefficients
from engine.sphere.symmetry import N_TURNS, SECTOR, images_of_wavelets
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float32]

# Angles to the normal and azimuths: of an isotropic reflection, and of one with a grain.
N_POLAR, N_AZIMUTHS, N_AROUND = 16, 9, 40
_STEEPEST = np.radians(89.0)


@dataclass(frozen=True, eq=False)
class Slices:
    """table (C, polar, azimuth, 3) float32: C coefficients of each slice, by `haar`'s numbers, times 4^(L − level), so
    that the integral of powers times a slice is the sum of products of coefficients.

    is_isotropic: the azimuths end at 36 degrees; otherwise they go round, without the last.
    """

    table: Floats
    is_isotropic: bool

    def shade(self, incident: Incident, points: NDArray[np.integer], wo: Floats) -> Floats:
        """Radiance (N, 3) that shading points (N,) send along wo (N, 3), unit, in their own frames."""
        radiance = np.empty((len(points), 3), np.float32)
        number, value, at = incident.number, incident.value, points.astype(np.int64, copy=False)
        images = inverse_images() if self.is_isotropic else inverse_images()[:1]

        def part(start: int, stop: int) -> None:
            kernels.shade_range(start, stop, at, wo, number, value, self.table, images, _STEEPEST, radiance)

        on_threads(part, *even_parts(len(points)))
        return radiance


def make_slices(layers: Sequence[Layer], finer: int = 1) -> Slices:
    """The slices of layers that lie on one another; each triangle's mean is taken over 4^finer parts of it."""
    is_isotropic = looks_isotropic(layers)
    n_azimuths = N_AZIMUTHS if is_isotropic else N_AROUND
    span = SECTOR if is_isotropic else 2.0 * np.pi * (N_AROUND - 1) / N_AROUND
    polar, azimuth = np.linspace(0.0, _STEEPEST, N_POLAR), np.linspace(0.0, span, n_azimuths)
    n_all = geodesic(LEVEL).n_triangles
    table = np.empty((n_all, N_POLAR, n_azimuths, 3), np.float32)
    measure = (4.0 ** (LEVEL - levels_of_coefficients(LEVEL))).astype(np.float32)[:, None, None]

    def row(i: int) -> None:
        wo = spherical(np.full(n_azimuths, polar[i]), azimuth)
        values = np.stack([_reflected(layers, direction, finer) for direction in wo], axis=1)
        table[:, i] = forward(values) * measure

    on_threads(row, range(N_POLAR))
    return Slices(table, is_isotropic)


def spherical(polar: NDArray[np.floating], azimuth: NDArray[np.floating]) -> NDArray[np.float64]:
    """Directions (N, 3) on the geodesic sphere: angle to +Y, azimuth from +Z to +X."""
    return np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)], axis=1)


def looks_isotropic(layers: Sequence[Layer]) -> bool:
    """Whether turning both directions about the normal, and mirroring them, changes nothing: asked of 256 pairs."""
    polar, azimuth = np.random.default_rng(1).random((2, 2, 256)) * np.array([1.5, 2.0 * np.pi])[:, None, None]
    wi, wo = spherical(polar[0], azimuth[0]), spherical(polar[1], azimuth[1])
    turn, mirror = np.array([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]]), np.array([-1.0, 1.0, 1.0])
    before = evaluate_layers(layers, to_shading(wi), to_shading(wo))
    after = evaluate_layers(layers, to_shading(wi @ turn.T * mirror), to_shading(wo @ turn.T * mirror))
    return bool(np.allclose(before, after, rtol=1e-4, atol=1e-6 * before.max(initial=0.0)))


def to_shading(directions: NDArray[np.floating]) -> NDArray[np.floating]:
    """Directions on the sphere, +Y the normal, to tangent, bitangent, normal as the layers take them."""
    # `ShadingPoints.frames` has tangent × normal for z, which is minus the bitangent.
    return directions[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])


def inverse_images() -> NDArray[np.int32]:
    """(10, C): the coefficient of an unmoved function that becomes each coefficient when a symmetry moves it."""
    images = images_of_wavelets(LEVEL)
    turns = [(N_TURNS - k) % N_TURNS for k in range(N_TURNS)]
    return images[[*turns, *range(N_TURNS, 2 * N_TURNS)]]  # a mirrored turn undoes itself


def _reflected(layers: Sequence[Layer], wo: NDArray[np.float64], finer: int) -> Floats:
    """The mean of ρ cos θ (5120, 3) over each triangle, for one outgoing direction."""
    sphere = geodesic(LEVEL + finer)
    above = np.flatnonzero(sphere.centres[:, 1] > 0.0)
    values = np.zeros((sphere.n_triangles, 3))
    eye = np.tile(to_shading(wo[None]), (len(above), 1))
    values[above] = evaluate_layers(layers, to_shading(sphere.centres[above]), eye)
    values *= sphere.solid_angles[:, None]
    n = 4**finer
    means = values.reshape(-1, n, 3).sum(axis=1) / sphere.solid_angles.reshape(-1, n).sum(axis=1)[:, None]
    return means.astype(np.float32)
