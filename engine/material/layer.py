"""A layer of a material: a model, its parameters, and the user's operators on the generated curves.

Edits are applied to the generated curve and not stored in it, so a parameter that changes afterwards preserves them
[docs/guides/materials.md]. A layer is a value: every edit returns a new one, and undo restores the old one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from engine.curve.bands import band_values
from engine.curve.operators import HALF_PI, Edit, apply_operators
from engine.material import kinds
from engine.material.layer_maps import LayerMaps
from engine.material.microfacet import rise
from engine.material.model import Model, channels, find_parameter, ones
from engine.material.parameter_maps import ParameterMap, ParameterMaps
from engine.material.parameters import FRESNEL, Parameter, Value

Float64Array = NDArray[np.float64]
Frame = Literal["base", "coat"]
FRAMES: tuple[Frame, ...] = ("base", "coat")
# Local directions (wi, wo), (N, 3) each, in each of `FRAMES`.
Directions = tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def object_of(key: str) -> str:
    """The name of the object that a layer belongs to: "teapot" for the key "teapot.1"."""
    return key.rpartition(".")[0]


def place_of(key: str) -> int:
    """The layer's index in its object: 1 for the key "teapot.1"."""
    return int(key.rpartition(".")[2])


def frame_of(quotient_parameters: Sequence[float] | Float64Array) -> Frame:
    """The frame of a layer with these quotient parameters (8,)."""
    return FRAMES[int(quotient_parameters[kinds.FRAME])]


@dataclass(frozen=True)
class GeneratedCurve:
    """The curve that a model generates from parameters, before any edit; angles (N,) to values (N, 3)."""

    model: Model
    factor: str
    parameters: tuple[tuple[str, Value], ...]

    def __call__(self, gamma: Float64Array) -> Float64Array:
        return self.model.generate(self.factor, dict(self.parameters), gamma)


@dataclass(frozen=True)
class FinalCurve:
    """The curve that pictures use: edited, and clamped to at least 0, because reflection cannot be negative."""

    edited: Callable[[Float64Array], Float64Array]

    def __call__(self, gamma: Float64Array) -> Float64Array:
        return np.maximum(self.edited(gamma), 0.0)

    @property
    def features(self) -> tuple[float, ...]:
        """Angles where it may jump, for `band_values`."""
        return tuple(getattr(self.edited, "features", ()))


