"""The state that the editor desires of the worker, has requested last, and has received: the values that
`transport_controller` compares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from app.document.document import Document
from app.document.light_state import RGB, LightState
from app.document.scene_state import LayerState
from app.document.view_state import ViewState
from app.modes.placement.curves import Coefficients, Curves, Float64Array
from engine.realtime.zonal_harmonics.pose import Poses
from engine.settings import Precision, RenderSettings

# What of the light follows a drag at once.
MOVED = ("rotation", "new_suns", "mix", "painted", "tilt", "hue", "contrast", "clamp")
Emission = tuple[tuple[str, RGB], ...]


@dataclass(frozen=True)
class TransportShape:
    """The properties of a layer that its transport depends on.

    ``baked``: for a layer whose object is fixed the bytes of its curves, which are then part of its transport: it is
    not edited, and so costs no bands.
    """

    key: str
    model: str
    quotient_parameters: tuple[float, ...]
    bands: tuple[tuple[str, int], ...]
    baked: bytes | None = None

    @property
    def is_fixed(self) -> bool:
        return self.baked is not None

    @property
    def bands_kept(self) -> tuple[int, ...]:
        """How many bands of each factor its transport has."""
        return () if self.is_fixed else tuple(n for _, n in self.bands)

    def takes(self, coefficients: Coefficients) -> bool:
        """Whether its transport can be contracted with these."""
        return not self.is_fixed and {name: len(values) for name, values in coefficients.items()} == dict(self.bands)

    def has_quotient_of(self, other: TransportShape | None) -> bool:
        """Whether the fixed part of both layers' reflection is the same."""
        return other is not None and (self.model, self.quotient_parameters) == (other.model, other.quotient_parameters)

    def looks_like(self, other: TransportShape | None) -> bool:
        """Whether transport of one gives the picture of the other, with bands or without."""
        if other is None or not self.has_quotient_of(other):
            return False
        return self.baked == other.baked or not (self.is_fixed and other.is_fixed)


def transport_shape(state: LayerState, coefficients: Coefficients) -> TransportShape:
    """The shape of a layer's transport, with these curves."""
    baked = b"".join(values.tobytes() for values in coefficients.values()) if state.fixed else None
    bands = tuple(zip(state.factors, state.bands, strict=True))
    return TransportShape(state.key, state.model, state.quotient_parameters, bands, baked)


@dataclass(frozen=True)
class DesiredTransport:
    """All that transport depends on: equal values have equal transport. is_drag: a quick picture of a dragged light;
    lamps: the poses of emitters that it has moved from where the view has them."""

    light: LightState
    layers: tuple[TransportShape, ...]
    emission: Emission = ()
    settings: RenderSettings = RenderSettings()
    is_drag: bool = False
    lamps: Poses = ()

    def moved_from(self, other: DesiredTransport) -> bool:
        """Whether only the environment's place and gain, changes of its map, suns and painted lights differ, what
        emitters emit or where they are, and they light the same objects."""
        moved = {name: getattr(other.light, name) for name in MOVED}
        light = replace(self.light, **moved)
        stayed = replace(
            self, light=light, emission=other.emission, lamps=other.lamps, layers=other.layers, is_drag=other.is_drag
        )
        is_linked_alike = self.light.exclusions == other.light.exclusions
        return stayed == other and is_linked_alike and not self.lights_like(other)

    def lights_like(self, other: DesiredTransport) -> bool:
        """Whether the light is the same."""
        return (self.light, self.emission, self.lamps) == (other.light, other.emission, other.lamps)

    def can_mix_with(self, other: DesiredTransport) -> bool:
        """Whether pictures of layers under both can be shown side by side."""
        one, two = self.settings, other.settings
        return self.lights_like(other) and (one == two or one.of_direct_light == two.of_direct_light)

    def alike(self, before: DesiredTransport) -> tuple[str, ...]:
        """Keys of the layers that have the same picture as under the desired transport before."""
        if not self.can_mix_with(before):
            return ()
        return tuple(shape.key for shape in self.layers if shape.looks_like(before.shape(shape.key)))

    def shape(self, key: str) -> TransportShape | None:
        return next((shape for shape in self.layers if shape.key == key), None)


@dataclass(frozen=True, eq=False)
class RestingPicture:
    """An idle picture: its document, and what of the view it depends on. It is equal to one of the identical document:
    undo comes back to those."""

    document: Document
    made_with: tuple[object, ...]

    @classmethod
    def of(cls, document: Document, view: ViewState) -> RestingPicture:
        settings = view.settings
        chosen = (
            settings.n_lights, settings.n_patches, settings.n_bounces, settings.second_bands, settings.lighting
        )  # fmt: skip
        return cls(document, (*chosen, view.shows_error))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RestingPicture):
            return False
        return self.document is other.document and self.made_with == other.made_with

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class DesiredCurve:
    """One curve's transport; ``others`` are the present coefficients of the layer's other factors.

    ``factor`` None desires the layer's radiance alone.
    """

    key: str
    factor: str | None
    others: Coefficients
    precision: Precision = "half"

    def same_curve(self, other: DesiredCurve | None) -> bool:
        """Whether the response to one is of the kind that the other waits for."""
        if other is None:
            return False
        return (self.key, self.factor, self.precision) == (other.key, other.factor, other.precision)

    def same(self, other: DesiredCurve | None) -> bool:
        return other is not None and self.same_curve(other) and same_coefficients(self.others, other.others)


@dataclass
class ReadyLayer:
    """The newest radiance of a layer under the transport requested last: its stage, the curves it was made with, and
    whether the renderer has summed it from transport in half floats."""

    stage: str
    coefficients: Coefficients
    in_halves: bool = False


@dataclass(frozen=True)
class ReadyCurve:
    """The transport that was delivered last for a selected curve of a layer."""

    key: str
    factor: str
    stage: str
    precision: Precision


def desired_transport(document: Document, settings: RenderSettings, curves: Curves) -> DesiredTransport:
    """The desired transport of a document's layers in its light."""
    scene = curves.scene_state(document)
    shapes = tuple(transport_shape(state, curves.coefficients(document, state.key)) for state in scene.layers)
    return DesiredTransport(scene.light, shapes, scene.emission, settings)


@lru_cache(maxsize=16)  # asked for each layer in each frame
def brightening_factors(wanted: Emission, known: Emission) -> Float64Array | None:
    """The factors (3,) by which every emitter is brighter than it was; None where they are not the same for all.

    Channels in which none emits, before or after, have 1: what else lights the scene keeps them.
    """
    if [name for name, _ in wanted] != [name for name, _ in known] or not known:
        return None
    new, old = (np.array([radiance for _, radiance in each], dtype=np.float64) for each in (wanted, known))
    factors = np.divide(new.sum(axis=0), old.sum(axis=0), out=np.ones(3), where=old.sum(axis=0) > 0.0)
    factors.setflags(write=False)
    return factors if np.allclose(old * factors, new, rtol=1e-9, atol=0.0) else None


def same_coefficients(one: Mapping[str, Float64Array], two: Mapping[str, Float64Array]) -> bool:
    """Whether two sets of band values agree to 1e-6, factor by factor."""
    if one.keys() != two.keys():
        return False
    return all(a is two[name] or _close(a, two[name]) for name, a in one.items())


def _close(one: Float64Array, two: Float64Array) -> bool:
    return one.shape == two.shape and bool(np.all(np.abs(one - two) <= 1e-6 * np.abs(two)))
