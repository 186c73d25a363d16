"""Matches a material with a model, for the worker and for `import insitu`: what a name stands for, the matched layer,
and how far it is from the original, as a BRDF and in place."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.document import Document, reflecting_layers
from app.document.linked_layers import Layers
from app.document.material_match import MaterialMatch, material_of
from app.files.materials import Library, load_material, measured_layers
from app.messages.match_messages import MatchErrors
from app.system.paths import is_file_name
from engine.core.errors import InsituError
from engine.core.generators import map_steps
from engine.inverse.brdf_fit import match_layer
from engine.material.layer import Layer, evaluate_layers, object_of
from engine.measured.measurement import ENDINGS

if TYPE_CHECKING:
    from engine.precompute.direct.pipeline import Placement, SkyState

FITTING, DRAWING = "fitting curves", "drawing both in place"
# The share of the work that the fit is.
_FIT = 0.7
MatchSteps = Generator[tuple[float, str], None, tuple[Layer, MatchErrors]]


def source_layers(document: Document, name: str) -> tuple[Layers, str]:
    """The layers of a material, which may be unread, and what to call it: an object or a layer of the document by its
    path, a material of the library or of a file, or a measured BRDF's file. Raises InsituError."""
    found = material_of(document, name)
    if found is not None:
        return found
    if Path(name).suffix.lower() in ENDINGS:
        return measured_layers(Path(name)), Path(name).stem
    if is_file_name(name):
        material = load_material(Path(name))
        return material.layers, material.name
    try:
        return Library().entry(name).material.layers, name
    except InsituError as error:
        raise InsituError(f"{error}, and no object or layer of that path in the scene") from None


def match_steps(
    match: MaterialMatch, document: Document, placement: Placement, sky: SkyState, n_bounces: int
) -> MatchSteps:
    """The matched layer and its errors; a generator of the share that is done, and of what is being done. The layers of
    the match, and of the document, are read. Raises InsituError."""
    from engine.inverse.placed_error import placed_error  # late: few sessions trace paths

    start = match.start(document)
    original = tuple(layer for layer in match.layers if layer.visible)
    fitting = match_layer(lambda wi, wo: evaluate_layers(original, wi, wo), start, match.names, match.parameters)
    found = yield from map_steps(fitting, lambda share: (_FIT * share, FITTING))
    yield _FIT, DRAWING
    names, seen = placement.scene.object_names, None
    if match.object in names and document.is_visible(f"{match.object}.0"):
        layers_of: dict[int, list[Layer]] = {}
        for key, layer in reflecting_layers(document):
            if object_of(key) in names:
                layers_of.setdefault(names.index(object_of(key)), []).append(layer)
        drawing = placed_error(
            placement, layers_of, names.index(match.object), original, (found.layer,), sky, max(n_bounces, 1)
        )
        seen = yield from map_steps(drawing, lambda share: (_FIT + (1.0 - _FIT) * share, DRAWING))
    return found.layer, MatchErrors(found.before, found.error, seen)