@dataclass(frozen=True)
class Layer:
    """One term of a material. `parameters` contains every parameter of the model, in the order of its table.

    `edits`: for each edited curve its name and operators, lowest first; curves without operators are omitted. `frozen`:
    the layer's curves cannot be edited. `follows`: the name of a layer of the same object with which it shares its
    curves. `maps`: the images that multiply it, pixel by pixel; the model's formula does not depend on them.
    `parameter_maps`: parameters that vary over the surface, each at most once; pictures are made of the layer's nodes
    (`engine.material.parameter_nodes`), which have none. `node_of`: the name of the layer that it is a node of, "" for
    all layers that the user sees.

    `under`: the name of a layer of the same object that lies directly on this one, "" for none; `covers`: all layers
    that lie on it, the nearest first. Each takes its directional albedo E(theta_o) from what is beneath:

        f_o(theta_o) = f_o of the model  times  the product of 1 - E_c(theta_o) over the covers c.

    `frame`: the shading frame in which it reflects, that of the object's bumps or the coat's
    (`engine.material.bumps.Bumps`). Every factor above takes theta_o to the normal of its own layer's frame; light that
    another normal would let in under a coat is not told apart, for the product reads the view's angle alone.

    `links`: for each curve that layers of other objects share, its name and that of the link, which they have as well.

    Any layer can have Schlick's Fresnel factor R + (1 - R)(1 - cos theta_d)^5 per channel: it is split into two layers
    with the same curves [BenArtzi07, eq. 3.12], itself times R, and a second one, which `rises`, times (1 - R)(1 - cos
    theta_d)^5. Both then have the further parameter `FRESNEL`, R, and no transport depends on it.
    """

    model: Model
    name: str
    parameters: tuple[tuple[str, Value], ...]
    edits: tuple[tuple[str, tuple[Edit, ...]], ...] = ()
    visible: bool = True
    frozen: bool = False
    follows: str = ""
    rises: bool = False
    maps: LayerMaps = LayerMaps()
    under: str = ""
    covers: tuple[Layer, ...] = ()
    parameter_maps: ParameterMaps = ()
    node_of: str = ""
    frame: Frame = "base"
    links: tuple[tuple[str, str], ...] = ()

    @property
    def title(self) -> str:
        """The name that the user sees: the layer's own; if it has none, its model's."""
        known = {"": self.model.label, self.model.name: self.model.label, "fresnel": "Fresnel term"}
        name, _, number = self.name.rpartition(" ")
        if number.isdecimal() and name in known:  # the second of its kind
            return f"{known[name]} {number}"
        return known.get(self.name, self.name)

    @property
    def can_cover(self) -> bool:
        """Whether it can lie on others: the second term of a layer does not, its first one stands for both."""
        return self.model.is_cover and not self.rises

    @property
    def is_further_node(self) -> bool:
        """Whether it is a node that is not in the place of the layer that the user sees."""
        return bool(self.node_of) and self.name != self.node_of

    @property
    def parameter_table(self) -> tuple[Parameter, ...]:
        """The parameters that the user can set: the model's, and R if it has one."""
        return self.model.parameters if self.fresnel is None else (*self.model.parameters, FRESNEL)

    @property
    def fresnel(self) -> Float64Array | None:
        """R (3,); None for a layer without a second term."""
        values = self.values
        return channels(values, FRESNEL.name) if FRESNEL.name in values else None

    @property
    def values(self) -> dict[str, Value]:
        """Parameters by name."""
        return dict(self.parameters)

    def operators(self, factor: str) -> tuple[Edit, ...]:
        """The operators on a curve, lowest first. Raises ParameterError for a curve that the model does not have."""
        return dict(self.edits).get(self.model.leader(factor), ())

    def generated_curve(self, factor: str) -> GeneratedCurve:
        """The curve below all operators."""
        return GeneratedCurve(self.model, self.model.leader(factor), self.parameters)

    def curve(self, factor: str) -> FinalCurve:
        """The curve with its operators, at least 0: a callable, angles (N,) to values (N, 3)."""
        return FinalCurve(apply_operators(self.operators(factor), self.generated_curve(factor)))

    @property
    def has_view_curve(self) -> bool:
        """Whether f_o is anything but 1: the model has a view factor, or a layer lies on this one."""
        return self.model.view_factor is not None or bool(self.covers)

    def view_curve(self, theta_o: Float64Array) -> Float64Array:
        """f_o (N, 3) at angles theta_o (N,), the same to the normals of both frames."""
        return self.view_factors(np.stack([theta_o, theta_o]))

    def view_factors(self, theta_o: Float64Array) -> Float64Array:
        """f_o (N, 3) at angles theta_o (2, N) to the normals of the `FRAMES`: the product of `view_curves`."""
        base, coat = (self._view_curve(angles, frame) for angles, frame in zip(theta_o, FRAMES, strict=True))
        return base * coat

    def view_curves(self, theta_o: Float64Array) -> Float64Array:
        """The factors of f_o (2, N, 3) that take their angle theta_o (N,) to the normal of each of the `FRAMES`."""
        return np.stack([self._view_curve(theta_o, frame) for frame in FRAMES])

    def _view_curve(self, theta_o: Float64Array, frame: Frame) -> Float64Array:
        """The model's view factor with its operators, if the layer is in this frame, times what covers in it leave."""
        view = self.model.view_factor
        own = ones(theta_o) if view is None or self.frame != frame else self.curve(view.name)(theta_o)
        return own * self._uncovered_by(frame, theta_o)[:, None]

    def coverage(self, theta_o: Float64Array) -> Float64Array:
        """The directional albedo E (N,), in [0, 1], that this layer takes from those beneath it; its Fresnel factor is
        that of mirrors, whose theta_d is theta_o, and of the largest channel."""
        albedo = self.model.coverage(self.values, self.curve, theta_o)
        if (facing := self.fresnel) is not None:
            albedo = albedo * (facing.max() + (1.0 - facing.max()) * (1.0 - np.cos(theta_o)) ** 5)
        return np.clip(albedo, 0.0, 1.0)

    def uncovered_share(self, theta_o: Float64Array) -> Float64Array:
        """The share (N,) of this layer's light that passes all covers, at angles theta_o (N,), or (2, N) to the normals
        of the `FRAMES`; hidden ones take nothing."""
        base, coat = np.broadcast_to(theta_o, (2, theta_o.shape[-1]))
        return self._uncovered_by("base", base) * self._uncovered_by("coat", coat)

    def _uncovered_by(self, frame: Frame, theta_o: Float64Array) -> Float64Array:
        share = np.ones(len(theta_o))
        for cover in self.covers:
            if cover.visible and cover.frame == frame:
                share *= 1.0 - cover.coverage(theta_o)
        return share

    def coefficients(self, factor: str, n_bands: int) -> Float64Array:
        """Band values of the curve, (J, 3) [BenArtzi07, eq. 4.17]. Raises BandCountError."""
        from_pole = self.model.factor(factor).gamma in (kinds.THETA_I, kinds.THETA_R, kinds.THETA_H)
        return band_values(self.curve(factor), n_bands, by_solid_angle=from_pole)

    def scale(self) -> Float64Array:
        """f_q, (3,)."""
        return self.model.scale(self.values) * self._share()

    def quotient_parameters(self) -> Float64Array:
        """The parameters of the quotient's kernel, (8,)."""
        q = self.model.quotient_parameters(self.values)
        q[kinds.FRESNEL_TERM], q[kinds.FRAME] = float(self.rises), float(FRAMES.index(self.frame))
        return q

    def brdf(self, wi: Float64Array, wo: Float64Array, theta_o: Float64Array | None = None) -> Float64Array:
        """The whole formula without operators, 1/sr, (N, 3), for unit directions (N, 3) in the local frame; theta_o
        (2, N): to the normals of the `FRAMES`, None where they are the same."""
        value = self.model.brdf(self.values, wi, wo) * self._share()
        if self.covers:
            value *= self.uncovered_share(_view_angles(wo) if theta_o is None else theta_o)[:, None]
        return value * rise(wi, wo)[:, None] if self.rises else value

    def _share(self) -> Float64Array:
        """The share of the model's strength that belongs to this layer, (3,)."""
        fresnel = self.fresnel
        if fresnel is None:
            return np.ones(3)
        return 1.0 - fresnel if self.rises else fresnel

    def with_parameter_map(self, map_: ParameterMap | None, name: str) -> Layer:
        """The layer with the map of one parameter, or (None) without."""
        others = (each for each in self.parameter_maps if each.parameter != name)
        maps = (*others, *([] if map_ is None else [map_]))
        return self.replace(parameter_maps=tuple(sorted(maps, key=lambda each: each.parameter)))

    def parameter_map(self, name: str) -> ParameterMap | None:
        """The map of a parameter; None for one that is the same everywhere."""
        return next((each for each in self.parameter_maps if each.parameter == name), None)

    def replace(self, **changes: Any) -> Layer:
        """The layer with some fields changed."""
        return dataclasses.replace(self, **changes)

    def with_parameter(self, name: str, value: object) -> Layer:
        """The layer with one parameter set. Raises ParameterError for an unknown one or an invalid value."""
        accepted = find_parameter(self.model.name, self.parameter_table, name).accept(value)
        return self.replace(parameters=tuple((key, accepted if key == name else old) for key, old in self.parameters))

    def with_operators(self, factor: str, operators: Sequence[Edit]) -> Layer:
        """The layer with the operators of one curve replaced; without any, the curve is as generated."""
        edits = {**dict(self.edits), self.model.leader(factor): tuple(operators)}
        return self.replace(edits=tuple((name, edits[name]) for name in sorted(edits) if edits[name]))

    def with_fresnel(self, value: object) -> Layer:
        """The layer with R set, which makes it one of two terms; None: it is the only one. Raises ParameterError."""
        own = tuple(pair for pair in self.parameters if pair[0] != FRESNEL.name)
        return self.replace(parameters=own if value is None else (*own, (FRESNEL.name, FRESNEL.accept(value))))

    def with_curves_of(self, other: Layer) -> Layer:
        """This layer with another's curves: the operators of curves that both models have, and the parameters that
        drive curves in both tables alike, and their maps; everything, and what lies on it, if it is the second term of
        the other. Returns itself if nothing differs."""
        if self.rises or other.rises:
            shared = self.replace(
                model=other.model, parameters=other.parameters, edits=other.edits, maps=other.maps,
                parameter_maps=other.parameter_maps, under=other.under, frame=other.frame, links=other.links,
            )  # fmt: skip
            return self if shared == self else shared
        curves = self.model.curve_names & other.model.curve_names
        edits = {name: operators for name, operators in self.edits if name not in curves}
        edits |= {name: operators for name, operators in other.edits if name in curves}
        driving = self.model.driving_parameters & other.model.driving_parameters
        values = self.values | {p.name: other.values[p.name] for p in driving}
        names = {p.name for p in driving}
        maps = [each for each in self.parameter_maps if each.parameter not in names]
        maps += [each for each in other.parameter_maps if each.parameter in names]
        links = {name: link for name, link in self.links if name not in curves}
        links |= {name: link for name, link in other.links if name in curves}
        shared = self.replace(
            parameters=tuple(values.items()), edits=tuple(sorted(edits.items())), links=tuple(sorted(links.items())),
            parameter_maps=tuple(sorted(maps, key=lambda each: each.parameter)),
        )  # fmt: skip
        return self if shared == self else shared

    def link(self, factor: str) -> str:
        """The name of the link of a curve, "" where it is shared with no other object."""
        return dict(self.links).get(factor, "") if factor in self.model.curve_names else ""

    def with_link(self, factor: str, name: str) -> Layer:
        """The layer with another link of a curve; "": none."""
        links = {**dict(self.links), factor: name}
        return self.replace(links=tuple((each, links[each]) for each in sorted(links) if links[each]))

    def with_curve_of(self, other: Layer, factor: str) -> Layer:
        """This layer with one curve of another that both models have: its operators, and the parameters that drive it
        in both tables alike, and their maps. Returns itself if nothing differs."""
        mine, theirs = (
            {p: dataclasses.replace(p, drives=()) for p in layer.model.drivers(factor)} for layer in (self, other)
        )
        names = {p.name for p in mine if mine[p] in theirs.values() and p.kind != "file"}
        values = {name: other.values[name] if name in names else value for name, value in self.values.items()}
        maps = [each for each in self.parameter_maps if each.parameter not in names]
        maps += [each for each in other.parameter_maps if each.parameter in names]
        shared = self.with_operators(factor, other.operators(factor)).replace(
            parameters=tuple(values.items()), parameter_maps=tuple(sorted(maps, key=lambda each: each.parameter))
        )
        return self if shared == self else shared


