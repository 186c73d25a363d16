"""Why an object's material cannot be matched to a photograph, said before a match begins."""

from __future__ import annotations

from app.document.commands.layers import SetMaterial
from app.document.document import Document, ObjectState, layer_key
from app.photo.match_settings import MatchSettings, possible_targets, written_targets
from engine.core.errors import InsituError


def match_refusal(document: Document, settings: MatchSettings) -> str:
    """One line that says why, "" where it can be matched."""
    state = next((each for each in document.objects if each.name == settings.object), None)
    if state is None:
        return f"{settings.object} is gone; choose another object"
    try:
        document = settings.begun(document)
    except InsituError as error:
        return str(error)
    state = document.object(settings.object)
    return object_refusal(document, state) or _targets_refusal(document, state, settings.targets)


def object_refusal(document: Document, state: ObjectState) -> str:
    """The same of an object, whatever is to be found of it."""
    name = state.name
    try:
        SetMaterial(name, ()).check(document)
    except InsituError as error:  # it is fixed, frozen or an emitter
        return str(error)
    if not state.visible:
        return f"{name} is hidden; show it to match its material"
    if any(layer.parameter_maps for layer in state.layers):
        return f"{name} has parameters that vary over its surface; expected the same everywhere"
    targets = list(possible_targets(state.layers))
    if not targets:
        return f"{name} has no visible layer that can be matched"
    if all(document.is_frozen(layer_key(name, each.layer)) for each in targets):
        return f"{name} has no layer that can be edited; thaw one to match it"
    return ""


def _targets_refusal(document: Document, state: ObjectState, chosen: tuple[str, ...]) -> str:
    targets = list(possible_targets(state.layers))
    found = [target for target, name in zip(targets, written_targets(targets), strict=True) if name in chosen]
    if not found:
        return "choose what is to be found: a curve, a scale or a parameter"
    frozen = (layer_key(state.name, each.layer) for each in found)
    key = next((key for key in frozen if document.is_frozen(key)), "")
    return f"{key} is frozen; thaw it, or find nothing of it" if key else ""
