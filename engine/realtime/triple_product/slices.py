"""A layer's reflection as Orbit reads it: BRDF times cosine for a grid of outgoing directions.

Slices are sampled over the angle of ωo to the normal and over its azimuth [Ma06, 3.2 and 3.3]. An isotropic BRDF is
invariant under rotation about the normal, and the geodesic sphere has ten symmetries about it; so slices over 36
degrees of azimuth, 4.5 apart, suffice. An anisotropic BRDF is symmetric under reflection, and has slices over half a
turn.

A slice holds means over the triangles of one level of the geodesic sphere, 1 to 4; each level less takes a quarter of
the memory. Fewer outgoing angles instead were rejected: between slices that are further apart a highlight fades out and
in again.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import count

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import n_threads, on_threads
from engine.core.triangles import quarters
from engine.material.layer import Layer, evaluate_layer
from engine.realtime.core.terms import has_isotropic_reflection, spherical, to_shading_frame
from engine.realtime.triple_product import _slice_kernels as kernels
from engine.realtime.triple_product.visibility import LEVEL, upper_triangles
from engine.sphere.geodesic import geodesic, triangle_solid_angles
from engine.sphere.haar import N_TURNS, SECTOR, forward, images_of_triangles, images_of_wavelets, levels_of_coefficients

Float32Array = NDArray[np.float32]

# Polar angles and azimuths: of an isotropic reflection, and azimuths of an anisotropic one.
N_POLAR, N_AZIMUTHS, N_GRAINED = 24, 9, 41
_STEEPEST = np.radians(89.0)
_SERIALS = count(1)
# The coarsest triangles that lie entirely above the surface or below it.
LEAST_LEVEL = 1
# Share of the largest value by which adjacent triangles may differ and count as constant inside.
_EVEN = 0.05
# Share of the largest of a triangle's parts by which it may exceed their mean before they are divided further; share of
# the largest of all that it has then; and how often parts are divided.
_STEEP, _HIGH, _MOST_CUTS = 0.4, 0.1, 5

Layers = tuple[Layer, ...]
_NOTE = "Orbit: so many glossy layers do not fit into memory; their highlights are coarser"


@dataclass(frozen=True, eq=False)
class Slices:
    """packed (polar, columns, U, 3): means of ρ cos θ over each upper triangle of a level, bfloat16 as from
    `kernels.packed`; is_isotropic: the columns are azimuths up to 36 degrees, otherwise up to 180. flat: packed with
    one number appended, as the kernels take it."""

    flat: NDArray[np.uint16]
    n_columns: int
    is_isotropic: bool

    @classmethod
    def of(cls, packed: NDArray[np.uint16], is_isotropic: bool) -> Slices:
        """Make slices of packed values."""
        return cls(np.append(packed, np.uint16(0)), packed.shape[1], is_isotropic)

    @property
    def packed(self) -> NDArray[np.uint16]:
        """See the class."""
        return self.flat[:-1].reshape(N_POLAR, self.n_columns, -1, 3)

    @property
    def values(self) -> Float32Array:
        """The packed values as float32."""
        return kernels.unpacked(self.packed)

    @property
    def level(self) -> int:
        """Level of the triangles, `LEAST_LEVEL` to 4."""
        return next(k for k in range(LEAST_LEVEL, LEVEL + 1) if len(_above(k)) == self.packed.shape[2])

    def at_level(self, level: int) -> Slices:
        """Resample to the triangles of another level: larger ones get the mean of four, which is exact."""
        finer = level - self.level
        if finer == 0:
            return self
        if finer > 0:
            return Slices.of(np.repeat(self.packed, 4**finer, axis=2), self.is_isotropic)
        parts = self.values.reshape(N_POLAR, self.n_columns, len(_above(level)), 4**-finer, 3)
        return Slices.of(kernels.packed(parts.mean(axis=3)), self.is_isotropic)

    def make_tables(self) -> kernels.Tables:
        """Make the tables of wavelet coefficients [Ma06, 3.1], times 4^(L − level), so that the integral of powers
        times a slice is the sum of the coefficients' products. Coefficients of the lower hemisphere, where all slices
        are 0, are left out."""
        level, rows = self.level, _rows(self.level)
        # An additional row of 0 serves all coefficients of finer levels.
        flat = np.zeros(N_POLAR * self.n_columns * (len(rows) + 1) * 3 + 1, np.uint16)
        table = flat[:-1].reshape(N_POLAR, self.n_columns, -1, 3)
        scale = (4.0 ** (LEVEL - levels_of_coefficients(level)))[rows].astype(np.float32)[:, None, None]

        def row(i: int) -> None:
            values = np.zeros((geodesic(level).n_triangles, self.n_columns, 3), np.float32)
            values[_above(level)] = kernels.unpacked(self.packed[i]).swapaxes(0, 1)
            table[i, :, :-1] = kernels.packed(forward(values)[rows] * scale).swapaxes(0, 1)

        on_threads(row, range(N_POLAR))
        images, places = _row_images(level), _place_images(LEVEL) // np.int32(4 ** (LEVEL - level))
        if not self.is_isotropic:
            images, places = images[[0, N_TURNS]], places[[0, N_TURNS]]
        return kernels.Tables(
            flat, self.flat, images, places, N_POLAR, self.n_columns, _STEEPEST, next(_SERIALS)
        )  # fmt: skip

    @cached_property
    def albedo(self) -> NDArray[np.float64]:
        """Equivalent albedo [BenArtzi07, 5.2.4], (3,): 1/π ∫∫ ρ cos cos."""
        solid_angles = geodesic(self.level).solid_angles[_above(self.level)].astype(np.float32)
        sent = np.einsum("k,paki->pai", solid_angles, self.values).astype(np.float64)
        sent = np.trapezoid(sent, axis=1) / (self.n_columns - 1)
        polar = np.linspace(0.0, _STEEPEST, N_POLAR)
        return np.asarray(np.trapezoid(sent * np.sin(2.0 * polar)[:, None], polar, axis=0))

    @cached_property
    def lobe(self) -> float:
        """Solid angle of the constant lobe with the same sharpness as the reflection at normal incidence: (∫ f)² / ∫
        f²."""
        solid_angles = geodesic(self.level).solid_angles[_above(self.level)]
        sent = kernels.unpacked(self.packed[:1, :1])[0, 0].sum(axis=1, dtype=np.float64)
        square = float(solid_angles @ sent**2)
        return float(solid_angles @ sent) ** 2 / square if square > 0.0 else 2.0 * np.pi

    def __add__(self, other: Slices) -> Slices:
        """Sum of both."""
        if self.is_isotropic != other.is_isotropic:
            return self.half_around() + other.half_around()
        if self.level != other.level:
            level = max(self.level, other.level)
            return self.at_level(level) + other.at_level(level)
        return Slices.of(kernels.packed(self.values + other.values), self.is_isotropic)

    def half_around(self) -> Slices:
        """Convert to slices over half a turn."""
        if not self.is_isotropic:
            return self
        places = _place_images(self.level)
        rotated = np.empty((N_POLAR, N_GRAINED, places.shape[1], 3), np.uint16)
        half = N_AZIMUTHS - 1  # of a fifth of a turn: mirrored from there on
        for i in range(N_GRAINED):
            turn, inside = divmod(i, 2 * half)
            symmetry, at = (turn, inside) if inside <= half else (N_TURNS + (turn + 1) % N_TURNS, 2 * half - inside)
            rotated[:, i] = self.packed[:, at][:, places[symmetry]]
        return Slices.of(rotated, False)


def slice_bytes_of(level: int, is_isotropic: bool) -> int:
    """Bytes of slices over the triangles of a level, `Slices.flat`."""
    return 2 * (_n_slices(is_isotropic) * len(_above(level)) * 3 + 1)


def table_bytes_of(level: int, is_isotropic: bool) -> int:
    """Bytes of the coefficients of such slices, `Tables.table`."""
    return 2 * (_n_slices(is_isotropic) * (len(_rows(level)) + 1) * 3 + 1)


def _n_slices(is_isotropic: bool) -> int:
    return N_POLAR * (N_AZIMUTHS if is_isotropic else N_GRAINED)


def slice_steps(layer: Layer, finer: int = 1) -> Generator[float, None, Slices]:
    """Compute the slices of a layer and yield the progress; each triangle's mean is over 4^finer parts of it, or, if
    −1, by the triangles of the next coarser level, in a quarter of the time of 0."""
    is_isotropic = has_isotropic_reflection(layer)
    n_azimuths, span = (N_AZIMUTHS, SECTOR) if is_isotropic else (N_GRAINED, np.pi)
    polar, azimuth = np.linspace(0.0, _STEEPEST, N_POLAR), np.linspace(0.0, span, n_azimuths)
    packed = np.empty((N_POLAR, n_azimuths, len(_above(LEVEL + min(finer, 0))), 3), np.uint16)

    def part(i: int) -> None:
        around = spherical(np.full(n_azimuths, polar[i]), azimuth)
        if finer < 0:  # all at once: for so few triangles the calls cost most
            packed[i] = kernels.packed(_in_middles(layer, around, LEVEL - 1).astype(np.float32))
            return
        for j in range(n_azimuths):
            # At normal incidence all azimuths are the same.
            packed[i, j] = packed[0, 0] if i == 0 < j else kernels.packed(_reflected(layer, around[j], finer))

    step = N_POLAR if finer < 0 else n_threads()
    for begin in range(0, N_POLAR, step):
        end = min(begin + step, N_POLAR)
        on_threads(part, range(begin, end))
        yield end / N_POLAR
    return Slices.of(packed, is_isotropic)


@lru_cache(maxsize=4)
def _above(level: int) -> NDArray[np.int32]:
    """The triangles of a level above the surface, ascending."""
    size = 4 ** (LEVEL - level)
    return upper_triangles()[::size] // size


@lru_cache(maxsize=4)
def _rows(level: int) -> NDArray[np.int64]:
    """The coefficients that may be nonzero for functions that are 0 below the surface, ascending."""
    above = np.zeros((geodesic(level).n_triangles, 1))
    above[_above(level), 0] = np.random.default_rng(1).random(len(_above(level)))
    return np.flatnonzero(forward(above)[:, 0])


def _inverse_turns() -> list[int]:
    """The inverse of each symmetry; mirrors are their own inverses."""
    return [*((N_TURNS - k) % N_TURNS for k in range(N_TURNS)), *range(N_TURNS, 2 * N_TURNS)]


@lru_cache(maxsize=4)
def _row_images(level: int) -> NDArray[np.int32]:
    """(10, 5120): the row of `_rows` of a level, in the stored function, that each coefficient reads after a symmetry
    was applied; the additional last row if there is none."""
    row = np.full(geodesic(LEVEL).n_triangles, len(_rows(level)), np.int32)
    row[_rows(level)] = np.arange(len(_rows(level)))
    return np.ascontiguousarray(row[images_of_wavelets(LEVEL)[_inverse_turns()]])


@lru_cache(maxsize=4)
def _place_images(level: int) -> NDArray[np.int32]:
    """(10, 10 * 4^level): the upper triangle of a level, in the stored function, that each upper triangle reads after a
    symmetry was applied."""
    triangles = images_of_triangles(level)[_inverse_turns()][:, _above(level)]
    return np.searchsorted(_above(level), triangles).astype(np.int32)


def _reflected(layer: Layer, wo: NDArray[np.float64], finer: int) -> Float32Array:
    """Means of ρ cos θ (U, 3) over each upper triangle, for one outgoing direction (3,)."""
    [values] = _in_middles(layer, wo[None], LEVEL)
    if finer == 0:
        return values.astype(np.float32)
    # Siblings that are nearly equal count as constant inside; only the others are subdivided.
    four = values.reshape(-1, 4, 3)
    uneven = np.abs(four - four.mean(axis=1, keepdims=True)).max(axis=(1, 2)) > _EVEN * values.max()
    uneven |= (uneven[_beside()] & (_beside() >= 0)).any(axis=1)  # at the foot of a peak
    chosen = np.repeat(uneven, 4)
    [parts] = _in_middles(layer, wo[None], LEVEL + finer, np.repeat(chosen, 4**finer))
    parts, sphere = parts.reshape(-1, 4**finer, 3), geodesic(LEVEL + finer)
    numbers = upper_triangles()[chosen][:, None] * 4**finer + np.arange(4**finer)
    mirrored = wo * [-1.0, 1.0, -1.0]
    peak = float(_towards(layer, wo, mirrored[None]).sum())
    size = math.sqrt(4.0 * math.pi / sphere.n_triangles)
    sharp = _stand_out(parts, sphere.centres[numbers] @ mirrored, size, peak)
    if sharp.any():
        corners = sphere.vertices[sphere.triangles[numbers[sharp]]].reshape(-1, 3, 3)
        parts[sharp] = _divided(layer, wo, corners, size, peak, _MOST_CUTS).reshape(-1, 4**finer, 3)
    weights = sphere.solid_angles[numbers]
    values[chosen] = np.einsum("kp,kpi->ki", weights, parts) / weights.sum(axis=1)[:, None]
    return values.astype(np.float32)


def _stand_out(values: NDArray[np.float64], along: NDArray[np.floating], size: float, peak: float) -> NDArray[np.bool_]:
    """Which triangles (K,) a lobe stands out of: among the values (K, P, 3) of their parts, `size` wide, or around the
    mirror direction, to which the parts have cosines along (K, P) and whose value is `peak`."""
    light = values.sum(axis=2)
    largest = light.max(axis=1)
    between = (largest - light.mean(axis=1) > _STEEP * largest) & (largest > _HIGH * largest.max(initial=0.0))
    return between | (along > math.cos(2.0 * size)).any(axis=1) & (largest < (1.0 - _STEEP) * peak)


def _divided(
    layer: Layer, wo: NDArray[np.float64], corners: NDArray[np.float64], size: float, peak: float, n: int
) -> NDArray[np.float64]:
    """Means of ρ cos θ (K, 3) over triangles (K, 3, 3), `size` wide, in four parts each; those that a lobe stands out
    of are divided again, up to n times in all.

    Lobes are α cos θ wide across the plane of incidence: with α = 0.03 at 88 degrees 0.1 degrees, where parts of the
    finest level have 1.4.
    """
    four = quarters(corners, on_sphere=True)
    middles, size = four.sum(axis=2), 0.5 * size
    middles /= np.linalg.norm(middles, axis=2, keepdims=True)
    found = _towards(layer, wo, middles.reshape(-1, 3)).reshape(-1, 4, 3)
    sharp = _stand_out(found, middles @ (wo * [-1.0, 1.0, -1.0]), size, peak)
    if n > 1 and sharp.any():
        found[sharp] = _divided(layer, wo, four[sharp].reshape(-1, 3, 3), size, peak, n - 1).reshape(-1, 4, 3)
    weights = triangle_solid_angles(four)
    return np.asarray(np.einsum("kp,kpi->ki", weights, found) / weights.sum(axis=1)[:, None])


def _towards(layer: Layer, wo: NDArray[np.float64], wi: NDArray[np.floating]) -> NDArray[np.float64]:
    """ρ cos θ (N, 3) for one outgoing direction (3,) and directions (N, 3)."""
    pairs = to_shading_frame(wi.astype(np.float64)), np.repeat(to_shading_frame(wo[None]), len(wi), axis=0)
    return evaluate_layer(layer, *pairs)


def _in_middles(
    layer: Layer, wo: NDArray[np.float64], level: int, which: NDArray[np.bool_] | slice = slice(None)
) -> NDArray[np.float64]:
    """ρ cos θ (W, N, 3) for outgoing directions (W, 3), at the centres of all triangles above the surface or of those
    in which."""
    wi = _middles_above(level)[which]
    pairs = np.tile(wi, (len(wo), 1)), np.repeat(to_shading_frame(wo), len(wi), axis=0)
    return evaluate_layer(layer, *pairs).reshape(len(wo), len(wi), 3)


@lru_cache(maxsize=4)
def _middles_above(level: int) -> NDArray[np.floating]:
    """Centres of all triangles above the surface, in the layers' frame."""
    centres = geodesic(level).centres
    return to_shading_frame(centres[centres[:, 1] > 0.0])