def make_layer(model: Model, parameters: Mapping[str, object] | None = None, name: str = "") -> Layer:
    """A layer of the model with the given parameters over the defaults; named after the model if no name is given.

    Raises ParameterError for an unknown parameter or an invalid value.
    """
    layer = Layer(model, name or model.name, tuple(model.defaults().items()))
    for key, value in (parameters or {}).items():
        layer = layer.with_parameter(key, value)
    return layer


def evaluate_layers(
    layers: Sequence[Layer], wi: np.ndarray, wo: np.ndarray, factors: NDArray[np.floating] | None = None,
    in_coat: tuple[np.ndarray, np.ndarray] | None = None,
) -> Float64Array:  # fmt: skip
    """Σ over visible layers of ρ(ωi, ωo) cosθi, (N, 3), for local directions (N, 3) in the base's frame, and in_coat in
    the coat's; None where both are the same.

    factors (N or 1, K, 3): factors of the first K visible layers; None, or K = 0, for none.
    """
    total = np.zeros((len(wi), 3))
    for k, layer in enumerate(layer for layer in layers if layer.visible):
        value = evaluate_layer(layer, wi, wo) if in_coat is None else evaluate_in_frame(layer, ((wi, wo), in_coat))
        total += value if factors is None or k >= factors.shape[1] else value * factors[:, k]
    return total


