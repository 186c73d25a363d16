"""Glossy transfer by rows: a layer's reflection as a few functions of the light, each weighted by the view [Sloan05,
3.2].

For a direction wo, a point reflects the light times b(wo, s) s_z. Over many wo these are the rows of a matrix of
harmonics (eq. 14); its singular value decomposition leaves K functions F_k of the light, and their weights u_k(wo) (eq.
15). One decomposition serves all three channels: they share the functions, and each has its own weights. A point's
transfer is the product of each F_k with what the point sees, fitted by zonal lobes as that of a diffuse point (eq. 16).
So gloss has the shadows of the directions that it reflects, where `engine.realtime.zonal_harmonics.shading`'s lobe has
those of a diffuse surface.

The product with visibility is taken of functions of order 10, and only the result is cut to order n; [Sloan05] cuts
both. A cut draws black rings beside what is bright: `window` attenuates the last bands, half as much as Lanczos' sigma
factors would, which leaves few rings and costs less sharpness than these or than lobes without any. Directions that the
object blocks reflect what the diffuse transfer says that they reflect on average.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer, evaluate_layer
from engine.realtime.core.terms import has_isotropic_reflection
from engine.realtime.zonal_harmonics import _gloss_row_kernels as kernels
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes, shade_some
from engine.realtime.zonal_harmonics.transfer import TransferPoints, ray_blocks, rotate_transfer
from engine.scene.raycaster import RayCaster
from engine.sphere.harmonics import MAX_ORDER, bands, basis

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

SIDE = 32  # of the square of directions wo
MOST_ROWS = 16
N_ROW_LOBES = 3  # of each row
_RADII, _AZIMUTHS = 64, 64  # directions about the mirror direction
_AT_45 = 0.05  # greatest difference of cosines
_CROWDED = 3  # how strongly towards its middle, where highlights are
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class GlossBasis:
    """A layer's reflection as K functions of the light.

    functions (K, 100): their harmonics of order 10, in the surface's axes; views (D, D, K, 3): their weights at
    `view_directions`, per channel. lost_by_order: the share, 0 to 1, of the reflection's energy (its square, over all
    wo and wi) that harmonics of order n cannot hold; lost_by_rows: of what they hold, the share that K functions
    cannot; lost_share: what both lose for wo at about 45 degrees, as `LowGloss.lost_share`.
    """

    order: int
    functions: Float64Array
    views: Float32Array
    lost_by_order: float
    lost_by_rows: float
    lost_share: float

    @property
    def n_rows(self) -> int:
        return len(self.functions)


def gloss_basis(layer: Layer, n: int, n_rows: int) -> GlossBasis:
    """The basis of order n with so many functions. Raises ValueError unless there are 1 to n^2.

    Each wo counts alike, whatever it reflects: otherwise what is bright at grazing angles takes all functions.
    """
    if not 1 <= n_rows <= n * n:
        raise ValueError(f"{n_rows} rows, expected 1 to {n * n}")
    matrix = reflection(layer)[0]
    lengths = np.linalg.norm(matrix[:, :, : n * n], axis=(1, 2), keepdims=True)
    alike = (matrix / np.maximum(lengths, 1e-6 * lengths.max() or 1.0)).reshape(-1, MAX_ORDER**2)
    left = np.linalg.svd(alike[:, : n * n], full_matrices=False)[0][:, :n_rows]
    return basis_of_functions(left.T @ alike, layer, n)


def basis_of_functions(functions: Float64Array, layer: Layer, n: int) -> GlossBasis:
    """A layer's reflection, approximated to order n by given functions (K, 100)."""
    matrix, energies = reflection(layer)
    whole = matrix.reshape(-1, MAX_ORDER**2)[:, : n * n]  # a row for each wo and channel
    weights = np.linalg.lstsq(functions[:, : n * n].T, whole.T, rcond=1e-9)[0].T
    held = (whole**2).reshape(SIDE**2, -1).sum(axis=1)
    left = ((whole - weights @ functions[:, : n * n]) ** 2).reshape(SIDE**2, -1).sum(axis=1)
    oblique = np.abs(view_directions()[:, :, 2].ravel() - np.cos(np.radians(45.0))) < _AT_45
    views = weights.reshape(SIDE, SIDE, 3, len(functions)).transpose(0, 1, 3, 2)
    return GlossBasis(
        n,
        functions,
        np.ascontiguousarray(views, np.float32),
        _share(energies - held, energies),
        _share(left, held),
        _share((energies - held + left)[oblique], energies[oblique]),
    )


