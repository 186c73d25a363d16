"""Makes the parts that a graphics card draws of (`engine.deform.parts`), which the window knows without all this."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.deform.gloss import STEEPEST, LowGloss
from engine.deform.parts import LookPart, PosedPart, ShapePart
from engine.deform.points import BendingPoints
from engine.deform.raster import Backdrop
from engine.deform.shading import BandLight, Lobes
from engine.sphere.harmonics import clamped_cosine

Singles = NDArray[np.float32]


def shape_part(number: int, points: BendingPoints, lobes: Lobes) -> ShapePart:
    surface, (n_points, n_lobes, order) = points.surface, lobes.coefficients.shape
    corners = np.empty((len(surface.corners), 3, 4), np.int32)
    corners[..., 0], corners[..., 3] = surface.corners, surface.i_object[:, None]
    corners[..., 1], corners[..., 2] = surface.sides[:, 0], surface.sides[:, 1]
    rows = np.concatenate([lobes.axes, lobes.coefficients], axis=2).reshape(n_points, -1)
    of_points = np.hstack([lobes.low, rows])
    return ShapePart(number, corners.reshape(-1, 4), points.owners, of_points, n_lobes, order)


def look_part(
    number: int, light: BandLight, albedos: Singles, emission: Singles,
    glosses: Mapping[int, Sequence[tuple[LowGloss, NDArray[np.floating]]]], backdrop: Backdrop,
) -> LookPart:  # fmt: skip
    """albedos and emission (M, 3) of the objects; glosses: of their layers that are not matt, times factors (3,)."""
    objects, rows = np.zeros((len(albedos), 8), np.float32), list[Singles]()
    objects[:, :3], objects[:, 4:7] = albedos, emission
    for i, own in glosses.items():
        objects[i, 3], objects[i, 7] = len(rows), len(own)
        for low, factor in own:
            bands = (low.bands * np.asarray(factor, np.float32)).reshape(len(low.lean), -1)
            rows.append(np.hstack([bands, low.lean[:, None]]))
    order = light.table.shape[2]
    gloss = np.array(rows, np.float32) if rows else np.zeros((0, 2, 3 * order + 1), np.float32)
    cosine = (clamped_cosine(order) / np.pi).astype(np.float32)
    return LookPart(
        number, light.harmonics, light.table, objects, gloss, float(STEEPEST), cosine, backdrop.radiance,
        backdrop.turn, backdrop.scale,
    )  # fmt: skip


def posed_part(places: Singles, frames: Singles, eye: NDArray[np.float64]) -> PosedPart:
    """places (V, 3) of all that is drawn, frames (S, 3, 3) of the points, which are the first of them."""
    rows = np.zeros((len(places), 12), np.float32)
    rows[: len(frames), :9], rows[:, 9:] = frames.reshape(-1, 9), places
    x, y, z = (float(each) for each in eye)
    return PosedPart(rows, (x, y, z))
