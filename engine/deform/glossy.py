"""Glossy surfaces: their reflection as a few functions of the light, each weighed by the view [Sloan05, 3.2].

What a surface sends to a view v is the light times b(v, s) s_z. Over many views that is a matrix of harmonics (eq. 14),
whose singular value decomposition leaves n_b functions of the light F_k and weights of the view u_k(v) (eq. 15); one
such decomposition serves all three colours, the functions being shared and the weights not. A point's transfer is the
harmonics of each F_k times what the point sees: n_b rows, each fitted by zonal lobes as if it were a matt point's.

[Sloan05] multiplies the rows by a transfer matrix of order n; we take the product with visibility at order 10, which
costs nothing more, and cut to n only what comes of it.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.deform import _shading_kernels as kernels
from engine.deform.shading import BandLight, Lobes, shade
from engine.deform.transfer import TransferPoints, ray_blocks, turned
from engine.material.layer import Layer
from engine.render.integrator import evaluate_layers
from engine.render.tabulate import is_anisotropic
from engine.scene.raycaster import RayCaster
from engine.sphere.harmonics import MAX_ORDER, basis
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

ORDER, N_ROWS, N_LOBES = 4, 3, 3
N_RAYS = 2000
SIDE = 32  # of the map of views
_RADII, _AZIMUTHS = 64, 64  # directions about the mirror direction
_CROWDED = 3  # how strongly towards its middle, where highlights are
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Gloss:
    """Layers as K functions of the light. functions (K, 100): their harmonics of order 10, in the surface's axes;
    views (SIDE, SIDE, K, 3): their weights by the view (`view_directions`), per colour.

    lost_by_order: the share, 0 to 1, of the reflection's energy - its square, over all views and directions of light -
    that harmonics of order n cannot hold; lost_by_rows: of what they hold, the share that K functions cannot.
    """

    order: int
    functions: Floats
    views: Singles
    lost_by_order: float
    lost_by_rows: float


def gloss(layers: Sequence[Layer], n: int = ORDER, n_rows: int = N_ROWS) -> Gloss:
    """The visible layers, curves and all, to order n in so many functions. Raises ValueError where there are none."""
    if not 1 <= n_rows <= n * n:
        raise ValueError(f"{n_rows} rows, expected 1 to {n * n}")
    harmonics, energy = reflection(layers)
    matrix = harmonics.transpose(0, 2, 1).reshape(-1, MAX_ORDER**2)  # a row a view and colour
    left = np.linalg.svd(matrix[:, : n * n], full_matrices=False)[0][:, :n_rows]
    functions = left.T @ matrix
    held, kept = (float((each**2).sum()) for each in (matrix[:, : n * n], functions[:, : n * n]))
    return Gloss(
        n,
        functions,
        left.reshape(SIDE, SIDE, 3, n_rows).transpose(0, 1, 3, 2).astype(np.float32).copy(),
        _share_lost(held, energy),
        _share_lost(kept, held),
    )


def lost_by_order(layers: Sequence[Layer], n: int) -> float:
    """The share, 0 to 1, of the visible layers' energy that harmonics of order n cannot hold, see `Gloss`."""
    harmonics, energy = reflection(layers)
    return _share_lost(float((harmonics[:, : n * n] ** 2).sum()), energy)


def reflection(layers: Sequence[Layer]) -> tuple[Floats, float]:
    """The harmonics (SIDE^2, 100, 3) of b(v, s) s_z for each view of the map (eq. 14); and the sum of all views' and
    colours' energies, the integrals of (b s_z)^2."""
    views = view_directions().reshape(-1, 3)
    if any(is_anisotropic(layer) for layer in layers if layer.visible):
        harmonics, energies = _reflected(layers, views)
        return harmonics, float(energies.sum())
    # The map's views stand on rings about the normal: one of each ring says what the others are.
    heights, ring = np.unique(np.round(views[:, 2], 9), return_inverse=True)
    slant = np.sqrt(1.0 - heights**2)
    of_rings, energies = _reflected(layers, np.stack([slant, 0.0 * slant, heights], axis=1))
    azimuth = np.arctan2(views[:, 1], views[:, 0])
    cosine, sine, none = np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth
    back = np.stack([cosine, -sine, none, sine, cosine, none, none, none, none + 1.0], axis=1).reshape(-1, 3, 3)
    channels = [turned(of_rings[ring, :, c], np.ascontiguousarray(back)) for c in range(3)]
    return np.stack(channels, axis=2), float(energies[ring].sum())


