"""Slow, obvious twin of the projection: each light sampled all over, each sample shared out by the hats."""

import numpy as np

from engine.material import MODELS
from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.direct.projection import LayerShape, VisibleLight
from tests.naive.curves import hats

HALF_PI = np.pi / 2


def dense_transport(hits, row, light: VisibleLight, layer: LayerShape, n_samples=400, seed=3):
    """U (J, K, 3) of one point in the light's units, all in float64 [BenArtzi07, eq. 4.15].

    Only sky lights. A light's shares Δ_mj, Δ_mk are the hats' means over random samples of its triangle, its weight
    ρ_q cosθ is taken at its centre, its visibility is the mean of the bits below it.
    """
    random = np.random.default_rng(seed)
    model = MODELS[layer.model]
    q = np.array(layer.quotient_parameters)
    n_a, n_b = layer.bands
    tangent, normal = hits.tangent[row].astype(float), hits.normal[row].astype(float)
    frame = np.stack([tangent, np.cross(normal, tangent), normal])
    wo = frame @ hits.wo[row].astype(float)
    sky = light.lighting.sky
    visible = visible_shares(light, row)
    bands = np.zeros((n_a, n_b, 3))
    for m in range(len(sky.corners)):
        weight = visible[m] * quotient_cosine(model.number, q, *(frame @ sky.centres[:, m]), *wo)
        if weight == 0.0:
            continue
        inside = samples_of(sky.directions[:, sky.corners[m]].T.astype(float), n_samples, random) @ frame.T
        delta_a = shares(model.factors[0].gamma, q, inside, wo, n_a)
        delta_b = shares(model.factors[-1].gamma, q, inside, wo, n_b) if n_b > 1 else np.ones(1)
        bands += weight * np.multiply.outer(np.outer(delta_a, delta_b), sky.colours[m])
    return bands


def visible_shares(light: VisibleLight, row):
    """What share of each sky light a point sees (M,): by its own bit, or the mean of the sphere's bits below it."""
    sky, at = light.lighting.sky, np.array([row])
    seen, fine_seen = light.sphere.unpacked(at)[0], light.fine.unpacked(at)[0]
    ranges = zip(sky.first, sky.n_bits, sky.fine, strict=True)
    return np.array([fine_seen[fine] if fine >= 0 else seen[first : first + n].mean() for first, n, fine in ranges])


def samples_of(corners, n, random):
    """n unit directions spread evenly over a small spherical triangle (3, 3)."""
    u, v = random.random(n), random.random(n)
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    points = corners[0] + u[:, None] * (corners[1] - corners[0]) + v[:, None] * (corners[2] - corners[0])
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def shares(kind, q, directions, wo, n_bands):
    """The mean (J,) of each hat over the directions; beyond π/2 the last one."""
    angles = np.array([gamma(kind, q, *direction, *wo) for direction in directions])
    return hats(np.minimum(angles, HALF_PI), n_bands).mean(axis=0)


def decode(tile, bands):
    """U (p, J, K, 3) of an encoded tile, entry by entry as `bandstore` describes the bits."""
    n_a, n_b = bands
    out = np.zeros((len(tile.scale), n_a, n_b, 3))
    for i in range(len(tile.scale)):
        at = int(tile.start[i])
        for j in range(n_a):
            first, count = (int(tile.first[i, j]), int(tile.count[i, j])) if n_b > 1 else (0, 1)
            for k in range(first, first + count):
                word = int(tile.values[at])
                at += 1
                exponent = (word >> 27) - 39
                for c in range(3):
                    out[i, j, k, c] = ((word >> (9 * c)) & 511) * 2.0**exponent * float(tile.scale[i])
    return out
