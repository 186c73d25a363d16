"""The exact integral of a lat-long map over every triangle of the geodesic sphere.

On the cylinder (phi, h = cos theta) areas are solid angles, a texel is a rectangle and a great circle is the curve

    h(psi) = k cos psi / sqrt(1 - k^2 sin^2 psi),    integral of h d psi = asin(k sin psi),

where psi is the azimuth from the circle's highest point, and k the height of that point. By Green's theorem the light
in a triangle is the signed sum over its edges of the light between the edge and the zenith,

    integral over the edge of A(phi, h(phi)) d phi,    A(phi, h) = integral of L(phi, h') d h' from h to 1,

and A is linear in h within a texel, so each edge is walked from texel to texel with the closed form above. Every edge
is walked once and counts for its two triangles with opposite signs: rounding can move light between them, but never
lose it.

Binning samples of texels into triangles was rejected after a trial: it conserves light too, but in no less time it left
a constant sky uneven by 3 % RMS at level 7, even after balancing the samples' weights.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light import _kernels
from engine.sphere.geodesic import geodesic


def integrate_over_triangles(
    radiance: NDArray[np.float32], light_above: NDArray[np.float64], turn: float, level: int
) -> NDArray[np.float64]:
    """The integral of L d omega over each triangle of `level`: (20 * 4^level, 3), never negative.

    radiance (H, W, 3); light_above (H + 1, W, 3), `Environment.light_above`; turn: azimuth in the map minus azimuth in
    the world, radians.
    """
    sphere = geodesic(level)
    edge_integrals = np.empty((len(sphere.edges), 3))
    row_edges = _row_edges(len(radiance))
    edges, triangle_edges = sphere.edges, sphere.triangle_edges
    on_threads(
        lambda start, stop: _kernels.integrate_above_edges(
            start, stop, edges, sphere.vertices, turn, radiance, light_above, row_edges, edge_integrals
        ),
        *even_parts(len(edges)),
    )
    integrals = np.empty((sphere.n_triangles, 3))
    on_threads(
        lambda start, stop: _kernels.sum_around_triangles(
            start, stop, sphere.triangles, triangle_edges, edge_integrals, integrals
        ),
        *even_parts(sphere.n_triangles),
    )
    integrals *= -1.0  # counter-clockwise from outside, the upper edges run towards smaller azimuth
    _close_at_nadir(sphere.vertices, sphere.triangles, turn, light_above[-1], integrals)
    return np.maximum(integrals, 0.0)


def _row_edges(height: int) -> NDArray[np.float64]:
    """(H + 1, 2): cosine and cotangent of theta at the rows' edges; the cotangents at zenith and nadir are never
    used."""
    theta = math.pi * np.arange(height + 1) / height
    sine = np.maximum(np.sin(theta), 1e-300)
    return np.stack([np.cos(theta), np.clip(np.cos(theta) / sine, -1e300, 1e300)], axis=1)


def _close_at_nadir(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    turn: float,
    column_light: NDArray[np.float64],
    integrals: NDArray[np.float64],
) -> None:
    """Adds the missing part of triangles with a corner at the nadir, where the boundary runs along h = -1."""
    for triangle in np.flatnonzero((vertices[triangles][..., 1] < -1.0 + 1e-12).any(axis=1)):
        x, y, z = vertices[triangles[triangle]].T
        phi = np.arctan2(x, -z)[y > -1.0 + 1e-12]
        step = (phi[1] - phi[0] + math.pi) % (2.0 * math.pi) - math.pi
        integrals[triangle] += _light_between(min(phi[0], phi[0] + step) + turn, abs(step), column_light)


def _light_between(first: float, step: float, column_light: NDArray[np.float64]) -> NDArray[np.float64]:
    """The integral of the columns' total light (W, 3) over the azimuths first .. first + step."""
    width = len(column_light)
    begin = (first + math.pi) / (2.0 * math.pi) * width
    columns = np.arange(math.floor(begin), math.ceil(begin + step / (2.0 * math.pi) * width) + 1)
    edges = np.clip(columns, begin, begin + step / (2.0 * math.pi) * width)
    return np.diff(edges) @ column_light[columns[:-1] % width] * (2.0 * math.pi / width)
