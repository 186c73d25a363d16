"""Objects of a document as they stand, and the edits that place several of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.document.commands.poses import PlaceObjects
from app.document.commands.several import named_together
from app.document.document import Document
from engine.core.errors import InsituError
from engine.scene.arrangement import PlacedObject, dropped, middle_of, moved, rotated, scaled, stood_on, transforms_of
from engine.scene.transform import Triple, rotation_matrix

Pivot = Literal["middle", "own", "active"]  # what several objects are rotated and scaled about
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
    placed: Sequence[PlacedObject], by: Triple, rotate: Triple, scale: Triple, pivot: Pivot = "middle"
) -> PlaceObjects:
    """The edit that moves objects by metres, then rotates them by degrees about the world's X, Y and Z, and scales them
    along its axes: about their pivot, "own": along their own axes. Raises InsituError."""
    if not placed:
        raise InsituError("the objects have no surface that could be moved")
    try:
        about = pivot_of(placed, pivot)
        found = rotated(scaled(placed, scale, about), rotation_matrix(rotate), about)
        return placing(moved(found, by), "move")
    except ValueError as error:
        raise InsituError(str(error)) from None


def pivot_of(placed: Sequence[PlacedObject], pivot: Pivot) -> NDArray[np.float64] | None:
    """The point (3,) that objects are rotated and scaled about, the last of them active; None: each about its own
    centre."""
    if pivot == "own":
        return None
    return placed[-1].centre if pivot == "active" else middle_of(placed)


def dropping(document: Document, names: Iterable[str], resting_box: RestingBox) -> PlaceObjects:
    """The edit that lets objects stand on what is below them; those of a group stay together. Raises InsituError."""
    placed = placed_objects(document, dict.fromkeys(names), resting_box)
    if not placed:
        raise InsituError("the objects have no surface that could stand on anything")
    try:
        return placing(dropped_in(document, placed, resting_box), "drop")
    except ValueError as error:
        raise InsituError(str(error)) from None


def dropped_in(document: Document, placed: Sequence[PlacedObject], resting_box: RestingBox) -> list[PlacedObject]:
    """Objects, wherever they are, moved up or down to stand on what is below them in a document. Raises ValueError
    outside the range of transforms."""
    units: dict[str, list[PlacedObject]] = {}
    for each in placed:
        group = document.object(each.name).in_group
        units.setdefault(f"group {group}" if group else f"object {each.name}", []).append(each)
    dropped_names = {each.name for each in placed}
    others = placed_objects(
        document, [s.name for s in document.objects if s.name not in dropped_names and not s.is_lamp], resting_box
    )
    boxes = np.array([each.moved_box for each in others]).reshape(-1, 2, 3)
    return dropped(list(units.values()), boxes)


def standing(placed: Sequence[PlacedObject], point: ArrayLike, normal: ArrayLike, aligns: bool) -> PlaceObjects:
    """The edit that lets objects stand on a point of a surface, see `stood_on`. Raises InsituError."""
    try:
        return placing(stood_on(placed, point, normal, aligns), "move")
    except ValueError as error:
        raise InsituError(str(error)) from None
