"""Reflection in the adaptive parameterization of RGL's measurements [Dupuy18].

Angles are spaced by u = sqrt(2 theta / pi) along columns, azimuths by v = phi / (2 pi) + 1/2 along rows. For each wi
of the measurement, the density of visible microfacets maps the half vector wm to the unit square: v by its marginal,
then u by what is conditional on v [Dupuy18, section 4]. Colours M are tabulated there, so that samples are dense where
the highlight is. All tables are interpolated linearly, those of neighbouring wi after they have been normalised. Then

    E(wi, wo) = rho(wi, wo) cos_o = M ndf(wm) / (4 sigma(wi)),        or M alone where it has not been divided.

Azimuths of wm are relative to wi where the surface is isotropic. The azimuths of wi of a surface that looks the same
after half a turn, or has two axes of symmetry, cover a half or a quarter of the circle, from -pi on.

Noise makes rho change where wi and wo change places. We use (E(wi, wo) + E(wo, wi)) / (cos_i + cos_o): the mean of both
weighted by cosines, so that the least certain, at grazing directions, is divided by no small number.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.measured.measurement import HALF_PI, SHAPE, directions_at, grid_directions
from engine.measured.sample_files import MISSING

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

# Sums of cosines below which a pair of directions counts as not measured.
LEAST_COSINES = 0.02
# Pairs of directions that factors are fitted to, before those that are steeper are left out.
N_SCATTERED = 8000
STEEPEST = np.radians(85.0)
# Numbers at the start of the packed form: those of azimuths and angles, rows and columns of four tables, symmetry,
# and whether colours are divided.
N_SIZES = 12


@dataclass(frozen=True, eq=False)
class AdaptiveReflection:
    """phi (P,), theta (T,): azimuths and angles of wi, ascending, radians; ndf, sigma (rows, columns) over wm and wi;
    vndf (P, T, rows, columns), not negative and in no slice all 0; colours (P, T, rows, columns, 3), linear Rec. 709;
    is_divided: the colours are to be multiplied by ndf / (4 sigma). All float32."""

    phi: Float32Array
    theta: Float32Array
    ndf: Float32Array
    sigma: Float32Array
    vndf: Float32Array
    colours: Float32Array
    is_divided: bool

    @property
    def is_isotropic(self) -> bool:
        return len(self.phi) <= 2

    @property
    def n_symmetric(self) -> int:
        """How many times the azimuths of wi cover the circle by symmetry: 1, after half a turn 2, by two axes 4."""
        if self.is_isotropic:
            return 1
        return round(2.0 * np.pi / float(self.phi[-1] - self.phi[0]))

    @cached_property
    def visible(self) -> VisibleDensity:
        """The visible density of each wi, normalised, with its integrals."""
        return VisibleDensity.of(self.vndf)

    def packed(self) -> Float32Array:
        """All of it in one array, for kernels (`engine.material._adaptive_kernels`)."""
        visible, tables = self.visible, (self.ndf, self.sigma, self.vndf[0, 0], self.colours[0, 0, ..., 0])
        sizes = [len(self.phi), len(self.theta), *(n for table in tables for n in table.shape)]
        head = np.array([*sizes, self.n_symmetric, self.is_divided], np.float32)
        arrays = (
            self.phi, self.theta, self.ndf, self.sigma, visible.density, visible.along, visible.up, self.colours
        )  # fmt: skip
        return np.concatenate([head, *(array.ravel() for array in arrays)]).astype(np.float32)

    @staticmethod
    def unpacked(values: Float32Array) -> AdaptiveReflection:
        """The inverse of `packed`."""
        shapes = _shapes(values)
        ends = N_SIZES + np.cumsum([math.prod(shape) for shape in shapes])
        parts = np.split(values[N_SIZES:], ends[:-1] - N_SIZES)
        phi, theta, ndf, sigma, vndf, _, _, colours = (p.reshape(s) for p, s in zip(parts, shapes, strict=True))
        return AdaptiveReflection(phi, theta, ndf, sigma, vndf, colours, bool(values[N_SIZES - 1]))

    def evaluate(self, wi: Float64Array, wo: Float64Array) -> Float64Array:
        """rho (N, 3), 1/sr, at least 0, for unit directions (N, 3); -1 below the horizon and where both graze."""
        cosines = wi[:, 2] + wo[:, 2]
        good = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0) & (cosines > LEAST_COSINES)
        value = np.full((len(wi), 3), MISSING)
        wi, wo = wi[good], wo[good]
        both = self.tabulated(wi, wo) + self.tabulated(wo, wi)
        value[good] = np.maximum(both / cosines[good, None], 0.0)
        return value

    def tabulated(self, wi: Float64Array, wo: Float64Array) -> Float64Array:
        """E(wi, wo) = rho cos_o (N, 3) of unit directions (N, 3) above the horizon."""
        if self.n_symmetric > 1:
            # Rotate or mirror wi into the azimuths that were measured.
            flip_y = np.where(wi[:, 1] > 0.0, -1.0, 1.0)
            flip_x = np.where(wi[:, 0] > 0.0, -1.0, 1.0) if self.n_symmetric == 4 else flip_y
            flips = np.stack([flip_x, flip_y, np.ones(len(wi))], axis=1)
            wi, wo = wi * flips, wo * flips
        half = wi + wo
        theta_i, phi_i, theta_m, phi_m = *_spherical(wi), *_spherical(half)
        u, v = _column(theta_m), _row(phi_m - phi_i if self.is_isotropic else phi_m)
        slices = _slices(self.phi, self.theta, phi_i, theta_i)
        x, y = self.visible.to_square(slices, u, v)
        value = sum(weight[:, None] * _bilinear(self.colours, k, x, y) for k, weight in slices)
        if self.is_divided:
            zero = np.zeros(len(wi), int)
            area = _bilinear(self.sigma[None, None], zero, _column(theta_i), _row(phi_i))
            facets = _bilinear(self.ndf[None, None], zero, u, v)
            value = value * (facets / np.maximum(4.0 * area, 1e-12))[:, None]
        return np.asarray(value)


@dataclass(frozen=True, eq=False)
class VisibleDensity:
    """Densities (P, T, rows, columns) of integral 1 over their patches; along (P, T, rows, columns): their integrals
    over u from the left of each row; up (P, T, rows): of whole rows, from the lowest one."""

    density: Float32Array
    along: Float32Array
    up: Float32Array

    @staticmethod
    def of(values: Float32Array) -> VisibleDensity:
        """Normalise densities (P, T, rows, columns), by the trapezoidal rule, which is exact for bilinear ones."""
        found = VisibleDensity(
            *(np.zeros(shape, np.float32) for shape in (values.shape, values.shape, values.shape[:3]))
        )
        for place in np.ndindex(*values.shape[:2]):
            density = values[place].astype(float)
            along, up = np.zeros_like(density), np.zeros(len(density))
            np.cumsum(0.5 * (density[:, 1:] + density[:, :-1]), axis=1, out=along[:, 1:])
            np.cumsum(0.5 * (along[1:, -1] + along[:-1, -1]), out=up[1:])
            for table, part in ((found.density, density), (found.along, along), (found.up, up)):
                table[place] = part / up[-1]
        return found

    def to_square(self, slices: Slices, u: Float64Array, v: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Where the densities' integrals map (u, v), each (N,) in [0, 1]: x, y in [0, 1]."""
        rows, columns = self.density.shape[2:]
        i, s = _patch(v, rows)
        j, t = _patch(u, columns)
        low, high, before, whole, after, below = np.zeros((6, len(u)))
        for k, weight in slices:
            density, along, up = (table.reshape(-1, *table.shape[2:]) for table in (self.density, self.along, self.up))
            # The density at the left and the right side of the patch, at height v.
            low += weight * ((1.0 - s) * density[k, i, j] + s * density[k, i + 1, j])
            high += weight * ((1.0 - s) * density[k, i, j + 1] + s * density[k, i + 1, j + 1])
            # Its integral over u up to the patch, and over the whole row: of the rows below and above v.
            before += weight * ((1.0 - s) * along[k, i, j] + s * along[k, i + 1, j])
            whole += weight * along[k, i, -1]
            after += weight * along[k, i + 1, -1]
            below += weight * up[k, i]
        row = (1.0 - s) * whole + s * after
        x = np.divide(before + t * (low + 0.5 * t * (high - low)), row, out=np.zeros_like(row), where=row > 0.0)
        y = below + s * (whole + 0.5 * s * (after - whole))
        return np.clip(x, 0.0, 1.0), np.clip(y, 0.0, 1.0)


