"""Compiled projection of light onto the bands of one or two curves, point by point.

The loop runs over lights, not over bands: a point costs O(M) for M lights [BenArtzi07, code 1]. A light is a triangle.
Its share of a band follows from γ at its centre of brightness and at its corners (`_share_kernels`). Near the axis of a
cone γ is not linear, and the triangle is split in four until it is.

Arguments come in named tuples, which cost nothing in compiled code. Directions are stored axis by axis, (3, N), so that
the compiler vectorises the loops over them.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from engine.precompute.direct._angle_kernels import HALF_PI, fill_gammas, is_cone, is_highlight, slope, tint, weigh
from engine.precompute.direct._band_kernels import encode_bands
from engine.precompute.direct._emitter_kernels import cut_emitters, make_cut
from engine.precompute.direct._share_kernels import (
    LEAVES,
    MAX_DEPTH,
    SPREAD,
    Spots,
    is_curved,
    make_spots,
    mean_and_spread,
    share_out,
    split,
)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def count_bits(word):
    """Number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(words, first, n):
    """The share of set bits in [first, first + n)."""
    if n == 1:
        return np.float32((words[first >> 6] >> np.uint64(first & 63)) & np.uint64(1))
    if n < 64:
        part = (words[first >> 6] >> np.uint64(first & 63)) & ((np.uint64(1) << np.uint64(n)) - np.uint64(1))
        return np.float32(count_bits(part)) / np.float32(n)
    total = 0
    for w in range(first >> 6, (first + n) >> 6):
        total += count_bits(words[w])
    return np.float32(total) / np.float32(n)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_visible(words, fine_words, first, n_bits, fine, lights, weights):
    """Lists the lights that a point sees, with the visible share of each; returns their number.

    The visible share of light m is that of set bits in [first, first + n_bits), a range of 1, 4, 16 or whole words; or,
    where fine[m] ≥ 0, that bit of fine_words.
    """
    n = 0
    for m in range(fine.shape[0]):
        f = fine[m]
        if f >= 0:
            share = np.float32((fine_words[f >> 6] >> np.uint64(f & 63)) & np.uint64(1))
        else:
            share = _share(words, first[m], n_bits[m])
        lights[n] = m
        weights[n] = share
        n += share > np.float32(0.0)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def to_local(vectors, frame, x, y, z):
    """Rotates (3, N) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[1]):
        x[v] = frame[0, 0] * vectors[0, v] + frame[0, 1] * vectors[1, v] + frame[0, 2] * vectors[2, v]
        y[v] = frame[1, 0] * vectors[0, v] + frame[1, 1] * vectors[1, v] + frame[1, 2] * vectors[2, v]
        z[v] = frame[2, 0] * vectors[0, v] + frame[2, 1] * vectors[1, v] + frame[2, 2] * vectors[2, v]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gather_local(vectors, listed, n, frame, x, y, z):
    """As `to_local`, for the first n listed columns only."""
    for i in range(n):
        u, v, w = vectors[0, listed[i]], vectors[1, listed[i]], vectors[2, listed[i]]
        x[i] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
        y[i] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
        z[i] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def set_frame(tangent, normal, frame):
    """Writes tangent, bitangent and normal as rows of the frame (3, 3)."""
    for axis in range(3):
        frame[0, axis] = tangent[axis]
        frame[2, axis] = normal[axis]
    frame[1, 0] = normal[1] * tangent[2] - normal[2] * tangent[1]
    frame[1, 1] = normal[2] * tangent[0] - normal[0] * tangent[2]
    frame[1, 2] = normal[0] * tangent[1] - normal[1] * tangent[0]


# Capacity for leaves of split lights, and for pieces of wide ones.
_ROOM = 4096
# Emitters have edges, which a highlight shows: they are split at a smaller bend of γ than the sky.
LAMP_SHARPNESS = np.float32(0.2)


class SkyLights(NamedTuple):
    """M triangle lights over N corner directions: directions (3, N), corners (M, 3), sizes (M,) longest edge in
    radians, centres (3, M), colours (M, 3) radiance times solid angle; first, n_bits, fine (M,): see `list_visible`;
    rows (M,) of the tree (N, 6) that they were cut from: colour and centre of each triangle, its children in rows 4 r +
    20 to 4 r + 23."""

    directions: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    centres: np.ndarray
    colours: np.ndarray
    first: np.ndarray
    n_bits: np.ndarray
    fine: np.ndarray
    rows: np.ndarray
    tree: np.ndarray


class Bits(NamedTuple):
    """Packed visibility (P, words) of the sphere, of sky lights with bits of their own, and of emitters' leaves. start
    (P + 1,), node and delta (K,) refine the visible share of some leaves, see `engine.precompute.direct.near_leaves`.
    """

    sphere: np.ndarray
    fine: np.ndarray
    emitters: np.ndarray
    start: np.ndarray
    node: np.ndarray
    delta: np.ndarray


class ViewedPoints(NamedTuple):
    """Shading points (P, 3): position, tangent, normal and the direction wo to the camera."""

    position: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray
    wo: np.ndarray


class Optics(NamedTuple):
    """A layer's reflection: model and angle numbers, quotient parameters q (8,), bands (J, K); tolerance: how many
    bands γ may bend over a light before it is split; tints: number of the look-up of quotients per colour channel, 0
    for a model with one quotient for all."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    n_a: int
    n_b: int
    tolerance: np.float32
    tints: int = 0


