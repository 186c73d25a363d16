"""Indirect light on the window's side: which freezing is desired, and the picture of it each frame.

The worker freezes indirect light for the object of the selected layer [BenArtzi07, sect. 6.1]: what every layer
reflects is then a polynomial in that object's equivalent albedo d, and the selected layer's also a sum over the bands
of its curve,

    L = Σ_n d^n β_n        and        L = Σ_n d^n Σ_j c_j F_jn.

Both are sums over a few thousand samples, a few milliseconds, so that indirect light follows a drag exactly in every
frame, without increments. What the sums hold fixed (other objects' curves, the other curve of the selected layer) is
compared with the document once a frame, and frozen anew when it has changed, one request at a time. The secondary
emission of a glossy object keeps its shape while its curve is dragged; it is frozen anew as well once the user is idle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document, Selection
from app.document.scene_state import LayerState, SceneState
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request
from app.modes.placement.curves import Curves, Float64Array, picture_identity
from app.modes.placement.edited_curves import edited_layers
from app.modes.placement.placement_events import Footprint, IndirectRadiance
from app.modes.placement.placement_messages import FreezeIndirect, IndirectFound, IndirectFrozen, IndirectNoise
from engine.material.layer import object_of
from engine.precompute.indirect.albedo import albedo_of
from engine.precompute.indirect.clamping import is_clamped, unscaled

FREEZE_PATIENCE = 5.0
IDLE_SECONDS = 0.25
FINE_STAGE = "fine"
# Freezings stored beside the one that is drawn: undo goes back to them.
MAX_CACHED = 4


@dataclass(frozen=True, eq=False)
class LayerReflectance:
    """The reflectance of a visible layer, to be compared: its curves, f_q (3,) and f_o (N,3), as `Curves` stores
    them."""

    layer: LayerState
    coefficients: tuple[Float64Array, ...]
    gain: Float64Array
    view_curve: Float64Array

    @property
    def key(self) -> str:
        return self.layer.key


def layer_reflectances(scene: SceneState, document: Document, curves: Curves) -> tuple[LayerReflectance, ...]:
    """The reflectance of all visible layers of a document, as the worker gets it."""
    return tuple(
        LayerReflectance(
            layer, tuple(curves.coefficients(document, layer.key).values()),
            curves.outgoing_gain(document, layer.key), curves.view_curve(document, layer.key),
        )
        for layer in scene.visible
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class DesiredFreezing:
    """The scene that indirect light is frozen for; two serve the same if what they hold fixed is the same.

    edited: for layers that share the selected curve, which of their curves it is: like all that is edited of the
    object, they have a shape, and are frozen anew once the user is idle.
    """

    scene: SceneState
    reflectances: tuple[LayerReflectance, ...]
    key: str | None
    factor: int | None
    second: int | None
    edited: Mapping[str, int] = field(default_factory=dict)

    def serves(self, other: DesiredFreezing) -> bool:
        """Whether the response to one is a response to the other as well."""
        if self is other:
            return True
        mine, theirs = (
            (desired.key, desired.factor, desired.second, len(desired.reflectances)) for desired in (self, other)
        )
        if mine != theirs:
            return False
        return all(
            self._alike(mine, theirs) for mine, theirs in zip(self.reflectances, other.reflectances, strict=True)
        )

    def same(self, other: DesiredFreezing) -> bool:
        """Whether it was also made with the other's curves of the edited object: glossy ones have a shape, and the
        noise depends on all of them."""
        if self is other:
            return True
        return len(self.reflectances) == len(other.reflectances) and all(
            _equal(*pair) for pair in zip(self.reflectances, other.reflectances, strict=True)
        )

    def _alike(self, mine: LayerReflectance, theirs: LayerReflectance) -> bool:
        if mine.key != theirs.key or mine.layer.quotient != theirs.layer.quotient:
            return False
        for i, (one, two) in enumerate(zip(mine.coefficients, theirs.coefficients, strict=True)):
            if (mine.key, i) == (self.key, self.factor) or self.edited.get(mine.key) == i or one is two:
                continue
            if not _close(one, two):
                return False
        if any(a.shape != b.shape for a, b in zip(mine.coefficients, theirs.coefficients, strict=True)):
            return False  # with another choice of bands, those of the selected curve differ
        if self.key is not None and object_of(mine.key) == object_of(self.key):
            return True  # its albedo is a variable
        return np.array_equal(mine.gain, theirs.gain) and np.array_equal(mine.view_curve, theirs.view_curve)


class IndirectController:
    """Requests indirect light, and makes its picture. ``send`` sends a request and returns its id."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self.scene_opened()

    def scene_opened(self) -> None:
        """Another scene is open: its light is unknown."""
        self._found: IndirectFound | None = None
        self._confirmed = -1
        self._frozen: tuple[DesiredFreezing, IndirectFrozen, Footprint] | None = None
        self._cached: list[tuple[DesiredFreezing, IndirectFrozen, Footprint]] = []
        self._requested: tuple[DesiredFreezing, int] | None = None
        self._serial = 0
        self._requested_at = self._changed_at = -math.inf
        self._last: DesiredFreezing | None = None
        self._desired_inputs: tuple[Document | None, Selection | None, int | None] = None, None, None
        self._drawn: DesiredFreezing | None = None
        self._shown: dict[str, tuple[object, ...]] = {}
        self._is_clamped: set[str] = set()
        self._noise: IndirectNoise | None = None
        self._n_bounces = 1
        self._complete = self._fits = self.is_on_screen = False

    @property
    def is_complete(self) -> bool:
        """Whether what is shown is the document's indirect light in its final quality, or none is desired."""
        return self._n_bounces <= 1 or self._complete

    def found_under(self, revision: int) -> IndirectFound | None:
        """The fine light that was found, or also holds, under the transport of that number; None without any."""
        found = self._found if self._confirmed == revision else None
        return found if found is not None and found.stage == FINE_STAGE else None

    @property
    def is_shown(self) -> bool:
        """Whether the picture has indirect light, of any quality."""
        return bool(self._shown)

    @property
    def awaits_frozen(self) -> bool:
        """Whether a freezing is under way of light that has been found."""
        if self._requested is None or self._found is None:
            return False
        return self._frozen is None or self._frozen[0] is not self._requested[0]

    @property
    def noise(self) -> float | None:
        """The noise of the indirect light that is shown, RMS relative to its mean; None while unknown."""
        return None if not self._shown or not self._noise_is_current or self._noise is None else self._noise.noise

    def noise_of_picture(self, direct: float) -> float:
        """The same, relative to the mean of the whole picture; direct: the mean of its direct light. 0 while
        unknown."""
        if self.noise is None or self._noise is None:
            return 0.0
        mean = self._noise.mean + direct
        return self.noise * self._noise.mean / mean if mean > 0.0 else self.noise

    @property
    def _noise_is_current(self) -> bool:
        """Whether the newest noise is that of the newest light."""
        if self._frozen is None or self._noise is None:
            return False
        frozen = self._frozen[1]
        return (self._noise.number, self._noise.serial) == (frozen.number, frozen.serial)

    @property
    def is_clamped(self) -> bool:
        """Whether some of the indirect light is brighter than a picture can store."""
        return bool(self._is_clamped)

    def edited(self) -> None:
        """The document or the selection changed: until the next update it is unknown whether anything is missing."""
        self._complete = False

    def worker_restarted(self) -> None:
        """A new worker knows nothing of what was requested, and computes light anew."""
        self._requested, self._confirmed = None, -1

    def receive_samples(self, response: IndirectFound) -> None:
        """Samples were found, or also hold under another transport; what they reflect comes with a freezing."""
        if self._found is not None and (self._found.stage, self._confirmed) == (FINE_STAGE, response.revision):
            if response.stage != FINE_STAGE:
                return  # what is there is finer, and of this light
        self._confirmed = response.revision
        if self._found is None or response.number != self._found.number:
            self._found = response

    def receive_frozen(self, response: IndirectFrozen) -> None:
        """Take a freezing; it is drawn with the footprint of its own samples."""
        found = self._found
        if (
            self._requested is None
            or found is None
            or (response.serial, response.number) != (self._serial, found.number)
        ):
            return
        footprint = Footprint(found.rows, found.weights)
        if self._frozen is not None and self._frozen[1].number == response.number:
            footprint = self._frozen[2]
        self._draw_with((self._requested[0], response, footprint))

    def _draw_with(self, frozen: tuple[DesiredFreezing, IndirectFrozen, Footprint]) -> None:
        """Use a freezing from now on; earlier ones stay stored as long as they are of the same light."""
        others = [each for each in (self._frozen, *self._cached) if each is not None and each is not frozen]
        self._cached = [each for each in others if each[1].number == frozen[1].number][:MAX_CACHED]
        self._frozen, self._drawn = frozen, None
        self._shown.clear()

    def _use_cached(self, desired: DesiredFreezing) -> None:
        """Use a stored freezing for the same edits until the requested one is here."""
        for each in self._cached:
            if each[0].serves(desired) and each[0].same(desired):
                self._draw_with(each)
                return

    def means_changed(self) -> None:
        """The albedo of layers became known otherwise than by an edit: the mean of a texture."""
        self._desired_inputs = None, None, None

    def receive_noise(self, response: IndirectNoise) -> None:
        """Take the noise of a freezing."""
        self._noise = response

    def update(
        self, now: float, document: Document, selected: Selection | None, n_bounces: int, second: int | None,
        revision: int,
    ) -> list[PictureEvent]:  # fmt: skip
        """Request what is missing; returns the radiances that changed."""
        self.request_missing(now, document, selected, n_bounces, second, revision)
        return self.follow(document)

    def request_missing(
        self, now: float, document: Document, selected: Selection | None, n_bounces: int, second: int | None,
        revision: int,
    ) -> None:  # fmt: skip
        """Request what is missing. second: the most bands of the second bounce, None for as many as a curve has;
        revision: of the transport requested last."""
        self._n_bounces = n_bounces
        if n_bounces <= 1:
            return
        desired = self._desired(document, selected, second)
        self._send_request(now, desired, revision)
        if self._frozen is None:
            self._complete = self._fits = False
            return
        if not self._frozen[0].serves(desired):
            self._use_cached(desired)
        made_for, frozen, _ = self._frozen
        self._fits = made_for.serves(desired)
        is_final = self._is_current(frozen, revision) and self._found is not None and self._found.stage == FINE_STAGE
        self._complete = self._fits and is_final and made_for.same(desired) and self._noise_is_current

    def follow(self, document: Document) -> list[PictureEvent]:
        """The radiances that changed, of the document at the last request."""
        if self._n_bounces <= 1:
            return self._remove_all()
        if self._frozen is None or not self._fits or self._drawn is self._last:
            return []
        self._drawn, self.is_on_screen = self._last, True
        return self._radiances(document, *self._frozen)

    @property
    def is_pending(self) -> bool:
        """Whether light has been found, and none of it is in the picture yet."""
        return self._n_bounces > 1 and self._found is not None and self._frozen is None

    def is_outdated(self, revision: int | None) -> bool:
        """Whether the picture has indirect light, and none of the document's is here yet. revision: of the transport
        under way, None where none is."""
        if self._n_bounces <= 1 or not self.is_on_screen or self._requested is None:
            return False
        is_due = not self._fits and self._frozen is not None and self._frozen[0] is not self._requested[0]
        return is_due or revision is not None and self._confirmed != revision

    def _is_current(self, frozen: IndirectFrozen, revision: int) -> bool:
        """Whether it is the newest light, and that of the transport requested last."""
        return self._found is not None and self._found.number == frozen.number and self._confirmed == revision

    def _remove_all(self) -> list[PictureEvent]:
        shown, self._shown, self._frozen, self._requested, self._drawn = self._shown, {}, None, None, None
        self._is_clamped.clear()
        self.is_on_screen = False
        return [IndirectRadiance(key) for key in shown]

    def _desired(self, document: Document, selected: Selection | None, second: int | None) -> DesiredFreezing:
        """The desired freezing, computed once: most ticks find nothing changed, and the processors are the worker's."""
        made_of, (before, *rest) = (document, selected, second), self._desired_inputs
        if self._last is None or before is not document or rest != [selected, second]:
            self._desired_inputs = made_of
            return self._make_desired(document, selected, second)
        return self._last

    def _make_desired(self, document: Document, selected: Selection | None, second: int | None) -> DesiredFreezing:
        key = factor = None
        edited: dict[str, int] = {}
        # An object that the user froze is not edited: it takes no part in the polynomial, and costs no bands.
        if selected is not None and not (document.object(selected.object).is_lamp or document.is_frozen(selected.key)):
            key = selected.key
            names = list(self._curves.coefficients(document, key))
            if selected.factor in names and document.object(selected.object).editable:
                factor = names.index(selected.factor)
                for other in edited_layers(document, selected)[1:]:
                    theirs = list(self._curves.coefficients(document, other))
                    edited |= {other: theirs.index(selected.factor)} if selected.factor in theirs else {}
        scene = self._curves.scene_state(document)
        return DesiredFreezing(scene, layer_reflectances(scene, document, self._curves), key, factor, second, edited)

    def _send_request(self, now: float, desired: DesiredFreezing, revision: int) -> None:
        if self._last is None or not (self._last.serves(desired) and self._last.same(desired)):
            self._changed_at = now
        self._last = desired
        if self._requested is not None and self._requested[1] == revision:
            requested = self._requested[0]
            waits = self._frozen is None or self._frozen[0] is not requested
            if requested.serves(desired) and (requested.same(desired) or now - self._changed_at < IDLE_SECONDS):
                return
            if waits and now - self._requested_at < FREEZE_PATIENCE:
                return
        self._requested, self._requested_at = (desired, revision), now
        self._serial += 1
        self._send(
            FreezeIndirect(desired.scene, desired.key, desired.factor, desired.second, self._serial, revision=revision)
        )

    def _radiances(
        self, document: Document, made_for: DesiredFreezing, frozen: IndirectFrozen, footprint: Footprint
    ) -> list[PictureEvent]:
        """The radiances of the layers that differ from those on screen."""
        albedo = self._albedo(document, frozen)
        events: list[PictureEvent] = []
        for look in made_for.reflectances:
            curve = None
            if look.key == frozen.key and frozen.factor is not None:
                curve = list(self._curves.coefficients(document, look.key).values())[frozen.factor]
            state = (*albedo.tolist(), id(curve))
            if self._shown.get(look.key) != state:
                self._shown[look.key] = state
                radiance = _radiance(frozen, look.key, albedo, curve)
                (self._is_clamped.add if is_clamped(radiance) else self._is_clamped.discard)(look.key)
                look_as = picture_identity(*look.layer.quotient)
                events.append(IndirectRadiance(look.key, radiance, footprint, look_as))
        return events

    def _albedo(self, document: Document, frozen: IndirectFrozen) -> Float64Array:
        """d (3,) of the edited object as it is now."""
        total = np.zeros(3)
        for key, e in frozen.albedos.items():
            if document.is_visible(key):
                values = tuple(self._curves.coefficients(document, key).values())
                gain, view = self._curves.outgoing_gain(document, key), self._curves.view_curve(document, key)
                total += albedo_of(e, values, gain, view)
        return total


