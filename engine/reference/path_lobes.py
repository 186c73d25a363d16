"""BRDF sampling for the path tracer: directions distributed roughly as a material reflects, from its current curves.

A material is sampled by a mixture: a cosine lobe, and one lobe for each layer that has one. A lobe is a table of the
layer's edited curves over the half vector (for Phong: over the angle from the mirror direction), so that it follows any
edit. It may be inaccurate, because the mixture's density is exact and the cosine lobe covers all directions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.curve.operators import HALF_PI
from engine.light.environment import LUMINANCE
from engine.material import _kernels as kernels
from engine.material import kinds
from engine.material.layer import FRAMES, Layer, evaluate_layer, evaluate_layers
from engine.material.layer_maps import ChannelImage
from engine.reference.texel_parameters import evaluate_layers_by_texel

Float64Array = NDArray[np.float64]

N_NUMBERS = 4  # random numbers for a direction
# Fine near the axis, for lobes with a roughness down to 1e-4.
_THETA = np.concatenate([[0.0], np.geomspace(1e-6, 0.05, 96), np.linspace(0.05, HALF_PI, 161)[1:]])
_SUB_PLACES = (0.125, 0.375, 0.625, 0.875)
_N_PHI = 32  # in a quarter turn
_LEAST_SHARE = 0.15


@dataclass(frozen=True, eq=False)
class Lobe:
    """A table of cells in (1 - cos θ, φ), constant within a cell, the same in all four quarters of φ.

    mirror: θ is measured from the mirror direction of wo, else it is the half vector's. edges (n + 1,): 1 - cos θ;
    cumulated (n·m,): the share up to each cell, row by row; density (n, m): per steradian of the half vector or of the
    direction.
    """

    mirror: bool
    edges: Float64Array
    cumulated: Float64Array
    density: Float64Array

    def sample(self, u: Float64Array, wo: Float64Array) -> Float64Array:
        """Sample directions (N, 3), also below the horizon, for wo (N, 3) and random numbers u (N, 3)."""
        cell = np.minimum(np.searchsorted(self.cumulated, u[:, 0], side="right"), self.cumulated.size - 1)
        ring, part = np.divmod(cell, self.density.shape[1])
        away = self.edges[ring] + u[:, 1] * (self.edges[ring + 1] - self.edges[ring])
        quarter, within = np.divmod(4.0 * u[:, 2], 1.0)
        phi = HALF_PI * (quarter + _mirror_quarter(part + within, quarter, self.density.shape[1]))
        sine = np.sqrt(away * (2.0 - away))
        drawn = np.stack([sine * np.cos(phi), sine * np.sin(phi), 1.0 - away], axis=1)
        if self.mirror:
            return _about_mirrored(drawn, wo)
        return 2.0 * np.einsum("ni,ni->n", wo, drawn)[:, None] * drawn - wo

    def pdf(self, wi: Float64Array, wo: Float64Array) -> Float64Array:
        """Density (N,) per steradian of wi (N, 3) above the horizon."""
        if self.mirror:
            mirrored = wo * np.array([-1.0, -1.0, 1.0])
            return self._density_at(np.einsum("ni,ni->n", mirrored, wi), _squared_length(np.cross(mirrored, wi)), wi)
        total = wi + wo
        length = np.maximum(np.sqrt(_squared_length(total)), 1e-12)
        half = total / length[:, None]
        return self._density_at(half[:, 2], half[:, 0] ** 2 + half[:, 1] ** 2, half) / (2.0 * length)

    def _density_at(self, cosine: Float64Array, sine2: Float64Array, vector: Float64Array) -> Float64Array:
        """Look up the table at an angle given by cosine and squared sine (N,), and the azimuth of vectors (N, 3)."""
        away = sine2 / (1.0 + np.maximum(cosine, 0.0))
        ring = np.clip(np.searchsorted(self.edges, away, side="right") - 1, 0, len(self.density) - 1)
        n_parts = self.density.shape[1]
        if n_parts == 1:
            return np.where(cosine > 0.0, self.density[ring, 0], 0.0)
        azimuth = np.arctan2(np.abs(vector[:, 1]), np.abs(vector[:, 0]))
        part = np.clip((azimuth * (n_parts / HALF_PI)).astype(np.int64), 0, n_parts - 1)
        return np.where(cosine > 0.0, self.density[ring, part], 0.0)


def make_lobe(layer: Layer) -> Lobe | None:
    """Make the lobe of a layer from its curves; None if it does not exceed the cosine lobe."""
    angles = {factor.gamma for factor in layer.model.factors}
    mirror = kinds.THETA_R in angles
    if not mirror and not angles.intersection(kinds.HALF_ANGLES):
        return None
    edges = 2.0 * np.sin(_THETA / 2.0) ** 2
    varies = layer.model.highlight_in_quotient or angles.intersection(kinds.HALF_AZIMUTHS)
    n_parts = _N_PHI if varies else 1
    values = np.zeros((len(edges) - 1, n_parts))
    phi = HALF_PI * (np.arange(n_parts) + 0.5) / n_parts
    for place in _SUB_PLACES:
        away = edges[:-1] + place * np.diff(edges)
        sine = np.sqrt(away * (2.0 - away))
        vectors = np.stack(np.broadcast_arrays(
            sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), (1.0 - away)[:, None]
        ), axis=2).reshape(-1, 3)  # fmt: skip
        values += _profile(layer, mirror, vectors).reshape(values.shape)
    solid_angle = np.diff(edges)[:, None] * (2.0 * math.pi / n_parts)
    shares = values * solid_angle
    total = float(shares.sum())
    if not total > 0.0:
        return None
    return Lobe(mirror, edges, np.cumsum(shares.ravel() / total), values / total)


def _profile(layer: Layer, mirror: bool, vectors: Float64Array) -> Float64Array:
    """Share of the layer's light that leaves by each half vector, or by each vector about the mirror direction,
    (N,)."""
    if mirror:
        angles = np.arctan2(np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2])
        return layer.curve("theta_r")(angles) @ LUMINANCE
    q = layer.model.quotient_parameters(layer.values)  # with a second Fresnel term: wi and wo coincide here
    value = vectors[:, 2].copy()
    if layer.model.highlight_in_quotient:
        rest = np.empty(len(vectors))
        kernels.quotient_cosines(layer.model.number, q, vectors, vectors, rest)
        value *= rest
    for factor in layer.model.factors:
        if factor.gamma in kinds.HALF_ANGLES:
            angles = np.empty(len(vectors))
            kernels.curve_angles(factor.gamma, q, vectors, vectors, angles)
            value *= layer.curve(factor.name)(np.clip(angles, 0.0, HALF_PI)) @ LUMINANCE
    return value


class Scattering:
    """The reflection of an object's visible layers, and sampling of directions for it."""

    def __init__(
        self, layers: Sequence[Layer], sampled: Sequence[Layer] | None = None, images: Sequence[ChannelImage] = ()
    ) -> None:
        """sampled: the layers whose lobes directions follow, None for the same; images: those that parameter maps of
        the layers read."""
        self.layers = tuple(layer for layer in layers if layer.visible)
        self._images = tuple(images)
        # The lobes, each with the number of its frame; None for the frame's cosine lobe.
        strengths: dict[tuple[int, Lobe | None], float] = {(0, None): _LEAST_SHARE}
        for layer in self.layers if sampled is None else (each for each in sampled if each.visible):
            lobe, number = make_lobe(layer), FRAMES.index(layer.frame)
            strengths.setdefault((number, None), _LEAST_SHARE)
            strengths[number, lobe] = strengths.get((number, lobe), 0.0) + _strength(layer, lobe)
        self._lobes = sorted(strengths, key=lambda each: each[1] is not None)
        shares = np.array([strengths[each] for each in self._lobes])
        shares = np.maximum(shares / shares.sum(), _LEAST_SHARE)
        self._shares = shares / shares.sum()

    @property
    def reflects(self) -> bool:
        return bool(self.layers)

    def evaluate(
        self, wi: Float64Array, wo: Float64Array, factors: NDArray[np.floating] | None = None,
        texels: Float64Array | None = None, to_coat: Float64Array | None = None,
    ) -> tuple[Float64Array, Float64Array]:  # fmt: skip
        """Evaluate ρ cosθ (N, 3) for local directions in the base's frame, and the density (N,) of sampling wi; both 0
        below the horizon.

        factors (N, K, 3): factors of the first K layers, texels (N, T): values of the first images; sampling ignores
        them. to_coat (N, 3, 3): from the base's frame to the coat's; None where both are the same.
        """
        value, pdf = np.zeros((len(wi), 3)), np.zeros(len(wi))
        coated = (wi, wo) if to_coat is None else (_rotated(to_coat, wi), _rotated(to_coat, wo))
        above = np.flatnonzero(np.maximum(wi[:, 2], coated[0][:, 2]) > kinds.GRAZING)
        directions = (wi[above], wo[above]), (coated[0][above], coated[1][above])
        own = None if factors is None else factors[above]
        of_coat = None if to_coat is None else directions[1]
        if self._images and own is not None and texels is not None:
            found = evaluate_layers_by_texel(self.layers, self._images, *directions[0], own, texels[above], of_coat)
        else:
            found = evaluate_layers(self.layers, *directions[0], own, of_coat)
        value[above] = found
        for share, (frame, lobe) in zip(self._shares, self._lobes, strict=True):
            wi, wo = directions[frame]
            reached = wi[:, 2] > kinds.GRAZING
            density = wi[:, 2] / math.pi if lobe is None else lobe.pdf(wi, wo)
            pdf[above] += share * np.where(reached, density, 0.0)
        return value, pdf

    def sample(self, u: Float64Array, wo: Float64Array, to_coat: Float64Array | None = None) -> Float64Array:
        """Sample local directions (N, 3) in the base's frame, some below the horizon, with random numbers u (N, 4);
        to_coat: see `evaluate`."""
        wi = np.empty((len(wo), 3))
        which = np.minimum(np.searchsorted(np.cumsum(self._shares), u[:, 0], side="right"), len(self._lobes) - 1)
        for i, (frame, lobe) in enumerate(self._lobes):
            rows = np.flatnonzero(which == i)
            turn = to_coat[rows] if frame and to_coat is not None else None
            towards = wo[rows] if turn is None else _rotated(turn, wo[rows])
            drawn = _cosine(u[rows, 1:]) if lobe is None else lobe.sample(u[rows, 1:], towards)
            wi[rows] = drawn if turn is None else _rotated(turn.swapaxes(1, 2), drawn)
        return wi


