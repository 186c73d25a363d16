"""Compiled: traces caustic photons from glossy surfaces, and reflects them at gather points.

A photon starts at a uniformly distributed position of the glossy surfaces, takes light from a light source, chosen by
power, and leaves about the axis of the surface's lobe, which works for any curve. Where it lands it contributes to the
gather points around it, with a kernel that falls to 0 at their radius r,

    E(x) = Σ 2 (1 - d²/r²) / (π r²) Φ .

A gather point's own rays find the same light where they happen to hit the glossy surface. The two estimates are
combined by the power heuristic (`photon_share`), by the number of samples that each expects near that path; a photon
must hit a disc of area π r²/2 about the gather point [Georgiev12; Hachisuka12].
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect._cache_kernels import _pick, _position, _shading_normal
from engine.precompute.indirect._gloss_kernels import add_gloss
from engine.precompute.indirect._light_choice_kernels import TINY, towards_light
from engine.precompute.indirect._ray_kernels import (
    ABOUT_AXIS,
    HORIZON,
    direction_pdf,
    local_wo,
    object_tangent,
    sample_direction,
    to_local,
    to_world,
)
from engine.precompute.indirect._reflection_kernels import CONSTANT, HALF_PI, ONE, ZERO, _coded, _coded_node, _curve_at
from engine.precompute.indirect._second_bounce_kernels import expected_photons, photon_share

# Bounds the weight of photons at grazing incidence.
_LEAST_COSINE = np.float32(0.05)
# sin² 15°: a photon seen at a greater angle to the tangent plane lies on another part of the surface.
_OFF_PLANE = np.float32(0.07)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def emit(numbers, about, triangles, turns, per_area, mesh, lobe_axes, axes, all_lights, offset,
         starts, to_light, limits, onward, normals, lights, power, ahead):  # fmt: skip
    """Emits n photons from the triangles (n,), with random numbers (n, 5) in [0, 1) and unit vectors `about` (n, 3)
    from a lobe table; turns (n,): codes of the tangents' maps there.

    per_area (M,): photons per square metre of each object. Writes shadow rays starts and to_light (n, 3) with limits
    (n,); onward (n, 3), normals (n, 3); lights (n,), by their numbers; power (n, 3) without the material, 0 for no
    photon; ahead (n,): as `expected_photons`.
    """
    for i in range(triangles.shape[0]):
        triangle = triangles[i]
        o = mesh.objects[triangle]
        power[i] = ZERO
        # A uniform position on the triangle.
        u, v = numbers[i, 0], numbers[i, 1]
        if u + v > ONE:
            u, v = ONE - u, ONE - v
        px, py, pz = _position(mesh, triangle, u, v)
        # A light source by power, and a point on it.
        m = _pick(all_lights.cumulative, numbers[i, 2])
        lights[i] = m
        x, y, z, far, geometry = towards_light(all_lights, m, numbers[i, 3], numbers[i, 4], px, py, pz)
        is_sky = m < all_lights.density.shape[0]
        limits[i] = far if is_sky else max(far * np.float32(0.9999), TINY)
        # Local frame on the lit side; sample the outgoing direction about the lobe axis.
        nx, ny, nz = _shading_normal(mesh, triangle, u, v)
        if nx * x + ny * y + nz * z < ZERO:
            nx, ny, nz = -nx, -ny, -nz
        tx, ty, tz = object_tangent(axes, o, turns[i], nx, ny, nz)
        lx, ly, lz = to_local(tx, ty, tz, nx, ny, nz, x, y, z)
        if lz <= HORIZON or geometry <= ZERO:
            continue
        ox, oy, oz = sample_direction(about, i, ABOUT_AXIS, ONE, ZERO, lobe_axes[o], lx, ly, lz)
        if oz <= HORIZON:
            continue
        wx, wy, wz = to_world(tx, ty, tz, nx, ny, nz, ox, oy, oz)
        face = mesh.face_normals[triangle]
        side = face[0] * x + face[1] * y + face[2] * z
        # Photons start uniformly by true area, so the outgoing flux uses the cosine to the face, even on smooth
        # surfaces.
        leaving = face[0] * wx + face[1] * wy + face[2] * wz
        if side * leaving <= ZERO:
            continue
        # Flux: light · geometry · cosine / (density of the direction · density of positions).
        density = direction_pdf(ZERO, ONE, lobe_axes[o], ox, oy, oz, lx, ly, lz)
        ahead[i] = expected_photons(all_lights, m, lobe_axes[o], per_area[o], lx, ly, lz, ox, oy, oz)
        lift = offset if side >= ZERO else -offset
        for axis in range(3):
            starts[i, axis] = (px if axis == 0 else py if axis == 1 else pz) + lift * face[axis]
            sent = all_lights.power[m, axis] * all_lights.shares[all_lights.groups[o], m, axis]
            power[i, axis] = sent * geometry * abs(leaving) / (density * per_area[o])
        to_light[i, 0], to_light[i, 1], to_light[i, 2] = x, y, z
        onward[i, 0], onward[i, 1], onward[i, 2] = wx, wy, wz
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def photon_power(photons, g, out):
    """The flux (n, 3) of each photon in watts under the curves of the glossy layers g, with the means of their texture
    maps."""
    nowhere = np.int64(-1)  # a literal would have its own type, and `add_gloss` would be compiled twice
    for i in range(out.shape[0]):
        o = photons.sources[i]
        nx, ny, nz = photons.normals[i, 0], photons.normals[i, 1], photons.normals[i, 2]
        # Directions to the light and onwards in the local frame.
        tx, ty, tz = object_tangent(g.axes, o, photons.turns[i], nx, ny, nz)
        to_light, onward = photons.to_light[i], photons.directions[i]
        x, y, z = to_local(tx, ty, tz, nx, ny, nz, to_light[0], to_light[1], to_light[2])
        ox, oy, oz = to_local(tx, ty, tz, nx, ny, nz, onward[0], onward[1], onward[2])
        out[i] = ZERO
        add_gloss(g, o, nowhere, x, y, z, ox, oy, oz, ONE, out[i])
        for channel in range(3):
            out[i, channel] *= photons.power[i, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _faces_away(face, place, photons, n, distance2):
    """Whether photon n arrives on the side of the surface that this normal points to, but away from its plane."""
    if n < 0:
        return False
    off, cosine = ZERO, ZERO
    for axis in range(3):
        off += face[axis] * (photons.positions[n, axis] - place[axis])
        cosine -= face[axis] * photons.directions[n, axis]
    return cosine > ZERO and off * off > _OFF_PLANE * distance2


@nb.njit(cache=True, nogil=True, error_model="numpy")
def weigh_photons(samples, begin, end, times, geometric, position, photons, found, distances2, radii2, weights):
    """Writes weights (p, k) of the photons found (p, k) near points [begin, end), nearest first: 1/m² divided by the
    cosine.

    distances2 (p, k), radii2 (p,). A radius shrinks to where the surface curves away, since light would otherwise be
    missing there. A missing photon is −1 in `found`.
    """
    n_cosine, n_lobe = np.float32(samples.tables_cosine.shape[1]), np.float32(samples.tables_lobe.shape[1])
    for i in range(begin, end):
        r = samples.rows[i]
        tangent, normal, face = samples.tangent[r], samples.normal[r], geometric[r]
        ox, oy, oz = local_wo(tangent, normal, samples.wo[r])
        # Shrink the radius to the nearest photon that lies off the tangent plane.
        for k in range(found.shape[1]):
            if distances2[i, k] < radii2[i] and _faces_away(face, position[r], photons, found[i, k], distances2[i, k]):
                radii2[i] = distances2[i, k]
        area = np.float32(math.pi / 2.0) * radii2[i]
        for k in range(found.shape[1]):
            weights[i, k] = ZERO
            n = found[i, k]
            if n < 0 or distances2[i, k] >= radii2[i]:
                continue
            # Kernel 2 (1 - d²/r²) / (π r²) times the photons' share of the light, over the cosine to the face.
            dx, dy, dz = -photons.directions[n, 0], -photons.directions[n, 1], -photons.directions[n, 2]
            cosine = face[0] * dx + face[1] * dy + face[2] * dz
            x, y, z = to_local(tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2], dx, dy, dz)
            if z <= HORIZON or cosine <= ZERO:
                continue
            sample_set = direction_pdf(n_cosine, n_lobe, samples.lobe_axes[i], x, y, z, ox, oy, oz) / times[i]
            share = photon_share(photons.ahead[n], z, area, sample_set)
            kernel = (ONE - distances2[i, k] / radii2[i]) / area
            weights[i, k] = share * kernel / max(cosine, _LEAST_COSINE)


class ReflectedPhotons(NamedTuple):
    """What one layer reflects of the photons near gather points, without its curves, from place `base` on in the list
    of nearby photons: weights (e',), 0 for those without a contribution; angles (A, e') uint16: as in
    `WeightArrays`."""

    weights: np.ndarray
    angles: np.ndarray
    base: int


@nb.njit(cache=True, nogil=True, error_model="numpy")
def weigh_nearby(samples, begin, end, optics, nearby, directions, reflected):
    """Writes the weights of photons near points [begin, end), which fly in directions (n, 3), to `reflected`."""
    n_angles = reflected.angles.shape[0]
    for i in range(begin, end):
        r = samples.rows[i]
        tangent, normal = samples.tangent[r], samples.normal[r]
        ox, oy, oz = local_wo(tangent, normal, samples.wo[r])
        for e in range(nearby.start[i], nearby.start[i + 1]):
            n, at = nearby.photon[e], e - reflected.base
            reflected.weights[at] = ZERO
            x, y, z = to_local(
                tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2],
                -directions[n, 0], -directions[n, 1], -directions[n, 2],
            )  # fmt: skip
            # Angles of the curves; light outside their domain is not reflected.
            if n_angles > 0:
                angle = gamma(optics.kind_a, optics.q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                reflected.angles[0, at] = _coded(angle)
            if n_angles > 1:
                angle = gamma(optics.kind_b, optics.q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                reflected.angles[1, at] = _coded(angle)
            # BRDF quotient times kernel weight.
            reflected.weights[at] = nearby.weight[e] * quotient_cosine(optics.model, optics.q, x, y, z, ox, oy, oz)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def reflected_photon(reflected, at, optics):
    """The weight in place `at` times the layer's curves, three channels."""
    a = b = c = reflected.weights[at]
    if optics.kind_a == CONSTANT:
        return a * optics.curve_a[0, 0], b * optics.curve_a[0, 1], c * optics.curve_a[0, 2]
    red, green, blue = _curve_at(reflected.angles[0, at], optics.curve_a)
    a, b, c = a * red, b * green, c * blue
    if reflected.angles.shape[0] > 1:
        red, green, blue = _curve_at(reflected.angles[1, at], optics.curve_b)
        a, b, c = a * red, b * green, c * blue
    return a, b, c


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_photons(begin, end, optics, nearby, reflected, sent, out):
    """Adds the reflection of photons at points [begin, end), without f_q and f_o, to out (p, 1, D, 3), or that of even
    and odd photons to out (p, 2, D, 3)."""
    n_halves, n_powers = out.shape[1], out.shape[2]
    scale = np.float32(n_halves)
    for i in range(begin, end):
        for e in range(nearby.start[i], nearby.start[i + 1]):
            n, at = nearby.photon[e], e - reflected.base
            power = sent.powers[n]
            if power >= n_powers or reflected.weights[at] == ZERO:
                continue
            a, b, c = reflected_photon(reflected, at, optics)
            total = out[i, n % n_halves, power]
            total[0] += scale * a * sent.light[n, 0]
            total[1] += scale * b * sent.light[n, 1]
            total[2] += scale * c * sent.light[n, 2]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_photon_bands(begin, end, optics, of_a, nearby, reflected, sent, out):
    """As `reflect_photons`, by band of one of the curves, to out (3, J, D, p): of the first if of_a."""
    n_bands, n_powers = out.shape[1], out.shape[2]
    edited, other = (0, 1) if of_a else (1, 0)
    curve = optics.curve_b if of_a else optics.curve_a
    for i in range(begin, end):
        for e in range(nearby.start[i], nearby.start[i + 1]):
            n, at = nearby.photon[e], e - reflected.base
            power = sent.powers[n]
            if power >= n_powers or reflected.weights[at] == ZERO:
                continue
            # Apply the other curve; distribute between the two bands next to the angle of this one.
            a = b = c = reflected.weights[at]
            if reflected.angles.shape[0] > 1:
                red, green, blue = _curve_at(reflected.angles[other, at], curve)
                a, b, c = a * red, b * green, c * blue
            a, b, c = a * sent.light[n, 0], b * sent.light[n, 1], c * sent.light[n, 2]
            j, t = _coded_node(reflected.angles[edited, at], n_bands)
            j1 = min(j + 1, n_bands - 1)
            for channel, value in enumerate((a, b, c)):
                out[channel, j, power, i] += (ONE - t) * value
                out[channel, j1, power, i] += t * value
