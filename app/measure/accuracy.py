"""The error of a picture against our brute-force oracle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.measure.precomputed import Precomputed, layer_coefficients
from app.measure.subject import Subject
from app.project.project import Project
from app.stills.stills import render_picture
from engine.core.threads import on_threads
from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.integrator import integrate_direct

CLAMP_PERCENTILE = 99.9
ORACLE_PATCHES = 1024

Radiance = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """relRMSE and the relative difference of means of a picture against the truth."""

    rmse: float
    mean: float


def errors(ours: NDArray[np.floating], truth: NDArray[np.floating]) -> Errors:
    """relRMSE = sqrt(mean((a-b)²)) / mean(b), both clamped at the truth's 99.9 percentile [docs/conventions.md].

    Any equal shapes, linear RGB. A black truth counts differences as they are.
    """
    a, b = np.asarray(ours, np.float64), np.asarray(truth, np.float64)
    top = np.percentile(b, CLAMP_PERCENTILE)
    a, b = np.minimum(a, top), np.minimum(b, top)
    mean = b.mean() or 1.0
    return Errors(float(np.sqrt(np.mean((a - b) ** 2)) / mean), float((a.mean() - b.mean()) / mean))


def seen_scale(placement: Placement, rows: NDArray[np.integer], layer: Layer) -> Radiance:
    """f_q f_o(θ_o) of a layer, (p, 3)."""
    view = layer.model.view_factor
    if view is None:
        return np.tile(layer.scale(), (len(rows), 1))
    cosine = np.einsum("pc,pc->p", placement.hits.normal[rows], placement.hits.wo[rows], dtype=np.float64)
    return layer.scale() * layer.curve(view.name)(np.arccos(np.clip(cosine, 0.0, 1.0)))


def reflected(done: Precomputed) -> Radiance:
    """Radiance (P, 3) that all points reflect to the camera, from the transport of a stage."""
    placement = done.placement
    total = np.zeros((len(placement.hits.pixel), 3))
    for transport in done.transports:
        rows = placement.rows_of(transport.i_object)
        picture = transport.store.radiance(*layer_coefficients(transport)) * done.light.lighting.unit
        total[rows] += picture * seen_scale(placement, rows, transport.layer)
    return total


def oracle(
    subject: Subject, placement: Placement, rows: NDArray[np.integer], level: int, layers: Sequence[Layer] | None = None
) -> Radiance:
    """Radiance (p, 3) at rows of the hits by brute force over 20·4^level directions and 1,024 patches.

    layers: in the place of the subject's, in its order.
    """
    of_object: dict[int, list[Layer]] = {}
    given = layers or [layer for _, layer in subject.layers]
    for (i_object, _), layer in zip(subject.layers, given, strict=True):
        of_object.setdefault(i_object, []).append(layer)
    environment, patches = _scaled(subject), placement.patches(ORACLE_PATCHES)

    def part(block: NDArray[np.integer]) -> Radiance:
        return integrate_direct(
            placement.hits, block, placement.caster, lambda i: of_object.get(i, ()), environment, subject.sky.rotation,
            patches, level,
        )  # fmt: skip

    return np.concatenate(on_threads(part, np.array_split(rows, max(1, len(rows) // 16))))


def _scaled(subject: Subject) -> Environment | None:
    environment = subject.sky.environment
    if environment is None:
        return None
    return replace(environment, radiance=environment.radiance * np.float32(subject.sky.scale))


def random_rows(placement: Placement, n_points: int, seed: int = 3) -> NDArray[np.integer]:
    """Rows of random points of the picture, ascending."""
    n_points = min(n_points, len(placement.hits.pixel))
    return np.sort(np.random.default_rng(seed).choice(len(placement.hits.pixel), n_points, replace=False))


def box_averaged(picture: NDArray[np.floating], n: int) -> Radiance:
    """Means (H, W, 3) over n × n pixels of (n H, n W, 3)."""
    height, width = picture.shape[0] // n, picture.shape[1] // n
    return np.asarray(picture.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float64))


def direct_picture(project: Project, n_edge_rays: int) -> NDArray[np.floating]:
    """The still (H, W, 3) of direct light with so many rays through pixels at edges."""
    return render_picture(project.with_settings(n_edge_rays=n_edge_rays), lambda step: None, series=BounceSeries(1))
