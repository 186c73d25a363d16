"""What the renderer draws: a document, which may be an earlier one than the present, and its layers' values.

The picture is always that of one document (`picture_transition`). Scales, view factors and band values are read from
that one in every frame.
"""

from __future__ import annotations

from collections.abc import Collection

from app.document.document import Document
from app.modes.mode import EditorServices
from app.modes.placement.curves import Curves, Float64Array, picture_identity
from app.modes.placement.edited_curves import edited_layers
from app.modes.placement.indirect_controller import IndirectController
from app.modes.placement.map_controller import MapController
from app.modes.placement.picture_transition import PictureTransition


class DrawnPicture:
    """The drawn document, and its layers as they are drawn."""

    def __init__(
        self,
        services: EditorServices,
        curves: Curves,
        transition: PictureTransition,
        indirect: IndirectController,
        maps: MapController,
    ) -> None:
        self._services, self._curves, self._transition = services, curves, transition
        self._indirect, self._maps = indirect, maps

    @property
    def _present(self) -> Document:
        return self._services.pictured

    @property
    def document(self) -> Document:
        """The document that the picture shows: the newest of which all changes are there."""
        document, transition = self._present, self._transition
        if self._services.history.dragging:
            transition.follow_drag(document)
        elif transition.drawn is not document and not self._needs_responses(document):
            transition.draw_now(document, self.edited_layers, self.factor)
        return transition.drawn

    def _needs_responses(self, document: Document) -> bool:
        """Whether responses of the worker are a part of every picture of a document."""
        return self._indirect.picture.is_on_screen or self._maps.is_wanted(document)

    @property
    def is_held(self) -> bool:
        """Whether the picture shows an earlier document than the present one."""
        return self.document is not self._present

    def is_fine_of(self, objects: Collection[str]) -> bool:
        """Whether these objects are not shown coarsely."""
        return self._transition.is_fine_of(objects)

    @property
    def factor(self) -> str | None:
        """The curve that is selected."""
        selected = self._services.pictured_view.selected
        return None if selected is None else selected.factor

    @property
    def edited_layers(self) -> tuple[str, ...]:
        """Keys of the layers that follow the selected curve, the selected one first; none of a fixed object."""
        return edited_layers(self._present, self._services.pictured_view.selected)

    def wanted_coefficients(self, key: str) -> dict[str, Float64Array]:
        """Band values (J,3) of each transport factor of a layer, as the present document has them."""
        return self._curves.coefficients(self._present, key)

    def coefficients(self, key: str) -> dict[str, Float64Array]:
        """The same, as the drawn document has them; none where the present one has another layer by now."""
        drawn = self.document
        models = [{key: layer.model for key, layer in each.layers()}.get(key) for each in (drawn, self._present)]
        return self._curves.coefficients(drawn, key) if models[0] is models[1] else {}

    def identity(self, key: str) -> tuple[object, ...]:
        """The identity of a layer's f_q and curves: a picture of another one must not be drawn with them."""
        layer = self.document.layer(key)
        return picture_identity(layer.model.name, layer.quotient_parameters().tolist())

    def gain(self, key: str) -> Float64Array:
        """The factor of a layer's picture, (3,): f_q, and how much brighter the only light has become."""
        return self._curves.gain(self.document, key) * self._transition.light_gain

    def view_curves(self, key: str) -> Float64Array:
        """The factors of f_o of a layer at 256 angles θ_o from 0 to π/2 to the normals of both frames, (2,256,3)."""
        return self._curves.view_curves(self.document, key)