@lru_cache(maxsize=1)
def _beside() -> NDArray[np.int32]:
    """Neighbours across edges of the upper triangles one level coarser (U / 4, 3), −1 for those below the surface."""
    parents = _above(LEVEL - 1)
    place = np.full(geodesic(LEVEL - 1).n_triangles, -1, np.int32)
    place[parents] = np.arange(len(parents))
    return place[geodesic(LEVEL - 1).neighbours[parents]]


class SliceLevels:
    """The level of each layer, `slices.LEAST_LEVEL` to 4: `of`.

    All layers get the finest level at which they all fit; then the first ones, as many as fit, get one level more. At
    the coarsest level an isotropic layer takes 0.1 MB and an anisotropic one 0.5 MB, whether or not they fit: 512 MiB
    hold 5,000 or 1,100 layers.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._isotropic: dict[Layer, bool] = {}
        self.of: dict[Layer, int] = {}
        self.notes: tuple[str, ...] = ()

    def choose(self, terms: Sequence[Layers]) -> None:
        """Choose the levels for layers that are summed in these terms, each distinct sum once."""
        layers = dict.fromkeys(layer for term in terms for layer in term)
        known = self._isotropic
        self._isotropic = {each: known[each] if each in known else has_isotropic_reflection(each) for each in layers}

        def at(level: int, n_finer: int) -> dict[Layer, int]:
            finer = {layer for term in terms[:n_finer] for layer in term}
            return {layer: level + (layer in finer) for layer in layers}

        # Both sequences need more bytes from one entry to the next: find the last that fits by bisection.
        fits = bisect_right(
            range(LEAST_LEVEL + 1, LEVEL + 1), self._most_bytes, key=lambda level: self._n_bytes(terms, at(level, 0))
        )
        level, n_finer = LEAST_LEVEL + fits, 0
        if level < LEVEL:
            n_finer = bisect_right(
                range(1, len(terms) + 1), self._most_bytes, key=lambda n: self._n_bytes(terms, at(level, n))
            )
        self.of = at(level, n_finer)
        is_coarse = any(level < LEVEL for level in self.of.values())
        self.notes = (_NOTE,) if is_coarse else ()

    def _n_bytes(self, terms: Sequence[Layers], of: dict[Layer, int]) -> int:
        """Bytes that slices and tables of all sums take at these levels."""
        total = sum(slice_bytes_of(level, self._isotropic[layer]) for layer, level in of.items())
        for term in terms:
            made = max(of[layer] for layer in term), all(self._isotropic[layer] for layer in term)
            # A sum of several layers has slices of its own.
            total += table_bytes_of(*made) + (slice_bytes_of(*made) if len(term) > 1 else 0)
        return total
