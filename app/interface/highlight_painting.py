"""Painting highlights in Python: a stroke over the scene's own picture becomes a change of curves.

It is solved as in the editor (`app.worker.curve_fits`), by transport of the pixels that it touches and of some that
hold the rest of the object, and again in the finished picture where light between surfaces has made it miss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetParameter
from app.document.commands.several import Several
from app.document.document import Document
from app.document.selection import Selection
from app.interface.editing import Editing
from app.modes.placement.painted_curves import (
    LEAST_ERROR,
    MOST_COMPARED,
    SMOOTHNESS,
    Solved,
    painted_layers,
    set_scale,
    solved_curves,
    with_change,
)
from app.project.project import Project
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.inverse.curve_fit import SCALE, radiance_weights
from engine.inverse.highlight_brush import HighlightBrush, Place, StrokeShares, evenly, wanted_radiance
from engine.inverse.layer_fit import HeldPixels, LayerFit, LayerPixels, fit_layers
from engine.inverse.photo_view import PhotoView, sampled, trace_view
from engine.material.layer import object_of
from engine.planner import Plan, plan_scene
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.precompute.indirect.sampling_settings import STILL
from engine.render.bounce_plan import planned_bounces
from engine.render.still import StillLayer, still_layers
from engine.scene.picture_frame import picture_frame

# Pixels of the stroke that decide, and of the rest of the object that is held.
MOST_PIXELS, MOST_HELD = 2048, 1024
# Half the side of the square, in pixels, whose mean is "as there".
PICKED = 1

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
    light, intensity = picture(), document.light.intensity or 1.0
    plan = plan_scene(
        before.scene, before.layers, has_sky=before.sky.environment is not None, editable=before.layers.keys(),
        overrides=before.overrides,
    )  # fmt: skip
    placement = Placement(before.scene, None, plan.n_edge_rays)
    touched = _touched(placement, before.scene.object_index(object_of(key)), brush, light / intensity, points)
    if not touched.pixel.size:
        raise InsituError(f"no pixel of the stroke sees {object_of(key)} alone")
    view, still, keys = _view(before, placement, plan, touched, painted_layers(document, key, names))
    change: dict[str, Float64Array] = {}
    expected = touched.wanted - touched.seen  # what is left where light between surfaces does as it was linearized
    size = _norm(expected)
    for _ in range(1 + MOST_COMPARED):
        now = project().document
        seen = (picture() / intensity).reshape(-1, 3)[touched.pixel].astype(np.float64)
        left = np.nan_to_num(touched.wanted - seen, posinf=0.0, neginf=0.0)
        if change and _norm(left - expected) <= LEAST_ERROR * size:
            break
        fitted = _fitted(view, still, keys, now, key, names, touched, seen, brush)
        expected = np.asarray(fitted.left, np.float64)
        change = {name: _whole(name, change.get(name), fit.change) for name, fit in fitted.fits.items()}
        if editing.document is not document:
            editing.undo()
        editing.do(_edit(document, key, change))
    seen = (picture() / intensity).reshape(-1, 3)[touched.pixel]
    return float(np.clip(1.0 - _norm(touched.wanted - seen) / size, 0.0, 1.0)) if size > 0.0 else 1.0


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


def _view(
    project: Project, placement: Placement, plan: Plan, touched: _Touched, keys: Sequence[str]
) -> tuple[PhotoView, tuple[StillLayer, ...], dict[str, int]]:
    """The light at the points, all layers there, and the numbers of those that follow the curves by their keys."""
    part = placement.at_rows(touched.rows)
    still = sampled(part, still_layers(project.layers.items(), project.object_names, plan))
    wanted = project.chosen_bounces or project.scene.description.bounces
    n_bounces = planned_bounces(placement, project.indexed_layers, wanted).n_bounces
    view = run_to_end(trace_view(part, still, project.sky, FINAL, n_bounces, STILL, as_needed=True))
    there = list(project.layers)
    return view, still, {key: there.index(key) for key in keys}


def _fitted(
    view: PhotoView, still: tuple[StillLayer, ...], keys: dict[str, int], now: Document, key: str,
    names: tuple[str, ...], touched: _Touched, seen: Float64Array, brush: HighlightBrush,
) -> LayerFit:  # fmt: skip
    """The change of the curves of the document as it is now."""
    layers = list(still)
    for own, i in keys.items():
        layers[i] = replace(layers[i], layer=now.layer(own))
    curve = next((name for name in names if name != SCALE), layers[keys[key]].layer.model.factors[0].name)
    between = view.rows_between(layers, dict.fromkeys(keys.values(), curve))
    pixels = [view.pixels(layers[i], between.get(i, {}), _shares_scale(now, key, own)) for own, i in keys.items()]
    deciding = [_at(each, touched.is_touched) for each in pixels]
    held = [_at(each, ~touched.is_touched) for each in pixels]
    of_held = np.asarray(sum(_radiance(each) for each in held))
    return fit_layers(
        deciding, names, touched.wanted - seen, radiance_weights(np.maximum(seen, touched.wanted)),
        HeldPixels(held, radiance_weights(of_held)), SMOOTHNESS, brush.hold, brush.keeps_hues,
    )  # fmt: skip


def _shares_scale(document: Document, key: str, other: str) -> bool:
    """Whether the parameter that scales a layer scales the other: that is its second Fresnel term, or itself."""
    return key == other or document.layer(key).rises != document.layer(other).rises


def _at(pixels: LayerPixels, which: NDArray[np.bool_]) -> LayerPixels:
    """Some of a layer's pixels."""
    between = {name: rows[:, which] for name, rows in pixels.indirect.items()}
    store = pixels.store.take(np.flatnonzero(which))
    return LayerPixels(store, pixels.view[which], pixels.curves, between, pixels.is_scaled)


def _radiance(pixels: LayerPixels) -> NDArray[np.floating]:
    """The direct light (n, 3) that pixels reflect."""
    first, *second = pixels.curves.values()
    return np.asarray(pixels.store.radiance(first, second[0] if second else np.ones((1, 3))) * pixels.view)


def _whole(name: str, before: Float64Array | None, change: Float64Array) -> Float64Array:
    """What a curve is more than at the start, where this is what it is more than after the change before."""
    if before is None:
        return change
    return (1.0 + before) * (1.0 + change) - 1.0 if name == SCALE else before + change


def _edit(document: Document, key: str, change: dict[str, Float64Array]) -> Several:
    """The edit that makes the curves of the answer, from the document before the stroke."""
    layer, commands = document.layer(key), list[SetOperators | SetParameter]()
    for name, each in change.items():
        if name == SCALE:
            commands.append(set_scale(key, layer, 1.0 + each[0]))
            continue
        below, added = with_change(layer, name, each, None)
        commands.append(SetOperators(key, name, below if added is None else (*below, added)))
    return Several(tuple(commands), f"paint highlight of {object_of(key)}")


def _norm(radiance: NDArray[np.floating]) -> float:
    return float(np.linalg.norm(radiance))