# Numbers of slices (N,) among (P, T), with their weights (N,).
Slices = list[tuple[NDArray[np.integer], Float64Array]]


def _shapes(packed: Float32Array) -> list[tuple[int, ...]]:
    """The shapes of the arrays of a packed measurement, by the sizes it starts with."""
    sizes = [int(size) for size in packed[:N_SIZES]]
    slices, grid = (sizes[0], sizes[1]), (sizes[6], sizes[7])
    return [
        (sizes[0],), (sizes[1],), (sizes[2], sizes[3]), (sizes[4], sizes[5]), (*slices, *grid), (*slices, *grid),
        (*slices, sizes[6]), (*slices, sizes[8], sizes[9], 3),
    ]  # fmt: skip


def is_packed(values: Float32Array) -> bool:
    """Whether an array (N,) has the sizes that it starts with, so that kernels read nothing beyond it."""
    if len(values) < N_SIZES or not ((values[: N_SIZES - 2] >= 2) & (values[: N_SIZES - 2] < 2**24)).all():
        return False
    return N_SIZES + sum(math.prod(shape) for shape in _shapes(values)) == len(values)


def scattered_directions() -> tuple[Float64Array, Float64Array]:
    """wi, wo (N, 3) for fits to anisotropic reflection, not steeper than `STEEPEST`: half vectors dense about the
    normal, as the nodes of curves are, all azimuths, and even angles between wi and the half vector."""
    random = np.random.default_rng(1)
    u = (np.arange(N_SCATTERED) + random.random(N_SCATTERED)) / N_SCATTERED
    theta_h, theta_d = HALF_PI * u * u, HALF_PI * random.random(N_SCATTERED)
    phi_h, phi_d = 2.0 * np.pi * random.random((2, N_SCATTERED))
    x, y = np.cos(phi_h), np.sin(phi_h)
    pair = [
        np.stack([x * v[:, 0] - y * v[:, 1], y * v[:, 0] + x * v[:, 1], v[:, 2]], axis=1)
        for v in directions_at(theta_h, theta_d, phi_d)
    ]
    good = np.minimum(pair[0][:, 2], pair[1][:, 2]) > np.cos(STEEPEST)
    return pair[0][good], pair[1][good]


