"""Compiled projection of light onto the bands of one or two curves, point by point.

The loop runs over lights, not over bands: cost O(M) a point [BenArtzi07, code 1]. A light is a triangle; its share of
a band follows from γ at its centre of brightness and its corners (`_share_kernels`). Near a pole γ is not linear, and
the triangle is split in four until it is.

Arguments come in groups (the named tuples below), which cost nothing in compiled code. Directions are stored axis by
axis, (3, N), so that loops over them are vector loops.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material._kernels import gamma
from engine.transport._angle_kernels import HALF_PI, fill_gammas, is_cone, slope, weigh
from engine.transport._band_kernels import encode_bands
from engine.transport._seen_kernels import gather_local, list_visible, patch_colours, set_frame, to_local, towards
from engine.transport._share_kernels import deposit, mean_and_spread

_MAX_SPLIT = 3
_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


class Sky(NamedTuple):
    """M triangle lights over N corner directions: directions (3, N), corners (M, 3), sizes (M,) longest edge, radians,
    centres (3, M), colours (M, 3) radiance times solid angle; first, n_bits, fine (M,): see `list_visible`."""

    directions: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    centres: np.ndarray
    colours: np.ndarray
    first: np.ndarray
    n_bits: np.ndarray
    fine: np.ndarray


class Patches(NamedTuple):
    """M patches over N corner points: points (3, N), corners (M, 3), centres (3, M), radiance (M, 3)."""

    points: np.ndarray
    corners: np.ndarray
    centres: np.ndarray
    radiance: np.ndarray


class Bits(NamedTuple):
    """Packed visibility (P, words) of the sphere, of sky lights with bits of their own, and of patches."""

    sphere: np.ndarray
    fine: np.ndarray
    patches: np.ndarray


class Surface(NamedTuple):
    """Shading points (P, 3): position, tangent, normal and the direction to the eye."""

    position: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray
    wo: np.ndarray


class Optics(NamedTuple):
    """A layer: model and angle numbers, quotient parameters q (8,), bands (J, K), and how many bands γ may bend over a
    light before it is split."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    n_a: int
    n_b: int
    tolerance: np.float32


class Encoded(NamedTuple):
    """Where a tile's bands are written: see `bandstore`."""

    scale: np.ndarray
    first: np.ndarray
    length: np.ndarray
    start: np.ndarray
    values: np.ndarray