def _rotated(rotations: Float64Array, vectors: Float64Array) -> Float64Array:
    return np.einsum("nij,nj->ni", rotations, vectors)


def _strength(layer: Layer, lobe: Lobe | None) -> float:
    """Approximate albedo of a layer: its mean over a few hundred directions."""
    u = np.random.default_rng(1).random((2, 512, 3))
    wo = _cosine(u[0])
    wi = _cosine(u[1]) if lobe is None else lobe.sample(u[1], wo)
    above = (wi[:, 2] > kinds.GRAZING) & (wo[:, 2] > kinds.GRAZING)
    wi, wo = wi[above], wo[above]
    pdf = wi[:, 2] / math.pi if lobe is None else lobe.pdf(wi, wo)
    weight = evaluate_layer(layer, wi, wo) @ LUMINANCE / np.maximum(pdf, 1e-12)
    return float(np.minimum(weight, 1e6).sum() / len(u[0]))


def _cosine(u: Float64Array) -> Float64Array:
    """Directions (N, 3) about +z with density cosθ / π."""
    radius, phi = np.sqrt(u[:, 0]), 2.0 * math.pi * u[:, 1]
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1.0 - u[:, 0])], axis=1)


def _about_mirrored(drawn: Float64Array, wo: Float64Array) -> Float64Array:
    """Rotate vectors (N, 3) about +z to vectors about the mirror direction of wo, which lies above the horizon
    [Duff17]."""
    x, y, z = -wo[:, 0], -wo[:, 1], wo[:, 2]
    a = -1.0 / (1.0 + z)
    b = x * y * a
    first = np.stack([1.0 + x * x * a, b, -x], axis=1)
    second = np.stack([b, 1.0 + y * y * a, -y], axis=1)
    return drawn[:, :1] * first + drawn[:, 1:2] * second + drawn[:, 2:] * np.stack([x, y, z], axis=1)


def _mirror_quarter(place: Float64Array, quarter: Float64Array, n_parts: int) -> Float64Array:
    """Mirror the position of an angle within its quarter, [0, 1): every second quarter runs backwards."""
    share = place / n_parts
    return np.where(quarter % 2.0 == 1.0, 1.0 - share, share)


def _squared_length(vectors: Float64Array) -> Float64Array:
    return np.einsum("ni,ni->n", vectors, vectors)
