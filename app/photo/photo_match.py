"""Matches a photograph that was taken in the light of a scene: aligns the camera, and finds the material of an object.

The photograph is compared at some thousand pixels of the scene's picture, in the size of the photograph or a smaller
one. What was found is one edit of the document, and a camera.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetParameter, editable_layer
from app.document.commands.several import Several
from app.document.document import Document
from app.document.linked_layers import with_layer
from app.document.view_state import Viewpoint
from app.project.project import Project
from engine.core.errors import InsituError, list_names
from engine.core.generators import StillProgress, map_steps
from engine.inverse.camera_fit import CameraFit, PointPair, fit_camera
from engine.inverse.curve_fit import Float64Array
from engine.inverse.photo import SRGB, Photo, check_transfer, read_photo, size_for
from engine.inverse.photo_fit import PhotoFit, PhotoMatch, PhotoPixels
from engine.inverse.photo_targets import Target, default_targets, target_of
from engine.inverse.photo_view import PhotoView, inner_pixels, rows_of_pixels, sampled, trace_view
from engine.material.layer import Layer
from engine.planner import Plan, plan_scene
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import STILL
from engine.render.bounce_plan import planned_bounces
from engine.render.light_pilot import with_light_budget
from engine.render.picture_files import read_picture
from engine.render.still import StillLayer, still_layers, still_quality

# The longer side of the picture that is compared, and how many pixels are: of the object, and of the rest.
LONGER_SIDE, LEAST_SIDE, MOST_SIDE = 512, 16, 4096
MOST_PIXELS, MOST_BESIDE, LEAST_PIXELS = 2048, 1024, 16


@dataclass(frozen=True)
class PhotoRequest:
    """object: whose material is matched; file: of the photograph, in a transfer curve, see `engine.inverse.photo`;
    pairs: what aligns the camera, none where the scene's is right; mask: a picture of the same size that is black where
    the photograph does not count, None for none; targets: "LAYER.NAME" of what is to be found, none for
    `default_targets`; exposure: None to find it; n_bounces: None for as many as the scene requires; longer_side: of the
    picture that is compared, pixels."""

    object: str
    file: Path
    transfer: str = SRGB
    pairs: tuple[PointPair, ...] = ()
    mask: Path | None = None
    targets: tuple[str, ...] = ()
    exposure: float | None = None
    n_bounces: int | None = None
    longer_side: int = LONGER_SIDE

    def __post_init__(self) -> None:
        check_transfer(self.transfer)
        if self.exposure is not None and not 1e-12 <= self.exposure <= 1e12:
            raise InsituError(f"exposure = {self.exposure:g}, expected 1e-12 to 1e12")
        if not LEAST_SIDE <= self.longer_side <= MOST_SIDE:
            raise InsituError(f"longer side = {self.longer_side}, expected {LEAST_SIDE} to {MOST_SIDE} pixels")


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """match: what was found; edit: the material, as one edit; camera: its alignment, None where the scene's was
    right; resolution: (width, height) of the picture in the shape of the photograph; notes: lines for the user."""

    match: PhotoMatch
    edit: Several
    camera: CameraFit | None
    resolution: tuple[int, int]
    notes: tuple[str, ...] = ()


def match_photo(project: Project, request: PhotoRequest) -> Generator[StillProgress, None, PhotoOutcome]:
    """Match a photograph; a generator of progress. Raises InsituError."""
    document = project.document
    layers, targets = _checked(document, request)
    photo = _read(request)
    camera = _aligned(project, request, photo)
    size = size_for(photo.size, request.longer_side)
    project = project.edited(document, Viewpoint(None if camera is None else camera.camera, size))
    seen = photo.resized(size)

    plan = _plan(project)
    placement = Placement(project.scene, None, plan.n_edge_rays)
    rows, beside = _chosen(placement, project.scene.object_index(request.object), seen, request)
    view, still = yield from map_steps(
        _view(project, placement, rows, plan, request), lambda step: replace(step, fraction=0.5 * step.fraction)
    )
    pixels = _photo_pixels(project, placement, rows, beside, seen)
    own = [index for index, layer in enumerate(layers) if f"{request.object}.{index}" in project.layers]
    fit = PhotoFit(
        view, still, project.scene.object_index(request.object), layers, own, pixels, targets, with_layer,
        None if request.exposure is None else request.exposure * document.light.intensity,
    )  # fmt: skip
    match = yield from map_steps(fit.run(), lambda step: replace(step, fraction=0.5 + 0.5 * step.fraction))
    intensity = document.light.intensity or 1.0
    match = replace(match, exposure=match.exposure / intensity)
    notes = () if fit.knows_exposure else ("no other object is in the picture: its exposure was taken to be 1",)
    return PhotoOutcome(match, edit_of(request.object, layers, match.layers), camera, size, notes)


def edit_of(name: str, before: Sequence[Layer], after: Sequence[Layer]) -> Several:
    """The edit that makes the layers of an object those that were found."""
    commands: list[SetParameter | SetOperators] = []
    for i, (old, new) in enumerate(zip(before, after, strict=True)):
        if old.follows or old.rises:
            continue  # they follow
        key = f"{name}.{i}"
        commands += [
            SetParameter(key, parameter, value) for parameter, value in new.parameters if value != old.values[parameter]
        ]
        commands += [
            SetOperators(key, curve, new.operators(curve)) for curve in sorted(new.model.curve_names)
            if new.model.leader(curve) == curve and new.operators(curve) != old.operators(curve)
        ]  # fmt: skip
    return Several(tuple(commands), f"match {name} to a picture")


def _checked(document: Document, request: PhotoRequest) -> tuple[tuple[Layer, ...], tuple[Target, ...]]:
    """The object's layers, and what of them is to be found."""
    state = document.object(request.object)
    if state.is_lamp or not state.layers:
        raise InsituError(f"{request.object} reflects nothing, expected an object with a material")
    if not state.visible:
        raise InsituError(f"{request.object} is hidden, expected an object in the picture")
    if any(layer.parameter_maps for layer in state.layers):
        raise InsituError(f"{request.object} has parameters that vary over its surface, expected the same everywhere")
    targets = tuple(_named(state.layers, request.object, name) for name in request.targets)
    targets = tuple(dict.fromkeys(targets)) or default_targets(state.layers)
    if not targets:
        raise InsituError(f"{request.object} has no visible layer to match")
    for target in targets:
        editable_layer(document, f"{request.object}.{target.layer}")
    return state.layers, targets


