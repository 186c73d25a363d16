"""Painting highlights in Python: a stroke over the scene's own picture becomes a change of curves.

It is solved as in the editor (`app.worker.curve_fits`), by transport of the pixels that it touches and of some that
hold the rest of the object, and again in the finished picture where light between surfaces has made it miss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.selection import Selection
from app.interface.editing import Editing
from app.modes.placement.painted_curves import (
    LEAST_ERROR,
    MOST_COMPARED,
    MOST_HELD,
    MOST_PIXELS,
    SMOOTHNESS,
    Solved,
    edit_of_changes,
    painted_layers,
    shares_scale,
    solved_curves,
    whole_change,
)
from app.project.picture_points import plan_points, view_points
from app.project.project import Project
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.inverse.curve_fit import SCALE, radiance_weights
from engine.inverse.highlight_brush import HighlightBrush, Place, StrokeShares, evenly, wanted_radiance
from engine.inverse.layer_fit import HeldPixels, LayerFit, fit_layers
from engine.inverse.photo_view import PhotoView
from engine.material.layer import object_of
from engine.precompute.direct.pipeline import Placement
from engine.render.still import StillLayer
from engine.scene.picture_frame import picture_frame

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Touched:
    """The stroke's pixels that decide: their places (n,) in the picture, row-major, and the radiance (n, 3) that they
    had and are to have; and rows of all points that are solved with: these, and those that are held."""

    pixel: NDArray[np.integer]
    seen: Float64Array
    wanted: Float64Array
    rows: NDArray[np.int32]
    is_touched: NDArray[np.bool_]


def paint_in_scene(
    editing: Editing, project: Callable[[], Project], picture: Callable[[], NDArray[np.floating]], selected: Selection,
    brush: HighlightBrush, points: Sequence[Place], solved: Solved,
) -> float:  # fmt: skip
    """Paint a highlight as one edit; returns the share of the wanted change that is reached, 0 to 1. project: the scene
    as it is at a call, and picture its picture (H, W, 3). Raises InsituError."""
    before = project()
    document = before.document
    key, names = solved_curves(document, selected, solved)
    if key not in before.layers:
        raise InsituError(f"{key} is not in the picture")
    light, intensity = picture(), document.light.intensity or 1.0
    plan = plan_points(before)
    placement = Placement(before.scene, None, plan.n_edge_rays)
    touched = _touched(placement, before.scene.object_index(object_of(key)), brush, light / intensity, points)
    if not touched.pixel.size:
        raise InsituError(f"no pixel of the stroke sees {object_of(key)} alone")
    view, still = run_to_end(view_points(before, placement, plan, touched.rows))
    change: dict[str, Float64Array] = {}
    expected = touched.wanted - touched.seen  # what is left where light between surfaces does as it was linearized
    size = float(np.linalg.norm(expected))
    for _ in range(1 + MOST_COMPARED):
        seen = (picture() / intensity).reshape(-1, 3)[touched.pixel].astype(np.float64)
        left = np.nan_to_num(touched.wanted - seen, posinf=0.0, neginf=0.0)
        if change and np.linalg.norm(left - expected) <= LEAST_ERROR * size:
            break
        fitted = _fitted(view, still, project(), key, names, touched, seen, brush)
        expected = np.asarray(fitted.left, np.float64)
        change = {name: whole_change(name, change.get(name), fit.change) for name, fit in fitted.fits.items()}
        if editing.document is not document:
            editing.undo()
        editing.do(edit_of_changes(key, document.layer(key), change, {})[0])
    seen = (picture() / intensity).reshape(-1, 3)[touched.pixel]
    missing = float(np.linalg.norm(touched.wanted - seen))
    return float(np.clip(1.0 - missing / size, 0.0, 1.0)) if size > 0.0 else 1.0


def _touched(
    placement: Placement, i_object: int, brush: HighlightBrush, light: NDArray[np.floating], points: Sequence[Place]
) -> _Touched:
    """What a stroke touches of an object in the picture `light` (H, W, 3)."""
    hits = placement.hits
    frame = picture_frame(hits, np.asarray(placement.scene.description.camera.position))
    begin, end = hits.object_ranges[i_object]
    seen = light.reshape(-1, 3)[hits.pixel[begin:end]].astype(np.float64)
    stroke = StrokeShares(frame, i_object, brush, seen)
    stroke.add(list(points))
    own = np.flatnonzero(stroke.shares > 0.0)
    decide = evenly(own, MOST_PIXELS)
    held = evenly(np.setdiff1d(np.arange(end - begin), own), MOST_HELD)
    rows = begin + np.union1d(decide, held).astype(np.int32)
    wanted = wanted_radiance(brush, seen[decide], stroke.shares[decide])
    return _Touched(hits.pixel[begin + decide], seen[decide], wanted, rows, np.isin(rows - begin, decide))


def _fitted(
    view: PhotoView, still: tuple[StillLayer, ...], project: Project, key: str, names: tuple[str, ...],
    touched: _Touched, seen: Float64Array, brush: HighlightBrush,
) -> LayerFit:  # fmt: skip
    """The change of the curves of the project as it is now."""
    layers = tuple(replace(each, layer=layer) for each, layer in zip(still, project.layers.values(), strict=True))
    numbers = {each: number for number, each in enumerate(project.layers)}
    document = project.picture_document
    keys = painted_layers(document, key, names)
    between: dict[int, dict[str, NDArray[np.floating]]] = {}
    for name in names:
        curve = document.layer(key).model.factors[0].name if name == SCALE else name
        for number, rows in view.rows_between(layers, {numbers[each]: curve for each in keys}).items():
            between.setdefault(number, {}).update(rows)
    selected = key, document.layer(key)
    pixels = [
        view.pixels(
            layers[numbers[each]], between.get(numbers[each], {}),
            shares_scale((each, document.layer(each)), selected),
        ) for each in keys
    ]  # fmt: skip
    deciding, held = ([each.at(which) for each in pixels] for which in (touched.is_touched, ~touched.is_touched))
    of_held = np.asarray(sum(each.radiance for each in held))
    return fit_layers(
        deciding, names, touched.wanted - seen, radiance_weights(np.maximum(seen, touched.wanted)),
        HeldPixels(held, radiance_weights(of_held)), SMOOTHNESS, brush.hold, brush.keeps_hues,
    )  # fmt: skip
