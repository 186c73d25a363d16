"""The transport of edited curves that is desired, requested and ready: the selected layer's, and that of layers that
share its curve, those of other objects with a link to it, or to its object, among them.

All of them follow the pointer in every frame, each from its own transport. The selected one's is requested first.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.document.document import Document, Selection
from app.document.linked_curves import linked_keys
from app.document.linked_layers import linked_indices
from app.document.linked_objects import linked_places
from app.modes.placement.curves import Curves
from app.modes.placement.desired_state import DesiredCurve, ReadyCurve, ReadyLayer, same_coefficients
from engine.material.layer import object_of
from engine.settings import Precision


def edited_layers(document: Document, selected: Selection | None) -> tuple[str, ...]:
    """Keys of the layers that follow the selected curve, that of the selected layer first.

    None where no curve is selected, or one of a lamp or a fixed object. Of layers that share it, the visible ones.
    """
    if selected is None or selected.factor is None:
        return ()
    state = document.object(selected.object)
    if state.is_lamp or not state.editable:
        return ()
    others = [
        i for i in linked_indices(state.layers, selected.layer) if i != selected.layer and state.layers[i].visible
    ]
    sharing = [i for i in others if selected.factor in state.layers[i].model.curve_names]
    own = tuple(f"{selected.object}.{i}" for i in (selected.layer, *sharing))
    if not (document.curve_links or document.object_links):
        return own
    linked = [*own, *(key for each in own for key in linked_keys(document, each, selected.factor))]
    everywhere = dict.fromkeys([*linked, *(key for each in linked for key in linked_places(document, each))])
    return (*own, *(key for key in everywhere if key not in own and _is_drawn(document, key)))


def _is_drawn(document: Document, key: str) -> bool:
    """Whether a layer takes part in the picture, and its object can be edited: a fixed one has no transport."""
    return document.is_visible(key) and document.object(object_of(key)).editable


def desired_curves(
    document: Document, selected: Selection | None, curves: Curves, precision: Precision
) -> tuple[DesiredCurve, ...]:
    """The desired transport of the selected curve in the layers that follow it; none of a curve applied in image
    space."""
    found = []
    for key in edited_layers(document, selected):
        coefficients = curves.coefficients(document, key)
        if selected is not None and selected.factor in coefficients:
            others = {name: values for name, values in coefficients.items() if name != selected.factor}
            found.append(DesiredCurve(key, selected.factor, others, precision))
    return tuple(found)


class EditedCurves:
    """Keeps track of this transport; `layers` are the radiances that came with the transport requested last."""

    def __init__(self) -> None:
        self.desired: tuple[DesiredCurve, ...] = ()
        self._requested: dict[str, DesiredCurve] = {}
        self._ready: dict[str, ReadyCurve] = {}

    def forget_answers(self, staying: Mapping[str, ReadyLayer]) -> None:
        """Forget what came: other transport was requested, and with it what is desired now. Layers that stay are
        ready."""
        self._requested = {desired.key: desired for desired in self.desired}
        self._ready = {key: shown for key, shown in self._ready.items() if key in staying}

    def forget_requested(self) -> None:
        """Forget what was requested: a new worker knows nothing of it."""
        self._requested = {}

    def note_request(self, desired: DesiredCurve) -> None:
        """Note that it is being requested."""
        self._requested[desired.key] = desired

    def withdraw(self, key: str) -> None:
        """Forget a request that failed or whose result was not stored: selected again, it is requested again."""
        self._requested.pop(key, None)

    def missing(self, layers: Mapping[str, ReadyLayer]) -> list[DesiredCurve]:
        """Those that are neither ready nor requested."""
        due = [desired for desired in self.desired if not self.has(desired, layers)]
        return [desired for desired in due if not desired.same(self._requested.get(desired.key))]

    def has_all(self, layers: Mapping[str, ReadyLayer]) -> bool:
        return all(self.has(desired, layers) for desired in self.desired)

    def has(self, desired: DesiredCurve, layers: Mapping[str, ReadyLayer]) -> bool:
        """Whether it has come, in the stage and with the other curve of its layer's radiance."""
        shown = layers.get(desired.key)
        if shown is None or desired.factor is None:
            return False
        if self._ready.get(desired.key) != ReadyCurve(desired.key, desired.factor, shown.stage, desired.precision):
            return False
        # The layer on screen may be the one before, with other curves than the document's.
        others = {name: values for name, values in shown.coefficients.items() if name != desired.factor}
        return same_coefficients(others, desired.others)

    def receive(self, came: ReadyCurve, edited: tuple[str, ...]) -> bool:
        """Note one that came; returns whether its layer is among those that follow the selected curve now."""
        if came.key not in edited:
            requested = self._requested.get(came.key)
            if requested is not None and (requested.factor, requested.precision) == (came.factor, came.precision):
                self.withdraw(came.key)
            return False
        # The renderer holds transport only for these: any other layer's is requested again when it is selected.
        self._requested = {key: desired for key, desired in self._requested.items() if key in edited}
        self._ready = {key: shown for key, shown in self._ready.items() if key in edited} | {came.key: came}
        return True

    def finish_stage(self, layers: Mapping[str, ReadyLayer]) -> None:
        """Note the end of a stage: what did not come with it is requested again."""
        for desired in self.desired:
            if not self.has(desired, layers):
                self.withdraw(desired.key)

    def stage_of(self, key: str, factor: str) -> str | None:
        """The stage of a curve's transport, where it is the one that is ready."""
        shown = self._ready.get(key)
        return None if shown is None or shown.factor != factor else shown.stage

    def is_in_halves(self, key: str) -> bool:
        """Whether the transport that is ready of a layer is in half floats."""
        return key in self._ready and self._ready[key].precision == "half"
