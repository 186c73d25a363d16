"""Objects of a document as they stand, and the edits that place several of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from app.document.commands.poses import PlaceObjects
from app.document.commands.several import named_together
from app.document.document import Document
from engine.core.errors import InsituError
from engine.scene.arrangement import PlacedObject, middle_of, moved, rotated, scaled, transforms_of
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
