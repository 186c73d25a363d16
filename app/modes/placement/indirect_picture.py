"""Indirect light in the picture: the sums over a freezing, for the document of each frame.

A frozen layer's radiance is a polynomial in the edited object's equivalent albedo, with sums over the bands of edited
curves, at the layer itself and at the second bounce (`engine.precompute.indirect.frozen_light`). They are sums over a
few thousand samples, a few milliseconds, so that indirect light follows a drag in every frame, without increments.

While lights change, the layer's radiance A by albedo alone is known under each of them (`IndirectRelit`). Of what
glossy surfaces add under the frozen light the share s stays; what they mirror of a sky that turns adds M:

    L(l) = A(l) + s (L(l₀) − A(l₀)) + M(l).

So the picture follows without a jump. When the new light is frozen by albedo, what glossy surfaces add stays in the
picture until that is known as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.messages.picture_events import PictureEvent
from app.modes.placement.curves import Curves, Float64Array, picture_identity
from app.modes.placement.desired_freezing import DesiredFreezing
from app.modes.placement.placement_events import Footprint, IndirectRadiance
from app.modes.placement.placement_messages import IndirectFrozen, IndirectRelit
from engine.core.clamping import is_clamped, unscaled
from engine.precompute.indirect.albedo import albedo_of
from engine.precompute.indirect.frozen_light import LightEdit


@dataclass(frozen=True, eq=False)
class Freezing:
    """A freezing that has come, what it was made for, and the footprint of its samples."""

    made_for: DesiredFreezing
    frozen: IndirectFrozen
    footprint: Footprint


class IndirectPicture:
    """The indirect light on screen. number: of the light that was drawn last; departure: how far the edited curves are
    from those that were frozen, see `FrozenLight`; unrepresented: the mean light of the edit that is left out.
    """

    def __init__(self, curves: Curves) -> None:
        self._curves = curves
        self.number = 0
        self.departure = self.unrepresented = 0.0
        self._shown: dict[str, tuple[object, ...]] = {}
        self._on_screen: set[str] = set()
        self._clamped: set[str] = set()
        self._gloss = _LastingGloss()

    @property
    def is_on_screen(self) -> bool:
        """Whether there is any, of the freezing that was drawn last or of one before."""
        return bool(self._on_screen)

    @property
    def is_shown(self) -> bool:
        """Whether the freezing that was drawn last is on screen."""
        return bool(self._shown)

    @property
    def is_clamped(self) -> bool:
        """Whether some of the indirect light is brighter than a picture can store."""
        return bool(self._clamped)

    def forget_drawn(self) -> None:
        """Draw all layers anew: another freezing is used from now on."""
        self._shown.clear()
        self.departure = self.unrepresented = 0.0

    def remove(self) -> list[PictureEvent]:
        """Remove all indirect light; returns the events."""
        removed = [IndirectRadiance(key) for key in sorted(self._on_screen)]
        self._on_screen.clear()
        self._shown.clear()
        self._clamped.clear()
        return list[PictureEvent](removed)

    def draw(self, document: Document, freezing: Freezing, relit: IndirectRelit | None = None) -> list[PictureEvent]:
        """Draw a document, under the light that was frozen or that of `relit`; returns the radiances of the layers that
        differ from those on screen."""
        frozen = freezing.frozen
        self.number = frozen.number
        self._gloss.follow(frozen)
        edit = light_edit(document, frozen, self._curves)
        self.departure = frozen.light.departure(edit)
        self.unrepresented = frozen.unit * frozen.light.unrepresented(edit)
        events: list[PictureEvent] = []
        for look in freezing.made_for.reflectances:
            i_layer = frozen.keys.index(look.key)
            state = (frozen.light.dependence(i_layer, edit), None if relit is None else relit.revision)
            if self._shown.get(look.key) != state:
                self._shown[look.key] = state
                self._on_screen.add(look.key)
                radiance = unscaled(frozen.light.radiance(i_layer, edit), frozen.unit)
                radiance = self._gloss.added_to(radiance, look.key)
                if relit is not None and look.key in relit.now:
                    radiance = self._gloss.relit(radiance, look.key, relit)
                (self._clamped.add if is_clamped(radiance) else self._clamped.discard)(look.key)
                drawn_as = picture_identity(*look.layer.quotient)
                events.append(IndirectRadiance(look.key, radiance, freezing.footprint, drawn_as))
        return events


class _LastingGloss:
    """What glossy surfaces add to the indirect light by albedo: as it was last known, until it is known anew."""

    def __init__(self) -> None:
        self._number, self._added = 0, dict[str, NDArray[np.float32]]()
        self._relit: dict[str, NDArray[np.float32]] = {}

    def follow(self, frozen: IndirectFrozen) -> None:
        """Begin to draw a freezing: gloss of the relit picture before stays with light by albedo alone, and with no
        other light after that."""
        if frozen.number != self._number or not frozen.by_albedo:
            self._added, self._number = self._relit if frozen.by_albedo else {}, frozen.number
            self._relit = {}

    def added_to(self, radiance: NDArray[np.float32], key: str) -> NDArray[np.float32]:
        """A layer's radiance (p,3) with the gloss that stays."""
        added = self._added.get(key)
        if added is None or added.shape != radiance.shape:
            return radiance
        return np.maximum(radiance + added, np.float32(0.0))

    def relit(self, radiance: NDArray[np.float32], key: str, relit: IndirectRelit) -> NDArray[np.float32]:
        """A layer's frozen radiance (p,3) under the light of `relit`."""
        gloss = relit.gloss[key] * (radiance - relit.resting[key]) + relit.mirrored[key]
        self._relit[key] = gloss
        return np.maximum(relit.now[key] + gloss, np.float32(0.0))


def edited_albedo(document: Document, frozen: IndirectFrozen, curves: Curves) -> Float64Array:
    """The equivalent albedo d (3,) of the edited object as it is in the document, by the numbers of bands that it was
    frozen with."""
    total = np.zeros(3)
    for key, e in frozen.albedos.items():
        if document.is_visible(key):
            n_factors = len(document.layer(key).model.factors)
            values = tuple(
                curves.band_values(document, key, i, n) for i, n in enumerate(e.shape[e.ndim - 2 :][:n_factors])
            )
            total += albedo_of(e, values, curves.outgoing_gain(document, key), curves.view_curve(document, key))
    return total


def light_edit(document: Document, frozen: IndirectFrozen, curves: Curves) -> LightEdit:
    """What a document edits of a freezing: albedo and curves, with the numbers of bands that they were frozen with."""
    light, values, sent = frozen.light, {}, {}
    for key, factor in frozen.curves.items():
        i = frozen.keys.index(key)
        values[i] = curves.band_values(document, key, factor, light.bands[i].shape[1])
    for each in light.gloss:
        key = frozen.keys[each.curve.layer]
        bands = curves.band_values(document, key, each.curve.factor, len(each.frozen))
        sent[each.curve.layer] = curves.outgoing_gain(document, key) * bands
    return LightEdit(edited_albedo(document, frozen, curves), values, sent)