def grid_samples(reflection: AdaptiveReflection) -> Iterator[float | Float32Array]:
    """Samples (90, 90, 180, 3), 1/sr, of isotropic reflection at the places of MERL's grid, -1 where there are none;
    yields the share done, then the samples."""
    wi, wo = grid_directions()
    samples = np.empty((*SHAPE, 3), np.float32)
    for i in range(SHAPE[0]):
        value = reflection.evaluate(wi[i].reshape(-1, 3), wo[i].reshape(-1, 3))
        samples[i] = value.reshape(*SHAPE[1:], 3)
        yield (i + 1) / SHAPE[0]
    yield samples


def _spherical(v: Float64Array) -> tuple[Float64Array, Float64Array]:
    return np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]), np.arctan2(v[:, 1], v[:, 0])


def _column(theta: Float64Array) -> Float64Array:
    return np.asarray(np.sqrt(np.minimum(theta / HALF_PI, 1.0)))


def _row(phi: Float64Array) -> Float64Array:
    """In [0, 1), wrapping around; 0 is -pi."""
    share = phi / (2.0 * np.pi) + 0.5
    return np.asarray(share - np.floor(share))


def _patch(place: Float64Array, n: int) -> tuple[NDArray[np.integer], Float64Array]:
    """The patch of a place in [0, 1] among n nodes, and where in it, 0 to 1."""
    position = np.clip(place, 0.0, 1.0) * (n - 1)
    index = np.minimum(position.astype(int), n - 2)
    return index, position - index


def _slices(phi: Float32Array, theta: Float32Array, phi_i: Float64Array, theta_i: Float64Array) -> Slices:
    """The slices around each wi, which is held to the azimuths and angles there are."""
    found: Slices = []
    for k, a in _around(phi, phi_i):
        for j, b in _around(theta, theta_i):
            found.append((k * len(theta) + j, a * b))
    return found


def _around(nodes: Float32Array, values: Float64Array) -> Slices:
    """The two nodes around each value with their weights; the only one, if there is one."""
    if len(nodes) == 1:
        return [(np.zeros(len(values), int), np.ones(len(values)))]
    low = np.clip(np.searchsorted(nodes, values, "right") - 1, 0, len(nodes) - 2)
    share = np.clip((values - nodes[low]) / (nodes[low + 1] - nodes[low]), 0.0, 1.0)
    return [(low, 1.0 - share), (low + 1, share)]


def _bilinear(tables: Float32Array, k: NDArray[np.integer], x: Float64Array, y: Float64Array) -> Float64Array:
    """Tables (P, T, rows, columns, ...) number k (N,) at x, y (N,) in [0, 1]."""
    flat = tables.reshape(-1, *tables.shape[2:])
    (i, s), (j, t) = _patch(y, flat.shape[1]), _patch(x, flat.shape[2])
    s, t = (share.reshape(-1, *(1,) * (flat.ndim - 3)) for share in (s, t))
    low = (1.0 - t) * flat[k, i, j] + t * flat[k, i, j + 1]
    return np.asarray((1.0 - s) * low + s * ((1.0 - t) * flat[k, i + 1, j] + t * flat[k, i + 1, j + 1]))