def simulate_glossy(
    mesh: TransferPoints, caster: RayCaster, reflects: Gloss, n_rays: int = N_RAYS
) -> Generator[float, None, Floats]:
    """Rows (P, K, n^2) of points with the mesh's own shadows, in their own axes. Yields the share that is done."""
    n_points, n2, n_rows = len(mesh.frames), reflects.order**2, len(reflects.functions)
    directions, values = hemisphere_directions(n_rays)
    of_functions = values @ reflects.functions.T * (2.0 * np.pi / n_rays)
    weights = (of_functions[:, :, None] * values[:, None, :n2]).reshape(n_rays, -1)
    # What the directions miss of the integral, seen by a point without shadows, is known.
    missing = (reflects.functions[:, :n2] - weights.sum(axis=0).reshape(n_rows, n2)).ravel()
    rows = np.empty((n_points, n_rows * n2))
    for start, stop, rays in ray_blocks(mesh, directions):
        free = ~caster.occluded(*rays).reshape(stop - start, n_rays)
        rows[start:stop] = free @ weights + free.mean(axis=1)[:, None] * missing
        yield stop / n_points
    return rows.reshape(n_points, n_rows, n2)


def shade_glossy(lobes: Lobes, reflects: Gloss, frames: ArrayLike, to_eye: ArrayLike, light: BandLight) -> Singles:
    """Radiance (P, 3) of points whose axes are now the rows of frames (P, 3, 3), seen from where to_eye (P, 3) points,
    of length 1 (eq. 16); 0 from below. lobes: of their rows one after the other, (P K, ...)."""
    frames = np.ascontiguousarray(frames, np.float32)
    to_eye = np.ascontiguousarray(to_eye, np.float32)
    n_rows = reflects.views.shape[2]
    rows = shade(lobes, np.repeat(frames, n_rows, axis=0), light).reshape(len(frames), n_rows, 3)
    radiance = np.empty((len(frames), 3), np.float32)
    on_threads(
        lambda start, stop: kernels.weigh_range(rows, reflects.views, frames, to_eye, start, stop, radiance),
        *even_parts(len(frames)),
    )
    return radiance


@cache
def view_directions() -> Floats:
    """The directions (SIDE, SIDE, 3) of the map's texels, each for the same share of the hemisphere: the square goes to
    the disc by [Shirley97], which goes to the hemisphere by its area."""
    line = np.linspace(-1.0, 1.0, 2 * SIDE + 1)[1::2]
    a, b = np.repeat(line, SIDE).reshape(SIDE, SIDE), np.tile(line, (SIDE, 1))
    along = np.abs(a) > np.abs(b)
    radius = np.where(along, a, b)
    ratio = np.where(along, b, a) / radius
    angle = np.where(along, ratio * (np.pi / 4.0), np.pi / 2.0 - ratio * (np.pi / 4.0))
    across = radius * np.sqrt(2.0 - radius**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), 1.0 - radius**2], axis=2)


@cache
def hemisphere_directions(count: int) -> tuple[Floats, Floats]:
    """Directions (D, 3) over the upper half of the sphere, evenly, and the harmonics there (D, 100)."""
    i = np.arange(count) + 0.5
    height, angle = 1.0 - i / count, i * _GOLDEN_ANGLE
    slant = np.sqrt(1.0 - height**2)
    directions = np.stack([slant * np.cos(angle), slant * np.sin(angle), height], axis=1)
    return directions, basis(directions, MAX_ORDER)


def _reflected(layers: Sequence[Layer], views: Floats) -> tuple[Floats, Floats]:
    """The harmonics (P, 100, 3) and energies (P,) of b s_z for some views (P, 3)."""
    about, weights = _about_pole()
    harmonics, energies = np.empty((len(views), MAX_ORDER**2, 3)), np.empty(len(views))

    def of_view(i: int) -> None:
        mirror = views[i] * (-1.0, -1.0, 1.0)
        wi = about @ _axes_about(mirror)
        above = wi[:, 2] > 0.0
        values = evaluate_layers(layers, wi[above], np.tile(views[i], (int(above.sum()), 1)))
        weighed = values * weights[above, None]
        harmonics[i] = basis(wi[above], MAX_ORDER).T @ weighed
        energies[i] = (weighed * values).sum()

    on_threads(of_view, range(len(views)))
    return harmonics, energies


@cache
def _about_pole() -> tuple[Floats, Floats]:
    """Directions (D, 3) over the sphere, the denser the nearer to +z, and their shares of its solid angle (D,)."""
    t, of_t = np.polynomial.legendre.leggauss(_RADII)
    t, of_t = (t + 1.0) / 2.0, of_t / 2.0
    polar = np.pi * t**_CROWDED
    of_polar = of_t * np.pi * _CROWDED * t ** (_CROWDED - 1) * np.sin(polar)
    azimuth = (np.arange(_AZIMUTHS) + 0.5) * (2.0 * np.pi / _AZIMUTHS)
    sine = np.sin(polar)[:, None]
    directions = np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)[:, None])
    return np.stack(directions, axis=-1).reshape(-1, 3), np.repeat(of_polar * (2.0 * np.pi / _AZIMUTHS), _AZIMUTHS)


def _axes_about(pole: Floats) -> Floats:
    """Rows: any two directions across a pole, and the pole."""
    side = np.array([0.0, 1.0, 0.0]) if abs(pole[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(side, pole)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(pole, across), pole])


def _share_lost(kept: float, whole: float) -> float:
    return min(max(1.0 - kept / whole, 0.0), 1.0) if whole > 0.0 else 0.0
