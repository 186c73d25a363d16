"""Which curves' transport is wanted, asked for and there: the selected layer's, and of layers that share its curve.

All of them follow the hand in every frame, each from its own transport. The selected one's is asked for first.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.document.document import Document, Selection
from app.document.linked_layers import linked_indices
from app.modes.placement.curves import Curves
from app.modes.placement.desired_state import DesiredCurve, ReadyCurve, ReadyLayer, same_coefficients
from engine.planner import Precision


def edited_layers(document: Document, selected: Selection | None) -> tuple[str, ...]:
    """Keys of the layers that follow the selected curve, that of the selected layer first.

    None where no curve is selected, or one of a lamp or a fixed object. Of layers that share it, those in sight.
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
    return tuple(f"{selected.object}.{i}" for i in (selected.layer, *sharing))


def desired_curves(
    document: Document, selected: Selection | None, curves: Curves, precision: Precision
) -> tuple[DesiredCurve, ...]:
    """The transport of the selected curve in the layers that follow it; none of a curve applied in image space."""
    wishes = []
    for key in edited_layers(document, selected):
        coefficients = curves.coefficients(document, key)
        if selected is not None and selected.factor in coefficients:
            others = {name: values for name, values in coefficients.items() if name != selected.factor}
            wishes.append(DesiredCurve(key, selected.factor, others, precision))
    return tuple(wishes)


class EditedCurves:
    """The books of the talk about them; `layers` are the radiances that came with the transport asked last."""

    def __init__(self) -> None:
        self.desired: tuple[DesiredCurve, ...] = ()
        self._requested: dict[str, DesiredCurve] = {}
        self._ready: dict[str, ReadyCurve] = {}

    def forget_answers(self, staying: Mapping[str, ReadyLayer]) -> None:
        """Other transport was asked for, and with it what is wanted now; that of layers that stay is there."""
        self._requested = {desired.key: desired for desired in self.desired}
        self._ready = {key: shown for key, shown in self._ready.items() if key in staying}

    def forget_requested(self) -> None:
        """A new worker knows nothing of what was asked."""
        self._requested = {}

    def note_request(self, desired: DesiredCurve) -> None:
        """It is being asked for."""
        self._requested[desired.key] = desired

    def withdraw(self, key: str) -> None:
        """What was asked for will not come, or was not kept: selected again, it is asked for again."""
        self._requested.pop(key, None)

    def missing(self, layers: Mapping[str, ReadyLayer]) -> list[DesiredCurve]:
        """Those that are neither there nor asked for."""
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
        # The layer that is shown may be the one before, with other curves than the document's.
        others = {name: values for name, values in shown.coefficients.items() if name != desired.factor}
        return same_coefficients(others, desired.others)

    def receive(self, came: ReadyCurve, edited: tuple[str, ...]) -> bool:
        """Note one that came; whether its layer is among those that follow the selected curve now."""
        if came.key not in edited:
            asked = self._requested.get(came.key)
            if asked is not None and (asked.factor, asked.precision) == (came.factor, came.precision):
                self.withdraw(came.key)
            return False
        # The renderer keeps no transport but theirs: of any other layer it is asked for again when it is selected.
        self._requested = {key: desired for key, desired in self._requested.items() if key in edited}
        self._ready = {key: shown for key, shown in self._ready.items() if key in edited} | {came.key: came}
        return True

    def finish_stage(self, layers: Mapping[str, ReadyLayer]) -> None:
        """A stage is over: what did not come with it is asked for again."""
        for desired in self.desired:
            if not self.has(desired, layers):
                self.withdraw(desired.key)

    def stage_of(self, key: str, factor: str) -> str | None:
        """The stage of a curve's transport, where it is the one that is there."""
        shown = self._ready.get(key)
        return None if shown is None or shown.factor != factor else shown.stage