def _share(part: Float64Array, whole: Float64Array) -> float:
    """The sum of a part over that of the whole, 0 to 1; 0 of nothing."""
    total = float(whole.sum())
    return min(max(float(part.sum()) / total, 0.0), 1.0) if total > 0.0 else 0.0


@lru_cache(maxsize=16)
def reflection(layer: Layer) -> tuple[Float64Array, Float64Array]:
    """The harmonics (D^2, 3, 100) of b(wo, s) s_z for each of `view_directions` [Sloan05, eq. 14]; and for each the
    integral (D^2,) of (b s_z)^2 over wi, summed over channels."""
    views = view_directions().reshape(-1, 3)
    if not has_isotropic_reflection(layer):
        return _reflected(layer, views)
    # Directions on a ring about the normal have the same reflection, rotated.
    heights, ring = np.unique(np.round(views[:, 2], 9), return_inverse=True)
    slant = np.sqrt(1.0 - heights**2)
    of_rings, energies = _reflected(layer, np.stack([slant, 0.0 * slant, heights], axis=1))
    azimuth = np.arctan2(views[:, 1], views[:, 0])
    cosine, sine, none = np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth
    back = np.stack([cosine, -sine, none, sine, cosine, none, none, none, none + 1.0], axis=1).reshape(-1, 3, 3)
    turned = [rotate_transfer(np.ascontiguousarray(of_rings[ring, c]), back) for c in range(3)]
    return np.stack(turned, axis=1), energies[ring]


@cache
def view_directions() -> Float64Array:
    """The directions (D, D, 3) of wo, each for the same share of the hemisphere: the square is mapped to the disc by
    [Shirley97], and the disc to the hemisphere by its area."""
    line = np.linspace(-1.0, 1.0, 2 * SIDE + 1)[1::2]
    a, b = np.repeat(line, SIDE).reshape(SIDE, SIDE), np.tile(line, (SIDE, 1))
    along = np.abs(a) > np.abs(b)
    radius = np.where(along, a, b)
    ratio = np.where(along, b, a) / radius
    angle = np.where(along, ratio * (np.pi / 4.0), np.pi / 2.0 - ratio * (np.pi / 4.0))
    across = radius * np.sqrt(2.0 - radius**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), 1.0 - radius**2], axis=2)