def evaluate_in_frame(layer: Layer, directions: Directions) -> Float64Array:
    """ρ(ωi, ωo) cosθi of one layer, (N, 3), for local directions in both of the `FRAMES`; 0 below its own horizon."""
    wi, wo = directions[FRAMES.index(layer.frame)]
    above = np.flatnonzero((wi[:, 2] > kinds.GRAZING) & (wo[:, 2] > kinds.GRAZING))
    theta_o = np.stack([_view_angles(towards[above]) for _, towards in directions])
    value = np.zeros((len(wi), 3))
    value[above] = evaluate_layer(layer, wi[above], wo[above], theta_o)
    return value


def evaluate_layer(layer: Layer, wi: np.ndarray, wo: np.ndarray, theta_o: Float64Array | None = None) -> Float64Array:
    """ρ(ωi, ωo) cosθi of one layer, (N, 3): the model's own formula, or quotient times curves if it was edited;
    directions in its frame, and theta_o (2, N) to the normals of the `FRAMES`, None where they are the same."""
    if not layer.edits:
        return layer.brdf(wi, wo, theta_o) * np.maximum(wi[:, 2:3], 0.0)
    return layer.scale() * evaluate_by_curves(layer, wi, wo, theta_o)


def evaluate_by_curves(
    layer: Layer, wi: np.ndarray, wo: np.ndarray, theta_o: Float64Array | None = None
) -> Float64Array:
    """ρ_q f_o f_A f_B cosθi of one layer, without f_q, (N, 3) [BenArtzi07, eq. 3.1]; see `evaluate_layer`."""
    value = quotient_cosines(layer, wi, wo)
    for factor in layer.model.factors:
        value *= layer.curve(factor.name)(curve_angles(layer, factor.name, wi, wo))
    if layer.has_view_curve:
        value *= layer.view_curve(_view_angles(wo)) if theta_o is None else layer.view_factors(theta_o)
    return value