class _Scratch(NamedTuple):
    """Room for one point."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    cx: np.ndarray
    cy: np.ndarray
    cz: np.ndarray
    gammas_a: np.ndarray
    gammas_b: np.ndarray
    centre_a: np.ndarray
    centre_b: np.ndarray
    lights: np.ndarray
    weights: np.ndarray
    stack: np.ndarray
    depths: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_curved(size, nearest, scale, tolerance):
    """Whether γ, a cone near its pole, bends over a triangle by more than `tolerance` bands and as much of its size.

    Over a triangle of extent s at distance r from the pole it leaves its chord by s²/8r. A triangle far larger than a
    band need not follow the band: there the bound is 0.3 · tolerance of the triangle.
    """
    bend = size * size * np.float32(0.125)
    return bend > nearest * tolerance * max(np.float32(1.0) / scale, np.float32(0.3) * size)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _fill_gammas_of(corner, optics, ox, oy, oz):
    """corner: x, y, z and, filled here, the γ of both curves (of the first alone where there is one)."""
    x, y, z = corner[0], corner[1], corner[2]
    corner[3] = min(gamma(optics.kind_a, optics.q, x, y, z, ox, oy, oz), HALF_PI)
    if optics.n_b > 1:
        corner[4] = min(gamma(optics.kind_b, optics.q, x, y, z, ox, oy, oz), HALF_PI)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _push_children(stack, depths, top, six, optics, ox, oy, oz):
    """Replace the triangle stack[top] by its four quarters; a γ that is known is not taken again."""
    for corner in range(3):
        for i in range(5):
            six[corner, i] = stack[top, corner, i]
    for m in range(3, 6):
        i, j = m - 3, (m - 2) % 3
        x, y, z = six[i, 0] + six[j, 0], six[i, 1] + six[j, 1], six[i, 2] + six[j, 2]
        inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
        six[m, 0], six[m, 1], six[m, 2] = x * inverse, y * inverse, z * inverse
        _fill_gammas_of(six[m], optics, ox, oy, oz)
    depth = depths[top] + 1
    for child in range(4):
        for corner in range(3):
            for i in range(5):
                stack[top + child, corner, i] = six[_CHILDREN[child, corner], i]
        depths[top + child] = depth


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _deposit_split(bands, weight, r, g, b, size_a, size_b, scale_a, scale_b, optics, ox, oy, oz, scratch):
    """As `deposit` for the triangle in stack[0] (corners x, y, z), split in four wherever γ is not linear over it."""
    stack, depths, two = scratch.stack, scratch.depths, optics.n_b > 1
    last_a, last_b = np.float32(optics.n_a - 1), np.float32(optics.n_b - 1)
    six = np.zeros((6, 5), np.float32)
    top = 0
    depths[0] = 0
    for corner in range(3):
        stack[0, corner, 4] = np.float32(0.0)
        _fill_gammas_of(stack[0, corner], optics, ox, oy, oz)
    while top >= 0:
        a0, a1, a2 = stack[top, 0, 3], stack[top, 1, 3], stack[top, 2, 3]
        b0, b1, b2 = stack[top, 0, 4], stack[top, 1, 4], stack[top, 2, 4]
        shrink = np.float32(0.5) ** depths[top]
        curved = _is_curved(size_a * shrink, min(a0, a1, a2), scale_a, optics.tolerance)
        if two:
            curved = curved or _is_curved(size_b * shrink, min(b0, b1, b2), scale_b, optics.tolerance)
        if curved and depths[top] < _MAX_SPLIT:
            _push_children(stack, depths, top, six, optics, ox, oy, oz)
            top += 3
            continue
        w = weight * shrink * shrink
        mean_a, spread_a = mean_and_spread(a0 * scale_a, a1 * scale_a, a2 * scale_a)
        mean_b, spread_b = mean_and_spread(b0 * scale_b, b1 * scale_b, b2 * scale_b)
        deposit(bands, r * w, g * w, b * w, mean_a, spread_a, last_a, mean_b, spread_b, last_b, two)
        top -= 1


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _extent(is_cone, size, centre, gammas, v0, v1, v2):
    """Spread of γ over a light and its least value, in radians: for a cone from its size alone, else from its corners.

    Over an equilateral triangle of side s, every linear function of slope 1 has the standard deviation s / sqrt 24.
    """
    if is_cone:
        return np.float32(0.204) * size, centre - np.float32(0.5) * size
    g0, g1, g2 = gammas[v0], gammas[v1], gammas[v2]
    return mean_and_spread(g0, g1, g2)[1], min(g0, g1, g2)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _project_lights(bands, corners, sizes, colours, n_directions, n_lights, optics, ox, oy, oz, scratch):
    """Add the listed lights to bands (J, K, 3): T_jk += V L ρ_q cosθ ΔΩ Δ_mj Δ_mk [BenArtzi07, eq. 4.15].

    scratch holds the local corner directions (x, y, z), the lights listed, their weights (visible share) and centre
    directions (cx, cy, cz); (ox, oy, oz) is the local eye direction. The mean of γ over a light is taken as γ at its
    centre of brightness: that takes out the first-order error of a light that is brighter on one side.
    """
    x, y, z, weights = scratch.x[:n_directions], scratch.y[:n_directions], scratch.z[:n_directions], scratch.weights
    gammas_a, gammas_b, q, two = scratch.gammas_a, scratch.gammas_b, optics.q, optics.n_b > 1
    scale_a, scale_b = np.float32(optics.n_a) / HALF_PI, np.float32(optics.n_b) / HALF_PI
    last_a, last_b = np.float32(optics.n_a - 1), np.float32(optics.n_b - 1)
    cone_a, cone_b = is_cone(optics.kind_a), is_cone(optics.kind_b)
    slope_a, slope_b = slope(optics.kind_a), slope(optics.kind_b)
    cx, cy, cz = scratch.cx[:n_lights], scratch.cy[:n_lights], scratch.cz[:n_lights]
    weigh(optics.model, q, cx, cy, cz, ox, oy, oz, weights)
    fill_gammas(optics.kind_a, q, cx, cy, cz, ox, oy, oz, scratch.centre_a)
    if not cone_a:
        fill_gammas(optics.kind_a, q, x, y, z, ox, oy, oz, gammas_a)
    if two:
        fill_gammas(optics.kind_b, q, cx, cy, cz, ox, oy, oz, scratch.centre_b)
        if not cone_b:
            fill_gammas(optics.kind_b, q, x, y, z, ox, oy, oz, gammas_b)
    spread_b = mean_b = np.float32(0.0)
    for i in range(n_lights):
        weight = weights[i]
        if not weight > 0.0:
            continue
        m = scratch.lights[i]
        v0, v1, v2 = corners[m, 0], corners[m, 1], corners[m, 2]
        r, g, b = colours[m, 0], colours[m, 1], colours[m, 2]
        size_a, size_b = sizes[m] * slope_a, sizes[m] * slope_b
        mean_a = scratch.centre_a[i]
        spread_a, nearest = _extent(cone_a, size_a, mean_a, gammas_a, v0, v1, v2)
        curved = _is_curved(size_a, nearest, scale_a, optics.tolerance)
        if two:
            mean_b = scratch.centre_b[i]
            spread_b, nearest = _extent(cone_b, size_b, mean_b, gammas_b, v0, v1, v2)
            curved = curved or _is_curved(size_b, nearest, scale_b, optics.tolerance)
        if curved:
            for corner in range(3):
                v, place = corners[m, corner], scratch.stack[0, corner]
                place[0], place[1], place[2] = x[v], y[v], z[v]
            _deposit_split(bands, weight, r, g, b, size_a, size_b, scale_a, scale_b, optics, ox, oy, oz, scratch)
            continue
        r, g, b = r * weight, g * weight, b * weight
        mean_a, spread_a, mean_b, spread_b = mean_a * scale_a, spread_a * scale_a, mean_b * scale_b, spread_b * scale_b
        deposit(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b, two)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _make_scratch(n_directions, n_lights):
    depth = 3 * _MAX_SPLIT + 4
    return _Scratch(
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n_lights, np.float32), np.empty(n_lights, np.float32), np.empty(n_lights, np.float32),
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n_lights, np.float32), np.empty(n_lights, np.float32),
        np.empty(n_lights + 1, np.int64), np.empty(n_lights + 1, np.float32),
        np.empty((depth, 3, 5), np.float32), np.empty(depth, np.int64),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_tile(rows, surface, sky, patches, bits, optics, trim, encoded):
    """Project all lights for one layer at the points `rows` and encode them; returns the number of values written."""
    n_sky, n_patches = sky.corners.shape[0], patches.corners.shape[0]
    n_sky_corners, n_patch_corners = sky.directions.shape[1], patches.points.shape[1]
    s = _make_scratch(max(n_sky_corners, n_patch_corners), max(n_sky, n_patches))
    corners_seen, centres_seen = np.empty((3, n_patch_corners), np.float32), np.empty((3, n_patches), np.float32)
    colours, sizes = np.zeros((n_patches, 3), np.float32), np.empty(n_patches, np.float32)
    own_bit = np.arange(n_patches)
    bands = np.empty((optics.n_a + 2, optics.n_b + 2 if optics.n_b > 1 else 1, 3), np.float32)
    frame = np.empty((3, 3), np.float32)
    cells, maxima = np.empty((optics.n_a, optics.n_b), np.float32), np.empty(optics.n_a, np.float32)
    written = np.int64(0)  # a literal would be a type of its own, and have `encode_bands` compiled twice
    for i in range(rows.shape[0]):
        r = rows[i]
        set_frame(surface.tangent[r], surface.normal[r], frame)
        wo = surface.wo[r]
        ox = frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2]
        oy = frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2]
        oz = frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2]
        bands[:] = np.float32(0.0)
        if n_sky > 0:
            n = list_visible(bits.sphere[r], bits.fine[r], sky.first, sky.n_bits, sky.fine, s.lights, s.weights)
            to_local(sky.directions, frame, s.x, s.y, s.z)
            gather_local(sky.centres, s.lights, n, frame, s.cx, s.cy, s.cz)
            _project_lights(bands, sky.corners, sky.sizes, sky.colours, n_sky_corners, n, optics, ox, oy, oz, s)
        if n_patches > 0:
            n = list_visible(bits.patches[r], bits.patches[r], own_bit, own_bit, own_bit, s.lights, s.weights)
            towards(patches.points, surface.position[r], corners_seen)
            towards(patches.centres, surface.position[r], centres_seen)
            patch_colours(corners_seen, patches.corners, patches.radiance, colours, sizes)
            to_local(corners_seen, frame, s.x, s.y, s.z)
            gather_local(centres_seen, s.lights, n, frame, s.cx, s.cy, s.cz)
            _project_lights(bands, patches.corners, sizes, colours, n_patch_corners, n, optics, ox, oy, oz, s)
        encoded.start[i] = written
        written = encode_bands(bands[: optics.n_a, : optics.n_b], trim, cells, maxima, encoded, i, written)
    return written