def _reflected(layer: Layer, views: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The harmonics (V, 3, 100) and energies (V,) of b s_z for directions wo (V, 3)."""
    about, weights = _about_pole()
    harmonics, energies = np.empty((len(views), 3, MAX_ORDER**2)), np.empty(len(views))
    for i, wo in enumerate(views):
        wi = about @ _axes_about(wo * (-1.0, -1.0, 1.0))
        above = wi[:, 2] > 0.0
        values = evaluate_layer(layer, wi[above], np.tile(wo, (int(above.sum()), 1)))
        weighted = values * weights[above, None]
        harmonics[i] = weighted.T @ basis(wi[above], MAX_ORDER)
        energies[i] = (weighted * values).sum()
    return harmonics, energies


@cache
def _about_pole() -> tuple[Float64Array, Float64Array]:
    """Directions (D, 3) over the sphere, the denser the nearer to +z, and their shares of its solid angle (D,)."""
    t, of_t = np.polynomial.legendre.leggauss(_RADII)
    t, of_t = (t + 1.0) / 2.0, of_t / 2.0
    polar = np.pi * t**_CROWDED
    of_polar = of_t * np.pi * _CROWDED * t ** (_CROWDED - 1) * np.sin(polar)
    azimuth = (np.arange(_AZIMUTHS) + 0.5) * (2.0 * np.pi / _AZIMUTHS)
    sine = np.sin(polar)[:, None]
    directions = np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)[:, None])
    return np.stack(directions, axis=-1).reshape(-1, 3), np.repeat(of_polar * (2.0 * np.pi / _AZIMUTHS), _AZIMUTHS)


def _axes_about(pole: Float64Array) -> Float64Array:
    """Rows: two directions perpendicular to a pole, and the pole."""
    side = np.array([0.0, 1.0, 0.0]) if abs(pole[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(side, pole)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(pole, across), pole])


def simulate_gloss_rows(
    mesh: TransferPoints, caster: RayCaster, found: GlossBasis, n_rays: int, diffuse: Float64Array | None = None
) -> Generator[float, None, Float64Array]:
    """Rows (P, K, n^2) of points with the shadows of what n_rays over their hemispheres meet, in their own axes, times
    `window`.

    diffuse (P, n^2): transfer of white Lambertian points with the light that the mesh reflects onto itself; what it has
    beyond direct light comes evenly from the blocked directions. None: these are black. Yields the share that is done.
    """
    n2, n_rows = found.order**2, found.n_rows
    directions, values = hemisphere_directions(n_rays)
    of_functions = values @ found.functions.T * (2.0 * np.pi / n_rays)
    products = (of_functions[:, :, None] * values[:, None, :n2]).reshape(n_rays, -1)
    of_cosine = directions[:, 2] * (2.0 / n_rays)
    # What the directions miss of the integral, which is known for a point without shadows.
    missing = (found.functions[:, :n2] - products.sum(axis=0).reshape(n_rows, n2)).ravel()
    rows = np.empty((len(mesh.frames), n_rows, n2))
    for start, stop, rays in ray_blocks(mesh, directions):
        blocked = caster.occluded(*rays).reshape(stop - start, n_rays).astype(np.float64)
        block = products.sum(axis=0) + missing * (1.0 - blocked.mean(axis=1))[:, None] - blocked @ products
        rows[start:stop] = block.reshape(-1, n_rows, n2)
        if diffuse is not None:
            direct = (1.0 - blocked) @ (of_cosine[:, None] * values[:, :n2])
            share = (blocked @ of_cosine)[:, None]
            reflected = np.where(share > 0.0, (diffuse[start:stop] - direct) / np.maximum(share, 1.0 / n_rays), 0.0)
            rows[start:stop] += (blocked @ of_functions)[:, :, None] * reflected[:, None, :]
        rows[start:stop] *= window(found.order)[bands(found.order)]
        yield stop / len(rows)
    return rows


def window(n: int) -> Float64Array:
    """Factors (n,) of bands: the roots of Lanczos' sigma factors sin(x) / x, x = pi l / n."""
    return np.sqrt(np.sinc(np.arange(n) / n))


@cache
def hemisphere_directions(count: int) -> tuple[Float64Array, Float64Array]:
    """Directions (R, 3) over the upper half of the sphere, evenly, and the harmonics there (R, 100)."""
    i = np.arange(count) + 0.5
    height, angle = 1.0 - i / count, i * _GOLDEN_ANGLE
    slant = np.sqrt(1.0 - height**2)
    directions = np.stack([slant * np.cos(angle), slant * np.sin(angle), height], axis=1)
    return directions, basis(directions, MAX_ORDER)


def add_gloss_rows(
    rows: Lobes, views: Float32Array, which: NDArray[np.int64], frames: Float32Array, places: Float32Array,
    camera_position: ArrayLike, light: BandLight, reached: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points (P,), out of all, send to the camera (3,) [Sloan05, eq. 16].

    rows: lobes of the points' rows one after the other (P K, ...); views (D, D, K, 3): see `GlossBasis`; frames (S, 3,
    3), places (S, 3); reached (P,): the share of the light that others leave.
    """
    n_rows, own_frames = views.shape[2], np.ascontiguousarray(frames[which], np.float32)
    wo = np.asarray(camera_position, np.float64) - places[which]
    wo = np.einsum("pai,pi->pa", own_frames, wo / np.maximum(np.linalg.norm(wo, axis=1, keepdims=True), 1e-30))
    wo = wo.astype(np.float32)
    seen = np.flatnonzero(wo[:, 2] > 0.0)
    values = np.empty((len(rows.low), 3), np.float32)
    shade_some((seen[:, None] * n_rows + np.arange(n_rows)).ravel(), rows, own_frames, light, values, n_rows)
    on_threads(
        lambda start, stop: kernels.weigh_range(start, stop, seen, values, wo, views, reached, which, sent),
        *even_parts(len(seen)),
    )
