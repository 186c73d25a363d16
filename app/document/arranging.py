"""Objects of a document as they stand, and the edits that place several of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.document.commands.poses import PlaceObjects
from app.document.commands.several import named_together
from app.document.document import Document
from engine.core.errors import InsituError
from engine.scene.arrangement import PlacedObject, dropped, middle_of, moved, rotated, scaled, stood_on, transforms_of
from engine.scene.transform import Triple, rotation_matrix

RestingBox = Callable[[str], NDArray[np.float64] | None]


def placed_objects(document: Document, names: Iterable[str], resting_box: RestingBox) -> list[PlacedObject]:
    """These objects as they stand, without those that have no surface; resting_box: gives the box (2, 3) of an object
    where its file has it."""
    known = {state.name: state for state in document.objects}
    boxes = [(known.get(name) or document.object(name), resting_box(name)) for name in names]
    return [PlacedObject(state.name, box, state.transform) for state, box in boxes if box is not None]


def placing(placed: Sequence[PlacedObject], verb: str) -> PlaceObjects:
    """The edit that places them so."""
    return PlaceObjects(transforms_of(placed), f"{verb} {named_together([each.name for each in placed])}")


def move_together(
    placed: Sequence[PlacedObject], by: Triple, rotate: Triple, scale: Triple, each_about_its_own: bool = False
) -> PlaceObjects:
    """The edit that moves objects by metres, then rotates them by degrees about the world's X, Y and Z, and scales them
    along its axes: about their middle, or each about its own centre and along its own axes. Raises InsituError."""
    if not placed:
        raise InsituError("the objects have no surface that could be moved")
    try:
        about = None if each_about_its_own else middle_of(placed)
        found = rotated(scaled(placed, scale, about), rotation_matrix(rotate), about)
        return placing(moved(found, by), "move")
    except ValueError as error:
        raise InsituError(str(error)) from None


def dropping(document: Document, names: Iterable[str], resting_box: RestingBox) -> PlaceObjects:
    """The edit that lets objects stand on what is below them; those of a group stay together. Raises InsituError."""
    placed = placed_objects(document, dict.fromkeys(names), resting_box)
    if not placed:
        raise InsituError("the objects have no surface that could stand on anything")
    units: dict[str, list[PlacedObject]] = {}
    for each in placed:
        group = document.object(each.name).in_group
        units.setdefault(f"group {group}" if group else f"object {each.name}", []).append(each)
    dropped_names = {each.name for each in placed}
    others = placed_objects(
        document, [s.name for s in document.objects if s.name not in dropped_names and not s.is_lamp], resting_box
    )
    boxes = np.array([each.moved_box for each in others]).reshape(-1, 2, 3)
    try:
        return placing(dropped(list(units.values()), boxes), "drop")
    except ValueError as error:
        raise InsituError(str(error)) from None


def standing(placed: Sequence[PlacedObject], point: ArrayLike, normal: ArrayLike, aligns: bool) -> PlaceObjects:
    """The edit that lets objects stand on a point of a surface, see `stood_on`. Raises InsituError."""
    try:
        return placing(stood_on(placed, point, normal, aligns), "move")
    except ValueError as error:
        raise InsituError(str(error)) from None