class _Scratch(NamedTuple):
    """Working memory for one point: corner directions x, y, z; centres cx, cy, cz and sizes of the lights listed in
    `spots`; row and above: the tree row of a leaf's colour and the leaf's share of it; colours of lights and, behind
    them, of leaves; tinted: those colours times the quotient."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    gammas_a: np.ndarray
    gammas_b: np.ndarray
    cx: np.ndarray
    cy: np.ndarray
    cz: np.ndarray
    sizes: np.ndarray
    curved: np.ndarray
    spots: Spots
    stack: np.ndarray
    depths: np.ndarray
    below: np.ndarray
    row: np.ndarray
    above: np.ndarray
    colours: np.ndarray
    tinted: np.ndarray
    quotients: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _mark_curved(kind, scale, tolerance, sizes, mean, curved):
    """Marks the lights over which a cone angle is curved."""
    rate = slope(kind)
    for i in range(mean.shape[0]):
        curved[i] |= np.int32(is_curved(sizes[i] * rate, mean[i], scale, tolerance))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _mean_and_spread(kind, sizes, gammas, corners, lights, n_whole, mean, spread):
    """Mean and spread of γ over each spot, in radians; mean holds γ at the spot's centre on entry.

    For a cone angle both follow from the spot's size, see `_share_kernels`. The same holds for leaves, which begin at
    n_whole: over a leaf every γ is nearly a cone. Otherwise the spread follows from the corners of the light.
    """
    rate, first = slope(kind), 0 if is_cone(kind) else n_whole
    for i in range(first, mean.shape[0]):
        part = SPREAD * sizes[i] * rate
        spread[i], mean[i] = part, np.sqrt(mean[i] * mean[i] + part * part)
    for i in range(first):
        m = lights[i]
        spread[i] = mean_and_spread(gammas[corners[m, 0]], gammas[corners[m, 1]], gammas[corners[m, 2]])[1]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _split_curved(corners, rows, tree, n_lights, scale_a, scale_b, optics, frame, ox, oy, oz, scratch):
    """Appends the leaves of curved lights behind the first n_lights, and gives the lights themselves weight 0; returns
    the new number.

    Each leaf has its own colour, stored behind those of the lights, and its own centre of brightness, as deep as the
    tree goes. Pieces of sun lights (row -1) are uniform. Lights stay whole once the list is full.
    """
    stack, lights, weights, sizes, curved = (
        scratch.stack, scratch.spots.light, scratch.spots.weight, scratch.sizes, scratch.curved
    )  # fmt: skip
    x, y, z, n, most = scratch.x, scratch.y, scratch.z, n_lights, scratch.cx.shape[0] - LEAVES
    leaves = (scratch.cx, scratch.cy, scratch.cz, sizes, scratch.row, scratch.above)
    colours, n_rows, n_colours = scratch.colours, tree.shape[0], rows.shape[0]
    for i in range(n_lights):
        # Skip lights that are not curved or lie below the horizon.
        if curved[i] == 0 or scratch.cz[i] <= -sizes[i] or n > most:
            continue
        m, first, weight, size = lights[i], n, weights[i], sizes[i]
        has_tree = n_rows > 0 and rows[m] >= 0
        # Split the triangle until γ is linear over each leaf.
        for corner in range(3):
            v = corners[m, corner]
            stack[0, corner, 0], stack[0, corner, 1], stack[0, corner, 2] = x[v], y[v], z[v]
        n = split(
            stack, scratch.depths, scratch.below, rows[m], size, scale_a, scale_b, optics,
            n_rows if has_tree else np.int64(0), ox, oy, oz, leaves, n,
        )  # fmt: skip
        # Colour and centre of a leaf: those of its own node, or a share of the deepest node above it.
        for leaf in range(first, n):
            row, share, own = scratch.row[leaf], scratch.above[leaf] * scratch.above[leaf], n_colours + leaf - n_lights
            for channel in range(3):
                colours[own, channel] = share * (tree[row, channel] if has_tree else colours[m, channel])
            if has_tree and share == np.float32(1.0):
                u, v, w = tree[row, 3], tree[row, 4], tree[row, 5]
                scratch.cx[leaf] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
                scratch.cy[leaf] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
                scratch.cz[leaf] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w
            lights[leaf], weights[leaf], sizes[leaf] = own, weight, size * sizes[leaf]
        weights[i] = np.float32(0.0)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _project_lights(bands, corners, sizes, rows, tree, n_directions, n_lights, optics, frame, ox, oy, oz, scratch):
    """Adds the listed lights to bands (J, K, 3): U_jk += V L ρ_q cosθ ΔΩ Δ_mj Δ_mk [BenArtzi07, eq. 4.15].

    scratch holds the local corner directions (x, y, z), the listed lights, their colours, weights (visible share) and
    centre directions (cx, cy, cz). (ox, oy, oz) is the local direction to the camera. γ at a light's centre of
    brightness serves as its mean over the light, which removes the first-order error of a light that is brighter on one
    side.
    """
    spots, q, two, n, colours = scratch.spots, optics.q, optics.n_b > 1, n_lights, scratch.colours
    x, y, z = scratch.x[:n_directions], scratch.y[:n_directions], scratch.z[:n_directions]
    cx, cy, cz, mean_a, mean_b = scratch.cx, scratch.cy, scratch.cz, spots.mean_a, spots.mean_b
    scale_a, scale_b = np.float32(optics.n_a) / HALF_PI, np.float32(optics.n_b) / HALF_PI
    listed, lights, curved = scratch.sizes, spots.light, scratch.curved[:n]
    for i in range(n):
        listed[i], curved[i] = sizes[lights[i]], np.int32(0)
    # γ_A and γ_B at the lights' centres and, unless they are cones, at the corners; mark lights to split.
    fill_gammas(optics.kind_a, q, cx[:n], cy[:n], cz[:n], ox, oy, oz, mean_a)
    _mark_curved(optics.kind_a, scale_a, optics.tolerance, listed, mean_a[:n], curved)
    if not is_cone(optics.kind_a):
        fill_gammas(optics.kind_a, q, x, y, z, ox, oy, oz, scratch.gammas_a)
    if two:
        fill_gammas(optics.kind_b, q, cx[:n], cy[:n], cz[:n], ox, oy, oz, mean_b)
        _mark_curved(optics.kind_b, scale_b, optics.tolerance, listed, mean_b[:n], curved)
        if not is_cone(optics.kind_b):
            fill_gammas(optics.kind_b, q, x, y, z, ox, oy, oz, scratch.gammas_b)
    # Split curved lights into leaves.
    n = _split_curved(corners, rows, tree, n_lights, scale_a, scale_b, optics, frame, ox, oy, oz, scratch)
    # Weights: visible share times ρ_q cosθ, or per channel where the quotient is coloured.
    if optics.tints != 0:
        tint(
            optics.tints, q, lights, cx[:n], cy[:n], cz[:n], ox, oy, oz, spots.weight, colours, scratch.quotients,
            scratch.tinted,
        )  # fmt: skip
        colours = scratch.tinted
    else:
        weigh(optics.model, q, cx[:n], cy[:n], cz[:n], ox, oy, oz, spots.weight)
    # γ at the leaves' centres, then mean and spread of γ over every spot.
    lx, ly, lz = cx[n_lights:n], cy[n_lights:n], cz[n_lights:n]
    fill_gammas(optics.kind_a, q, lx, ly, lz, ox, oy, oz, mean_a[n_lights:n])
    _mean_and_spread(optics.kind_a, listed, scratch.gammas_a, corners, lights, n_lights, mean_a[:n], spots.spread_a)
    if two:
        fill_gammas(optics.kind_b, q, lx, ly, lz, ox, oy, oz, mean_b[n_lights:n])
        _mean_and_spread(optics.kind_b, listed, scratch.gammas_b, corners, lights, n_lights, mean_b[:n], spots.spread_b)
    # The shares Δ_mj Δ_mk of the bands, with the weighted colours [BenArtzi07, eq. 4.12 and 4.15].
    share_out(bands, colours, n, spots, scale_a, scale_b)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _with_lamp_sharpness(optics):
    """The optics for emitters: their edges show in a highlight, whereas the sky is cut evenly."""
    tolerance = optics.tolerance * LAMP_SHARPNESS if is_highlight(optics.kind_a) else optics.tolerance
    return Optics(
        optics.model, optics.q, optics.kind_a, optics.kind_b, optics.n_a, optics.n_b, tolerance, optics.tints
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _copy_colours(colours, out):
    """Copies colours into the first rows, element by element: for whole-array assignment the compiler generates error
    messages, which takes as long to compile as the rest of a kernel."""
    for m in range(colours.shape[0]):
        for channel in range(3):
            out[m, channel] = colours[m, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _make_scratch(n_directions, n_lights):
    """Working memory for one point with n_directions corner directions and n_lights lights."""
    depth, n = 3 * MAX_DEPTH + 4, n_lights + _ROOM
    return _Scratch(
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32),
        np.empty(n_lights, np.int32), make_spots(n + _ROOM),
        np.empty((depth, 3, 3), np.float32), np.empty(depth, np.int64), np.empty((depth, 2), np.int64),
        np.empty(n, np.int64), np.empty(n, np.float32),
        np.zeros((n_lights + n, 3), np.float32), np.zeros((n_lights + n, 3), np.float32),
        np.empty((n, 3), np.float32),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_tile(rows, surface, sky, emitters, bits, optics, trim, encoded):
    """Projects all lights onto the bands of one layer at the points `rows` and encodes them; returns the number of
    values written."""
    n_sky, n_sky_corners = sky.corners.shape[0], sky.directions.shape[1]
    cut, no_tree = make_cut(emitters.child.shape[0], emitters.n_roots), np.empty((0, 6), np.float32)
    n_most = cut.sizes.shape[0]
    sharp = _with_lamp_sharpness(optics)
    s = _make_scratch(max(n_sky_corners, 3 * n_most), max(n_sky, n_most))
    lights, weights = s.spots.light, s.spots.weight
    bands = np.empty((optics.n_a + 2, optics.n_b + 2 if optics.n_b > 1 else 1, 3), np.float32)
    frame = np.empty((3, 3), np.float32)
    cells, maxima = np.empty((optics.n_a, optics.n_b), np.float32), np.empty(optics.n_a, np.float32)
    written = np.int64(0)  # a literal would have its own type, and `encode_bands` would be compiled twice
    for i in range(rows.shape[0]):
        r = rows[i]
        # Local frame, and the direction to the camera in it.
        set_frame(surface.tangent[r], surface.normal[r], frame)
        wo = surface.wo[r]
        ox = frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2]
        oy = frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2]
        oz = frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2]
        bands[:] = np.float32(0.0)
        # Sky: list the visible lights with their visible shares, then project them.
        if n_sky > 0:
            n = list_visible(bits.sphere[r], bits.fine[r], sky.first, sky.n_bits, sky.fine, lights, weights)
            to_local(sky.directions, frame, s.x, s.y, s.z)
            gather_local(sky.centres, lights, n, frame, s.cx, s.cy, s.cz)
            if i == 0 or n_most > 0:
                _copy_colours(sky.colours, s.colours)
            _project_lights(
                bands, sky.corners, sky.sizes, sky.rows, sky.tree, n_sky_corners, n, optics, frame, ox, oy, oz, s
            )
        # Emitters: cut the tree for this point, then project the nodes of the cut.
        if n_most > 0:
            near = (bits.node, bits.delta, bits.start[r], bits.start[r + 1])
            n = cut_emitters(
                bits.emitters[r], near, emitters, surface.position[r], frame, optics, ox, oy, oz, cut, s.x, s.y, s.z,
                s.cx, s.cy, s.cz, s.colours, weights,
            )  # fmt: skip
            for k in range(n):
                lights[k] = cut.rows[k]
            _project_lights(bands, cut.corners, cut.sizes, cut.rows, no_tree, 3 * n, n, sharp, frame, ox, oy, oz, s)
        # Trim and encode the bands of the point.
        encoded.start[i] = written
        written = encode_bands(bands[: optics.n_a, : optics.n_b], trim, cells, maxima, encoded, i, written)
    return written