def _named(layers: Sequence[Layer], owner: str, text: str) -> Target:
    """What "LAYER.NAME" means; the layer by its number or its name."""
    layer, _, name = text.rpartition(".")
    names = [each.name for each in layers]
    there = [str(i) for i in range(len(layers))]
    if layer not in (*names, *there):
        raise InsituError(f"{owner}: {text!r}, expected LAYER.NAME with a layer of {list_names([*there, *names])}")
    return target_of(layers, names.index(layer) if layer in names else int(layer), name)


def _read(request: PhotoRequest) -> Photo:
    photo = read_photo(request.file, request.transfer)
    if request.mask is None:
        return photo
    mask = read_picture(request.mask)
    if mask.shape[:2] != photo.radiance.shape[:2]:
        height, width = mask.shape[:2]
        raise InsituError(
            f"{request.mask}: {width} x {height}, expected the size of {request.file.name}, "
            f"{photo.size[0]} x {photo.size[1]}"
        )
    return photo.masked(np.asarray(mask.max(axis=2) > 0.5))


def _aligned(project: Project, request: PhotoRequest, photo: Photo) -> CameraFit | None:
    if not request.pairs:
        return None
    return fit_camera(request.pairs, photo.size, project.scene.description.camera)


def _plan(project: Project) -> Plan:
    """The plan of layers that are all edited: their curves have the bands that the editor would store."""
    return plan_scene(
        project.scene, project.layers, has_sky=project.sky.environment is not None, editable=project.layers.keys(),
        overrides=project.overrides,
    )  # fmt: skip


def _chosen(
    placement: Placement, i_object: int, seen: Photo, request: PhotoRequest
) -> tuple[NDArray[np.int32], NDArray[np.integer]]:
    """The points that are compared, and pixels (m,) that show the environment."""
    hits, generator = placement.hits, np.random.default_rng(1)
    objects = inner_pixels(hits, seen.usable).ravel()

    def some(pixels: NDArray[np.integer], most: int) -> NDArray[np.integer]:
        return pixels if len(pixels) <= most else np.sort(generator.choice(pixels, most, replace=False))

    own = rows_of_pixels(hits, some(np.flatnonzero(objects == i_object), MOST_PIXELS))
    if len(own) < LEAST_PIXELS:
        raise InsituError(
            f"{request.file}: {len(own)} usable pixels of {request.object}, expected {LEAST_PIXELS} or more that are "
            "neither clipped nor at its edge"
        )
    others = rows_of_pixels(hits, some(np.flatnonzero((objects >= 0) & (objects != i_object)), MOST_BESIDE))
    beside = some(np.flatnonzero((objects == -1) & (hits.open_image.ravel() == 1.0)), MOST_BESIDE)
    return np.union1d(own, others).astype(np.int32), beside


def _view(
    project: Project, placement: Placement, rows: NDArray[np.int32], plan: Plan, request: PhotoRequest
) -> Generator[StillProgress, None, tuple[PhotoView, tuple[StillLayer, ...]]]:
    """The view of the points, and the layers of the scene there."""
    part = placement.at_rows(rows)
    layers = sampled(part, still_layers(project.layers.items(), project.object_names, plan))
    yield StillProgress(0.0, "choosing lights")
    budget = with_light_budget(part, layers, project.sky, plan)
    quality = still_quality((yield from map_steps(budget, lambda step: StillProgress(0.0, "choosing lights"))))
    wanted = request.n_bounces or project.chosen_bounces or project.scene.description.bounces
    n_bounces = planned_bounces(placement, project.indexed_layers, wanted).n_bounces
    n_rays = plan.settings.n_hemisphere_rays
    view = yield from trace_view(part, layers, project.sky, quality, n_bounces, STILL.with_rays(n_rays), not n_rays)
    return view, layers


def _photo_pixels(
    project: Project, placement: Placement, rows: NDArray[np.int32], beside: NDArray[np.integer], seen: Photo
) -> PhotoPixels:
    """The photograph at the points, and where it shows the environment."""
    hits, sky = placement.hits, project.sky
    radiance, error = (np.asarray(each, np.float64).reshape(-1, 3) for each in (seen.radiance, seen.error))
    at = hits.pixel[rows]
    if sky.environment is None:
        return PhotoPixels(radiance[at], error[at])
    directions = hits.ray_directions.reshape(-1, 3)[beside]
    known: Float64Array = np.asarray(sky.environment.evaluate(directions, sky.rotation) * sky.scale, np.float64)
    return PhotoPixels(radiance[at], error[at], radiance[beside], known)