def _radiance(
    frozen: IndirectFrozen, key: str, albedo: Float64Array, curve: Float64Array | None
) -> NDArray[np.float32]:
    """Indirect radiance (p,3) of one layer, without f_q and f_o."""
    # Powers in double precision: beyond single, what they multiply may be 0.
    if curve is None:
        reflected = frozen.reflected[key]
        powers = albedo ** np.arange(len(reflected))[:, None]
        return unscaled(np.einsum("npc,nc->pc", reflected, powers), frozen.unit)
    bands = frozen.bands
    powers = albedo ** np.arange(bands.shape[2])[:, None]
    channels = [
        powers[:, c] @ (curve[:, c].astype(np.float32) @ bands[c].reshape(len(curve), -1)).reshape(bands.shape[2:])
        for c in range(3)
    ]
    return unscaled(np.stack(channels, axis=1), frozen.unit)


def _equal(one: LayerReflectance, two: LayerReflectance) -> bool:
    """Whether two reflectances of one layer are equal."""
    mine, theirs = ((*look.coefficients, look.gain, look.view_curve) for look in (one, two))
    return all(a is b or _close(a, b) for a, b in zip(mine, theirs, strict=True))


def _close(one: NDArray[np.floating], two: NDArray[np.floating]) -> bool:
    return one.shape == two.shape and bool(np.allclose(one, two, rtol=1e-6, atol=0.0))
