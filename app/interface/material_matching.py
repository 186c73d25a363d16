"""Matching a material for the Python interface: its files are read, and both materials drawn in place, here and now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.document.material_match import MaterialMatch, MaterialMatchErrors
from app.interface.editing import Editing
from engine.core.generators import run_to_end

if TYPE_CHECKING:
    from app.project.project import Project


def match_object(
    editing: Editing, project: Project, name: str, model: str, source: str | None, curves: Sequence[str] | None,
    search: Sequence[str] | None,
) -> MaterialMatchErrors:  # fmt: skip
    """See `Scene.match_material`. project: of the scene as it is now."""
    from app.project.material_matching import found_source, match_material  # late: few programs match a material

    match = MaterialMatch(name, source or name, model, _names(curves), _names(search))
    match = found_source(match, editing.document)
    found = run_to_end(match_material(project, match))
    editing.do(match.command(found.layer))
    return found.errors


def _names(given: Sequence[str] | None) -> tuple[str, ...] | None:
    return None if given is None else (given,) if isinstance(given, str) else tuple(given)
