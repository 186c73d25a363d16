"""How many wavelets the triple product needs [Ma06, figures 7 and 8]: light, visibility and reflection truncated.

At random pixels the three factors are known in 81,920 directions, whose sum is the truth. Their means over 5,120
triangles, in the world's frame, are transformed, truncated to n coefficients and multiplied again. So nothing but the
truncation is judged: no tables, no interpolation between points or angles.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from app.measure.report import save_figure
from engine.core.frames import local_frames
from engine.light.environment import triangle_integrals
from engine.material.layer import Layer, evaluate_layers
from engine.precompute.direct.pipeline import SkyState
from engine.render.picture_difference import errors
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import Rule, forward, inverse, select_coefficients

Float64Array = NDArray[np.float64]

Counts = tuple[int, ...]
FINE, COARSE = 6, 4
COUNTS: Counts = (20, 80, 320, 1280)
RULES: tuple[Rule, ...] = get_args(Rule)
WAYS = ("all three", "reflection", "light", "visibility", "light × visibility")
DRAWN = ("all three", "light × visibility")
PERCENT = (1, 2, 5, 10, 20, 50)
COLOURS = {"size": "#2f6690", "energy": "#c0392b", "top": "#8a8a8a"}
FILE, PLOT = "orbit_truncation.csv", "orbit_truncation.png"


@dataclass(frozen=True)
class Truncated:
    """relRMSE of one scene with n coefficients of what `way` names, chosen by `rule`; the rest is whole."""

    scene: str
    way: str
    rule: str
    n: int
    rmse: float


def truncation_errors(
    scene: str,
    hits: PrimaryHits,
    rows: NDArray[np.integer],
    caster: RayCaster,
    layers: Mapping[int, tuple[Layer, ...]],
    sky: SkyState,
    fine: int = FINE,
    coarse: int = COARSE,
    counts: Counts = COUNTS,
) -> list[Truncated]:
    """Of direct light from the environment at these hits, for each rule, n and way.

    The truth is the sum over the triangles of level `fine`; the wavelets are those of level `coarse`.
    """
    truth, means = direct_factors(hits, rows, caster, layers, sky, fine, coarse)
    found = dict[tuple[str, Rule, int], list[Float64Array]]()
    for factors in means:
        for key, radiance in _truncated(*factors, counts):
            found.setdefault(key, []).append(radiance)
    return [
        Truncated(scene, way, rule, n, errors(np.array(radiance), truth).rmse)
        for (way, rule, n), radiance in found.items()
    ]


def direct_factors(
    hits: PrimaryHits, rows: NDArray[np.integer], caster: RayCaster, layers: Mapping[int, Sequence[Layer]],
    sky: SkyState, fine: int = FINE, coarse: int = COARSE,
) -> tuple[Float64Array, list[tuple[Float64Array, Float64Array, Float64Array]]]:  # fmt: skip
    """Direct light (p, 3) from the environment at rows of the hits, and for each of them the means over the triangles
    of level `coarse` of its three factors: power (T, 3), visibility (T, 1), BRDF times cosine (T, 3)."""
    assert sky.environment is not None
    power = triangle_integrals(sky.environment, sky.rotation, fine) * sky.scale
    children, objects = 4 ** (fine - coarse), hits.objects
    truth, means = np.zeros((len(rows), 3)), []
    for i, row in enumerate(rows):
        own = layers.get(int(objects[row]), ())
        visible, reflected = factors_at(hits, int(row), caster, own, geodesic(fine).centres)
        truth[i] = (power * visible[:, None] * reflected).sum(axis=0)
        means.append((
            power.reshape(-1, children, 3).sum(axis=1),
            visible.reshape(-1, children, 1).mean(axis=1),
            reflected.reshape(-1, children, 3).mean(axis=1),
        ))  # fmt: skip
    return truth, means


def factors_at(
    hits: PrimaryHits, row: int, caster: RayCaster, layers: Sequence[Layer], towards: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Visibility (M,) and BRDF times cosine (M, 3) at one point in directions (M, 3)."""
    frame = local_frames(hits.tangent[row : row + 1], hits.normal[row : row + 1])[0]
    local = towards @ frame.T
    above = np.flatnonzero(local[:, 2] > 0)
    position, lift = hits.position[row].astype(np.float64), hits.offset_position[row].astype(np.float64)
    side = np.where(towards[above] @ hits.geometric_normal[row].astype(np.float64) >= 0, 1.0, -1.0)
    origins = (position + side[:, None] * (lift - position)).astype(np.float32)
    visible, reflected = np.zeros(len(towards)), np.zeros((len(towards), 3))
    visible[above] = ~caster.occluded(origins, towards[above].astype(np.float32), None)
    wo = np.tile(frame @ hits.wo[row].astype(np.float64), (len(above), 1))
    reflected[above] = evaluate_layers(layers, local[above], wo)
    return visible, reflected


def _truncated(
    light: Float64Array, visible: Float64Array, reflected: Float64Array, counts: Counts
) -> Iterator[tuple[tuple[str, Rule, int], Float64Array]]:
    """((way, rule, n), radiance (3,)) of factors (T, 3 or 1) on the triangles of a level."""
    lit = light * visible
    transformed = [forward(each) for each in (light, visible, reflected, lit)]
    for rule in RULES:
        for n in counts:
            few = [inverse(np.where(select_coefficients(each, n, rule)[:, None], each, 0.0)) for each in transformed]
            products = (
                few[0] * few[1] * few[2],
                lit * few[2],
                few[0] * visible * reflected,
                light * few[1] * reflected,
                few[3] * reflected,
            )
            for way, product in zip(WAYS, products, strict=True):
                yield (way, rule, n), product.sum(axis=0)


def write_truncation(folder: Path, found: Sequence[Truncated]) -> None:
    """The table and the plot, error against n for each scene, in a folder."""
    with open(folder / FILE, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("scene", "truncated", "chosen by", "coefficients", "relRMSE"))
        writer.writerows((each.scene, each.way, each.rule, each.n, each.rmse) for each in found)
    scenes = list(dict.fromkeys(each.scene for each in found))
    figure, all_axes = plt.subplots(
        1, len(scenes), figsize=(4.5 * len(scenes), 4.0), layout="constrained", sharey=True, squeeze=False
    )
    for axes, scene in zip(all_axes[0], scenes, strict=True):
        _draw(axes, scene, [each for each in found if each.scene == scene])
    all_axes[0][0].set_ylabel("relRMSE, %")
    all_axes[0][-1].legend(frameon=False, fontsize=8)
    save_figure(folder / PLOT, figure)


def _draw(axes: Axes, scene: str, found: Sequence[Truncated]) -> None:
    for way in DRAWN:
        for rule, colour in COLOURS.items():
            own = [each for each in found if (each.way, each.rule) == (way, rule)]
            style = "-" if way == DRAWN[0] else "--"
            axes.plot([e.n for e in own], [100 * e.rmse for e in own], style, color=colour, label=f"{way}, by {rule}")
    axes.set(title=scene, xscale="log", yscale="log", xlabel="coefficients a factor")
    axes.set_xticks(COUNTS, [str(n) for n in COUNTS])
    axes.set_yticks(PERCENT, [str(each) for each in PERCENT])
    axes.minorticks_off()
    axes.spines[["top", "right"]].set_visible(False)
