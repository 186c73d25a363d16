"""The variants of a USD stage's default prim that differ in their materials alone, which become variants of objects.

The stage is composed again with each selection, where its layers are (`usd_stage`), and what it has beside materials is
compared. A variant that moves, hides or replaces anything is none of these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

MOST_LOOKS = 16
_SHADING = frozenset({"Material", "Shader", "NodeGraph"})
_NOT_COMPARED = _SHADING | {"", "Scope"}
_OF_BINDINGS = ("material", "schemas", "variants", "parent")

Rows = list[dict[str, Any]]


def selections(stage: Any) -> tuple[str, list[str]]:
    """The only variant set of the default prim and its variants; nothing where it has none, or several."""
    prim = stage.GetDefaultPrim()
    sets = prim.GetVariantSets().GetNames() if prim else []
    if len(sets) != 1 or stage.GetPrototypes():
        return "", []
    names = list(map(str, prim.GetVariantSet(sets[0]).GetVariantNames()))
    return str(sets[0]), names if 1 < len(names) <= MOST_LOOKS else []


def differ_in_materials_alone(
    prims: Rows, arrays: Mapping[str, np.ndarray], others: Rows, other_arrays: Mapping[str, np.ndarray]
) -> bool:
    """Whether the prims of two selections are the same but for their materials."""
    if any(row["kind"] == "PointInstancer" for row in prims) or arrays.keys() != other_arrays.keys():
        return False
    if list(_compared(prims)) != list(_compared(others)):
        return False
    return all(np.array_equal(array, other_arrays[name], equal_nan=True) for name, array in arrays.items())


def _compared(prims: Rows) -> Iterator[dict[str, Any]]:
    for row in prims:
        if row["kind"] not in _NOT_COMPARED:
            own = {key: value for key, value in row.items() if key not in _OF_BINDINGS}
            for key in ("values", "meta"):
                own[key] = {name: each for name, each in row[key].items() if not name.startswith("material:")}
            yield own
