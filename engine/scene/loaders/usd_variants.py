"""The variant sets of a USD stage, and the choice among their variants, where the stage is composed (`usd_stage`).

A choice is made by the name of a set: that of the default prim where it has one of that name, else of every prim that
has. It is written to the session layer alone. A set inside a variant is there once that variant is chosen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MOST_SETS, MOST_VARIANTS = 64, 256  # that are offered; any can be chosen


def choose_variants(stage: Any, chosen: Mapping[str, str]) -> None:
    """Choose these variants of sets by their names, one after the other; names that are not there change nothing."""
    from pxr import Usd

    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for group, name in chosen.items():
            for prim in _owners(stage, group):
                own = prim.GetVariantSet(group)
                if name in own.GetVariantNames():
                    own.SetVariantSelection(name)


def variant_sets(stage: Any) -> dict[str, tuple[str, list[str]]]:
    """The sets by their names, each with the variant that is chosen, "" where prims differ, and all that there are."""
    groups: dict[str, None] = {}
    for prim in stage.TraverseAll():
        groups.update(dict.fromkeys(map(str, prim.GetVariantSets().GetNames())))
        if len(groups) >= MOST_SETS:
            break
    found = {}
    for group in list(groups)[:MOST_SETS]:
        owners = _owners(stage, group)
        chosen = {str(prim.GetVariantSet(group).GetVariantSelection()) for prim in owners}
        names = dict.fromkeys(str(name) for prim in owners for name in prim.GetVariantSet(group).GetVariantNames())
        found[group] = (chosen.pop() if len(chosen) == 1 else "", list(names)[:MOST_VARIANTS])
    return found


def _owners(stage: Any, group: str) -> list[Any]:
    """The prims whose set of that name is meant."""
    default = stage.GetDefaultPrim()
    if default and default.GetVariantSets().HasVariantSet(group):
        return [default]
    return [prim for prim in stage.TraverseAll() if prim.GetVariantSets().HasVariantSet(group)]
