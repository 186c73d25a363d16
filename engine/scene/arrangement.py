"""Several objects moved, rotated and scaled together, about a common point or each about its own centre.

An object with its centre at c and the linear part R S (`engine.scene.transform`) goes, about a point o, to

    c' = o + A (c - o) ,   R' S' nearest to A R S ,

with the rotation or the scale A along the world's axes or any others. A rotation is exact. A scale by f along axes that
an object's own do not follow would shear it; it scales the object's axis r_j by |A r_j| and keeps their directions, as
Blender does: exact where the axes agree, and for one factor in all directions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.scene.light_placement import rotation_between
from engine.scene.transform import LEAST_SCALE, MOST_SCALE, Transform, Triple, rotation_degrees, rotation_matrix

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """An object as it stands: its name, its box (2, 3) where its file has it, and its transform from there."""

    name: str
    box: Float64Array
    transform: Transform

    @property
    def pivot(self) -> Float64Array:
        """The centre of its box where its file has it (3,)."""
        return 0.5 * (self.box[0] + self.box[1])

    @property
    def centre(self) -> Float64Array:
        """Where that is now (3,)."""
        return self.pivot + self.transform.translation

    @property
    def moved_box(self) -> Float64Array:
        """The box (2, 3) around it as it stands."""
        return self.transform.moved_box(self.box)

    def at(self, centre: ArrayLike) -> PlacedObject:
        """The same with its centre elsewhere. Raises ValueError outside the range of transforms."""
        translation = _triple(np.asarray(centre, np.float64) - self.pivot)
        return replace(self, transform=replace(self.transform, translation=translation))

    def extent_along(self, direction: ArrayLike) -> float:
        """How far its box reaches from its centre in a unit direction (3,)."""
        half = 0.5 * (self.box[1] - self.box[0])
        return float(np.abs(np.asarray(direction, np.float64) @ self.transform.linear) @ half)


Placed = Sequence[PlacedObject]


def middle_of(placed: Placed) -> Float64Array:
    """The mean of their centres (3,)."""
    return np.mean([each.centre for each in placed], axis=0)


def box_of(placed: Placed) -> Float64Array:
    """The box (2, 3) around all of them as they stand."""
    boxes = np.array([each.moved_box for each in placed])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def moved(placed: Placed, by: ArrayLike) -> list[PlacedObject]:
    """All of them moved by metres (3,). Raises ValueError outside the range of transforms."""
    return [
        replace(each, transform=replace(each.transform, translation=_triple(np.add(each.transform.translation, by))))
        for each in placed
    ]


def rotated(placed: Placed, rotation: Float64Array, about: Float64Array | None = None) -> list[PlacedObject]:
    """All of them rotated (3, 3) about a point (3,), None: each about its centre."""
    found = list[PlacedObject]()
    for each in placed:
        turned = rotation_degrees(rotation @ rotation_matrix(each.transform.rotation))
        changed = replace(each, transform=replace(each.transform, rotation=turned))
        found.append(changed if about is None else changed.at(about + rotation @ (each.centre - about)))
    return found


def scaled(
    placed: Placed, factors: ArrayLike, about: Float64Array | None = None, axes: Float64Array | None = None
) -> list[PlacedObject]:
    """All of them scaled by factors (3,) along axes, the columns of (3, 3), about a point (3,). axes None: those of the
    world, or, where about is None, each along its own axes and about its centre. Factors of an object stay within the
    range of transforms."""
    found = list[PlacedObject]()
    for each in placed:
        along = np.eye(3) if axes is None else axes
        matrix = along * np.asarray(factors, np.float64) @ along.T
        if axes is None and about is None:
            stretched = np.asarray(factors, np.float64)
        else:
            stretched = np.linalg.norm(matrix @ each.transform.own_axes, axis=0)
        scale = _triple(np.clip(stretched * each.transform.scale, LEAST_SCALE, MOST_SCALE))
        changed = replace(each, transform=replace(each.transform, scale=scale))
        found.append(changed if about is None else changed.at(about + matrix @ (each.centre - about)))
    return found


def transforms_of(placed: Iterable[PlacedObject]) -> tuple[tuple[str, Transform], ...]:
    """The transform of each, by its name."""
    return tuple((each.name, each.transform) for each in placed)


def _triple(values: Float64Array) -> Triple:
    x, y, z = np.asarray(values, np.float64).tolist()
    return x, y, z


# ----------------------------------------------------------------------------------------------- standing on something


def stood_on(placed: Placed, point: ArrayLike, normal: ArrayLike, aligns: bool = False) -> list[PlacedObject]:
    """All of them moved so that their middle is over a point of a surface, in the direction of its unit normal, and
    their boxes touch it. aligns: turned first so that what is up in the world points along the normal. Raises
    ValueError outside the range of transforms."""
    normal, middle = np.asarray(normal, np.float64), middle_of(placed)
    if aligns:
        placed = rotated(placed, rotation_between(np.array([0.0, 1.0, 0.0]), normal), middle)
    # How far they reach from their middle against the normal.
    reach = max(float((middle - each.centre) @ normal) + each.extent_along(normal) for each in placed)
    return moved(placed, np.asarray(point, np.float64) + reach * normal - middle)


def dropped(units: Sequence[Placed], others: Float64Array) -> list[PlacedObject]:
    """Units, of objects that stay together, moved up or down to stand on what is below their middle: the lowest first,
    on the boxes (N, 2, 3) of the others and on those that stand already. Raises ValueError outside the range of
    transforms."""
    found, boxes = list[PlacedObject](), [*others]
    for unit in sorted(units, key=lambda unit: float(box_of(unit)[0, 1])):
        box = box_of(unit)
        rise = support_below(box, np.array(boxes).reshape(-1, 2, 3)) - box[0, 1]
        stands = moved(unit, (0.0, rise, 0.0))
        found += stands
        boxes += [each.moved_box for each in stands]
    return found


def support_below(box: Float64Array, others: Float64Array) -> float:
    """The height on which a box (2, 3) stands above others (N, 2, 3): the highest top below its middle of those that it
    overlaps from above, or the floor of those that it is in, as of a room or a backdrop; else the lowest of all; 0
    where there are none."""
    if not len(others):
        return 0.0
    low, high = others[:, 0], others[:, 1]
    middle = 0.5 * (box[0] + box[1])
    overlaps = np.all((low < box[1]) & (high > box[0]), axis=1, where=np.array([True, False, True]))
    surrounds = np.all((low <= middle) & (middle < high), axis=1)
    tops = high[overlaps & (high[:, 1] <= middle[1]), 1]
    floors = low[overlaps & surrounds, 1]
    heights = np.concatenate([tops, floors])
    return float(heights.max() if len(heights) else low[:, 1].min())
