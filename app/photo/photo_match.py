"""Matches a photograph that was taken in the light of a scene: aligns the camera, and finds the material of an object.

The photograph is compared at some thousand pixels of the scene's picture, in the size of the photograph or a smaller
one. What was found is one edit of the document, and a camera.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetMaterial, SetParameter, editable_layer
from app.document.commands.light import SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.several import Several
from app.document.document import Document
from app.document.history import Command
from app.document.linked_curves import linked_keys
from app.document.linked_layers import with_layer
from app.document.linked_objects import linked_places
from app.document.view_state import Viewpoint
from app.files.materials import Library
from app.photo.compared_points import ComparedPoints, compared_points
from app.photo.match_refusal import object_refusal
from app.photo.match_settings import usual_targets
from app.photo.photo_light import found_rotation, found_strengths
from app.photo.photo_request import PhotoRequest
from app.project.project import Project
from engine.core.errors import InsituError, list_names
from engine.core.generators import StillProgress, map_steps
from engine.inverse.camera_fit import CameraFit, PointPair, fit_camera
from engine.inverse.photo import Photo, read_photo, size_for
from engine.inverse.photo_fit import PhotoFit, PhotoMatch
from engine.inverse.photo_targets import Target, target_of
from engine.material.layer import Layer, object_of
from engine.render.picture_files import read_picture

# How often light and material are found in turn, where both are wanted.
N_TURNS = 2
# A band whose deviation is below this share of it is determined.
DETERMINED = 0.1


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """match: what was found; edit: the material, as one edit; camera: its alignment, None where the scene's was
    right; resolution: (width, height) of the picture in the shape of the photograph; photo: as it was read; notes:
    lines for the user."""

    match: PhotoMatch
    edit: Several
    camera: CameraFit | None
    resolution: tuple[int, int]
    photo: Photo
    notes: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """What was found, a line each."""
        match, lines = self.match, list[str]()
        if self.camera is not None:
            lines.append(f"camera: points within {self.camera.error:.2f} pixels of their places")
        lines += [_line_of(command) for command in self.edit.commands]
        for target, deviation in match.deviations.items():
            values = match.layers[target.layer].coefficients(target.name, len(deviation))
            known = np.count_nonzero((deviation < DETERMINED * np.maximum(values, 1e-300)).all(axis=1))
            lines.append(
                f"{target.layer}.{target.name}: {known} of {len(deviation)} bands known within {DETERMINED:.0%}"
            )
        lines.append(f"exposure {match.exposure:.4g}, {match.n_pixels:,} pixels")
        return (*lines, f"relRMSE {match.error:.2%} of the pixels that were held back, {match.before:.2%} before")


def match_photo(project: Project, request: PhotoRequest) -> Generator[StillProgress, None, PhotoOutcome]:
    """Match a photograph; a generator of progress. Raises InsituError."""
    begin = _start_of(request)
    project = project.edited(Several(begin, "start").apply(project.document), Viewpoint(None, None))
    layers, targets = _checked(project.document, request)
    photo = _read(request)
    camera = _aligned(project, request, photo)
    size = size_for(photo.size, request.longer_side)
    project = project.edited(project.document, Viewpoint(None if camera is None else camera.camera, size))
    linked = linked_to(project.document, request.object)
    points = compared_points(project, request.object, photo.resized(size), str(request.file), linked)

    # Light and material in turn: each with the other as it was found last.
    lights: tuple[SetRotation | SetMix, ...] = ()
    n_turns = N_TURNS if request.finds_rotation or request.finds_lights else 1
    look = Viewpoint(None, None)
    matched = project
    for turn in range(n_turns):
        span = partial(_within, turn / n_turns, 1.0 / n_turns)
        if n_turns > 1:
            found = yield from map_steps(_found_light(matched, points, request, is_first=turn == 0), span)
            lights = _last_of_each((*lights, *found))
            project = project.edited(Several(found, "light").apply(project.document), look)
        match, knows_exposure = yield from map_steps(_found_material(project, points, request, layers, targets), span)
        edit = edit_of(request.object, layers, match.layers)
        matched = project.edited(edit.apply(project.document), look)
    notes = () if knows_exposure else ("too little else in the picture says how it was exposed; taken to be 1",)
    return PhotoOutcome(match, replace(edit, commands=(*begin, *lights, *edit.commands)), camera, size, photo, notes)


def _start_of(request: PhotoRequest) -> tuple[SetMaterial, ...]:
    """The edit that gives the object the material to begin with, none for its own."""
    if not request.start:
        return ()
    return (SetMaterial(request.object, Library().entry(request.start).material.layers, request.start),)


def _within(begin: float, share: float, step: StillProgress) -> StillProgress:
    return replace(step, fraction=begin + share * step.fraction)


def linked_to(document: Document, name: str) -> frozenset[str]:
    """The names of the objects that get what is found of one as well, because their curves or materials are linked."""
    keys = [f"{name}.{i}" for i in range(len(document.object(name).layers))]
    curves = [(key, curve) for key in keys for curve in document.layer(key).model.curve_names]
    linked = {each for key in keys for each in linked_places(document, key)}
    linked.update(each for key, curve in curves for each in linked_keys(document, key, curve))
    return frozenset(map(object_of, linked)) - {name}


def _last_of_each(edits: Sequence[SetRotation | SetMix]) -> tuple[SetRotation | SetMix, ...]:
    """Of edits of the same value the last."""
    return tuple({edit.light if isinstance(edit, SetMix) else "": edit for edit in edits}.values())


def _found_light(
    project: Project, points: ComparedPoints, request: PhotoRequest, is_first: bool
) -> Generator[StillProgress, None, tuple[SetRotation | SetMix, ...]]:
    """What of the light was found, as edits."""
    edits: tuple[SetRotation | SetMix, ...] = ()
    if request.finds_rotation:
        edits = (SetRotation((yield from found_rotation(project, points, is_near=not is_first))),)
        project = project.edited(edits[0].apply(project.document), Viewpoint(None, None))
    if request.finds_lights:
        edits = (*edits, *(yield from found_strengths(project, points, request.n_bounces)))
    return edits


def _found_material(
    project: Project, points: ComparedPoints, request: PhotoRequest, layers: tuple[Layer, ...],
    targets: Sequence[Target],
) -> Generator[StillProgress, None, tuple[PhotoMatch, bool]]:  # fmt: skip
    """The material in the light of the project, and whether its exposure is known."""
    halves = partial(_within, 0.0, 0.5), partial(_within, 0.5, 0.5)
    view, still = yield from map_steps(points.view(project, request.n_bounces), halves[0])
    own = [index for index, _ in enumerate(layers) if f"{request.object}.{index}" in project.layers]
    # A picture has the intensity of the light in it, transport has not.
    intensity = project.document.light.intensity
    fit = PhotoFit(
        view, still, project.scene.object_index(request.object), layers, own, points.pixels(project), targets,
        with_layer, None if request.exposure is None else request.exposure * intensity,
    )  # fmt: skip
    match = yield from map_steps(fit.run(), halves[1])
    return replace(match, exposure=match.exposure / intensity), fit.knows_exposure


def edit_of(name: str, before: Sequence[Layer], after: Sequence[Layer]) -> Several:
    """The edit that makes the layers of an object those that were found."""
    commands: list[SetParameter | SetOperators] = []
    for i, (old, new) in enumerate(zip(before, after, strict=True)):
        if old.rises:
            continue  # all of it is of the layer that it follows
        key = f"{name}.{i}"
        commands += [
            SetParameter(key, parameter, value) for parameter, value in new.parameters if value != old.values[parameter]
        ]
        commands += [
            SetOperators(key, curve, new.operators(curve)) for curve in sorted(new.model.curve_names)
            if not old.follows and new.model.leader(curve) == curve and new.operators(curve) != old.operators(curve)
        ]  # fmt: skip
    return Several(tuple(commands), f"match {name} to a picture")


def _line_of(command: Command[Document]) -> str:
    """What an edit sets, and to what."""
    match command:
        case SetMaterial():
            return f"{command.object}: began with {command.name}"
        case SetRotation():
            return f"light.rotation = {command.degrees:.2f}"
        case SetMix():
            return f"{command.light}.{command.name} = {command.value:.3f}"
        case SetParameter():
            values = command.value if isinstance(command.value, tuple) else (command.value,)
            return f"{command.key}.{command.name} = {', '.join(f'{value:.4g}' for value in values)}"
        case SetOperators():
            n = len(command.operators)
            return f"{command.key}.{command.factor}: {n} operator{'' if n == 1 else 's'}"
    return command.label


def _checked(document: Document, request: PhotoRequest) -> tuple[tuple[Layer, ...], tuple[Target, ...]]:
    """The object's layers, and what of them is to be found."""
    state = document.object(request.object)
    if refusal := object_refusal(document, state):
        raise InsituError(refusal)
    if not document.light.intensity:
        raise InsituError("light.intensity = 0, expected more: without light a picture says nothing of a material")
    targets = tuple(_named(state.layers, request.object, name) for name in request.targets)
    targets = tuple(dict.fromkeys(targets)) or usual_targets(document, request.object)
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
    pairs = request.pairs
    if request.in_shares:
        width, height = photo.size
        pairs = tuple(PointPair((u * width, v * height), point) for (u, v), point in pairs)
    return fit_camera(pairs, photo.size, project.scene.description.camera)