def _view_angles(wo: np.ndarray) -> Float64Array:
    """θ_o (N,) of local directions (N, 3)."""
    return np.arccos(np.clip(wo[:, 2], 0.0, 1.0))


def curve_angles(layer: Layer, factor: str, wi: np.ndarray, wo: np.ndarray) -> Float64Array:
    """The angles (N,) at which a layer's curve is evaluated for directions in its frame."""
    from engine.material import _kernels as kernels

    wi, wo = np.ascontiguousarray(wi, np.float64), np.ascontiguousarray(wo, np.float64)
    angle = np.empty(len(wi))
    kernels.curve_angles(layer.model.factor(factor).gamma, layer.quotient_parameters(), wi, wo, angle)
    return np.clip(angle, 0.0, HALF_PI)


def quotient_cosines(layer: Layer, wi: np.ndarray, wo: np.ndarray) -> Float64Array:
    """ρ_q cosθi (N, 3) of a layer for directions in its frame: equal in all channels unless the model is coloured."""
    from engine.material import _kernels as kernels

    wi, wo = np.ascontiguousarray(wi, np.float64), np.ascontiguousarray(wo, np.float64)
    model = layer.model
    q = np.array(model.bind_parameters(layer.quotient_parameters()))
    value = np.empty((3, len(wi)))
    for channel in range(3 if model.is_coloured else 1):
        if model.is_coloured:
            q[kinds.CHANNEL] = channel
        kernels.quotient_cosines(model.number, q, wi, wo, value[channel])
    return value.T.copy() if model.is_coloured else np.repeat(value[0][:, None], 3, axis=1)
