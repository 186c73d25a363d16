"""Matching a material for the Python interface: its files are read, and both materials drawn in place, here and now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.document.commands.layers import SetMaterial
from app.document.material_match import MaterialMatch
from app.interface.editing import Editing
from app.messages.match_messages import MatchErrors
from engine.core.generators import run_to_end

if TYPE_CHECKING:
    from app.project.project import Project


def match_object(
    editing: Editing, project: Project, name: str, model: str, source: str | None, curves: Sequence[str] | None,
    search: Sequence[str] | None,
) -> MatchErrors:  # fmt: skip
    """See `Scene.match_material`. project: of the scene as it is now."""
    from app.project.matching import match_steps, source_layers  # late: few programs match a material
    from app.project.reading import read_measurements
    from engine.precompute.direct.pipeline import Placement
    from engine.scene.cutouts import scene_caster

    document = editing.document
    layers, title = source_layers(document, source or name)
    MaterialMatch(name, layers, title, model, _names(curves), _names(search)).start(document)
    # The files are read as those of a document with this material are.
    layers = read_measurements(SetMaterial(name, layers, title).apply(document)).object(name).layers
    match = MaterialMatch(name, layers, title, model, _names(curves), _names(search))
    placement = Placement(project.scene, scene_caster(project.scene))
    n_bounces = project.editor_settings.n_bounces
    layer, errors = run_to_end(match_steps(match, project.picture_document, placement, project.sky, n_bounces))
    editing.do(match.command(layer))
    return errors


def _names(given: Sequence[str] | None) -> tuple[str, ...] | None:
    return None if given is None else (given,) if isinstance(given, str) else tuple(given)
